//! The threads of a recorder in real time: one reads, one writes, one asks the system to bring the file to the disk.
//!
//! A file can hold its writer up for longer than the slots of a state last, as on a disk that others write to. The thread
//! that reads waits for it only when so many messages wait in memory that it must.

use std::collections::BTreeMap;
use std::fs::File;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crossbeam_channel::{Receiver, Sender, TrySendError, bounded};
use motorium::component::StopRequest;
use motorium::os::{leave_realtime, thread_cpu_ns, wake_first};

use super::batch::Batch;
use super::outcome::{Outcome, note};
use super::settings::Counts;
use super::sink::Sink;
use super::taps::Readers;

/// Time between two requests to the system to bring the file to the disk.
const SYNC_EVERY: Duration = Duration::from_millis(500);
/// Longest time between two looks whether the file is due to be handed to the system.
const FLUSH_CHECK: Duration = Duration::from_millis(250);
/// Batches on their way from one thread to the other.
const BATCHES: usize = 2;
/// Bytes of messages in one batch, where the file is slow: with those on their way, the one that is filled and the one that is
/// written 64 MiB wait in memory. Beyond them the reading waits, and samples may be lost.
const WAITING: usize = (64 << 20) / (BATCHES + 2);
/// Niceness of the thread that reads while it hands over, and where it may not have a real-time priority.
const NICENESS: i32 = -10;

/// An order of the thread that reads to the thread that writes.
pub(super) enum Order {
    /// Messages to write.
    Write(Batch),
    /// The end of the recording: its counts, and the same of each topic.
    End(Counts, BTreeMap<String, String>),
}

/// The end of the thread that reads: its orders, and emptied batches on their way back.
pub(super) type Reading = (Sender<Order>, Receiver<Batch>);
/// The end of the thread that writes.
pub(super) type Writing = (Receiver<Order>, Sender<Batch>);

/// The two ends between the threads.
pub(super) fn link() -> (Reading, Writing) {
    let (orders, taken) = bounded(BATCHES);
    let (emptied, batches) = bounded(BATCHES + 1);
    ((orders, batches), (taken, emptied))
}

/// Reads what is published until the component has stopped, or the file has ended.
pub(super) fn read(
    mut readers: Readers,
    (orders, emptied): Reading,
    stop: &StopRequest,
    poll: Duration,
    outcome: &Mutex<Outcome>,
) {
    // Without the right to, it has its turns as all others have.
    let _ = rustix::process::setpriority_process(None, NICENESS);
    let mut batch = Batch::default();
    loop {
        // It reads before all that is not real-time, so that busy programs make it lose nothing; it takes about 0.1 ms. What follows
        // may wait for the thread that writes.
        wake_first();
        let last_round = stop.wait(poll);
        if last_round {
            readers.read_last(&mut batch)
        } else {
            readers.read(&mut batch)
        }
        leave_realtime();
        let counts = readers.counts();
        // The one that writes may be held up while it has the lock: the next round tells.
        if let Ok(mut outcome) = outcome.try_lock() {
            (outcome.counts.samples, outcome.counts.lost) = (counts.samples, counts.lost);
            outcome.cpu_ns[0] = Some(thread_cpu_ns());
        }
        if last_round {
            // The one that writes has told if it cannot go on.
            let _ = orders
                .send(Order::Write(batch))
                .and_then(|()| orders.send(Order::End(counts, readers.summary())));
            return;
        }
        if batch.is_empty() {
            continue;
        }
        batch = match hand_over(&orders, batch) {
            Handed::Taken => emptied.try_recv().unwrap_or_default(),
            Handed::Waits(same) => same,
            Handed::Ended => return,
        };
    }
}

/// The outcome of handing a batch over.
enum Handed {
    Taken,
    /// The file is slow: the batch grows meanwhile.
    Waits(Batch),
    /// The file has ended.
    Ended,
}

fn hand_over(orders: &Sender<Order>, batch: Batch) -> Handed {
    if batch.len() >= WAITING {
        return if orders.send(Order::Write(batch)).is_ok() { Handed::Taken } else { Handed::Ended };
    }
    match orders.try_send(Order::Write(batch)) {
        Ok(()) => Handed::Taken,
        Err(TrySendError::Full(Order::Write(batch))) => Handed::Waits(batch),
        Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => Handed::Ended,
    }
}

/// Writes what was read until the reading ends, or the file cannot be written.
pub(super) fn write(mut sink: Sink, (orders, emptied): &Writing, outcome: &Mutex<Outcome>) {
    let mut nothing = Batch::default();
    loop {
        let written = match orders.recv_timeout(FLUSH_CHECK) {
            Ok(Order::Write(mut batch)) => {
                let written = sink.write(&mut batch);
                // One more than there is room for is dropped.
                let _ = emptied.try_send(batch);
                written
            }
            Ok(Order::End(counts, summary)) => {
                let ended = sink.finish(summary).map(|bytes| Counts { bytes, ..counts });
                outcome.lock().unwrap_or_else(PoisonError::into_inner).cpu_ns[1] = Some(thread_cpu_ns());
                return note(outcome, None, ended);
            }
            Err(error) if error.is_timeout() => sink.write(&mut nothing),
            // The thread that reads has panicked, which the component tells.
            Err(_) => return,
        };
        {
            let mut outcome = outcome.lock().unwrap_or_else(PoisonError::into_inner);
            (outcome.counts.bytes, outcome.cpu_ns[1]) = (sink.bytes(), Some(thread_cpu_ns()));
        }
        if let Err(error) = written {
            return note(outcome, None, Err(error));
        }
    }
}

/// Brings what was written to the disk, twice a second.
pub(super) fn sync(file: &File, stop: &StopRequest) {
    while !stop.wait(SYNC_EVERY) {
        // The writer finds out when the disk takes nothing more.
        let _ = file.sync_data();
    }
}

#[cfg(test)]
mod tests {
    use motorium::state::Stamp;

    use super::*;

    fn batch(bytes: usize) -> Batch {
        let mut batch = Batch::default();
        batch.push(0, &Stamp::default(), 0, |out| out.resize(bytes, 7));
        batch
    }

    #[test]
    fn a_slow_file_makes_the_batch_wait_and_grow_and_an_ended_one_ends_the_reading() {
        let ((orders, _emptied), (taken, given_back)) = link();
        for _ in 0..BATCHES {
            assert!(matches!(hand_over(&orders, batch(10)), Handed::Taken));
        }
        let Handed::Waits(mut same) = hand_over(&orders, batch(10)) else { panic!("there was room") };
        assert_eq!(same.len(), 10, "nothing is lost of it");
        same.push(0, &Stamp::default(), 1, |out| out.resize(15, 7));
        drop(taken.recv().unwrap());
        assert!(matches!(hand_over(&orders, same), Handed::Taken));
        drop((taken, given_back));
        assert!(matches!(hand_over(&orders, batch(10)), Handed::Ended));
    }

    #[test]
    fn a_batch_of_all_that_may_wait_in_memory_is_handed_over_before_more_is_read() {
        let ((orders, _emptied), (taken, _given_back)) = link();
        let slow = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(50));
            taken.iter().take(BATCHES + 1).map(|order| matches!(order, Order::Write(_))).collect::<Vec<_>>()
        });
        for _ in 0..BATCHES {
            assert!(matches!(hand_over(&orders, batch(10)), Handed::Taken));
        }
        assert!(matches!(hand_over(&orders, batch(WAITING)), Handed::Taken), "it waits until there is room");
        assert_eq!(slow.join().unwrap(), [true; BATCHES + 1]);
    }
}
