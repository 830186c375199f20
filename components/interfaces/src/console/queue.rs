//! A bounded byte queue for values of different sizes, from the step to the printing thread.

use std::sync::Arc;

use crossbeam_queue::ArrayQueue;

/// Maximum size of a queue, bytes.
const LONGEST: usize = 64 << 20;

/// The sending side, used by the step. It never blocks.
#[derive(Debug)]
pub(super) struct Sender(Arc<Slots>);

/// The receiving side, used by the printing thread.
#[derive(Debug)]
pub(super) struct Receiver(Arc<Slots>);

/// Slots that circulate between sender and receiver.
#[derive(Debug)]
struct Slots {
    free: ArrayQueue<Slot>,
    filled: ArrayQueue<Slot>,
}

/// Storage for one value.
#[derive(Debug)]
struct Slot {
    time: f64,
    input: usize,
    length: usize,
    bytes: Box<[u8]>,
}

/// A queued value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Entry<'a> {
    /// Time of the step, s since the start of the run.
    pub(super) time: f64,
    /// Index of the input.
    pub(super) input: usize,
    pub(super) bytes: &'a [u8],
}

/// Creates a queue for `count` values of at most `largest` bytes. The capacity is lower if the values would
/// exceed 64 MiB.
pub(super) fn queue(count: usize, largest: usize) -> (Sender, Receiver) {
    let count = count.min(LONGEST / largest.max(1)).max(1);
    let slots = Slots { free: ArrayQueue::new(count), filled: ArrayQueue::new(count) };
    for _ in 0..count {
        let slot = Slot { time: 0.0, input: 0, length: 0, bytes: vec![0; largest].into() };
        let _ = slots.free.push(slot); // there is room for all
    }
    let slots = Arc::new(slots);
    (Sender(slots.clone()), Receiver(slots))
}

impl Sender {
    /// Enqueues a value; returns `false` if the queue is full. Does not allocate.
    pub(super) fn send(&mut self, time: f64, input: usize, bytes: &[u8]) -> bool {
        let Some(mut slot) = self.0.free.pop() else { return false };
        let Some(room) = slot.bytes.get_mut(..bytes.len()) else {
            let _ = self.0.free.push(slot);
            return false;
        };
        room.copy_from_slice(bytes);
        (slot.time, slot.input, slot.length) = (time, input, bytes.len());
        self.0.filled.push(slot).is_ok()
    }
}

impl Receiver {
    /// Passes the next queued value to `read` and returns the result; `None` if the queue is empty.
    pub(super) fn receive<T>(&mut self, read: impl FnOnce(Entry<'_>) -> T) -> Option<T> {
        let slot = self.0.filled.pop()?;
        let result = read(Entry { time: slot.time, input: slot.input, bytes: &slot.bytes[..slot.length] });
        let _ = self.0.free.push(slot); // it was popped from this queue
        Some(result)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_pass_the_queue_unchanged() {
        let (mut sender, mut receiver) = queue(3, 40);
        let values: Vec<Vec<u8>> = [40, 0, 7].map(|length| (0..length).collect()).into();
        for round in 0..50 {
            let time = f64::from(round);
            assert!(sender.send(time, 1, &values[0]) && sender.send(time, 2, &values[2]));
            assert!(sender.send(time, 3, &values[1]));
            assert!(!sender.send(time, 4, &values[1]), "three values are queued already");
            for (input, bytes) in [(1, &values[0]), (2, &values[2]), (3, &values[1])] {
                let seen = receiver.receive(|entry| assert_eq!(entry, Entry { time, input, bytes }));
                assert_eq!(seen, Some(()));
            }
            assert_eq!(receiver.receive(|_| ()), None);
        }
    }

    #[test]
    fn oversized_value_is_rejected_without_using_a_slot() {
        let (mut sender, mut receiver) = queue(1, 4);
        assert!(!sender.send(0.0, 0, &[0; 5]));
        assert!(sender.send(0.0, 0, &[7; 4]));
        assert_eq!(receiver.receive(|entry| entry.bytes.to_vec()), Some(vec![7; 4]));
    }

    #[test]
    fn values_of_any_size_are_bounded_in_memory() {
        let (mut sender, _receiver) = queue(1_000, LONGEST / 2);
        assert!(sender.send(0.0, 0, &[1]) && sender.send(0.0, 0, &[2]));
        assert!(!sender.send(0.0, 0, &[3]));
    }
}
