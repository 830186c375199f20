//! Models of a ring with records of several writers.

use loom::sync::Arc;
use loom::thread;

use super::{Modelled, holds_only_with};
use crate::atomics::Site;
use crate::region::{Ring, RingFound};

type One = Ring<Modelled, 1, 2>;

/// Reads records of two numbers, which must be consistent if found.
fn read_whole(ring: &One) {
    for number in 1..=2 {
        let mut words = [0; 2];
        if ring.read(number, &mut words) == RingFound::Record {
            assert!(words[0] > 0 && words[1] == 10 * words[0], "{words:?}");
        }
    }
}

/// A record is overwritten while it is being read.
fn a_record_is_whole() {
    let ring = Arc::new(One::empty());
    assert!(ring.write(&[1, 10]));
    let writer = {
        let ring = ring.clone();
        thread::spawn(move || assert!(ring.write(&[2, 20])))
    };
    read_whole(&ring);
    writer.join().unwrap();
}

/// Two writers share one slot while a reader reads it.
fn writers_of_one_slot() {
    let ring = Arc::new(One::empty());
    let writer = |value: u64| {
        let ring = ring.clone();
        thread::spawn(move || ring.write(&[value, 10 * value]))
    };
    let writers = [writer(1), writer(2)];
    read_whole(&ring);
    let written = writers.map(|writer| writer.join().unwrap());
    assert!(written.contains(&true), "at least one finds the slot free");
    read_whole(&ring);
}

/// Two writers with one slot each lose no record.
fn no_record_is_lost() {
    let ring = Arc::new(Ring::<Modelled, 2, 1>::empty());
    let other = {
        let ring = ring.clone();
        thread::spawn(move || assert!(ring.write(&[1])))
    };
    assert!(ring.write(&[2]));
    other.join().unwrap();
    let mut values: Vec<u64> = (1..=ring.newest())
        .filter_map(|number| {
            let mut words = [0];
            (ring.read(number, &mut words) == RingFound::Record).then_some(words[0])
        })
        .collect();
    values.sort_unstable();
    assert_eq!(values, [1, 2]);
}

#[test]
fn overwritten_record_is_never_torn() {
    holds_only_with(&[Site::Enter, Site::Leave, Site::Begin, Site::Confirm], 3, a_record_is_whole);
}

#[test]
fn record_of_two_writers_is_never_torn() {
    holds_only_with(&[], 3, writers_of_one_slot);
}

#[test]
fn writers_with_separate_slots_lose_no_record() {
    holds_only_with(&[], 3, no_record_is_lost);
}
