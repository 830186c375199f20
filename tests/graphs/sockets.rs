//! `sensor.udp` and activation by a descriptor: datagrams over loopback become values of a topic, in real
//! time, with real processes.

use std::net::UdpSocket;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use motorium::launcher::{ComponentReport, Exit};
use motorium::prelude::*;
use rustix::process::Signal;
use serde_json::Value;

use crate::program::printed;
use crate::support::{Ended, Run, await_end, await_that, kill, leftovers, machine, signal};

/// A graph that receives wrenches, with these settings of the receiving component; returns the folder that
/// contains it, the graph, and a socket that sends to it.
fn receiver(settings: &str) -> (tempfile::TempDir, PathBuf, UdpSocket) {
    // a port that was free a moment ago
    let free = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
    sender.connect(free).unwrap();
    let text = format!(
        r#"
name = "receive"

[topic."grip/wrench"]
history = 1000

[component.clock]
kind      = "log.console"
rate      = "200 Hz"
schedule  = "normal"
lost_steps = 1.0
subscribe = {{ wrench = "grip/wrench" }}

[component.grip]
kind     = "sensor.udp"
activate = {{ on = "fd", min_interval = "2 ms" }}
publish  = {{ value = "grip/wrench" }}
config   = {{ type = "motorium.Wrench", port = {} }}
{settings}
"#,
        free.port()
    );
    let folder = tempfile::tempdir().unwrap();
    let graph = folder.path().join("graph.toml");
    std::fs::write(&graph, text).unwrap();
    (folder, graph, sender)
}

/// Starts the graph. It is ready when the components released only by the clock step; no datagram has arrived
/// yet.
fn start(graph: &std::path::Path, arguments: &[&str]) -> Run {
    Run::start_when(graph, arguments, |plan, region| {
        let clock = plan.components.iter().position(|component| component.name == "clock").unwrap();
        let steps = region.components()[clock].steps.load(std::sync::atomic::Ordering::Relaxed);
        steps > 20
    })
}

/// Sends a datagram that introduces the sender's socket and is not published.
fn introduce(run: &Run, sender: &UdpSocket) {
    let before = run.steps_of("grip");
    sender.send(&payload(0.0)).unwrap();
    await_that("the sender is introduced", || run.steps_of("grip") > before);
}

fn payload(newton: f64) -> Vec<u8> {
    let wrench = Wrench { force: [newton, 0.0, 0.0], ..Wrench::default() };
    bytemuck::bytes_of(&[wrench.force, wrench.torque]).to_vec()
}

fn newest(run: &Run) -> Value {
    let id = run.folder.id();
    let text = printed(&["topic", "echo", "grip/wrench", "--run", id, "--count", "1", "--json"]);
    serde_json::from_str(text.trim()).expect("JSON")
}

fn end(run: Run) -> (Ended, ComponentReport, Value) {
    signal(run.launcher(), Signal::INT);
    let ended = run.finish();
    assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Interrupted), "{}", ended.stderr);
    let grip = ended.report().components.iter().find(|c| c.name == "grip").expect("reported").clone();
    let result = ended.report().results["grip"].clone();
    (ended, grip, result)
}

#[test]
fn a_datagram_is_published_with_its_arrival_time() {
    assert_eq!(Wrench::layout().size, payload(0.0).len());
    let _machine = machine();
    let (_folder, graph, sender) = receiver("");
    let run = start(&graph, &["--for", "60 s"]);
    let id = run.folder.id().to_string();
    assert_eq!((run.published("grip/wrench"), run.steps_of("grip")), (0, 0), "nothing releases it");
    introduce(&run, &sender);
    for count in 1..=150_u64 {
        let before = motorium::os::monotonic_ns();
        sender.send(&payload(count as f64)).unwrap();
        await_that("the value", || run.published("grip/wrench") == count);
        if count % 50 == 0 {
            let value = newest(&run);
            assert_eq!(value["value"]["force"], serde_json::json!([count as f64, 0.0, 0.0]));
            let time = |name: &str| value[name].as_u64().unwrap_or_else(|| panic!("{value}"));
            assert!(
                (before..=time("publish_time_ns")).contains(&time("source_time_ns")),
                "sent at {before}: {value}"
            );
        }
    }
    let (ended, grip, result) = end(run);
    assert_eq!((&result["received"], &result["published"]), (&151.into(), &150.into()), "{result}");
    assert_eq!((grip.steps, grip.allocations), (151, Some(0)), "{grip:?}");
    assert_eq!(ended.report().warnings, Vec::<String>::new());
    assert_eq!(leftovers(&id), Vec::<String>::new());
}

#[test]
fn burst_is_merged_into_steps_min_interval_apart() {
    let _machine = machine();
    let (_folder, graph, sender) = receiver("");
    let run = start(&graph, &["--for", "60 s"]);
    introduce(&run, &sender);
    let (began, mut sent) = (Instant::now(), 0_u32);
    loop {
        let published = run.published("grip/wrench");
        if published >= 10 {
            break;
        }
        assert!(began.elapsed() < Duration::from_secs(20), "{published} steps of {sent} datagrams");
        // At most 110 datagrams wait in the kernel while a busy host delays the receiver. Those sent right
        // after a step arrive before its interval ends.
        if u64::from(sent) < 10 * (published + 10) {
            sender.send(&payload(f64::from(sent))).unwrap();
            sent += 1;
        }
        std::hint::spin_loop();
    }
    await_that("the newest value", || newest(&run)["value"]["force"][0] == f64::from(sent - 1));
    let elapsed = began.elapsed();
    let (_, grip, result) = end(run);
    let count = |name: &str| result[name].as_u64().unwrap();
    // one step at the beginning, and then one in each interval
    let most = elapsed.as_millis() as u64 / 2 + 2;
    assert!((11..=most).contains(&grip.steps), "{} steps in {elapsed:?}", grip.steps);
    assert!(grip.deferred > 0 && grip.deferred < grip.steps, "{grip:?}");
    assert_eq!(count("published") + 1, grip.steps);
    assert_eq!(count("received"), u64::from(sent) + 1);
    assert!(count("replaced") > 0, "{result}");
    assert_eq!(count("published") + count("replaced"), u64::from(sent), "{result}");
}

#[test]
fn invalid_datagrams_are_counted_and_not_published() {
    let _machine = machine();
    let (_folder, graph, sender) = receiver("");
    let other = UdpSocket::bind("127.0.0.1:0").unwrap();
    let text = std::fs::read_to_string(&graph).unwrap();
    let from = format!(
        "port = {}, from = [\"{}\"]",
        sender.peer_addr().unwrap().port(),
        sender.local_addr().unwrap()
    );
    let port = format!("port = {}", sender.peer_addr().unwrap().port());
    std::fs::write(&graph, text.replace(&port, &from)).unwrap();
    let run = start(&graph, &["--for", "60 s"]);
    introduce(&run, &sender);
    sender.send(&payload(1.0)).unwrap();
    await_that("the first value", || run.published("grip/wrench") == 1);
    let send = |bytes: &[u8]| {
        sender.send(bytes).unwrap();
    };
    send(&payload(f64::NAN));
    send(&payload(2.0)[1..]);
    send(&[payload(2.0), vec![0]].concat());
    send(&[]);
    other.send_to(&payload(2.0), sender.peer_addr().unwrap()).unwrap();
    sender.send(&payload(3.0)).unwrap();
    await_that("the second value", || newest(&run)["value"]["force"][0] == 3.0);
    assert_eq!(run.published("grip/wrench"), 2);
    let (_, _, result) = end(run);
    assert_eq!((&result["received"], &result["published"]), (&8.into(), &2.into()));
    let refused = serde_json::json!(
        { "sender": 1, "length": 3, "not_finite": 1, "count_too_large": 0, "too_late": 0 }
    );
    assert_eq!(result["refused"], refused);
}

#[test]
fn run_ends_promptly_while_no_datagram_arrives() {
    let _machine = machine();
    let (_folder, graph, _sender) = receiver("");
    let text = std::fs::read_to_string(&graph).unwrap();
    // hosted in threads, the launcher interrupts the thread itself
    for (interval, hosting) in [("2 ms", "processes"), ("30 s", "processes"), ("30 s", "threads")] {
        std::fs::write(&graph, text.replace("2 ms", interval)).unwrap();
        let began = Instant::now();
        let ended = crate::support::run(&graph, &["--for", "1 s", "--hosting", hosting]);
        assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Finished), "{}", ended.stderr);
        let component = &ended.report().components[1];
        assert_eq!((component.steps, &ended.report().warnings), (0, &Vec::new()), "{}", ended.stderr);
        assert!(began.elapsed() < Duration::from_secs(3), "{hosting}: {:?}", began.elapsed());
    }
    let run = start(&graph, &[]);
    let began = Instant::now();
    signal(run.launcher(), Signal::TERM);
    let ended = run.finish();
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(began.elapsed() < Duration::from_millis(1_500), "{:?}", began.elapsed());
}

#[test]
fn run_ends_promptly_while_an_event_is_delayed() {
    let _machine = machine();
    let (_folder, graph, sender) = receiver("");
    let text = std::fs::read_to_string(&graph).unwrap();
    let text = text.replace("2 ms", "30 s").replace("config   = {", "config   = { local_users = \"any\",");
    std::fs::write(&graph, text).unwrap();
    let run = start(&graph, &[]);
    for count in 1..=2 {
        sender.send(&payload(f64::from(count))).unwrap();
        await_that("the first step", || run.published("grip/wrench") == 1);
    }
    std::thread::sleep(Duration::from_millis(50));
    let began = Instant::now();
    let (_, grip, _) = end(run);
    assert_eq!((grip.steps, grip.deferred), (1, 1));
    assert!(began.elapsed() < Duration::from_millis(1_500), "{:?}", began.elapsed());
}

#[test]
fn a_killed_or_stopped_receiver_binds_again() {
    let _machine = machine();
    let settings = "restart = { when = \"failure\" }\nhang_after = \"200 ms\"";
    let (_folder, graph, sender) = receiver(settings);
    let run = start(&graph, &["--for", "60 s"]);
    let mut count = 0;
    let mut arrives = |run: &Run| {
        let before = run.published("grip/wrench");
        let began = Instant::now();
        // data sent without a receiver is lost, and the sender may get an error
        while run.published("grip/wrench") == before {
            count += 1;
            let _ = sender.send(&payload(f64::from(count)));
            std::thread::sleep(Duration::from_millis(5));
            assert!(began.elapsed() < Duration::from_secs(20), "nothing arrives");
        }
    };
    arrives(&run);
    for end in [kill as fn(u32), |pid| signal(pid, Signal::STOP)] {
        let (pid, steps) = (run.pid_of("grip"), run.steps_of("clock"));
        end(pid);
        await_end(pid);
        arrives(&run);
        await_that("the others step", || run.steps_of("clock") > steps + 20);
    }
    let (ended, grip, _) = end(run);
    assert_eq!(grip.restarts, 2);
    assert!(ended.stderr.contains("stopped by a signal"), "{}", ended.stderr);
}

/// Returns `true` if a line of strace is this system call.
fn is(call: &str, name: &str) -> bool {
    call.split('(').next() == Some(name)
}

/// Returns `true` if a system call has received a datagram of the test below.
fn took(call: &str) -> bool {
    is(call, "recvmsg") && call.ends_with("= 48")
}

#[test]
fn the_wait_is_one_system_call_and_a_datagram_two_more() {
    let _machine = machine();
    if std::process::Command::new("strace").arg("-V").output().is_err() {
        return eprintln!("skipped: there is no strace");
    }
    let (folder, graph, sender) = receiver("");
    // without checking the owners of local sockets
    let text = std::fs::read_to_string(&graph).unwrap();
    std::fs::write(&graph, text.replace("config   = {", "config   = { local_users = \"any\",")).unwrap();
    let run = start(&graph, &["--for", "60 s"]);
    for count in 0..110 {
        sender.send(&payload(f64::from(count))).unwrap();
        std::thread::sleep(Duration::from_millis(4));
    }
    let file = folder.path().join("calls");
    let mut strace = std::process::Command::new("strace")
        .args(["-o", file.to_str().unwrap(), "-p", &run.pid_of("grip").to_string()])
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(500));
    for count in 0..20 {
        sender.send(&payload(f64::from(count))).unwrap();
        std::thread::sleep(Duration::from_millis(20));
    }
    signal(strace.id(), Signal::INT);
    strace.wait().unwrap();
    let calls = std::fs::read_to_string(&file).unwrap();
    if !calls.contains("recvmsg") {
        return eprintln!("skipped: this process may not trace another one");
    }
    let lines: Vec<&str> = calls.lines().collect();
    // one call for each datagram, and one more that finds none
    assert!((15..=20).contains(&lines.iter().filter(|call| took(call)).count()), "{calls}");
    for waited in lines.split(|call| is(call, "ppoll")).skip(1).filter(|calls| !calls.is_empty()) {
        let received: Vec<_> = waited.iter().take_while(|call| is(call, "recvmsg")).collect();
        let datagrams = received.iter().filter(|call| took(call)).count();
        // two datagrams that arrived during a stall of the host are one step
        assert!(datagrams > 0 && received.len() == datagrams + 1, "{calls}");
    }
    end(run);
}
