//! Two processes that throw something to and fro: the floors of the machine, and motorium's hops beside them.
//!
//! A hop is measured in one direction: from the clock read before the payload is written to the clock read after the
//! other process has read all of it. `CLOCK_MONOTONIC` is the same on all cores. The exception is the cache line:
//! half of a round trip, with the clock read off its path, so that the floor is as low as the machine allows.

mod board;
mod floors;
mod link;
mod part;
mod plain;
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
use board::Board;
pub(crate) use part::{PART, run_part};

/// What carries the payload, and how the receiver waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Carrier {
    /// One word of shared memory that both cores look at: no payload.
    CacheLine,
    /// A word that both cores look at, and 512 bytes of plain shared memory.
    Plain,
    /// A word and a futex, and a payload of any size in plain shared memory.
    PlainBlocking,
    /// A word and a futex, nothing around them: no payload.
    Futex,
    /// A motorium topic, the receiver waits for its trigger.
    Blocking,
    /// A motorium topic, the receiver looks for it again and again.
    Polling,
    /// Stock iceoryx2: `ipc::Service` with publish-subscribe, and an event to wake the receiver.
    Stock,
}

/// One measurement of two processes.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Throw {
    /// What carries it.
    pub carrier: Carrier,
    /// Bytes of payload; one of [`SIZES`](crate::payload::SIZES).
    pub bytes: usize,
    /// The cores of the two processes.
    pub cores: [usize; 2],
    /// `SCHED_FIFO` priority of both; 0 for none.
    pub fifo: u8,
    /// Round trips; there are two samples of each, or one where a pace or the cache line is measured.
    pub rounds: usize,
    /// Rounds before the recorded ones.
    pub warm_up: usize,
    /// Time between two round trips, ns: the receiver then sleeps deeply. 0 for one after the other.
    pub pace_ns: u64,
}

/// What came of it.
#[derive(Debug, Clone)]
pub struct Thrown {
    /// Time of each hop, ns.
    pub samples: Vec<u64>,
    /// `SCHED_FIFO` priority both had, read back; 0 for normal time sharing.
    pub fifo: u32,
}

/// What a part of a measurement finds in its folder.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Assignment {
    throw: Throw,
    /// Folder of the topics or of the stock domain.
    exchange: PathBuf,
}

const SIDES: [&str; 2] = ["ping", "pong"];

/// Runs a measurement with a program that hands its arguments to [`Part`](crate::Part).
///
/// # Errors
/// Shared memory or the processes could not be made, or one of them failed.
pub fn measure(program: &Path, registry: &Registry, throw: &Throw) -> Result<Thrown, MeasureError> {
    let folder = Folder::create()?;
    let exchange = matches!(throw.carrier, Carrier::Blocking | Carrier::Polling)
        .then(|| exchange(registry, throw))
        .transpose()?;
    let assignment = Assignment {
        throw: throw.clone(),
        exchange: exchange.as_ref().map_or(folder.0.clone(), |exchange| exchange.path().to_path_buf()),
    };
    let text =
        serde_json::to_vec(&assignment).map_err(|error| MeasureError::system("writing the parts", error))?;
    std::fs::write(folder.0.join("assignment.json"), text)
        .map_err(|error| MeasureError::system("writing the parts", error))?;
    let board = Board::create(&folder.0.join("board"), throw.rounds)
        .map_err(|error| MeasureError::system("making shared memory", error))?;
    let ended = supervise(program, &folder.0, throw);
    if throw.carrier == Carrier::Stock {
        Domain::new(&folder.0, &folder.name()).map(|domain| domain.remove()).ok();
    }
    ended?;
    let mut samples = board.recorded(1);
    // At a pace only the way there finds a receiver that sleeps.
    if throw.pace_ns == 0 {
        samples.extend(board.recorded(0));
    }
    let fifo = board.side(0).fifo.load(Relaxed).min(board.side(1).fifo.load(Relaxed));
    Ok(Thrown { samples, fifo })
}

/// Starts both processes and waits for their end.
fn supervise(program: &Path, folder: &Path, throw: &Throw) -> Result<(), MeasureError> {
    let parts = SIDES.map(|side| (side, vec![PART.to_string(), side.to_string()]));
    // Far more than any machine needs: what takes longer hangs.
    let rounds = (throw.rounds + throw.warm_up) as u64;
    let limit = Duration::from_secs(20) + Duration::from_nanos(rounds * (throw.pace_ns * 2 + 4_000_000));
    run_to_end(program, &parts, folder, limit.min(Duration::from_secs(180)))
}

/// Topics there and back. A graph must not go round in circles, so each process takes the places of two components.
fn exchange(registry: &Registry, throw: &Throw) -> Result<TopicSet, MeasureError> {
    let config = format!("config = {{ bytes = {} }}", throw.bytes);
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
[component.pong-hears]
kind = "bench.relay"
trigger = "bench/there"
subscribe = {{ in = "bench/there" }}
{config}
[component.pong]
kind = "bench.relay"
rate = "1 kHz"
publish = {{ out = "bench/back" }}
{config}
[component.ping-hears]
kind = "bench.relay"
trigger = "bench/back"
subscribe = {{ in = "bench/back" }}
{config}
"#,
        core = throw.cores[0]
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
