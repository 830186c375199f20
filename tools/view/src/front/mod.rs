//! The port of the viewer: serves the page over HTTP and forwards WebSockets to the server of Foxglove's
//! protocol.
//!
//! The server of Foxglove's protocol accepts only WebSockets and listens on a separate internal port, so this
//! module forwards connections to it. A WebSocket whose address contains the token gets the right to command
//! before its first message is forwarded. For this purpose the module sets the token as the parameter
//! [`TOKEN`](crate::rights::TOKEN), which viewers may also set.

mod files;
mod head;

use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::time::Duration;

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, copy_bidirectional};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::timeout;

use crate::rights;
use head::{Asked, Status};

/// Maximum time for a client's request, and for a stall while it is answered.
const PATIENCE: Duration = Duration::from_secs(5);
/// Pause after a failed accept: a resource shortage does not resolve immediately.
const SHORTAGE: Duration = Duration::from_millis(100);

/// The port is unavailable.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FrontError {
    #[error(
        "port {0} is in use, perhaps by another `motorium view`; choose another port with `--port`, or 0 for any \
         free port"
    )]
    Taken(u16),
    #[error("port {port} of this machine cannot be served: {reason}")]
    Refused { port: u16, reason: io::Error },
}

/// Returns the digest of the viewer's page, which `--headless-check` stores in its screenshots.
///
/// ```
/// assert_eq!(motorium_view::page_digest().len(), 16);
/// ```
pub fn page_digest() -> String {
    files::digest()
}

/// The port of the viewer, bound before anything starts.
#[derive(Debug)]
pub(crate) struct Front(std::net::TcpListener);

impl Front {
    /// Binds the port on the loopback interface.
    pub(crate) fn bind(port: u16) -> Result<Self, FrontError> {
        let refused = |reason: io::Error| match reason.kind() {
            io::ErrorKind::AddrInUse => FrontError::Taken(port),
            _ => FrontError::Refused { port, reason },
        };
        let listener = std::net::TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(refused)?;
        listener.set_nonblocking(true).map_err(refused)?;
        Ok(Self(listener))
    }

    /// Returns the number of the port.
    pub(crate) fn port(&self) -> u16 {
        self.0.local_addr().map_or(0, |address| address.port())
    }

    /// Serves until the program ends. `server` is the address of the protocol's server.
    pub(crate) async fn serve(self, server: SocketAddr, token: String) -> io::Result<()> {
        let listener = TcpListener::from_std(self.0)?;
        loop {
            match listener.accept().await {
                Ok((client, _)) => {
                    let token = token.clone();
                    // Errors of a client affect only that client.
                    tokio::spawn(async move { drop(answer(client, server, &token).await) });
                }
                Err(_) => tokio::time::sleep(SHORTAGE).await,
            }
        }
    }
}

async fn answer(mut client: TcpStream, server: SocketAddr, token: &str) -> io::Result<()> {
    client.set_nodelay(true)?;
    let (asked, bytes) = timeout(PATIENCE, listen(&mut client)).await??;
    let (head, body) = match asked {
        Asked::WebSocket { token: given } => {
            return hand_on(client, &bytes, server, given.filter(|given| rights::is_token(token, given)))
                .await;
        }
        Asked::File { file, body } => (
            head::head(Status::Ok, file.content_type, file.content.len()),
            if body { file.content.to_vec() } else { Vec::new() },
        ),
        Asked::Wrong(status, advice) => {
            let body = format!("{advice}\n").into_bytes();
            (head::head(status, "text/plain; charset=utf-8", body.len()), body)
        }
    };
    timeout(PATIENCE, async {
        client.write_all(head.as_bytes()).await?;
        client.write_all(&body).await?;
        client.shutdown().await
    })
    .await?
}

/// The request of a client, and its bytes.
async fn listen(client: &mut TcpStream) -> io::Result<(Asked, Vec<u8>)> {
    let mut bytes = Vec::new();
    loop {
        let mut part = [0; 2048];
        let room = part.len().min(head::LONGEST - bytes.len());
        match client.read(&mut part[..room]).await? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            length => bytes.extend_from_slice(&part[..length]),
        }
        if let Some(asked) = head::read(&bytes) {
            return Ok((asked, bytes));
        }
    }
}

/// Connects a client with the server of the protocol, with the right to command if it has the token.
async fn hand_on(
    mut client: TcpStream,
    request: &[u8],
    server: SocketAddr,
    token: Option<String>,
) -> io::Result<()> {
    let mut upstream = TcpStream::connect(server).await?;
    upstream.set_nodelay(true)?;
    upstream.write_all(request).await?;
    if let Some(token) = token {
        // The server reads frames once it has answered the request.
        let answer = timeout(PATIENCE, answer_of(&mut upstream)).await??;
        client.write_all(&answer).await?;
        if answer.starts_with(b"HTTP/1.1 101") {
            upstream.write_all(&frame(&rights::grant(&token))).await?;
        }
    }
    copy_bidirectional(&mut client, &mut upstream).await?;
    Ok(())
}

/// Reads the header of the server's answer, and any bytes that follow.
async fn answer_of(upstream: &mut TcpStream) -> io::Result<Vec<u8>> {
    let mut answer = Vec::new();
    while !answer.windows(4).any(|end| end == b"\r\n\r\n") {
        let mut part = [0; 2048];
        match upstream.read(&mut part).await? {
            0 => return Ok(answer),
            length => answer.extend_from_slice(&part[..length]),
        }
        if answer.len() > head::LONGEST {
            return Err(io::ErrorKind::InvalidData.into());
        }
    }
    Ok(answer)
}

/// Returns a text of at most 65535 bytes as a WebSocket frame of a client (RFC 6455, section 5.2), masked
/// with zeros.
fn frame(text: &str) -> Vec<u8> {
    let mut frame = vec![0x81];
    match u8::try_from(text.len()) {
        Ok(short) if short < 126 => frame.push(0x80 | short),
        _ => {
            frame.push(0x80 | 126);
            frame.extend(u16::try_from(text.len()).unwrap_or(u16::MAX).to_be_bytes());
        }
    }
    frame.extend([0; 4]);
    frame.extend(text.bytes().take(usize::from(u16::MAX)));
    frame
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_has_its_length_and_a_mask() {
        let short = frame("hello");
        assert_eq!(short, [&[0x81, 0x85, 0, 0, 0, 0][..], b"hello"].concat());
        let long = frame(&"a".repeat(300));
        assert_eq!(long[..8], [0x81, 0xfe, 1, 44, 0, 0, 0, 0]);
        assert_eq!(long.len(), 308);
    }

    #[test]
    fn occupied_port_is_reported_with_advice() {
        let first = Front::bind(0).unwrap();
        let error = Front::bind(first.port()).unwrap_err().to_string();
        assert!(error.contains(&first.port().to_string()) && error.contains("--port"), "{error}");
    }
}
