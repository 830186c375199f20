//! The viewer of motorium: a separate program that `motorium view` starts.
//!
//! The viewer serves one port of the loopback interface. On this port it serves its own page over HTTP, and
//! Foxglove's WebSocket protocol (`foxglove.sdk.v1`). The page, Foxglove and Lichtblick all use this
//! protocol. The viewer reads the shared memory of the run through taps, on the shared cores, at most
//! [`Request::rate_hz`] times a second, and only for subscribed clients. No component waits for the viewer or
//! does any work for it.
//!
//! | module | contents |
//! |---|---|
//! | `request` | the request of `motorium view` |
//! | `front` | the port: files of the page, WebSockets |
//! | `server`, `ask`, `rights`, `assets` | protocol server: channels, services, parameters, files, token |
//! | `follow`, `joined`, `parameters` | the run: finding it, reading it |
//! | `playback`, `player` | a recording instead of a run, and the position in it |
//! | `channels`, `schemas`, `graph`, `world` | the description of a graph and its topics |
//! | `children`, `cores` | commands of `motorium` that it starts; keeping off the real-time cores |
//! | `watch` | a client that subscribes to everything, for measurements |
//! | `browser`, `check` | a check of the page in a headless browser |

mod ask;
mod assets;
pub mod browser;
mod channels;
mod check;
mod children;
mod cores;
mod follow;
mod front;
mod graph;
mod joined;
mod parameters;
mod playback;
mod player;
mod request;
mod rights;
mod schemas;
mod server;
mod watch;

use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, mpsc};

use anyhow::Context as _;
use motorium::program::{Program, list};
use signal_hook::consts::{SIGINT, SIGTERM};

pub use front::page_digest;
pub use request::{Request, SERVE};

/// Runs the viewer and returns its exit code.
pub fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    // `motorium` queries each sibling program for its version and its kinds; this one has no kinds.
    if let Some(Program::Kinds) = Program::from_arguments(&arguments) {
        return list(&[]);
    }
    motorium::transport::quieten();
    let request = match arguments.as_slice() {
        [_, first, request] if first == SERVE => serde_json::from_str::<Request>(request),
        _ => {
            eprintln!("this program is started by `motorium view GRAPH`");
            return ExitCode::from(2);
        }
    };
    let served = request
        .context(
            "reading the request of `motorium view`: does its version differ from the \
             viewer's?",
        )
        .and_then(serve);
    match served {
        Ok(code) => code,
        Err(error) => {
            // Its message is already on the screen, and its exit code names the class of the failure.
            if let Some(children::NeverSeen::Failed(code)) = error.downcast_ref() {
                return ExitCode::from(*code);
            }
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Serves a run, and checks the page on request.
fn serve(request: Request) -> anyhow::Result<ExitCode> {
    anyhow::ensure!(
        request.rate_hz.is_finite() && (1.0..=1000.0).contains(&request.rate_hz),
        "--rate is {} Hz, expected 1 to 1000",
        request.rate_hz
    );
    let front = front::Front::bind(request.port)?;
    let token = match &request.token {
        Some(token) => token.clone(),
        None => rights::new_token().context("the random source")?,
    };
    let (over, interrupted) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    signal_hook::flag::register(SIGINT, interrupted.clone()).context("catching signals")?;
    signal_hook::flag::register(SIGTERM, over.clone()).context("catching signals")?;
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    let (sender, asks) = mpsc::channel();
    let rights = Arc::new(rights::Rights::new(token.clone()));
    let opened = request.recording.as_deref().map(playback::open).transpose()?;
    let recorded = opened.map(|(recording, times)| (Arc::new(recording), times));
    let recording = recorded.as_ref().map(|(recording, _)| recording.clone());
    let player = recorded.as_ref().map(|(_, times)| Arc::new(Mutex::new(player::Player::new(*times))));
    let asks_to = ask::Asks { sender, rights, player: player.clone() };
    let server = Arc::new(runtime.block_on(server::Server::start(asks_to, recorded))?);
    let port = front.port();
    runtime.spawn(front.serve(server.address(), token.clone()));
    eprintln!("view at http://localhost:{port}/?token={token}");
    eprintln!("for Foxglove and Lichtblick: ws://localhost:{port}/?token={token}");
    let check = match request.headless_check.clone() {
        None => None,
        Some(picture) => {
            let address = format!("http://localhost:{port}/?token={token}");
            let (over, began) = (over.clone(), request.began_ms);
            Some(std::thread::spawn(move || {
                let checked = check::check(&address, &picture, began, &over);
                over.store(true, Relaxed);
                checked
            }))
        }
    };
    if request.watched {
        let over = over.clone();
        std::thread::spawn(move || {
            if let Err(error) = watch::watch(port, &over) {
                eprintln!("the client that subscribes to everything has ended: {error:#}");
            }
        });
    }
    let followed = match (&recording, &player) {
        (Some(recording), Some(player)) => {
            playback::play(&request, recording, &server, player, &asks, [&over, &interrupted])
        }
        _ => follow::Follower::new(request, server, asks)
            .and_then(|follower| follower.follow(&over, &interrupted)),
    };
    over.store(true, Relaxed);
    let checked = check.map(|check| check.join().unwrap_or_else(|_| anyhow::bail!("the check failed")));
    runtime.shutdown_background();
    followed?;
    checked.unwrap_or(Ok(()))?;
    Ok(ExitCode::SUCCESS)
}
