//! Models of reading every value from the slots of older publications.

use loom::sync::Arc;
use loom::thread;

use super::{Topic, holds_only_with};
use crate::atomics::Site;
use crate::transport::latest::protocol::{Reuse, Writer, newest, pin_marked, unpin};

/// A tap reads the available publications in order, while the writer cycles through its slots.
fn a_tap() {
    let topic = Arc::new(Topic::new(1, 3));
    let tap = {
        let topic = topic.clone();
        thread::spawn(move || {
            let end = newest(&topic.head).number();
            for wanted in end.max(1)..=end + 1 {
                for slot in 0..3 {
                    if pin_marked(&*topic, &topic.pins[0], slot, wanted) {
                        assert_eq!(topic.read(slot), wanted);
                    }
                }
            }
            unpin(&topic.pins[0]);
        })
    };
    let mut writer = Writer::new(&*topic, Reuse::Oldest);
    for value in 1..=4 {
        let slot = writer.slot(&*topic);
        topic.write(slot, value);
        writer.publish(&*topic, value);
    }
    tap.join().unwrap();
}

/// A tap that pins a slot just before the writer claims it keeps the value for other taps.
fn a_value_that_is_kept() {
    let topic = Arc::new(Topic::new(1, 3));
    let mut writer = Writer::new(&*topic, Reuse::Oldest);
    for value in 1..=2 {
        assert_eq!(writer.slot(&*topic), value as usize - 1);
        topic.write(value as usize - 1, value);
        writer.publish(&*topic, value);
    }
    assert!(pin_marked(&*topic, &topic.pins[0], 0, 1));
    let other = {
        let topic = topic.clone();
        thread::spawn(move || {
            let slot = writer.slot(&*topic);
            topic.write(slot, 3);
            writer.publish(&*topic, 3);
            let slot = writer.slot(&*topic);
            topic.write(slot, 4);
        })
    };
    assert_eq!(topic.read(0), 1);
    other.join().unwrap();
    assert!(pin_marked(&*topic, &topic.pins[0], 0, 1), "it is still available");
}

#[test]
fn tap_reads_complete_values_of_the_requested_number() {
    holds_only_with(&[Site::Mark, Site::Claim, Site::Scan, Site::Pin, Site::Pinned], 3, a_tap);
}

#[test]
fn value_pinned_by_a_tap_stays_available() {
    holds_only_with(&[], 3, a_value_that_is_kept);
}
