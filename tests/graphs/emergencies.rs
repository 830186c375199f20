//! The emergency-stop topic when it is fed from outside of the graph: by datagrams, by a program that dies.

use std::net::UdpSocket;
use std::path::PathBuf;
use std::time::Duration;

use motorium::region::{GateState, Latch};

use crate::commands::{await_gate, gate, motorium};
use crate::support::{Run, await_that, machine, panda_reach};

/// The Panda with an emergency stop by datagrams; the folder that holds the graph, and the socket of the
/// feeder.
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
    Run::start_when(graph, &["--for", "60 s"], |plan, region| {
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
fn nothing_moves_before_the_feeder_is_heard_and_silence_latches() {
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
    // The feeder dies: it sends nothing any more.
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
        // In one step of the receiver, and of the gate: pressed, and released at once.
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
