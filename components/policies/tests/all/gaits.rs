//! Every gait of every pattern generator on every legged robot of the catalogue.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::Path;

use crate::support;
use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::state::{JointCommand, JointState};
use motorium::transport::{Input, Output};
use motorium::worker::Kind;
use motorium_policies::CpgPolicy;
use motorium_primitives::cpg::Gait;
use motorium_robots::load;
use serde_json::json;

/// A robot that follows its setpoints immediately, and observes how its joints swing in the last seconds.
struct Legged {
    command: Input<JointCommand>,
    state: Output<JointState>,
    config: LeggedConfig,
    q: Vec<f64>,
    v: Vec<f64>,
    swings: Vec<ObservedMotion>,
    leap: f64,
    effort: Vec<f64>,
}

#[derive(Clone, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct LeggedConfig {
    /// Joint positions of the standing robot.
    q: Vec<f64>,
    /// Start of the observation, s.
    from: f64,
    /// Strides per second.
    frequency: f64,
}

/// Observed motion of a joint.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
struct ObservedMotion {
    low: f64,
    high: f64,
    speed: f64,
    /// Component of the first harmonic.
    real: f64,
    imaginary: f64,
}

#[derive(Debug, serde::Serialize, serde::Deserialize)]
struct Seen {
    swings: Vec<ObservedMotion>,
    leap: f64,
    effort: Vec<f64>,
}

impl Component for Legged {
    const KIND: &'static str = "test.legged";
    const SUMMARY: &'static str = "a robot that follows its setpoints immediately";
    type Config = LeggedConfig;

    fn declare(_: &LeggedConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.input::<JointCommand>("joint_command", "setpoints");
        declare.output::<JointState>("joint_state", "joint positions");
        Ok(())
    }

    fn configure(config: LeggedConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let joints = config.q.len();
        let nowhere = ObservedMotion { low: f64::MAX, high: f64::MIN, ..ObservedMotion::default() };
        Ok(Self {
            command: setup.input("joint_command")?,
            state: setup.output("joint_state")?,
            q: config.q.clone(),
            v: vec![0.0; joints],
            swings: vec![nowhere; joints],
            leap: 0.0,
            effort: vec![0.0; joints],
            config,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let time = tick.time_ns as f64 * 1e-9;
        if let Some(command) = self.command.latest() {
            let angle = TAU * self.config.frequency * time;
            for (j, swing) in self.swings.iter_mut().enumerate() {
                let (q, v) = (command.position()[j], command.velocity()[j]);
                self.leap = self.leap.max((q - self.q[j]).abs());
                (self.q[j], self.v[j]) = (q, v);
                self.effort[j] = command.effort()[j];
                // the limits hold from the start
                swing.low = swing.low.min(q);
                swing.high = swing.high.max(q);
                swing.speed = swing.speed.max(v.abs());
                if time >= self.config.from {
                    swing.real += q * angle.cos();
                    swing.imaginary -= q * angle.sin();
                }
            }
        }
        let mut state = self.state.loan()?;
        state.set_count(self.q.len());
        state.position_mut().copy_from_slice(&self.q);
        state.velocity_mut().copy_from_slice(&self.v);
        state.effort_mut().fill(0.0);
        state.publish()
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(json!(Seen { swings: self.swings.clone(), leap: self.leap, effort: self.effort.clone() }))
    }
}

/// A robot, and the forward-swinging joints of a leg, given by the ends of their names and their phase lead
/// over the leg.
struct Walker {
    robot: &'static str,
    legs: &'static [&'static str],
    joints: &'static [(&'static str, f64)],
}

const WALKERS: [Walker; 6] = [
    Walker {
        robot: "quadruped",
        legs: &["front_left", "front_right", "hind_left", "hind_right"],
        joints: &[("hip_pitch", 0.0), ("knee", FRAC_PI_2)],
    },
    Walker {
        robot: "hexapod",
        legs: &["front_left", "front_right", "middle_left", "middle_right", "hind_left", "hind_right"],
        joints: &[("coxa", 0.0), ("femur", FRAC_PI_2)],
    },
    Walker { robot: "planar-biped", legs: &["left", "right"], joints: &[("hip", 0.0), ("knee", FRAC_PI_2)] },
    Walker {
        robot: "biped",
        legs: &["left", "right"],
        joints: &[("hip_pitch", 0.0), ("knee", FRAC_PI_2), ("ankle_pitch", 1.0)],
    },
    Walker {
        robot: "humanoid",
        legs: &["left", "right"],
        joints: &[("hip_pitch", 0.0), ("knee", FRAC_PI_2), ("ankle_pitch", 1.0)],
    },
    Walker {
        robot: "centaur",
        legs: &["front_left", "front_right", "hind_left", "hind_right"],
        joints: &[("hip_pitch", 0.0), ("knee_pitch", FRAC_PI_2)],
    },
];

const AMPLITUDE: f64 = 0.15;
const FREQUENCY: f64 = 2.0;
/// Settling time, and whole strides to observe, s.
const FROM: f64 = 3.0;
const LOOK: f64 = 2.0;

/// Difference between angles, rad.
fn apart(a: f64, b: f64) -> f64 {
    let d = (a - b).rem_euclid(TAU);
    d.min(TAU - d)
}

/// Walks, and checks the swinging joints' lags, amplitudes and limits. `tolerance` is the tolerance of the
/// lags, rad.
fn walk(walker: &Walker, model: &str, gait: Gait, tolerance: f64) {
    let Walker { robot, legs, joints } = walker;
    let what = format!("{robot}, {model}, {gait:?}");
    let loaded = load(robot, Path::new(".")).unwrap();
    let home = loaded.profile.as_ref().unwrap().home(&loaded.model).unwrap();
    let index = |leg: &str, joint: &str| {
        let name = format!("{leg}_{joint}");
        loaded.model.joint_index(&name).unwrap_or_else(|| panic!("{robot} has no {name}"))
    };
    let table: Vec<_> = legs
        .iter()
        .map(|leg| {
            let swings = joints.iter().map(|(joint, phase)| {
                let offset = home[index(leg, joint)];
                json!({ "joint": format!("{leg}_{joint}"), "amplitude": AMPLITUDE, "offset": offset, "phase": phase })
            });
            json!({ "joints": swings.collect::<Vec<_>>() })
        })
        .collect();
    let graph = json!({
        "name": "gait",
        "clock": "lockstep",
        "duration": format!("{} ms", ((FROM + LOOK) * 1e3).round()),
        "robot": { "walker": { "urdf": robot } },
        "component": {
            "robot": {
                "kind": "test.legged",
                "rate": "500 Hz",
                "subscribe": { "joint_command": "walker/joint_command" },
                "publish": { "joint_state": "walker/joint_state" },
                "config": { "q": home.as_slice(), "from": FROM, "frequency": FREQUENCY },
            },
            "policy": {
                "kind": "policy.cpg",
                "robot": "walker",
                "trigger": "walker/joint_state",
                "subscribe": { "joint_state": "walker/joint_state" },
                "publish": { "joint_command": "walker/joint_command" },
                "config": { "model": model, "gait": gait, "frequency": FREQUENCY, "legs": table },
            },
        },
    });
    let text = toml::to_string(&graph).unwrap();
    let report = support::run(Path::new("gait.toml"), text, [Kind::of::<Legged>(), Kind::of::<CpgPolicy>()]);
    assert_eq!(support::faults(&report), (Some(0), 0), "{what}");
    assert_eq!(report.results["policy"]["model"], model);
    let seen: Seen = serde_json::from_value(report.results["robot"].clone()).unwrap();

    // 2 Hz and 0.15 rad: no faster than 1.9 rad/s, and twice as fast if a cycle is far from harmonic
    assert!(seen.leap < 2.0 * TAU * FREQUENCY * AMPLITUDE / 500.0, "{what}: a jump of {} rad", seen.leap);
    let phases = gait.phases(legs.len()).unwrap();
    let angle = |joint: usize| seen.swings[joint].imaginary.atan2(seen.swings[joint].real);
    let reference = angle(index(legs[0], joints[0].0));
    let mut swinging = Vec::new();
    for (leg, phase) in legs.iter().zip(phases) {
        for (joint, ahead) in *joints {
            let j = index(leg, joint);
            swinging.push(j);
            let swing = &seen.swings[j];
            let reach = 0.5 * (swing.high - swing.low);
            assert!((reach / AMPLITUDE - 1.0).abs() < 0.04, "{what}: {leg} {joint} swings by {reach}");
            let lag = apart(angle(j) - reference, phase + ahead);
            assert!(lag < tolerance, "{what}: {leg} {joint} has a lag error of {lag} rad");
        }
    }
    for (j, swing) in seen.swings.iter().enumerate() {
        let (low, high) = (loaded.model.lower()[j], loaded.model.upper()[j]);
        let name = &loaded.model.joint_names()[j];
        assert!(swing.low >= low && swing.high <= high, "{what}: {name} leaves its limits: {swing:?}");
        assert!(swing.speed <= loaded.model.velocity_limit()[j], "{what}: {name} is too fast: {swing:?}");
        if !swinging.contains(&j) {
            assert_eq!((swing.low, swing.high), (home[j], home[j]), "{what}: {name} must not move");
        }
    }
    let passive = &loaded.profile.as_ref().unwrap().passive;
    for (name, effort) in loaded.model.joint_names().iter().zip(&seen.effort) {
        assert!(effort.is_finite() && (*effort == 0.0 || !passive.contains(name)), "{what}: {name} {effort}");
    }
}

#[test]
fn every_gait_walks_on_every_legged_robot() {
    for walker in &WALKERS {
        for gait in Gait::for_legs(walker.legs.len()) {
            walk(walker, "phase", *gait, 0.01);
        }
    }
}

#[test]
fn kuramoto_phases_walk_on_every_legged_robot() {
    WALKERS.iter().for_each(|walker| walk(walker, "kuramoto", Gait::Walk, 0.01));
}

#[test]
fn hopf_oscillators_walk_on_every_legged_robot() {
    WALKERS.iter().for_each(|walker| walk(walker, "hopf", Gait::Walk, 0.05));
}

#[test]
fn neuron_pairs_walk_on_every_legged_robot() {
    WALKERS.iter().for_each(|walker| walk(walker, "matsuoka", Gait::Walk, 0.05));
}

#[test]
fn a_joint_of_another_robot_is_refused_with_its_key() {
    let legs = json!([{ "joints": [{ "joint": "left_hip", "amplitude": 0.1 }] }, { "joints": [{ "joint": "right_hip", "amplitude": 0.1 }] }]);
    let config = json!({ "model": "hopf", "gait": "walk", "legs": legs });
    let error = support::refusal::<CpgPolicy>(config, Some("quadruped"), Path::new("."));
    assert_eq!(error.key.as_deref(), Some("legs[0].joints[0].joint"));
}

#[test]
fn model_numbers_are_checked_and_other_models_refused() {
    let leg = |joint: &str| json!({ "joints": [{ "joint": joint, "amplitude": 0.1 }] });
    let refused = |more: serde_json::Value| {
        let mut config = json!({ "gait": "walk", "legs": [leg("left_hip"), leg("right_hip")] });
        config.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        let error = support::refusal::<CpgPolicy>(config, Some("planar-biped"), Path::new("."));
        (error.key.unwrap(), error.message)
    };
    let (key, message) = refused(json!({ "hopf": {} }));
    assert_eq!(
        (key.as_str(), message.as_str()),
        ("hopf", "`model` is \"phase\", which does not use these settings")
    );
    let (key, message) = refused(json!({ "model": "hopf", "hopf": { "duty_factor": 1.0 } }));
    assert_eq!(
        (key.as_str(), message.as_str()),
        ("hopf", "duty_factor = 1: expected a number from 0.05 to 0.95")
    );
    let (key, message) = refused(json!({ "model": "matsuoka", "matsuoka": { "inhibition": 4.0 } }));
    assert!(key == "matsuoka" && message.contains("for the pair to oscillate"), "{message}");
}
