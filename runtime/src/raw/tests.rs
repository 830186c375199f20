use super::*;
use crate::declare::TopicPattern;
use crate::plan::PortPlan;
use crate::state::{StateBuffer, Wrench};
use crate::transport::tests::Bench;
use crate::transport::{InputPlace, SliceInput};

/// Opens the input of a bench's topic as bytes.
fn raw_input(bench: &Bench) -> RawStreamInput {
    let topic = bench.topic();
    let place = InputPlace { index: 0, topic, port: "input", pin: 0, is_cause: false, edge: Some(0) };
    RawStreamInput::open(&bench.participant(1), &place).unwrap()
}

/// Opens the output of a bench's topic as bytes.
fn raw_output(bench: &Bench) -> RawStreamOutput {
    let topic = bench.topic();
    let (pattern, layout) = (topic.pattern, topic.layout.clone());
    let port = PortPlan { port: "output".to_string(), topic: Some(0), pattern, layout };
    RawStreamOutput::open(&bench.participant(0), bench.output_place(), &port).unwrap()
}

fn bytes_of(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_ne_bytes()).collect()
}

#[test]
fn raw_slices_are_read_as_typed_ones_in_place() {
    let bench = Bench::new(f32::layout(), TopicPattern::Slices { capacity: 4, longest: 8 });
    let (mut output, mut input) = (raw_output(&bench), raw_input(&bench));
    let topic = bench.topic();
    let place = InputPlace { index: 0, topic, port: "input", pin: 0, is_cause: false, edge: Some(0) };
    let mut typed = SliceInput::<f32>::open(&bench.participant(1), &place).unwrap();
    assert_eq!((output.longest(), input.pattern()), (8, Some(topic.pattern)));
    for values in [&[1.0, 2.0, 3.0][..], &[], &[5.0; 8]] {
        output.publish(&bytes_of(values)).unwrap();
        assert_eq!(typed.next_unread().unwrap().1, values);
        let read = input.next_unread().unwrap();
        assert_eq!((read.bytes, read.count), (&bytes_of(values)[..], values.len()));
        let address = read.bytes.as_ptr();
        assert_eq!(input.current().unwrap().bytes.as_ptr(), address, "no copy is made");
    }
    assert_eq!(input.lost(), 0);
    let long = output.publish(&bytes_of(&[0.0; 9])).unwrap_err();
    assert_eq!(long.to_string(), "9 elements to publish, expected at most 8");
    assert!(matches!(output.publish(&bytes_of(&[f32::NAN])), Err(RawError::Content(_))));
    assert!(matches!(output.publish(&[0; 7]), Err(RawError::Content(_))));
    assert!(input.next_unread().is_none(), "no part of it is published");
}

#[test]
fn raw_ports_lose_none_of_a_million_values() {
    for (layout, pattern) in [
        (Wrench::layout(), TopicPattern::Stream { capacity: 16 }),
        (f32::layout(), TopicPattern::Slices { capacity: 16, longest: 8 }),
    ] {
        let bytes = vec![0; layout.size];
        let bench = Bench::new(layout, pattern);
        let (mut output, mut input) = (raw_output(&bench), raw_input(&bench));
        let mut next = 1;
        for round in 0..100_000 {
            (0..10).for_each(|_| output.publish(&bytes).unwrap());
            while let Some(read) = input.next_unread() {
                assert_eq!((read.stamp.sequence, read.count), (next, 1), "in round {round}");
                next += 1;
            }
        }
        assert_eq!((next, input.lost()), (1_000_001, 0), "{pattern:?}");
    }
}

#[test]
fn raw_stream_refuses_an_empty_value() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::Stream { capacity: 16 });
    assert!(matches!(raw_output(&bench).publish(&[]), Err(RawError::Length { found: 0, longest: 1 })));
}
