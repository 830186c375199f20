//! The floor of a blocking hop of any size: a futex, and the payload in plain shared memory.

#![allow(unsafe_code)] // payloads are used where they lie in mapped memory

use std::fs::OpenOptions;
use std::marker::PhantomData;
use std::path::Path;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::time::Duration;

use memmap2::{MmapOptions, MmapRaw};
use motorium::os::{futex_wait, futex_wake};

use super::link::Link;
use super::shared_buffer::SharedBuffer;
use crate::payload::Payload;

/// Number of payloads that a side writes in turn.
const TURNS: usize = 2;

/// A word, a futex, and payloads in plain shared memory: what a blocking hop of this size takes at least.
pub(super) struct PlainBlocking<'a, P: Payload> {
    buffer: &'a SharedBuffer,
    memory: MmapRaw,
    side: usize,
    sent: usize,
    received: usize,
    payload: PhantomData<P>,
}

impl<'a, P: Payload> PlainBlocking<'a, P> {
    /// Opens the payloads of both sides; the first process to open them makes them.
    pub(super) fn open(folder: &Path, buffer: &'a SharedBuffer, side: usize) -> std::io::Result<Self> {
        let path = folder.join("payloads");
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
        let bytes = 2 * TURNS * size_of::<P>();
        rustix::fs::fallocate(&file, rustix::fs::FallocateFlags::empty(), 0, bytes as u64)?;
        let memory = MmapOptions::new().len(bytes).map_raw(&file)?;
        Ok(Self { buffer, memory, side, sent: 0, received: 0, payload: PhantomData })
    }

    fn payload(&self, side: usize, number: usize) -> *mut P {
        // SAFETY: in bounds: the mapping holds the turns of both sides.
        unsafe { self.memory.as_mut_ptr().cast::<P>().add(side * TURNS + number % TURNS) }
    }
}

impl<P: Payload> Link for PlainBlocking<'_, P> {
    fn send(&mut self, time_ns: u64) -> Result<(), String> {
        self.sent += 1;
        // SAFETY: aligned to a page and a multiple of the payload's size, valid for any bytes. The other side has read
        // this turn's payload before it answered, and reads it again only after the futex word below.
        unsafe { &mut *self.payload(self.side, self.sent) }.write(time_ns);
        let line = self.buffer.line(self.side);
        line.futex.store(line.futex.load(Relaxed).wrapping_add(1), Release);
        futex_wake(&line.futex);
        Ok(())
    }

    fn receive(&mut self) -> Result<u64, String> {
        let line = self.buffer.line(1 - self.side);
        while line.futex.load(Acquire) as usize == self.received {
            futex_wait(&line.futex, self.received as u32, Some(Duration::from_secs(5)));
        }
        self.received += 1;
        // SAFETY: as in `send`: the other side writes this turn's payload again only after the next answer but one.
        unsafe { &*self.payload(1 - self.side, self.received) }
            .read()
            .ok_or_else(|| "a payload was torn".into())
    }
}
