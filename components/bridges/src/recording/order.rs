//! Samples of a recording in time order, without loading all of them.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use super::{ReadError, RecordedSample, Recording, Samples};

/// Iterator over the samples of a recording in time order. Samples with equal times are in file order. Memory
/// use is proportional to the disorder of the file.
pub struct InOrder<'r> {
    samples: Samples<'r>,
    /// Samples that others may still precede.
    waiting: BinaryHeap<Reverse<Waiting>>,
    /// Maximum time by which a message in the file is earlier than a preceding one, ns.
    disorder_ns: u64,
    /// Latest sample time so far, ns.
    latest_ns: u64,
    /// Number of samples read so far.
    read: u64,
    is_over: bool,
}

/// A sample and its index in the file.
struct Waiting(RecordedSample, u64);

impl Waiting {
    fn sort_key(&self) -> (u64, u64) {
        (self.0.time_ns, self.1)
    }
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.sort_key() == other.sort_key()
    }
}

impl Eq for Waiting {}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        self.sort_key().cmp(&other.sort_key())
    }
}

impl Recording {
    /// Returns an iterator over all samples in time order.
    ///
    /// ```no_run
    /// use motorium_bridges::recording::Recording;
    ///
    /// let recording = Recording::open("out/run.mcap".as_ref())?;
    /// for sample in recording.in_order() {
    ///     println!("{}", sample?.time_ns);
    /// }
    /// # Ok::<(), motorium_bridges::recording::ReadError>(())
    /// ```
    pub fn in_order(&self) -> InOrder<'_> {
        InOrder {
            samples: self.samples(),
            waiting: BinaryHeap::new(),
            disorder_ns: self.disorder_ns(),
            latest_ns: 0,
            read: 0,
            is_over: false,
        }
    }

    /// Returns all samples in time order as a list.
    ///
    /// # Errors
    /// Returns an error if a message is damaged.
    pub fn sorted(&self) -> Result<Vec<RecordedSample>, ReadError> {
        self.in_order().collect()
    }
}

impl Iterator for InOrder<'_> {
    type Item = Result<RecordedSample, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let is_next = |Reverse(first): &Reverse<Waiting>| {
                self.is_over || first.0.time_ns.saturating_add(self.disorder_ns) <= self.latest_ns
            };
            if self.waiting.peek().is_some_and(is_next) {
                return self.waiting.pop().map(|Reverse(Waiting(sample, _))| Ok(sample));
            }
            match self.samples.next() {
                Some(Ok(sample)) => {
                    self.latest_ns = self.latest_ns.max(sample.time_ns);
                    self.waiting.push(Reverse(Waiting(sample, self.read)));
                    self.read += 1;
                }
                Some(Err(error)) => return Some(Err(error)),
                None if self.is_over => return None,
                None => self.is_over = true,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use motorium::state::{Stamp, StateBuffer as _, Wrench, encode};

    use super::super::file::Writer;
    use super::super::{LAYOUT, Recording};
    use crate::foxglove::Derived;

    #[test]
    fn samples_are_sorted_by_time_stably() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.mcap");
        let (mut writer, _) = Writer::create(&file).unwrap();
        let derived = Derived::new(&Wrench::layout()).unwrap();
        let layout = serde_json::to_string(&Wrench::layout()).unwrap();
        let of_topic = BTreeMap::from([(LAYOUT.to_string(), layout)]);
        let channel = writer.channel("wrench", derived.schema(), &of_topic).unwrap();
        for (sequence, time_ns) in (1..).zip([5, 3, 9, 9, 4, 12, 12, 11, 20]) {
            let (stamp, mut message) = (Stamp { sequence, ..Stamp::default() }, Vec::new());
            let bytes = encode(&Wrench::layout(), "force=[1.0, 2.0, 3.0]").unwrap();
            derived.encode(&stamp, &bytes, &mut message);
            writer.message(channel, sequence, (time_ns, time_ns), &message).unwrap();
        }
        writer.finish().unwrap();
        let recording = Recording::open(&file).unwrap();
        assert_eq!(recording.disorder_ns(), 5, "4 follows 9");
        let found = recording.in_order().map(Result::unwrap);
        let found: Vec<(u64, u64)> = found.map(|sample| (sample.time_ns, sample.stamp.sequence)).collect();
        assert_eq!(found, [(3, 2), (4, 5), (5, 1), (9, 3), (9, 4), (11, 8), (12, 6), (12, 7), (20, 9)]);
        let mut samples = recording.in_order();
        samples.by_ref().take(3).for_each(drop);
        assert!(samples.waiting.len() <= 4, "not all of them are in memory: {}", samples.waiting.len());
    }
}
