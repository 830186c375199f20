//! Standard output and standard error of a component's process. Printing neither aborts nor delays a step.
//!
//! Both are pipes to the launcher. The process keeps a reading end of each, so that printing after the
//! launcher's death does not break the pipe. The watcher thread discards output that is not read.

use std::fs::File;
use std::os::fd::{AsFd, AsRawFd as _, BorrowedFd};

use rustix::fs::{FileType, Mode, OFlags};
use rustix::pipe::{fcntl_getpipe_size, fcntl_setpipe_size};

/// Capacity for output that the launcher has not read yet, bytes.
const ROOM: usize = 1 << 20;

/// The pipes that a process prints into.
#[derive(Debug)]
pub(super) struct Output {
    pipes: Vec<Pipe>,
}

#[derive(Debug)]
struct Pipe {
    /// A reading end.
    reader: File,
    dropped: usize,
}

impl Output {
    /// Opens the pipes behind standard output and standard error. Files other than pipes are not changed.
    pub(super) fn open() -> Self {
        let (stdout, stderr) = (std::io::stdout(), std::io::stderr());
        let pipes = [stdout.as_fd(), stderr.as_fd()].into_iter().filter_map(Pipe::behind).collect();
        Self { pipes }
    }

    /// Discards the older half of a pipe that is nearly full because it is not read. A full pipe would block
    /// the next step that prints.
    pub(super) fn relieve(&mut self) {
        for pipe in &mut self.pipes {
            let capacity = fcntl_getpipe_size(&pipe.reader).unwrap_or(ROOM);
            let waiting = rustix::io::ioctl_fionread(&pipe.reader).unwrap_or(0) as usize;
            if waiting > capacity / 4 * 3 {
                pipe.drop_up_to(waiting / 2);
            }
        }
    }

    /// Discards later output and unblocks a waiting step, after the death of the launcher.
    pub(super) fn close(&mut self) {
        if self.pipes.is_empty() {
            return;
        }
        crate::os::discard_output();
        for mut pipe in self.pipes.drain(..) {
            pipe.drop_up_to(usize::MAX);
        }
    }

    /// Returns the number of bytes discarded since the last call.
    pub(super) fn take_dropped(&mut self) -> usize {
        self.pipes.iter_mut().map(|pipe| core::mem::take(&mut pipe.dropped)).sum()
    }
}

impl Pipe {
    fn behind(descriptor: BorrowedFd<'_>) -> Option<Self> {
        let mode = rustix::fs::fstat(descriptor).ok()?.st_mode;
        if FileType::from_raw_mode(mode) != FileType::Fifo {
            return None;
        }
        let _ = fcntl_setpipe_size(descriptor, ROOM);
        let path = format!("/proc/self/fd/{}", descriptor.as_raw_fd());
        let flags = OFlags::RDONLY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let reader = rustix::fs::open(path, flags, Mode::empty()).ok()?;
        Some(Self { reader: reader.into(), dropped: 0 })
    }

    fn drop_up_to(&mut self, bytes: usize) {
        use std::io::Read as _;
        let mut buffer = [0; 4096];
        let mut left = bytes;
        while left > 0 {
            let room = left.min(buffer.len());
            match self.reader.read(&mut buffer[..room]) {
                Ok(read) if read > 0 => {
                    left -= read;
                    self.dropped += read;
                }
                _ => return,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    fn pipe() -> (Output, std::io::PipeReader, std::io::PipeWriter) {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        let pipe = Pipe::behind(writer.as_fd()).expect("it is a pipe");
        (Output { pipes: vec![pipe] }, reader, writer)
    }

    #[test]
    fn printing_still_works_when_the_reader_is_gone() {
        let (mut output, reader, mut writer) = pipe();
        drop(reader);
        writer.write_all(b"still here\n").expect("no broken pipe");
        output.pipes[0].drop_up_to(usize::MAX);
        assert_eq!(output.take_dropped(), 11);
    }

    #[test]
    fn unread_output_makes_room_for_new_output_and_is_counted() {
        let (mut output, _reader, mut writer) = pipe();
        let capacity = fcntl_getpipe_size(&writer).expect("it has a size");
        let block = vec![b'x'; capacity / 8];
        let mut dropped = 0;
        for _ in 0..64 {
            writer.write_all(&block).expect("there is room");
            output.relieve();
            dropped += output.take_dropped();
        }
        assert!(dropped > 4 * capacity, "{dropped} bytes");
    }

    #[test]
    fn output_that_is_read_is_not_discarded() {
        let (mut output, mut reader, mut writer) = pipe();
        writer.write_all(b"a line\n").expect("there is room");
        output.relieve();
        assert_eq!(output.take_dropped(), 0);
        let mut line = [0; 7];
        std::io::Read::read_exact(&mut reader, &mut line).expect("it is there");
        assert_eq!(&line, b"a line\n");
    }
}
