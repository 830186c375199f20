//! Tests of values and slices that are checked while they are written.

use std::cell::RefCell;

use proptest::prelude::*;

use super::*;
use crate::declare::StepError;
use crate::state::{CloudPoint, MAX_RANGES, Ranges};

/// Fills a value element by element, as a reference for `fill_from`.
fn send_by_hand(output: &mut Output<Ranges>, values: &[f32]) -> Result<(), StepError> {
    let mut loan = output.loan()?;
    loan.set_count(values.len());
    loan.range_mut().copy_from_slice(values);
    loan.publish()
}

fn send(output: &mut Output<Ranges>, values: &[f32]) -> Result<(), StepError> {
    let mut loan = output.loan()?;
    loan.set_count(values.len());
    assert_eq!(loan.fill_from(Ranges::range, values.iter().copied()), values.len());
    loan.publish()
}

fn outcome(result: Result<(), StepError>) -> Result<(), String> {
    result.map_err(|error| error.to_string())
}

#[test]
fn non_finite_number_is_refused_at_any_position() {
    let bench = Bench::new(Ranges::layout(), TopicPattern::State);
    let output = RefCell::new(bench.output::<Ranges>());
    let values = |count: usize| (0..count).map(|i| i as f32 * 0.01).collect::<Vec<_>>();
    proptest!(|(
        count in 1..=MAX_RANGES,
        place in any::<prop::sample::Index>(),
        wrong in prop_oneof![Just(f32::NAN), Just(f32::INFINITY), Just(f32::NEG_INFINITY)],
        is_wrong: bool,
    )| {
        let mut values = values(count);
        if is_wrong {
            values[place.index(count)] = wrong;
        }
        let by_hand = outcome(send_by_hand(&mut output.borrow_mut(), &values));
        prop_assert_eq!(by_hand.is_err(), is_wrong);
        prop_assert_eq!(outcome(send(&mut output.borrow_mut(), &values)), by_hand);
    });
}

#[test]
fn refused_value_leaves_the_previous_one_in_place() {
    let bench = Bench::new(Ranges::layout(), TopicPattern::State);
    let (mut output, mut input) = (bench.output::<Ranges>(), bench.input::<Ranges>());
    let mut values: Vec<f32> = (0..1_500).map(|i| i as f32).collect();
    send(&mut output, &values).unwrap();
    values[1_499] = f32::NAN;
    send(&mut output, &values).unwrap_err();
    let read = input.latest().unwrap();
    assert_eq!((read.stamp().sequence, read.count(), read.range()[1_499]), (1, 1_500, 1_499.0));
    assert_eq!(bench.region.components()[0].refused.load(std::sync::atomic::Ordering::Relaxed), 1);
}

#[test]
fn writes_outside_the_filled_part_are_checked_as_well() {
    let bench = Bench::new(Ranges::layout(), TopicPattern::State);
    let mut output = bench.output::<Ranges>();
    let values = [1.0_f32; 100];
    for wrong in 0..4 {
        let mut loan = output.loan().unwrap();
        loan.set_count(100);
        loan.range_mut().fill(1.0);
        loan.range_mut()[70] = if wrong == 3 { f32::NAN } else { 1.0 };
        let filled = if wrong == 3 { &values[..50] } else { &values };
        assert_eq!(loan.fill_from(Ranges::range, filled.iter().copied()), filled.len());
        match wrong {
            0 => loan.most = f64::INFINITY,
            1 => loan.range_mut()[99] = f32::NAN,
            2 => {
                loan.set_count(101);
                loan.range_mut()[100] = f32::NAN;
            }
            _ => {}
        }
        assert!(matches!(loan.publish(), Err(StepError::InvalidOutput { .. })), "case {wrong}");
    }
    let mut loan = output.loan().unwrap();
    loan.most = 2.0;
    loan.set_count(100);
    assert_eq!(loan.fill_from(Ranges::range, std::iter::repeat(1.0)), 100, "at most the capacity");
    loan.publish().unwrap();
}

#[test]
#[should_panic(expected = "outside the loaned motorium.Ranges")]
fn numbers_outside_the_value_are_not_filled() {
    static ELSEWHERE: [f32; 4] = [0.0; 4];
    let bench = Bench::new(Ranges::layout(), TopicPattern::State);
    let mut output = bench.output::<Ranges>();
    output.loan().unwrap().fill_from(|_| &ELSEWHERE[..], [1.0; 4]);
}

#[test]
fn slice_with_a_non_finite_number_is_refused() {
    let pattern = TopicPattern::Slices { capacity: 4, longest: 3_000 };
    let bench = Bench::new(CloudPoint::layout(), pattern);
    let place = bench.output_place();
    let output = SliceOutput::<CloudPoint>::open(&bench.participant(0), place, "output").unwrap();
    let output = RefCell::new(output);
    proptest!(ProptestConfig::with_cases(64), |(
        length in 1..3_000usize,
        place in any::<prop::sample::Index>(),
        field in 0..4usize,
        is_wrong: bool,
        written_later: bool,
    )| {
        let mut points = vec![CloudPoint { x: 1.0, y: -2.0, z: 3e30, intensity: 0.5 }; length];
        let point = &mut points[place.index(length)];
        if is_wrong {
            let fields = [&mut point.x, &mut point.y, &mut point.z, &mut point.intensity];
            *fields.into_iter().nth(field).unwrap() = f32::NAN;
        }
        let mut output = output.borrow_mut();
        let mut by_hand = output.loan(length).unwrap();
        by_hand.copy_from_slice(&points);
        let by_hand = outcome(by_hand.publish());
        prop_assert_eq!(by_hand.is_err(), is_wrong);
        let mut loan = output.loan(length).unwrap();
        prop_assert_eq!(loan.fill_from(points.iter().copied()), length);
        if written_later {
            loan[length / 2].z = f32::INFINITY;
        }
        let filled = outcome(loan.publish());
        if written_later { prop_assert!(filled.is_err()) } else { prop_assert_eq!(filled, by_hand) }
    });
    let mut output = output.into_inner();
    let mut loan = output.loan(3).unwrap();
    loan.fill(CloudPoint { x: f32::NAN, ..CloudPoint::default() });
    assert_eq!(loan.fill_from([CloudPoint::default(); 2]), 2);
    assert!(loan.publish().is_err(), "the third point was not filled");
}
