//! Serves the metrics of a run over HTTP, from a thread that no real-time thread ever waits for.

use std::io::{self, Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use motorium::plan::Plan;
use motorium::run_folder::RunFolder;

use super::Address;
use super::exposition::{CONTENT_TYPE, Exposition};
use super::request::{self, LONGEST, Request, Status};
use crate::runs::LivingRun;

/// A client that takes longer to ask, or stands still for longer while it is answered, is left alone.
const TIMEOUT: Duration = Duration::from_secs(2);

/// Metrics cannot be served.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ServeError {
    #[error(
        "metrics cannot be served on {0}: another program has this port; choose another, or 0 for any that is free"
    )]
    Taken(SocketAddr),
    #[error("metrics cannot be served on {address}: {reason}")]
    Refused { address: SocketAddr, reason: io::Error },
}

/// A place where metrics will be served: taken before anything runs, so that a taken one is noticed in time.
#[derive(Debug)]
pub(crate) struct Server {
    listener: TcpListener,
    address: SocketAddr,
}

impl Server {
    /// Takes the place. Who connects before [`serve`](Self::serve) waits.
    pub(crate) fn bind(address: Address) -> Result<Self, ServeError> {
        let refused = |reason: io::Error| match reason.kind() {
            io::ErrorKind::AddrInUse => ServeError::Taken(address.0),
            _ => ServeError::Refused { address: address.0, reason },
        };
        let listener = TcpListener::bind(address.0).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        Ok(Self { listener, address })
    }

    /// Address of the metrics.
    pub(crate) fn url(&self) -> String {
        format!("http://{}/metrics", self.address)
    }

    /// Serves the metrics of a run that this process has just made, until the process ends.
    pub(crate) fn serve_created(self, id: &str, plan: &Plan) -> anyhow::Result<()> {
        let folder = RunFolder::find(id).ok_or_else(|| anyhow::anyhow!("the run {id} is over"))?;
        let region = folder.region()?;
        Ok(self.serve(LivingRun { folder, plan: plan.clone(), region })?)
    }

    /// Serves the metrics of a run until the process ends, from a thread of its own on the shared cores.
    pub(crate) fn serve(self, run: LivingRun) -> io::Result<()> {
        let thread = std::thread::Builder::new().name("metrics".to_string());
        thread.spawn(move || {
            run.stand_aside();
            let exposition = Exposition::new(run);
            for client in self.listener.incoming() {
                match client {
                    // What a client does wrong is its own affair.
                    Ok(client) => drop(answer(client, &exposition)),
                    // Out of file descriptors, as a rule: that does not pass at once.
                    Err(_) => std::thread::sleep(Duration::from_millis(100)),
                }
            }
        })?;
        Ok(())
    }
}

fn answer(mut client: TcpStream, exposition: &Exposition) -> io::Result<()> {
    client.set_write_timeout(Some(TIMEOUT))?;
    let plain = "text/plain; charset=utf-8";
    let (head, body) = match listen(&mut client)? {
        asked @ (Request::Metrics | Request::Head) => {
            let body = exposition.text();
            let head = request::head(Status::Ok, CONTENT_TYPE, body.len());
            (head, if asked == Request::Head { String::new() } else { body })
        }
        Request::Wrong(status, advice) => {
            let body = format!("{advice}\n");
            (request::head(status, plain, body.len()), body)
        }
    };
    client.write_all(head.as_bytes())?;
    client.write_all(body.as_bytes())?;
    client.shutdown(std::net::Shutdown::Write)
}

/// The request of a client that asks in time.
fn listen(client: &mut TcpStream) -> io::Result<Request> {
    let end = Instant::now() + TIMEOUT;
    let mut bytes = Vec::new();
    loop {
        let left = end.checked_duration_since(Instant::now()).filter(|left| !left.is_zero());
        client.set_read_timeout(Some(left.ok_or(io::ErrorKind::TimedOut)?))?;
        let mut part = [0; 1024];
        let room = part.len().min(LONGEST - bytes.len());
        match client.read(&mut part[..room])? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            length => bytes.extend_from_slice(&part[..length]),
        }
        if let Some(request) = request::read(&bytes) {
            return Ok(request);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::fixture::silent_run;

    fn ask(address: SocketAddr, request: &str) -> String {
        let mut client = TcpStream::connect(address).expect("somebody listens");
        client.write_all(request.as_bytes()).expect("it is heard");
        let mut answer = String::new();
        client.read_to_string(&mut answer).expect("it answers");
        answer
    }

    #[test]
    fn a_client_gets_the_metrics_whatever_another_one_did_before_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let server = Server::bind("0".parse().expect("an address")).expect("a free port");
        let address = server.address;
        server.serve(silent_run(folder.path())).expect("a thread");
        drop(TcpStream::connect(address).expect("somebody listens"));
        assert!(ask(address, "nonsense\r\n\r\n").starts_with("HTTP/1.1 400 "));
        let answer = ask(address, "GET /metrics HTTP/1.1\r\nHost: a\r\n\r\n");
        let (head, body) = answer.split_once("\r\n\r\n").expect("head and body");
        assert!(head.starts_with("HTTP/1.1 200 OK\r\n") && head.contains(CONTENT_TYPE), "{head}");
        assert!(head.contains(&format!("Content-Length: {}\r\n", body.len())), "{head}");
        assert!(body.ends_with("# EOF\n"), "{body}");
        let head = ask(address, "HEAD /metrics HTTP/1.1\r\nHost: a\r\n\r\n");
        assert!(head.starts_with("HTTP/1.1 200 OK\r\n") && head.ends_with("\r\n\r\n"), "{head}");
    }

    #[test]
    fn a_taken_port_is_named() {
        let first = Server::bind("0".parse().expect("an address")).expect("a free port");
        let text = first.address.port().to_string();
        let error = Server::bind(text.parse().expect("an address")).expect_err("it is taken").to_string();
        assert!(error.contains(&format!("127.0.0.1:{text}")) && error.contains("another program"), "{error}");
    }
}
