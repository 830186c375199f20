//! Reading the newest value from outside the graph.

use crate::declare::TopicPattern;
use crate::session::TopicReader;
use crate::state::{StateBuffer as _, Wrench};
use crate::transport::tests::{Bench, swapped, wrench};
use crate::transport::{SliceOutput, Tap};

fn reader(bench: &Bench) -> TopicReader {
    TopicReader::open(&bench.folder.domain().unwrap(), bench.topic()).unwrap()
}

#[test]
fn value_stays_in_place_until_the_next_poll() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let mut output = bench.output::<Wrench>();
    let mut reader = reader(&bench);
    assert!(!reader.poll() && reader.bytes().is_none() && reader.stamp().is_none());
    output.send(&wrench(1.0)).unwrap();
    assert!(reader.poll() && !reader.poll());
    let first = reader.value::<Wrench>().unwrap().unwrap();
    let address = core::ptr::from_ref(first);
    (2..1_000).for_each(|x| output.send(&wrench(f64::from(x))).unwrap());
    assert_eq!(first.force[0], 1.0, "the writer does not touch the pinned slot");
    assert_eq!(reader.stamp().unwrap().sequence, 1);
    assert_eq!(core::ptr::from_ref(reader.value::<Wrench>().unwrap().unwrap()), address, "no copy is made");
    assert_eq!(reader.bytes().unwrap().as_ptr().cast::<Wrench>(), address);
    assert!(reader.poll());
    assert_eq!(reader.value::<Wrench>().unwrap().unwrap().force[0], 999.0);
}

#[test]
fn reader_checks_the_layout_of_types() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let reader = reader(&bench);
    assert_eq!(reader.layout().type_name, "motorium.Wrench");
    let error = reader.value::<swapped::Wrench>().unwrap_err().to_string();
    assert!(error.contains("0  torque: [f64; 3]"), "{error}");
}

#[test]
fn newest_value_of_a_stream_is_read() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::Stream { capacity: 4 });
    let mut reader = reader(&bench);
    let mut output = bench.output::<Wrench>();
    for round in 0..3 {
        (0..10).for_each(|x| output.send(&wrench(f64::from(10 * round + x))).unwrap());
        assert!(reader.poll());
        assert_eq!(reader.value::<Wrench>().unwrap().unwrap().force[0], f64::from(10 * round + 9));
        assert_eq!(reader.stamp().unwrap().sequence, 10 * (round as u64 + 1));
        assert!(!reader.poll(), "nothing newer");
    }
}

#[test]
fn slice_is_read_as_the_bytes_of_all_elements() {
    let bench = Bench::new(u16::layout(), TopicPattern::Slices { capacity: 4, longest: 1_000 });
    let mut reader = reader(&bench);
    let mut output = SliceOutput::<u16>::open(&bench.participant(0), bench.output_place(), "output").unwrap();
    for length in [3, 0, 1_000] {
        let mut loan = output.loan(length).unwrap();
        loan.fill_from((0..length).map(|value| value as u16));
        loan.publish().unwrap();
    }
    assert!(reader.poll());
    let bytes = reader.bytes().unwrap();
    assert_eq!((bytes.len(), bytes[1998], bytes[1999]), (2_000, 231, 3));
    let error = reader.value::<u16>().unwrap_err().to_string();
    assert!(error.contains("slices"), "{error}");
}

#[test]
fn four_programs_read_a_topic_and_a_fifth_is_refused() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let mut readers: Vec<_> = (0..3).map(|_| reader(&bench)).collect();
    let tap = Tap::open(&bench.folder.domain().unwrap(), bench.topic()).unwrap();
    let refused = TopicReader::open(&bench.folder.domain().unwrap(), bench.topic());
    assert!(refused.unwrap_err().to_string().contains("four programs"));
    drop(tap);
    readers.push(reader(&bench));
    let mut output = bench.output::<Wrench>();
    for x in 0..100 {
        output.send(&wrench(f64::from(x))).unwrap();
        for (index, reader) in readers.iter_mut().enumerate() {
            if x % (index as i32 + 1) == 0 {
                assert!(reader.poll());
                assert_eq!(reader.value::<Wrench>().unwrap().unwrap().force[0], f64::from(x));
            }
        }
    }
}

#[test]
fn new_episode_is_read_from_its_first_value() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let mut output = bench.output::<Wrench>();
    let mut reader = reader(&bench);
    (0..5).for_each(|x| output.send(&wrench(f64::from(x))).unwrap());
    assert!(reader.poll());
    bench.participant(0).memory(bench.topic()).unwrap().clear();
    bench.output::<Wrench>().send(&wrench(7.0)).unwrap();
    assert!(reader.poll());
    assert_eq!(reader.value::<Wrench>().unwrap().unwrap().force[0], 7.0);
}
