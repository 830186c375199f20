//! Homing in a lockstep graph: adapter, simulated buses and drives, physics.

use motorium::prelude::*;
use motorium::region::GateState;
use motorium::state::EmergencyStop;
use motorium::testing::{Probe, Source};
use motorium_can::{CanAdapter, JointHealth};

use super::components::{Folder, GOAL, bare_graph, command, graph};

/// Drive table of the planar arm with homing; the first joint is homed before the others.
pub(super) const PLANAR: &str = r#"
[[bus]]
name    = "can0"
bitrate = 1_000_000

[[drive]]
joint    = "joint1"
bus      = "can0"
protocol = "damiao"
node     = 1
ratio    = 4.0
watchdog = "20 ms"
ranges   = { position = 25.0, velocity = 30.0, torque = 8.0 }
homing   = { by = "stop", velocity = 1.5, effort = 12.0, position = 2.9, energy = 4.0 }

[[drive]]
joint    = "joint2"
bus      = "can0"
protocol = "damiao"
node     = 2
ratio    = 4.0
reversed = true
watchdog = "20 ms"
ranges   = { position = 25.0, velocity = 30.0, torque = 8.0 }
homing   = { by = "stop", velocity = 1.5, effort = 12.0, position = 2.9, order = 1, energy = 4.0 }

[[bus]]
name    = "can1"
bitrate = 1_000_000

[[drive]]
joint        = "joint3"
bus          = "can1"
protocol     = "cia402"
node         = 3
ratio        = 4.0
watchdog     = "20 ms"
increments   = 65536.0
rated_torque = 4.0
rated_current = 8.0
current_limit = 16.0
ranges       = { position = 25.0, velocity = 30.0, torque = 8.0 }
position_loop = { kp = 20.0, kd = 1.0 }
offset       = -1.2
homing       = { by = "drive", method = 17, velocity = 0.5, creep_velocity = 0.1, acceleration = 2.0, order = 1 }
"#;

/// Same table with an ODrive, which reports unsolicited, instead of the CiA 402 drive.
fn with_odrive() -> String {
    let own = &PLANAR[PLANAR.find("protocol     = \"cia402\"").unwrap()..];
    let odrive = r#"protocol = "odrive"
node     = 3
ratio    = 4.0
watchdog = "20 ms"
report_every = "3 ms"
torque_constant = 0.5
current_limit = 16.0
ranges   = { position = 25.0, velocity = 30.0, torque = 8.0 }
position_loop = { kp = 20.0, kd = 1.0 }
offset   = -1.2
homing   = { by = "drive", order = 1 }
"#;
    PLANAR.replace(own, odrive)
}

#[test]
fn an_arm_is_homed_in_a_graph_before_it_follows() {
    homes_an_arm("homing", PLANAR);
}

#[test]
fn an_arm_with_an_odrive_is_homed_in_a_graph() {
    homes_an_arm("homing-odrive", &with_odrive());
}

fn homes_an_arm(name: &str, drives: &str) {
    let folder = Folder::new(name, drives);
    let (measured, truth) =
        (Probe::<JointState>::for_topic("arm/state"), Probe::<JointState>::for_topic("arm/true_state"));
    let health = Probe::<JointHealth>::for_topic("arm/health");
    let report = graph(&folder, "", "").with(&measured).with(&truth).with(&health).run("12 s").unwrap();
    let result = &report.results["adapter"];
    for joint in ["joint1", "joint2", "joint3"] {
        assert_eq!(result["joints"][joint]["homing"], "homed", "{result}");
        assert_eq!(result["joints"][joint]["phase"], "enabled", "{result}");
    }
    assert_eq!((&result["tripped"], &result["missing_replies"]), (&false.into(), &0.into()), "{result}");
    let adapter = report.components.iter().find(|component| component.name == "adapter").unwrap();
    assert_eq!(adapter.allocations, Some(0));
    // published positions are true from the first state on
    let truth = truth.samples();
    for sample in measured.samples() {
        let now = sample.stamp.source_time;
        let then = truth.iter().min_by_key(|truth| truth.stamp.publish_time.abs_diff(now)).unwrap();
        for (q, truth) in sample.value.position().iter().zip(then.value.position()) {
            assert!(
                (q - truth).abs() < 0.03,
                "{now}: {:?} {:?}",
                sample.value.position(),
                then.value.position()
            );
        }
    }
    let last = measured.values().pop().unwrap();
    for (q, goal) in last.position().iter().zip(GOAL) {
        assert!((q - goal).abs() < 0.2, "{:?}", last.position());
    }
    // nothing was enabled before, and the flags report the reason
    let first = health.values()[100];
    assert_eq!(
        first.flags[0] & (JointHealth::HOMING | JointHealth::NOT_HOMED),
        JointHealth::HOMING | JointHealth::NOT_HOMED
    );
    assert_eq!(first.flags[1] & (JointHealth::HOMING | JointHealth::NOT_HOMED), JointHealth::NOT_HOMED);
}

#[test]
fn an_emergency_stop_interrupts_a_homing() {
    let folder = Folder::new("homing-stopped", PLANAR);
    let truth = Probe::<JointState>::for_topic("arm/true_state");
    let stop =
        Source::new("button", "button", |tick| Some(EmergencyStop { stop: u64::from(tick.time() > 1.0) }));
    let safety = "emergency_stop = \"button\"";
    let report = graph(&folder, "", safety).with(stop).with(&truth).run("3 s").unwrap();
    let (result, drives) = (&report.results["adapter"], &report.results["drives"]["drives"]);
    assert_eq!(result["joints"]["joint1"]["homing"], "waiting", "{result}");
    assert_eq!(drives["joint1"]["enabled"], false, "{drives}");
    let at = |time: f64| {
        truth.samples().iter().find(|sample| sample.tick.time() >= time).unwrap().value.position()[0]
    };
    assert!(at(0.95) > at(0.5) + 0.3, "it was moving");
    assert!((at(2.9) - at(1.2)).abs() < 1e-3, "and rests: {} {}", at(1.2), at(2.9));
}

#[test]
fn commands_are_not_checked_while_an_arm_is_homed() {
    let folder = Folder::new("homing-judged", PLANAR);
    // far beyond all limits
    let wild = Source::new("commands", "arm/command", |_| {
        let mut wild = command();
        wild.velocity_mut().fill(50.0);
        Some(wild)
    });
    let report = bare_graph(&folder, "", "").kind::<CanAdapter>().with(wild).run("2 s").unwrap();
    let adapter = report.components.iter().find(|component| component.name == "adapter").unwrap();
    let gate = adapter.gate.as_ref().unwrap();
    assert_eq!((gate.state, gate.latch, gate.entries), (GateState::Safe, None, 0), "{gate:?}");
    assert!(gate.limited.is_empty() && gate.refused.is_empty(), "{gate:?}");
}

#[test]
fn a_homing_beyond_the_limits_of_its_joint_is_refused() {
    for (from, to, words) in [
        (
            "velocity = 1.5, effort = 12.0, position = 2.9",
            "velocity = 6.0, effort = 12.0, position = 2.9",
            "a velocity beyond the joint's limit, 5.000",
        ),
        (
            "effort = 12.0, position = 2.9",
            "effort = 21.0, position = 2.9",
            "an effort beyond the joint's limit, 20.000",
        ),
        (
            "position = 2.9",
            "position = 3.0",
            "it ends at 2.9500, outside the joint's range of -2.9000 to 2.9000",
        ),
    ] {
        let folder = Folder::new("homing-limits", &PLANAR.replacen(from, to, 1));
        let text = graph(&folder, "", "").check().unwrap_err().render(false);
        assert!(text.contains(words), "{text}");
    }
    let folder = Folder::new("homing-faults", PLANAR);
    let fault = r#"faults = [{ at = "1 s", kind = "no_mark", joint = "joint1" }]"#;
    let text = graph(&folder, fault, "").check().unwrap_err().render(false);
    assert!(text.contains("the drive of `joint1` does not home itself"), "{text}");
}

#[test]
fn a_stuck_switch_in_a_graph_trips_the_adapter_with_its_reason() {
    let folder = Folder::new("homing-stuck", PLANAR);
    let fault = r#"faults = [{ at = "0 s", kind = "stuck_mark", joint = "joint3" }]"#;
    let report = graph(&folder, fault, "").run("12 s").unwrap();
    let result = &report.results["adapter"];
    assert_eq!(result["tripped"], true, "{result}");
    assert_eq!(result["joints"]["joint3"]["homing"], "failed", "{result}");
    let fault = result["joints"]["joint3"]["homing_fault"].as_str().unwrap();
    assert!(fault.contains("is its switch stuck"), "{fault}");
    assert!(result["enabled_in_cycle"].is_null(), "{result}");
}
