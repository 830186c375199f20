//! One client of the metrics: the received part of its request and the pending answer.

use std::io::{self, Read as _, Write as _};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

use rustix::event::PollFlags;

use super::exposition::{CONTENT_TYPE, Exposition};
use super::request::{self, LONGEST, Request, Status};

/// Time in which a client must send its request and read the answer.
pub(super) const TIMEOUT: Duration = Duration::from_secs(2);

/// A client that is never waited for.
#[derive(Debug)]
pub(super) struct Client {
    pub(super) stream: TcpStream,
    /// The request so far.
    asked: Vec<u8>,
    /// The answer, and the number of its bytes that were sent.
    answer: Option<(Vec<u8>, usize)>,
    /// Time at which it is dropped.
    pub(super) end: Instant,
}

/// The state of a client after a turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Turn {
    /// The client must send or read more first.
    Waits,
    /// The client has its answer, or has gone.
    Done,
}

impl Client {
    pub(super) fn new(stream: TcpStream, now: Instant) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        Ok(Self { stream, asked: Vec::new(), answer: None, end: now + TIMEOUT })
    }

    /// Returns the readiness of the stream that it waits for.
    pub(super) fn awaits(&self) -> PollFlags {
        if self.answer.is_none() { PollFlags::IN } else { PollFlags::OUT }
    }

    /// Reads and writes as much as is possible without waiting.
    pub(super) fn turn(&mut self, exposition: &Exposition) -> Turn {
        match self.progress(exposition) {
            Ok(turn) => turn,
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Turn::Waits,
            // Errors of a client affect only that client.
            Err(_) => Turn::Done,
        }
    }

    fn progress(&mut self, exposition: &Exposition) -> io::Result<Turn> {
        if self.answer.is_none() {
            let request = self.listen()?;
            self.answer = Some((answer(request, exposition), 0));
        }
        let Some((answer, sent)) = &mut self.answer else { return Ok(Turn::Waits) };
        while *sent < answer.len() {
            match self.stream.write(&answer[*sent..])? {
                0 => return Ok(Turn::Done),
                count => *sent += count,
            }
        }
        self.stream.shutdown(Shutdown::Write)?;
        Ok(Turn::Done)
    }

    /// Returns the request, once it is complete.
    fn listen(&mut self) -> io::Result<Request> {
        loop {
            let mut part = [0; 1024];
            let room = part.len().min(LONGEST - self.asked.len());
            match self.stream.read(&mut part[..room])? {
                0 => return Err(io::ErrorKind::UnexpectedEof.into()),
                length => self.asked.extend_from_slice(&part[..length]),
            }
            if let Some(request) = request::read(&self.asked) {
                return Ok(request);
            }
        }
    }
}

fn answer(request: Request, exposition: &Exposition) -> Vec<u8> {
    let (head, body) = match request {
        Request::Metrics | Request::Head => {
            let body = exposition.text();
            let head = request::head(Status::Ok, CONTENT_TYPE, body.len());
            (head, if request == Request::Head { String::new() } else { body })
        }
        Request::Wrong(status, advice) => {
            let body = format!("{advice}\n");
            (request::head(status, "text/plain; charset=utf-8", body.len()), body)
        }
    };
    (head + &body).into_bytes()
}
