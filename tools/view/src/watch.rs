//! A client that subscribes to everything the viewer serves, and reads it.

use std::net::{Ipv4Addr, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

use anyhow::Context as _;
use serde_json::{Value as Json, json};
use tungstenite::client::IntoClientRequest as _;
use tungstenite::{Error, Message};

/// Poll interval for the end of the viewer.
const LOOK: Duration = Duration::from_millis(200);

/// Reads everything the viewer on this port sends, until the viewer ends.
pub(crate) fn watch(port: u16, over: &AtomicBool) -> anyhow::Result<()> {
    let mut request = format!("ws://localhost:{port}/").into_client_request()?;
    request.headers_mut().insert("sec-websocket-protocol", "foxglove.sdk.v1".parse()?);
    let stream = TcpStream::connect((Ipv4Addr::LOCALHOST, port))?;
    stream.set_nodelay(true)?;
    let (mut socket, _) = tungstenite::client(request, stream).context("joining the viewer")?;
    socket.get_ref().set_read_timeout(Some(LOOK))?;
    let mut subscriptions: u32 = 0;
    while !over.load(Relaxed) {
        let text = match socket.read() {
            Ok(Message::Text(text)) => text,
            Ok(_) => continue,
            Err(Error::Io(error)) if error.kind() == std::io::ErrorKind::WouldBlock => continue,
            Err(Error::ConnectionClosed | Error::AlreadyClosed) => break,
            Err(error) => return Err(error.into()),
        };
        let said: Json = serde_json::from_str(&text)?;
        if said["op"] != "advertise" {
            continue;
        }
        let wanted = said["channels"].as_array().into_iter().flatten().map(|channel| {
            subscriptions += 1;
            json!({ "id": subscriptions, "channelId": channel["id"] })
        });
        let wanted: Vec<Json> = wanted.collect();
        socket.send(Message::text(json!({ "op": "subscribe", "subscriptions": wanted }).to_string()))?;
    }
    Ok(())
}
