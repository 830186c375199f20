//! Streams of values and of slices.

use super::*;

#[test]
fn stream_delivers_samples_in_order_and_counts_lost_ones() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::Stream { capacity: 4 });
    let (mut output, mut input) = (bench.output::<Wrench>(), bench.input::<Wrench>());
    let read = |input: &mut Input<Wrench>| {
        let mut seen = Vec::new();
        while let Some(reading) = input.next_unread() {
            seen.push(reading.force[0]);
        }
        seen
    };
    (0..3).for_each(|x| output.send(&wrench(f64::from(x))).unwrap());
    assert_eq!(read(&mut input), [0.0, 1.0, 2.0]);
    assert_eq!(input.lost(), 0);
    (3..13).for_each(|x| output.send(&wrench(f64::from(x))).unwrap());
    assert_eq!(read(&mut input), [9.0, 10.0, 11.0, 12.0]);
    assert_eq!(input.lost(), 6);
    assert_eq!(bench.region.topics()[0].dropped.load(std::sync::atomic::Ordering::Relaxed), 6);
}

#[test]
fn slices_up_to_the_declared_length_arrive_in_order() {
    let bench = Bench::new(u16::layout(), TopicPattern::Slices { capacity: 4, longest: 1_000 });
    let mut output = SliceOutput::<u16>::open(&bench.participant(0), bench.output_place(), "output").unwrap();
    let topic = bench.topic();
    let place = InputPlace { index: 0, topic, port: "input", pin: 0, is_cause: false, edge: Some(0) };
    let mut input = SliceInput::<u16>::open(&bench.participant(1), &place).unwrap();
    assert!(input.next_unread().is_none());
    for length in [0, 1, 1_000] {
        let mut loan = output.loan(length).unwrap();
        loan.iter_mut().enumerate().for_each(|(i, value)| *value = (length + i) as u16);
        loan.publish().unwrap();
    }
    for (sequence, length) in [(1, 0), (2, 1), (3, 1_000)] {
        let (stamp, slice) = input.next_unread().unwrap();
        assert_eq!((stamp.sequence, slice.len()), (sequence, length));
        assert!(slice.iter().enumerate().all(|(i, value)| *value == (length + i) as u16));
    }
    let error = output.loan(1_001).unwrap_err().to_string();
    assert!(error.contains("longer than the declared maximum"), "{error}");
    for value in 0..9 {
        let mut loan = output.loan(1).unwrap();
        loan[0] = value;
        loan.publish().unwrap();
    }
    let read: Vec<u16> = std::iter::from_fn(|| input.next_unread().map(|(_, slice)| slice[0])).collect();
    assert_eq!(read, [5, 6, 7, 8]);
    assert_eq!(input.lost(), 5);
}

#[test]
fn slice_with_a_non_finite_number_is_not_published() {
    let bench = Bench::new(f32::layout(), TopicPattern::Slices { capacity: 4, longest: 8 });
    let mut output = SliceOutput::<f32>::open(&bench.participant(0), bench.output_place(), "output").unwrap();
    let mut loan = output.loan(8).unwrap();
    loan.fill(1.0);
    loan[5] = f32::NAN;
    let error = loan.publish().unwrap_err();
    let crate::declare::StepError::InvalidOutput { defect: Defect::NotFinite { index: 5, .. }, .. } = error
    else {
        panic!("{error}")
    };
    let error = bench.try_input::<f32>().unwrap_err().to_string();
    assert!(error.contains("slice_input"), "{error}");
}

#[test]
fn array_has_the_digest_of_its_elements() {
    use crate::state::{Digest, Field};
    let (mut bytes, mut elements) = (Digest::default(), Digest::default());
    let values = [1.5_f64, -2.0, 3.25];
    f64::digest_all(&values, &mut bytes);
    values.iter().for_each(|value| value.digest(&mut elements));
    assert_eq!(bytes.finish(), elements.finish());
}
