//! Models of pinning and publishing.

use loom::sync::Arc;
use loom::thread;

use super::{Topic, holds_only_with};
use crate::atomics::Site;
use crate::transport::latest::protocol::{Reuse, Writer, pin_newest};

fn write(topic: &Topic, reuse: Reuse, publications: u64) {
    let mut writer = Writer::new(topic, reuse);
    for _ in 0..publications {
        let (slot, number) = (writer.slot(topic), writer.number());
        topic.write(slot, number);
        writer.publish(topic, number);
    }
}

/// Reads `looks` times. Every value must belong to the pinned publication, and none may be older than the
/// previous one.
fn read(topic: &Topic, pin: usize, looks: usize) {
    let mut last = 0;
    for _ in 0..looks {
        if let Some(pinned) = pin_newest(topic, &topic.pins[pin], last, |_| {}) {
            assert!(pinned.number() > last);
            assert_eq!(topic.read(pinned.slot()), pinned.number());
            last = pinned.number();
        }
    }
}

fn one_reader() {
    let topic = Arc::new(Topic::new(1, 3));
    let reader = {
        let topic = topic.clone();
        thread::spawn(move || read(&topic, 0, 2))
    };
    write(&topic, Reuse::First, 3);
    reader.join().unwrap();
}

/// A writer claims two slots together, with one scan of the pins for two publications.
fn one_reader_and_slots_in_stock() {
    let topic = Arc::new(Topic::new(1, 4));
    write(&topic, Reuse::First, 1);
    let reader = {
        let topic = topic.clone();
        thread::spawn(move || read(&topic, 0, 2))
    };
    write(&topic, Reuse::Several, 4);
    reader.join().unwrap();
}

fn two_readers() {
    let topic = Arc::new(Topic::new(2, 4));
    let readers: Vec<_> = (0..2)
        .map(|pin| {
            let topic = topic.clone();
            thread::spawn(move || read(&topic, pin, 1))
        })
        .collect();
    write(&topic, Reuse::First, 3);
    readers.into_iter().for_each(|reader| reader.join().unwrap());
}

/// A reader was killed with the newest value pinned; its successor inherits the pin.
fn a_killed_reader() {
    let topic = Arc::new(Topic::new(1, 3));
    write(&topic, Reuse::First, 1);
    assert!(pin_newest(&*topic, &topic.pins[0], 0, |_| {}).is_some());
    let successor = {
        let topic = topic.clone();
        thread::spawn(move || read(&topic, 0, 1))
    };
    write(&topic, Reuse::First, 2);
    successor.join().unwrap();
}

/// A writer was killed while filling a slot; its successor continues, and the last value stays intact.
fn a_killed_writer() {
    let topic = Arc::new(Topic::new(1, 3));
    write(&topic, Reuse::First, 1);
    let slot = Writer::new(&*topic, Reuse::First).slot(&*topic);
    topic.write(slot, u64::MAX);
    let reader = {
        let topic = topic.clone();
        thread::spawn(move || read(&topic, 0, 2))
    };
    let mut successor = Writer::new(&*topic, Reuse::First);
    let slot = successor.slot(&*topic);
    topic.write(slot, 2);
    successor.publish(&*topic, 2);
    reader.join().unwrap();
}

#[test]
fn pinned_value_is_complete_and_never_written_to() {
    let sites = [Site::Publish, Site::Claim, Site::Scan, Site::Pin, Site::Pinned];
    holds_only_with(&sites, 4, one_reader);
}

#[test]
fn free_slots_stay_free_until_they_are_published() {
    let sites = [Site::Publish, Site::Claim, Site::Scan, Site::Pin, Site::Pinned];
    holds_only_with(&sites, 3, one_reader_and_slots_in_stock);
}

#[test]
fn two_readers_leave_the_writer_a_slot() {
    holds_only_with(&[], 2, two_readers);
}

#[test]
fn successor_of_a_killed_reader_inherits_its_pin() {
    holds_only_with(&[], 3, a_killed_reader);
}

#[test]
fn last_complete_value_survives_a_killed_writer() {
    holds_only_with(&[], 3, a_killed_writer);
}
