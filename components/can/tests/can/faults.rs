//! Faults on simulated buses, in lockstep. Each fault runs twice, with bit-identical results.

use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::testing::{Probe, Source};
use motorium_can::{CanAdapter, CanAdapterConfig, JointHealth};
use serde_json::{Value, json};

use super::components::{DRIVES, Folder, adapter, bare_graph, command, graph};

/// Runs a fault twice for 600 ms, checks that both runs are identical, and returns the report.
fn row(name: &str, fault: &str) -> Report {
    let run = |turn: &str| {
        let folder = Folder::new(&format!("row-{name}-{turn}"), DRIVES);
        graph(&folder, &format!("faults = [{{ at = \"300 ms\", {fault} }}]"), "").run("600 ms").unwrap()
    };
    let (one, two) = (run("1"), run("2"));
    assert!(one.state_hash.is_some(), "{name}");
    assert_eq!(one.state_hash, two.state_hash, "{name}");
    assert_eq!(adapter(&one), adapter(&two), "{name}");
    for component in one.components.iter().filter(|component| component.name != "commands") {
        assert_eq!(component.allocations, Some(0), "{name}: {}", component.name);
    }
    one
}

fn number(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("{value} is not a number"))
}

fn drive<'a>(report: &'a Report, joint: &str) -> &'a Value {
    &report.results["drives"]["drives"][joint]
}

/// Drives that their watchdogs have disabled and that are still disabled.
fn let_go(report: &Report) -> Vec<&'static str> {
    let has = |joint: &&str| {
        let drive = drive(report, joint);
        drive["watchdog_trips"] == 1 && drive["enabled"] == false
    };
    ["joint1", "joint2", "joint3"].into_iter().filter(has).collect()
}

#[test]
fn a_silent_node_is_lost_in_its_third_cycle() {
    let report = row("silent", r#"kind = "silent", joint = "joint1""#);
    let joint = &adapter(&report)["joints"]["joint1"];
    // the first query without an answer is in cycle 301; it counts as missing in 302
    assert_eq!((&joint["lost"], &joint["lost_in_cycle"]), (&json!(1), &json!(304)), "{joint}");
    assert_eq!(adapter(&report)["tripped"], true);
}

#[test]
fn a_constantly_late_reply_is_lost_in_three_cycles() {
    // less than a cycle; a whole cycle, like timely answers; two cycles; and longer than the time until a
    // drive is lost
    for delay in ["800 us", "1 ms", "1.05 ms", "1.3 ms", "2 ms", "2.2 ms", "3.5 ms"] {
        let fault = format!(r#"kind = "late", delay = "{delay}", joint = "joint1""#);
        let report = row(&format!("late-{}", delay.replace([' ', '.'], "-")), &fault);
        let result = adapter(&report);
        let joint = &result["joints"]["joint1"];
        assert_eq!(result["tripped"], true, "{delay}: {joint}");
        // a drive whose late answers look timely is exposed by the cycle in which it is skipped
        assert_eq!(joint["lost"], 1, "{delay}: {joint}");
        assert!((304..=305).contains(&number(&joint["lost_in_cycle"])), "{delay}: {joint}");
        assert!(number(&joint["missing_replies"]) >= 3, "{delay}: {joint}");
        let is_lost_by_silence = delay == "3.5 ms";
        assert!(is_lost_by_silence || number(&joint["late_replies"]) >= 3, "{delay}: {joint}");
        assert_eq!(result["joints"]["joint2"]["missing_replies"], 0, "{delay}");
    }
}

#[test]
fn a_single_reply_a_cycle_late_does_not_trip() {
    for (delay, late) in [("1 ms", 1), ("1.05 ms", 1)] {
        let fault = format!(r#"lasts = "1 ms", kind = "late", delay = "{delay}", joint = "joint1""#);
        let report = row(&format!("late-once-{}", delay.replace([' ', '.'], "-")), &fault);
        let result = adapter(&report);
        assert_eq!(
            (&result["missing_replies"], &result["late_replies"], &result["duplicate_replies"]),
            (&json!(1), &json!(late), &json!(0)),
            "{delay}: {result}"
        );
        assert_eq!(result["tripped"], false, "{delay}");
    }
}

#[test]
fn a_single_lost_reply_costs_one_cycle() {
    let report = row("lost-once", r#"lasts = "1 ms", kind = "silent", joint = "joint1""#);
    let result = adapter(&report);
    assert_eq!((&result["missing_replies"], &result["late_replies"]), (&json!(1), &json!(0)), "{result}");
    assert_eq!(result["tripped"], false);
    // the drive is skipped for one cycle, to check that its answers are not late
    let sent = |bus: &str| number(&result["buses"][bus]["sent"]);
    assert_eq!((sent("can0"), sent("can1")), (2 * number(&result["cycles"]) - 1, number(&result["cycles"])));
}

#[test]
fn a_saturated_bus_is_refused_and_a_blocked_one_trips() {
    let crowded = DRIVES
        .replace("bus      = \"can1\"", "bus      = \"can0\"")
        .replace("bitrate = 1_000_000", "bitrate = 500_000");
    let folder = Folder::new("saturated", &crowded);
    let text = graph(&folder, "", "").check().unwrap_err().render(false);
    assert!(text.contains("3 drives do not fit on bus `can0`"), "{text}");
    assert!(text.contains("% load)"), "{text}");

    let report = row("babbling", r#"lasts = "50 ms", kind = "babbling", bus = "can0""#);
    let result = adapter(&report);
    let bus = &result["buses"]["can0"];
    assert_eq!(result["tripped"], true, "{result}");
    // a frame lasts 0.12 ms, so 50 ms have room for 400
    assert!((380..=500).contains(&number(&result["stray_frames"])), "{result}");
    assert!(number(&bus["queue_full"]) > 0 && number(&bus["unsent"]) > 0, "{bus}");
    assert!(bus["highest_load"].as_f64().unwrap() > 0.9, "{bus}");
    assert_eq!(result["joints"]["joint3"]["missing_replies"], 0, "the other bus continues");
}

#[test]
fn unacknowledged_frames_are_reported_and_dropped() {
    let report = row("alone", r#"lasts = "100 ms", kind = "alone", bus = "can0""#);
    let result = adapter(&report);
    let bus = &result["buses"]["can0"];
    assert!(number(&bus["unacknowledged"]) > 100, "{bus}");
    assert_eq!(bus["diagnosis"], "nobody acknowledges on `can0`: power, bitrate, termination?");
    // two frames per cycle: twelve are buffered, the rest are dropped
    assert!((180..=200).contains(&number(&bus["unsent"])), "{bus}");
    assert!(number(&bus["queue_full"]) >= 90, "{bus}");
    assert_eq!((&bus["condition"], &bus["bus_off"]), (&json!("active"), &json!(0)), "{bus}");
    assert_eq!(result["tripped"], true);
    // joint 3 is on the other bus, and damped
    assert_eq!(let_go(&report), ["joint1", "joint2"]);
    assert_eq!(drive(&report, "joint3")["enabled"], true);
}

#[test]
fn an_error_passive_bus_is_reported_and_keeps_running() {
    // four frames per millisecond are disturbed and retransmitted
    let report = row("passive", r#"lasts = "10 ms", kind = "disturbed", bus = "can1""#);
    let result = adapter(&report);
    let bus = &result["buses"]["can1"];
    assert!(number(&bus["errors"]) >= 1, "{bus}");
    assert_eq!((&bus["condition"], &bus["bus_off"]), (&json!("active"), &json!(0)), "{bus}");
    assert_eq!((&result["missing_replies"], &result["tripped"]), (&json!(0), &json!(false)), "{result}");
}

#[test]
fn bus_off_trips_the_adapter_and_drives_release() {
    let report = row("disturbed", r#"lasts = "100 ms", kind = "disturbed", bus = "can0""#);
    let result = adapter(&report);
    let bus = &result["buses"]["can0"];
    assert_eq!((&bus["condition"], &bus["bus_off"]), (&json!("bus-off"), &json!(1)), "{bus}");
    let diagnosis = bus["diagnosis"].as_str().unwrap();
    assert!(
        diagnosis.contains("has left the bus: check for a short circuit or a wrong bitrate"),
        "{diagnosis}"
    );
    assert_eq!(result["tripped"], true);
    assert_eq!(let_go(&report), ["joint1", "joint2"]);
}

#[test]
fn nothing_is_sent_after_bus_off_until_drives_release() {
    let report = row("off", r#"lasts = "100 ms", kind = "bus_off", bus = "can0""#);
    let result = adapter(&report);
    let bus = &result["buses"]["can0"];
    assert_eq!((&bus["condition"], &bus["bus_off"]), (&json!("active"), &json!(1)), "{bus}");
    assert!((196..=202).contains(&number(&bus["unsent"])), "{bus}");
    assert_eq!(result["tripped"], true);
    assert_eq!(let_go(&report), ["joint1", "joint2"]);
}

#[test]
fn a_link_that_goes_down_trips_and_recovers() {
    let report = row("down", r#"lasts = "100 ms", kind = "down", bus = "can1""#);
    let result = adapter(&report);
    let bus = &result["buses"]["can1"];
    assert_eq!((&bus["condition"], &bus["down"], &bus["bus_off"]), (&json!("active"), &json!(1), &json!(0)));
    assert_eq!(bus["diagnosis"], "`can1` was down, and is up again");
    assert!((98..=101).contains(&number(&bus["unsent"])), "{bus}");
    assert_eq!(result["tripped"], true);
    // its drive disabled itself; the adapter detected that when the link returned
    assert_eq!(drive(&report, "joint3")["enabled"], false);

    let report = row("stays-down", r#"kind = "down", bus = "can1""#);
    let bus = &adapter(&report)["buses"]["can1"];
    assert_eq!(bus["condition"], "down");
    assert!(bus["diagnosis"].as_str().unwrap().contains("sudo ip link set can1 up"), "{bus}");
    assert_eq!(let_go(&report), ["joint3"]);
}

#[test]
fn two_drives_with_one_number_are_lost() {
    let report = row("twin", r#"kind = "twin", joint = "joint1""#);
    let result = adapter(&report);
    let joint = &result["joints"]["joint1"];
    assert_eq!((&joint["lost"], &result["tripped"]), (&json!(1), &json!(true)), "{result}");
    // only the drive's own positions are published
    assert_eq!(number(&joint["duplicate_replies"]) + number(&joint["refused_frames"]), 0, "{joint}");
    assert_eq!(result["buses"]["can0"]["condition"], "active", "the adapter stays");
}

#[test]
fn malformed_and_corrupt_answers_are_refused() {
    for kind in ["wrong_length", "corrupt"] {
        for joint in ["joint1", "joint3"] {
            let report = row(&format!("{kind}-{joint}"), &format!(r#"kind = "{kind}", joint = "{joint}""#));
            let result = adapter(&report);
            let strays = number(&result["stray_frames"]);
            let health = &result["joints"][joint];
            // an answer of another device with a mini cheetah's identifier is a stray frame
            assert!(number(&health["refused_frames"]) + strays > 3, "{kind}: {result}");
            assert_eq!(
                (&health["lost"], &health["lost_in_cycle"]),
                (&json!(1), &json!(304)),
                "{kind}: {health}"
            );
            assert_eq!(result["tripped"], true);
        }
    }
}

#[test]
fn a_drive_stays_disabled_after_power_returns() {
    let report = row("power", r#"lasts = "50 ms", kind = "off", joint = "joint2""#);
    assert_eq!(adapter(&report)["tripped"], true);
    assert_eq!(drive(&report, "joint2")["enabled"], false);
}

/// Adapter that dies or hangs in its step at 300 ms.
struct Doomed<const DIES: bool>(CanAdapter);

impl<const DIES: bool> Component for Doomed<DIES> {
    const KIND: &'static str = "can.adapter";
    const SUMMARY: &'static str = "commands drives until it dies or hangs";
    const READS_GRAVITY: bool = true;
    type Config = CanAdapterConfig;

    fn declare(config: &CanAdapterConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        CanAdapter::declare(config, declare)
    }

    fn configure(config: CanAdapterConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        CanAdapter::configure(config, setup).map(Self)
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        match tick.time_ns < 300_000_000 {
            true => self.0.step(tick),
            false if DIES => Err(StepError::failed("it was killed")),
            false => Ok(()),
        }
    }
}

#[test]
fn drives_release_when_the_adapter_dies_or_hangs() {
    let run = |name: &str, turn: u32| {
        let folder = Folder::new(&format!("{name}-{turn}"), DRIVES);
        let commands = Source::new("commands", "arm/command", |_| Some(command()));
        let graph = bare_graph(&folder, "", "").set("component.adapter.on_failure", "\"ignore\"");
        let graph = match name {
            "dies" => graph.kind::<Doomed<true>>(),
            _ => graph.kind::<Doomed<false>>(),
        };
        graph.with(commands).run("600 ms").unwrap()
    };
    for name in ["dies", "hangs"] {
        let (one, two) = (run(name, 1), run(name, 2));
        assert_eq!(let_go(&one), ["joint1", "joint2", "joint3"], "{name}: {:?}", one.results["drives"]);
        assert_eq!(one.state_hash, two.state_hash, "{name}");
    }
}

#[test]
fn a_silent_controller_triggers_the_safe_state() {
    let run = |turn: u32| {
        let folder = Folder::new(&format!("controller-{turn}"), DRIVES);
        let commands =
            Source::new("commands", "arm/command", |tick| (tick.time_ns < 300_000_000).then(command));
        let health = Probe::<JointHealth>::for_topic("arm/health");
        let graph = bare_graph(&folder, "", "").kind::<CanAdapter>().with(commands).with(&health);
        (graph.run("600 ms").unwrap(), health.values().pop().unwrap())
    };
    let ((one, health), (two, _)) = (run(1), run(2));
    let result = adapter(&one);
    assert!(number(&result["cycles_in_safe_state"]) > 250, "{result}");
    assert_eq!((&result["missing_replies"], &result["tripped"]), (&json!(0), &json!(false)), "{result}");
    assert!(health.flags[..3].iter().all(|flags| flags & JointHealth::ENABLED != 0), "held, not disabled");
    assert_eq!(one.state_hash, two.state_hash);
}
