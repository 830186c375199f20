//! The threads of a recorder in real time: a reader, a writer, and one that syncs the file to disk.
//!
//! A busy disk can block the writer for longer than the slots of a state keep their samples. The reader waits
//! for the writer only when the message memory is full.

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

/// Time between two syncs of the file to disk.
const SYNC_EVERY: Duration = Duration::from_millis(500);
/// Longest interval between checks for a due flush.
const FLUSH_CHECK: Duration = Duration::from_millis(250);
/// Number of batches in transit between the threads.
const BATCHES: usize = 2;
/// Maximum number of message bytes per batch when the file is slow. The batches in transit, the one being
/// filled and the one being written amount to 64 MiB. Beyond that, the reader waits and samples may be lost.
const WAITING: usize = (64 << 20) / (BATCHES + 2);
/// Niceness of the reader while it hands batches over, and whenever it has no real-time priority.
const NICENESS: i32 = -10;

/// A command from the reader to the writer.
pub(super) enum Order {
    /// Messages to write.
    Write(Batch),
    /// End of the recording, with its total counts and its counts per topic.
    End(Counts, BTreeMap<String, String>),
}

/// Reader's end: its commands, and emptied batches that return.
pub(super) type Reading = (Sender<Order>, Receiver<Batch>);
/// Writer's end.
pub(super) type Writing = (Receiver<Order>, Sender<Batch>);

/// Creates the two ends of the connection between the threads.
pub(super) fn link() -> (Reading, Writing) {
    let (orders, taken) = bounded(BATCHES);
    let (emptied, batches) = bounded(BATCHES + 1);
    ((orders, batches), (taken, emptied))
}

/// Reads published values until the component has stopped or the file has ended.
pub(super) fn read(
    mut readers: Readers,
    (orders, emptied): Reading,
    stop: &StopRequest,
    poll: Duration,
    outcome: &Mutex<Outcome>,
) {
    // Without the privilege, the reader is scheduled like any other thread.
    let _ = rustix::process::setpriority_process(None, NICENESS);
    let mut batch = Batch::default();
    loop {
        // Reading lasts about 0.1 ms and preempts everything without real-time priority, so busy programs
        // cause no losses. The rest may wait for the writer.
        wake_first();
        let last_round = stop.wait(poll);
        if last_round {
            readers.read_last(&mut batch)
        } else {
            readers.read(&mut batch)
        }
        leave_realtime();
        let counts = readers.counts();
        // The writer may be preempted while it holds the lock; the counts are then reported in the next
        // round.
        if let Ok(mut outcome) = outcome.try_lock() {
            (outcome.counts.samples, outcome.counts.lost) = (counts.samples, counts.lost);
            outcome.cpu_ns[0] = Some(thread_cpu_ns());
        }
        if last_round {
            // A writer that cannot continue has already reported its error.
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

/// Outcome of handing over a batch.
enum Handed {
    Taken,
    /// The file is slow, so the batch keeps growing.
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

/// Writes batches until reading ends or the file cannot be written.
pub(super) fn write(mut sink: Sink, (orders, emptied): &Writing, outcome: &Mutex<Outcome>) {
    let mut nothing = Batch::default();
    loop {
        let written = match orders.recv_timeout(FLUSH_CHECK) {
            Ok(Order::Write(mut batch)) => {
                let written = sink.write(&mut batch);
                // A batch beyond the capacity is dropped.
                let _ = emptied.try_send(batch);
                written
            }
            Ok(Order::End(counts, summary)) => {
                let ended = sink.finish(summary).map(|bytes| Counts { bytes, ..counts });
                outcome.lock().unwrap_or_else(PoisonError::into_inner).cpu_ns[1] = Some(thread_cpu_ns());
                return note(outcome, None, ended);
            }
            Err(error) if error.is_timeout() => sink.write(&mut nothing),
            // The reader panicked; the component reports the panic.
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

/// Syncs the file to disk, twice per second.
pub(super) fn sync(file: &File, stop: &StopRequest) {
    while !stop.wait(SYNC_EVERY) {
        // The writer detects a full disk.
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
    fn slow_file_delays_batches_and_ended_file_stops_reading() {
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
    fn full_batch_is_handed_over_before_more_is_read() {
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
