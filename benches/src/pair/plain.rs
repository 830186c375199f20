//! The floors of a hop of any size: a word, a futex if the receiver sleeps, and the payload in plain shared
//! memory.

#![allow(unsafe_code)] // payloads are used where they lie in mapped memory

use std::fs::OpenOptions;
use std::marker::PhantomData;
use std::path::Path;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::time::Duration;

use memmap2::{MmapOptions, MmapRaw};
use motorium::os::{futex_wait, futex_wake, monotonic_ns};
use motorium::state::Stamp;

use super::link::Link;
use super::shared_buffer::SharedBuffer;
use super::topics::Waits;
use crate::payload::Payload;

/// Number of payloads that a side writes in turn.
const TURNS: usize = 2;
/// Bytes before a payload with a stamp: a cache line, filled by the stamp except for a word.
const STAMP: usize = 64;

/// Payloads in plain shared memory: the minimum for a hop of this size.
pub(super) struct PlainMemory<'a, P: Payload> {
    buffer: &'a SharedBuffer,
    memory: MmapRaw,
    side: usize,
    waits: Waits,
    /// `true` if each payload is checked for finite numbers and stamped with the time, like every
    /// publication.
    checks: bool,
    sent: usize,
    received: usize,
    payload: PhantomData<P>,
}

impl<'a, P: Payload> PlainMemory<'a, P> {
    /// Opens the payloads of both sides; the first process creates them.
    pub(super) fn open(
        folder: &Path,
        (buffer, side): (&'a SharedBuffer, usize),
        waits: Waits,
        checks: bool,
    ) -> std::io::Result<Self> {
        let path = folder.join("payloads");
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
        let bytes = 2 * TURNS * (size_of::<P>() + STAMP);
        rustix::fs::fallocate(&file, rustix::fs::FallocateFlags::empty(), 0, bytes as u64)?;
        let memory = MmapOptions::new().len(bytes).map_raw(&file)?;
        Ok(Self { buffer, memory, side, waits, checks, sent: 0, received: 0, payload: PhantomData })
    }

    /// Returns the payload of a side's turn; its stamp, if any, precedes it.
    fn payload(&self, side: usize, number: usize) -> *mut P {
        let stamp = if self.checks { STAMP } else { 0 };
        let place = (side * TURNS + number % TURNS) * (size_of::<P>() + stamp) + stamp;
        // SAFETY: in bounds: the mapping holds the turns of both sides, with their stamps.
        unsafe { self.memory.as_mut_ptr().add(place).cast::<P>() }
    }
}

impl<P: Payload> Link for PlainMemory<'_, P> {
    fn send(&mut self, time_ns: u64) -> Result<(), String> {
        self.sent += 1;
        let place = self.payload(self.side, self.sent);
        // SAFETY: aligned to a cache line and a multiple of the payload's size, valid for any bytes. The
        // other side read this payload before its answer, and reads it again only after the futex word below.
        let payload = unsafe { &mut *place };
        if self.checks {
            if !payload.write_checked(time_ns) {
                return Err("a payload is not finite".to_string());
            }
            let publish_time = monotonic_ns();
            let sequence = self.sent as u64;
            let stamp = Stamp { sequence, source_time: time_ns, publish_time, ..Stamp::default() };
            // SAFETY: the cache line before the payload is its stamp's, under the same rule.
            unsafe { place.byte_sub(STAMP).cast::<Stamp>().write(stamp) };
        } else {
            payload.write(time_ns);
        }
        let line = self.buffer.line(self.side);
        line.futex.store(line.futex.load(Relaxed).wrapping_add(1), Release);
        if self.waits == Waits::Blocking {
            futex_wake(&line.futex);
        }
        Ok(())
    }

    fn receive(&mut self) -> Result<u64, String> {
        let line = self.buffer.line(1 - self.side);
        while line.futex.load(Acquire) as usize == self.received {
            match self.waits {
                Waits::Blocking => {
                    futex_wait(&line.futex, self.received as u32, Some(Duration::from_secs(5)));
                }
                Waits::Spinning | Waits::Yielding => core::hint::spin_loop(),
            }
        }
        self.received += 1;
        // SAFETY: as in `send`: the other side writes this turn's payload again only after the next answer
        // but one.
        unsafe { &*self.payload(1 - self.side, self.received) }
            .read()
            .ok_or_else(|| "a payload was torn".into())
    }
}
