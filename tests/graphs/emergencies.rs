//! The emergency-stop topic fed from outside the graph: by datagrams, and by a program that dies.

use std::net::UdpSocket;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use motorium::region::{GateState, Latch};

use crate::commands::{await_gate, gate, motorium};
use crate::support::{MOTORIUM, Run, await_that, machine, panda_reach};

/// The Panda with an emergency stop by datagrams; returns the folder that contains the graph, the graph, and
/// the socket of the feeder.
fn graph() -> (tempfile::TempDir, PathBuf, UdpSocket) {
    // a port that was free a moment ago
    let free = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let feeder = UdpSocket::bind("127.0.0.1:0").unwrap();
    feeder.connect(free).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let graph = folder.path().join("graph.toml");
    let text = format!(
        r#"
extends = {:?}
name = "emergency"
[component.button]
kind = "sensor.udp"
activate = {{ on = "fd", min_interval = "20 ms" }}
schedule = "normal"
publish = {{ value = "button" }}
config = {{ type = "motorium.EmergencyStop", port = {} }}
[safety]
emergency_stop = "button"
emergency_stop_max_age = "1 s"
"#,
        panda_reach(),
        free.port()
    );
    std::fs::write(&graph, text).unwrap();
    (folder, graph, feeder)
}

fn start(graph: &std::path::Path) -> Run {
    let length = format!("{} s", 60 + pressing().as_secs());
    Run::start_when(graph, &["--for", &length], |plan, region| {
        let physics = plan.components.iter().position(|component| component.name == "physics").unwrap();
        region.components()[physics].steps.load(std::sync::atomic::Ordering::Relaxed) > 20
    })
}

/// Feeds the value "released" until the robot follows its commands.
fn follow(run: &Run, feeder: &UdpSocket) {
    await_that("the feeder is heard", || {
        let _ = feeder.send(&0_u64.to_ne_bytes());
        gate(run).state == GateState::Following
    });
}

#[test]
fn nothing_moves_before_the_feeder_and_silence_latches() {
    let _machine = machine();
    let (_folder, graph, feeder) = graph();
    let run = start(&graph);
    assert_eq!(gate(&run).state, GateState::Safe, "nobody has released the stop");
    let region = run.folder.region().unwrap();
    await_that("the feeder never came", || region.header().latched() == Some(Latch::EmergencyStop));
    await_that("it is resumed", || {
        let _ = feeder.send(&0_u64.to_ne_bytes());
        gate(&run).latch.is_none() || motorium(&run, &["resume"]).0 == Some(0)
    });
    follow(&run, &feeder);
    // The feeder dies: it sends nothing more.
    await_gate(&run, "its silence is noticed", |gate| gate.latch == Some(Latch::EmergencyStop));
    assert_eq!(motorium(&run, &["resume"]).0, Some(1), "it is still silent");
    assert_eq!(motorium(&run, &["stop"]).0, Some(0));
    let ended = run.finish();
    assert!(ended.stderr.contains("no value of the emergency stop `button`"), "{}", ended.stderr);
}

#[test]
fn every_press_latches_however_short_it_is() {
    let _machine = machine();
    let (_folder, graph, feeder) = graph();
    let run = start(&graph);
    let _ = feeder.send(&0_u64.to_ne_bytes());
    for press in 0..20_u64 {
        await_that("it can be resumed", || {
            let _ = feeder.send(&0_u64.to_ne_bytes());
            gate(&run).latch.is_none() || motorium(&run, &["resume"]).0 == Some(0)
        });
        follow(&run, &feeder);
        // In one step of the receiver and of the gate: pressed and immediately released.
        feeder.send(&(press + 1).to_ne_bytes()).unwrap();
        feeder.send(&0_u64.to_ne_bytes()).unwrap();
        await_that("the press is latched", || {
            std::thread::sleep(Duration::from_millis(5));
            let _ = feeder.send(&0_u64.to_ne_bytes());
            gate(&run).latch == Some(Latch::EmergencyStop)
        });
    }
    assert_eq!(motorium(&run, &["stop"]).0, Some(0));
    run.finish();
}

/// A program that feeds the value "released". It is killed on drop.
enum Feeder {
    /// Sends until the other end of the channel is dropped.
    Datagrams(Option<(Sender<()>, JoinHandle<()>)>),
    Program(Child),
}

impl Feeder {
    fn datagrams(socket: &UdpSocket) -> Self {
        let (socket, (ends, ended)) = (socket.try_clone().unwrap(), channel());
        let feed = move || {
            while ended.recv_timeout(Duration::from_millis(10)) == Err(RecvTimeoutError::Timeout) {
                let _ = socket.send(&0_u64.to_ne_bytes());
            }
        };
        Self::Datagrams(Some((ends, std::thread::spawn(feed))))
    }

    fn program(run: &Run) -> Self {
        let arguments = ["topic", "pub", "button", "stop=0", "--rate", "50", "--run", run.folder.id()];
        let mut program = Command::new(MOTORIUM);
        program.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        Self::Program(program.spawn().unwrap())
    }
}

impl Drop for Feeder {
    fn drop(&mut self) {
        match self {
            Self::Datagrams(feeding) => {
                if let Some((ends, thread)) = feeding.take() {
                    drop(ends);
                    thread.join().unwrap();
                }
            }
            Self::Program(child) => {
                let _ = child.kill();
                let _ = child.wait();
            }
        }
    }
}

/// Returns the time for which each method of pressing is tried: `MOTORIUM_PRESS_SECONDS` in seconds, default
/// 3.
fn pressing() -> Duration {
    let seconds = std::env::var("MOTORIUM_PRESS_SECONDS").ok().and_then(|text| text.parse().ok());
    Duration::from_secs(seconds.unwrap_or(3))
}

/// Presses at random moments, and ends the feeder at others; each must latch. The timeout of the feeder is 1
/// s.
fn press_at_random(run: &Run, feed: &dyn Fn() -> Feeder, press: &dyn Fn(u64)) {
    let mut seed = 5_u64;
    let mut uniform = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64
    };
    let until = Instant::now() + pressing();
    let (mut presses, mut deaths, mut slowest) = (0_u64, 0_u64, Duration::ZERO);
    let mut feeder = None;
    while Instant::now() < until || presses < 5 || deaths < 1 {
        let fed = feeder.take().unwrap_or_else(feed);
        await_that("the robot follows", || {
            let gate = gate(run);
            if gate.latch.is_some() {
                // Rejected while the feeder is silent.
                motorium(run, &["resume"]);
            }
            gate.latch.is_none() && gate.state == GateState::Following
        });
        // up to 100 steps at 1 kHz
        let moment = run.steps_of("physics") + (100.0 * uniform()) as u64;
        await_that("the run has reached the moment", || run.steps_of("physics") >= moment);
        let began = Instant::now();
        if uniform() < 0.2 || presses >= 5 && deaths == 0 {
            drop(fed);
            deaths += 1;
            await_gate(run, "the dead feeder is noticed", |gate| gate.latch == Some(Latch::EmergencyStop));
            slowest = slowest.max(began.elapsed());
        } else {
            presses += 1;
            press(presses);
            await_gate(run, "the press is latched", |gate| gate.latch == Some(Latch::EmergencyStop));
            feeder = Some(fed);
        }
    }
    println!("{presses} presses, {deaths} dead feeders, noticed within {slowest:?} of a max_age of 1 s");
}

#[test]
fn random_presses_by_datagrams_latch() {
    let _machine = machine();
    let (_folder, graph, socket) = graph();
    let run = start(&graph);
    press_at_random(&run, &|| Feeder::datagrams(&socket), &|press| {
        socket.send(&press.to_ne_bytes()).unwrap();
        socket.send(&0_u64.to_ne_bytes()).unwrap();
    });
    let stopped = motorium(&run, &["stop"]);
    assert_eq!(stopped.0, Some(0), "{}", stopped.1);
    run.finish();
}

#[test]
fn random_presses_through_the_bridge_latch() {
    let _machine = machine();
    let folder = tempfile::tempdir().unwrap();
    let graph = folder.path().join("graph.toml");
    let text = format!(
        r#"
extends = {:?}
name = "emergency"
[component.bridge]
kind = "bridge.iceoryx2"
rate = "200 Hz"
schedule = "normal"
publish = {{ button = "button" }}
config = {{ in = {{ button = {{ type = "motorium.EmergencyStop", max_rate = "100 Hz" }} }} }}
[safety]
emergency_stop = "button"
emergency_stop_max_age = "1 s"
"#,
        panda_reach()
    );
    std::fs::write(&graph, text).unwrap();
    let run = start(&graph);
    press_at_random(&run, &|| Feeder::program(&run), &|_| {
        let pressed = motorium(&run, &["topic", "pub", "button", "stop=1"]);
        assert_eq!(pressed.0, Some(0), "{}", pressed.1);
    });
    let stopped = motorium(&run, &["stop"]);
    assert_eq!(stopped.0, Some(0), "{}", stopped.1);
    run.finish();
}
