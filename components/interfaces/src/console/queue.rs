//! A bounded queue of values of different sizes, as bytes, from the step to the thread that prints.

use rtrb::{Consumer, Producer, RingBuffer};

/// Bytes before each value: time, index of the input, bytes of the value.
const HEADER: usize = 16;
/// Most bytes of a queue.
const LONGEST: usize = 64 << 20;

/// The side of the step. It never waits.
pub(super) struct Sender(Producer<u8>);

/// The side of the printer.
pub(super) struct Receiver(Consumer<u8>);

/// A value on its way.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Entry {
    /// Time of the step, s since the run began.
    pub(super) time: f64,
    /// Index of the input.
    pub(super) input: usize,
    pub(super) bytes: Vec<u8>,
}

/// A queue with room for `count` values of at most `largest` bytes, or for as many of them as 64 MiB hold.
pub(super) fn queue(count: usize, largest: usize) -> (Sender, Receiver) {
    let entry = HEADER + largest;
    let bytes = count.saturating_mul(entry).min(LONGEST).max(entry);
    let (producer, consumer) = RingBuffer::new(bytes);
    (Sender(producer), Receiver(consumer))
}

impl Sender {
    /// Hands a value on; false if there is no room. Allocates nothing.
    pub(super) fn send(&mut self, time: f64, input: usize, bytes: &[u8]) -> bool {
        let Ok(mut chunk) = self.0.write_chunk(HEADER + bytes.len()) else { return false };
        let (first, second) = chunk.as_mut_slices();
        let header = [time.to_ne_bytes(), ((input as u64) << 32 | bytes.len() as u64).to_ne_bytes()];
        let mut room = first.iter_mut().chain(second);
        // the shorter one first: `zip` takes from its first iterator before it sees that the second has ended
        for (from, to) in header.as_flattened().iter().zip(room.by_ref()) {
            *to = *from;
        }
        for (to, from) in room.zip(bytes) {
            *to = *from;
        }
        chunk.commit_all();
        true
    }
}

impl Receiver {
    /// The next value.
    pub(super) fn receive(&mut self) -> Option<Entry> {
        let mut header = self.0.read_chunk(HEADER).ok()?.into_iter();
        let mut word = || {
            header.by_ref().take(8).enumerate().fold([0; 8], |mut word, (i, byte)| {
                word[i] = byte;
                word
            })
        };
        let (time, place) = (f64::from_ne_bytes(word()), u64::from_ne_bytes(word()));
        drop(header);
        let length = (place & u64::from(u32::MAX)) as usize;
        // header and value were handed on together
        let bytes = self.0.read_chunk(length).ok()?.into_iter().collect();
        Some(Entry { time, input: (place >> 32) as usize, bytes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_out_as_they_went_in_and_none_is_cut_short() {
        let (mut sender, mut receiver) = queue(2, 40);
        let values: Vec<Vec<u8>> = [40, 0, 7].map(|length| (0..length).collect()).into();
        for round in 0..50 {
            let time = f64::from(round);
            assert!(sender.send(time, 1, &values[0]) && sender.send(time, 2, &values[2]));
            assert!(sender.send(time, 3, &values[1]), "a short one finds room that a long one would not");
            assert!(!sender.send(time, 4, &values[0]));
            for (input, bytes) in [(1, &values[0]), (2, &values[2]), (3, &values[1])] {
                assert_eq!(receiver.receive(), Some(Entry { time, input, bytes: bytes.clone() }));
            }
            assert_eq!(receiver.receive(), None);
        }
    }
}
