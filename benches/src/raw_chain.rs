//! The floor (lowest possible latency) of a chain: processes on one core that only pass on a payload in plain
//! shared memory and wake one another by a futex, at priorities that rise along the chain.

#![allow(unsafe_code)] // mapped bytes become words

use std::fs::OpenOptions;
use std::path::Path;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release, SeqCst};
use std::sync::atomic::{AtomicU32, AtomicU64};
use std::time::Duration;

use memmap2::{MmapOptions, MmapRaw};
use motorium::os::{Request, apply, futex_wait, futex_wake, monotonic_ns, prefault_stack, sleep_until};
use motorium::plan::SchedulingClass;
use serde::{Deserialize, Serialize};

use crate::MeasureError;
use crate::pair::Folder;
use crate::processes::run_to_end;

/// Marks a link in its command line.
pub(crate) const LINK: &str = "--bench-link";
/// Numbers of the payload: 512 B.
const NUMBERS: usize = 64;
const PERIOD_NS: u64 = 1_000_000;
/// Time before its release at which the head stops sleeping and spins, ns, like a clock-released component.
const SPIN_NS: u64 = 100_000;
/// Passed on instead of a time to end the measurement.
const OVER: u64 = 0;
/// Number of warm-up rounds.
const WARM_UP: u64 = 100;

/// A chain to measure.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct RawChain {
    pub(crate) processes: usize,
    pub(crate) core: usize,
    /// `SCHED_FIFO` priority of the head; 0 for none. Each further process has a priority higher by one.
    pub(crate) fifo: u8,
    pub(crate) rounds: u64,
}

/// Connection from one process to the next.
#[repr(C, align(1024))]
struct Link {
    published: AtomicU32,
    ready: AtomicU32,
    fifo: AtomicU32,
    payload: [AtomicU64; NUMBERS],
}

struct Links {
    memory: MmapRaw,
    chain: RawChain,
}

impl Links {
    fn bytes(chain: &RawChain) -> usize {
        chain.processes * size_of::<Link>() + 8 * chain.rounds as usize
    }

    fn open(folder: &Path) -> Result<Self, String> {
        let text = std::fs::read(folder.join("chain.json")).map_err(|error| error.to_string())?;
        let chain: RawChain = serde_json::from_slice(&text).map_err(|error| error.to_string())?;
        let file = OpenOptions::new().read(true).write(true).open(folder.join("links"));
        let map = |file| MmapOptions::new().len(Self::bytes(&chain)).map_raw(&file);
        let memory = file.and_then(map).map_err(|error| error.to_string())?;
        Ok(Self { memory, chain })
    }

    fn links(&self) -> &[Link] {
        // SAFETY: the file was created with the length of all links and samples, the mapping is page-aligned,
        // and atomics are valid for any bytes.
        unsafe { core::slice::from_raw_parts(self.memory.as_ptr().cast::<Link>(), self.chain.processes) }
    }

    fn samples(&self) -> &[AtomicU64] {
        let links = self.chain.processes * size_of::<Link>();
        // SAFETY: as above; the samples follow the links.
        unsafe {
            let first = self.memory.as_ptr().add(links).cast::<AtomicU64>();
            core::slice::from_raw_parts(first, self.chain.rounds as usize)
        }
    }
}

impl Link {
    fn send(&self, time_ns: u64) {
        self.payload.iter().for_each(|number| number.store(time_ns, Relaxed));
        self.published.fetch_add(1, SeqCst);
        futex_wake(&self.published);
    }

    /// Returns the time in the next payload, all of which is read.
    fn receive(&self, seen: &mut u32) -> Result<u64, String> {
        while self.published.load(Acquire) == *seen {
            futex_wait(&self.published, *seen, Some(Duration::from_secs(5)));
        }
        *seen = seen.wrapping_add(1);
        let first = self.payload[0].load(Relaxed);
        let differ = self.payload.iter().fold(0, |differ, number| differ | (number.load(Relaxed) ^ first));
        if differ == 0 { Ok(first) } else { Err("a payload was torn".to_string()) }
    }
}

/// Runs a chain. Returns the times from the head's payload until the last process has read it, ns, and the
/// lowest priority.
pub(crate) fn measure(program: &Path, chain: &RawChain) -> Result<(Vec<u64>, u32), MeasureError> {
    let folder = Folder::create()?;
    let trouble = |error: std::io::Error| MeasureError::system("making shared memory", error);
    let text = serde_json::to_vec(chain).map_err(|error| MeasureError::system("writing the chain", error))?;
    std::fs::write(folder.path().join("chain.json"), text).map_err(trouble)?;
    let file = OpenOptions::new().write(true).create_new(true).open(folder.path().join("links"));
    let file = file.map_err(trouble)?;
    let bytes = Links::bytes(chain) as u64;
    rustix::fs::fallocate(&file, rustix::fs::FallocateFlags::empty(), 0, bytes)
        .map_err(|error| trouble(error.into()))?;
    let processes: Vec<_> =
        (0..chain.processes).map(|index| ("link", vec![LINK.to_string(), index.to_string()])).collect();
    let limit = Duration::from_secs(20) + Duration::from_nanos(2 * PERIOD_NS * chain.rounds);
    run_to_end(program, &processes, folder.path(), limit)?;
    let links = Links::open(folder.path()).map_err(|error| MeasureError::system("reading samples", error))?;
    let samples = links.samples().iter().map(|sample| sample.load(Relaxed)).collect();
    let fifo = links.links().iter().map(|link| link.fifo.load(Relaxed)).min().unwrap_or(0);
    Ok((samples, fifo))
}

/// Runs one process of the chain.
pub(crate) fn run_link(index: &str, folder: &Path) -> Result<(), String> {
    let index: usize = index.parse().map_err(|_| format!("`{index}` is no link"))?;
    let memory = Links::open(folder)?;
    let (links, chain) = (memory.links(), &memory.chain);
    let class = match chain.fifo {
        0 => SchedulingClass::Normal,
        head => SchedulingClass::Fifo(head + index as u8),
    };
    let request = Request { class, cores: vec![chain.core], lock_memory: chain.fifo > 0 };
    let (applied, _) = apply(&request);
    prefault_stack();
    memory.samples().iter().for_each(|sample| {
        core::hint::black_box(sample.load(Relaxed));
    });
    links[index].fifo.store(u32::from(applied.fifo_priority), Relaxed);
    links[index].ready.store(1, Release);
    if index == 0 { head(links, chain) } else { follow(links, index, &memory) }
}

fn head(links: &[Link], chain: &RawChain) -> Result<(), String> {
    while links.iter().any(|link| link.ready.load(Acquire) == 0) {
        std::thread::sleep(Duration::from_millis(1));
    }
    let mut release = monotonic_ns() + PERIOD_NS;
    for _ in 0..chain.rounds + WARM_UP {
        sleep_until(release - SPIN_NS);
        while monotonic_ns() < release {
            core::hint::spin_loop();
        }
        links[0].send(monotonic_ns());
        // Releases missed during a long delay are skipped.
        release += PERIOD_NS * (1 + monotonic_ns().saturating_sub(release) / PERIOD_NS);
    }
    sleep_until(release);
    links[0].send(OVER);
    Ok(())
}

fn follow(links: &[Link], index: usize, memory: &Links) -> Result<(), String> {
    let last = index + 1 == links.len();
    let (mut seen, mut round) = (0, 0);
    loop {
        let time = links[index - 1].receive(&mut seen)?;
        let now = monotonic_ns();
        if !last {
            links[index].send(time);
        }
        if time == OVER {
            return Ok(());
        }
        if last
            && round >= WARM_UP
            && let Some(sample) = memory.samples().get((round - WARM_UP) as usize)
        {
            sample.store(now - time, Relaxed);
        }
        round += 1;
    }
}
