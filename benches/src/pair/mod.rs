//! Ping-pong between two processes: the floors of the machine and motorium's hops.
//!
//! A hop is measured in one direction: from the clock read before the payload is written to the clock read
//! after the other process has read all of it. `CLOCK_MONOTONIC` is the same on all cores. The transport
//! [`CacheLine`](Transport::CacheLine) is an exception: its time is half of a round trip, with the clock read
//! outside the measured path, so that this floor is as low as the machine allows.

mod floors;
mod link;
mod plain;
mod role;
mod shared_buffer;
mod stock;
mod topics;

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use motorium::graph::{self, Machine};
use motorium::testing::TopicSet;
use motorium::transport::Domain;
use motorium::worker::Registry;
use serde::{Deserialize, Serialize};

use crate::MeasureError;
use crate::processes::run_to_end;
pub(crate) use role::{ROLE, run_role};
use shared_buffer::SharedBuffer;

/// Transport of the payload, including how the receiver waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Transport {
    /// One word of shared memory polled by both cores; no payload.
    CacheLine,
    /// A word that both cores poll, and a payload of 512 bytes in plain shared memory.
    Plain,
    /// A word and a futex that wakes the receiver, and a payload of any size in plain shared memory.
    PlainBlocking,
    /// Like `Plain`, but with the work of every motorium publication: a check for finite numbers, a clock
    /// reading, and a stamp.
    PlainChecked,
    /// Like `PlainBlocking`, but with the additional work of `PlainChecked`.
    PlainBlockingChecked,
    /// A word and a futex that wakes the receiver; no payload.
    Futex,
    /// A motorium topic, whose receiver waits for its trigger.
    Blocking,
    /// A motorium topic, polled by the receiver.
    Polling,
    /// Stock iceoryx2: `ipc::Service` with publish-subscribe, and an event to wake the receiver.
    Stock,
}

/// Settings of one ping-pong measurement between two processes.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PingPong {
    /// Transport of the payload.
    pub transport: Transport,
    /// Size of the payload, bytes; one of [`SIZES`](crate::payload::SIZES).
    pub bytes: usize,
    /// The cores of the two processes.
    pub cores: [usize; 2],
    /// `SCHED_FIFO` priority of both processes; 0 for normal time sharing.
    pub fifo: u8,
    /// Number of round trips. A round trip yields two samples. With a pace, and for [`Transport::CacheLine`],
    /// a round trip yields one sample.
    pub rounds: usize,
    /// Number of warm-up rounds before the recorded rounds.
    pub warm_up: usize,
    /// Time between two round trips, ns, in which the receiver's core enters deep sleep; 0 for back-to-back
    /// round trips.
    pub pace_ns: u64,
}

/// Measured times of a ping-pong.
#[derive(Debug, Clone)]
pub struct HopTimes {
    /// Time of each hop, ns.
    pub samples: Vec<u64>,
    /// `SCHED_FIFO` priority of both sides, as read back from the kernel; 0 for normal time sharing.
    pub fifo: u32,
}

/// Description of the measurement that each process reads from its folder.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Assignment {
    ping_pong: PingPong,
    /// Folder of the topics or of the stock domain.
    topics: PathBuf,
}

const SIDES: [&str; 2] = ["ping", "pong"];

/// Runs a measurement with `program`, which passes its arguments to [`Role`](crate::Role).
///
/// # Errors
/// Shared memory or the processes could not be created, or a process failed.
pub fn measure(program: &Path, registry: &Registry, ping_pong: &PingPong) -> Result<HopTimes, MeasureError> {
    let folder = Folder::create()?;
    let topics = matches!(ping_pong.transport, Transport::Blocking | Transport::Polling)
        .then(|| topic_set(registry, ping_pong))
        .transpose()?;
    let assignment = Assignment {
        ping_pong: ping_pong.clone(),
        topics: topics.as_ref().map_or(folder.0.clone(), |topics| topics.path().to_path_buf()),
    };
    let text = serde_json::to_vec(&assignment)
        .map_err(|error| MeasureError::system("writing the assignment", error))?;
    std::fs::write(folder.0.join("assignment.json"), text)
        .map_err(|error| MeasureError::system("writing the assignment", error))?;
    let buffer = SharedBuffer::create(&folder.0.join("buffer"), ping_pong.rounds)
        .map_err(|error| MeasureError::system("making shared memory", error))?;
    let ended = supervise(program, &folder.0, ping_pong);
    if ping_pong.transport == Transport::Stock {
        Domain::new(&folder.0, &folder.name()).map(|domain| domain.remove()).ok();
    }
    ended?;
    let mut samples = buffer.recorded(1);
    // With a pace, only the forward path meets a sleeping receiver.
    if ping_pong.pace_ns == 0 {
        samples.extend(buffer.recorded(0));
    }
    let fifo = buffer.side(0).fifo.load(Relaxed).min(buffer.side(1).fifo.load(Relaxed));
    Ok(HopTimes { samples, fifo })
}

/// Starts both processes and waits for their end.
fn supervise(program: &Path, folder: &Path, ping_pong: &PingPong) -> Result<(), MeasureError> {
    let processes = SIDES.map(|side| (side, vec![ROLE.to_string(), side.to_string()]));
    // A generous limit: anything longer is a hang.
    let rounds = (ping_pong.rounds + ping_pong.warm_up) as u64;
    let limit = Duration::from_secs(20) + Duration::from_nanos(rounds * (ping_pong.pace_ns * 2 + 4_000_000));
    run_to_end(program, &processes, folder, limit.min(Duration::from_secs(180)))
}

/// Topics in both directions. A graph must not be cyclic, so each process joins as two components.
fn topic_set(registry: &Registry, ping_pong: &PingPong) -> Result<TopicSet, MeasureError> {
    let config = format!("config = {{ bytes = {} }}", ping_pong.bytes);
    let text = format!(
        r#"
name = "bench-hop"
[cores]
realtime = [{core}]
[component.ping]
kind = "bench.relay"
rate = "1 kHz"
publish = {{ out = "bench/there" }}
{config}
[component.pong-reader]
kind = "bench.relay"
trigger = "bench/there"
subscribe = {{ in = "bench/there" }}
{config}
[component.pong]
kind = "bench.relay"
rate = "1 kHz"
publish = {{ out = "bench/back" }}
{config}
[component.ping-reader]
kind = "bench.relay"
trigger = "bench/back"
subscribe = {{ in = "bench/back" }}
{config}
"#,
        core = ping_pong.cores[0]
    );
    let checked = graph::check(Path::new("bench-hop.toml"), text, &[], registry, &Machine::detect())
        .map_err(|error| MeasureError::Graph(error.render(false)))?;
    Ok(TopicSet::create(&checked.plan)?)
}

/// A folder in shared memory, removed when it is dropped.
pub(crate) struct Folder(PathBuf);

impl Folder {
    pub(crate) fn path(&self) -> &Path {
        &self.0
    }

    pub(crate) fn create() -> Result<Self, MeasureError> {
        use std::sync::atomic::AtomicU32;
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!("motorium-bench-{}-{}", std::process::id(), COUNT.fetch_add(1, Relaxed));
        let path = Path::new("/dev/shm").join(name);
        std::fs::create_dir(&path)
            .map_err(|error| MeasureError::system("making a folder in /dev/shm", error))?;
        Ok(Self(path))
    }

    fn name(&self) -> String {
        self.0.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
