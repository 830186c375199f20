//! Serves the metrics of a run over HTTP, from a thread that no real-time thread ever waits for.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::time::{Duration, Instant};

use motorium::plan::Plan;
use motorium::run_folder::RunFolder;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::Address;
use super::client::{Client, Turn};
use super::exposition::Exposition;
use crate::runs::LivingRun;

/// Metrics cannot be served.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ServeError {
    #[error(
        "metrics cannot be served on {0}: another program has this port; choose another port, or 0 for any free port"
    )]
    Taken(SocketAddr),
    #[error("metrics cannot be served on {address}: {reason}")]
    Refused { address: SocketAddr, reason: io::Error },
}

/// A bound address for metrics. It is bound before the run starts, so that an occupied port is reported in
/// time.
#[derive(Debug)]
pub(crate) struct Server {
    listener: TcpListener,
    address: SocketAddr,
}

impl Server {
    /// Binds the address. Clients that connect before [`serve`](Self::serve) wait.
    pub(crate) fn bind(address: Address) -> Result<Self, ServeError> {
        let refused = |reason: io::Error| match reason.kind() {
            io::ErrorKind::AddrInUse => ServeError::Taken(address.0),
            _ => ServeError::Refused { address: address.0, reason },
        };
        let listener = TcpListener::bind(address.0).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        Ok(Self { listener, address })
    }

    /// Returns the address of the metrics.
    pub(crate) fn url(&self) -> String {
        format!("http://{}/metrics", self.address)
    }

    /// Serves the metrics of a run that this process has just created, until the process ends.
    pub(crate) fn serve_created(self, id: &str, plan: &Plan) -> anyhow::Result<()> {
        let folder = RunFolder::find(id).ok_or_else(|| anyhow::anyhow!("the run {id} is over"))?;
        let region = folder.region()?;
        Ok(self.serve(LivingRun { folder, plan: plan.clone(), region })?)
    }

    /// Serves the metrics of a run until the process ends, on a separate thread on the shared cores.
    pub(crate) fn serve(self, run: LivingRun) -> io::Result<()> {
        self.listener.set_nonblocking(true)?;
        let thread = std::thread::Builder::new().name("metrics".to_string());
        thread.spawn(move || {
            run.stand_aside();
            let exposition = Exposition::new(run);
            serve_all(&self.listener, &exposition);
        })?;
        Ok(())
    }
}

/// Maximum number of simultaneous clients; a further one replaces the longest-waiting one.
const MOST: usize = 64;
/// Pause after a client could not be accepted, usually for lack of file descriptors.
const PAUSE: Duration = Duration::from_millis(100);

/// Serves all clients in turn; none waits for another.
fn serve_all(listener: &TcpListener, exposition: &Exposition) {
    let mut clients: Vec<Client> = Vec::new();
    loop {
        let ready = await_any(listener, &clients);
        let now = Instant::now();
        if ready.first() == Some(&true) {
            match listener.accept() {
                Ok((stream, _)) => {
                    if clients.len() >= MOST {
                        clients.remove(0);
                    }
                    clients.extend(Client::new(stream, now).ok());
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                Err(_) => std::thread::sleep(PAUSE),
            }
        }
        // A client just accepted may have sent its request already.
        clients.retain_mut(|client| client.turn(exposition) == Turn::Waits && now < client.end);
    }
}

/// Waits until a client can be accepted (first) or a served one can continue.
fn await_any(listener: &TcpListener, clients: &[Client]) -> Vec<bool> {
    let mut polled = vec![PollFd::new(listener, PollFlags::IN)];
    polled.extend(clients.iter().map(|client| PollFd::new(&client.stream, client.awaits())));
    let end = clients.iter().map(|client| client.end).min();
    let timeout = end.map(|end| {
        let left = end.saturating_duration_since(Instant::now()) + Duration::from_millis(1);
        Timespec { tv_sec: left.as_secs() as _, tv_nsec: left.subsec_nanos().into() }
    });
    let _ = poll(&mut polled, timeout.as_ref());
    polled.iter().map(|polled| !polled.revents().is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};
    use std::net::TcpStream;

    use super::*;
    use crate::metrics::client::TIMEOUT;
    use crate::metrics::exposition::CONTENT_TYPE;
    use crate::metrics::fixture::silent_run;

    fn ask(address: SocketAddr, request: &str) -> String {
        let mut client = TcpStream::connect(address).expect("somebody listens");
        client.write_all(request.as_bytes()).expect("it is heard");
        let mut answer = String::new();
        client.read_to_string(&mut answer).expect("it answers");
        answer
    }

    #[test]
    fn metrics_client_is_served_after_a_bad_client() {
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
    fn silent_clients_do_not_delay_others() {
        let folder = tempfile::tempdir().expect("a folder");
        let server = Server::bind("0".parse().expect("an address")).expect("a free port");
        let address = server.address;
        server.serve(silent_run(folder.path())).expect("a thread");
        let mut silent = Vec::new();
        let began = Instant::now();
        for _ in 0..2 * MOST {
            let mut client = TcpStream::connect(address).expect("somebody listens");
            client.write_all(b"GET /met").expect("it is heard");
            silent.push(client);
        }
        // One after the other they would last 128 times 2 s.
        assert!(ask(address, "GET /metrics HTTP/1.1\r\nHost: a\r\n\r\n").ends_with("# EOF\n"));
        assert!(began.elapsed() < 10 * TIMEOUT, "{:?}", began.elapsed());
        let mut rest = Vec::new();
        let ended = silent.last_mut().expect("a client").read_to_end(&mut rest);
        assert!(ended.is_err() || rest.is_empty(), "it is dropped without an answer");
    }

    #[test]
    fn occupied_port_is_named() {
        let first = Server::bind("0".parse().expect("an address")).expect("a free port");
        let text = first.address.port().to_string();
        let error = Server::bind(text.parse().expect("an address")).expect_err("it is taken").to_string();
        assert!(error.contains(&format!("127.0.0.1:{text}")) && error.contains("another program"), "{error}");
    }
}
