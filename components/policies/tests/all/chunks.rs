//! `policy.joint_targets` with chunks that are late, lost, repeated, or end.

use motorium::component::{Component, ConfigureError, RunClock, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::state::ActionChunk;
use motorium::transport::Output;
use serde_json::Value;

use crate::joint_targets::{Seen, run};

/// Publishes chunks of 40 actions, 20 ms apart, that are sines with discontinuities. Stepped at 1 kHz.
pub(crate) struct ChunkProducer {
    chunk: Output<ActionChunk>,
    clock: RunClock,
    config: Config,
    random: u64,
    /// Chunks in transit: time of arrival, time of the first action, number, phase.
    pending: Vec<(u64, u64, u64, f64)>,
    sequence: u64,
}

/// The faults.
#[derive(serde::Deserialize, schemars::JsonSchema)]
pub(crate) struct Config {
    /// Longest delay, ms.
    delay: u64,
    /// Fraction of chunks that are lost, and fraction that are repeated.
    lost: f64,
    repeated: f64,
    /// Largest discontinuity in the phase of a chunk, rad.
    jump: f64,
    /// Time of the last chunk, ms.
    end: u64,
    seed: u64,
}

impl ChunkProducer {
    fn random(&mut self) -> f64 {
        self.random =
            self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.random >> 11) as f64 / (1_u64 << 53) as f64
    }
}

impl Component for ChunkProducer {
    const KIND: &'static str = "test.chunks";
    const SUMMARY: &'static str = "publishes chunks";
    type Config = Config;

    fn declare(_: &Config, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<ActionChunk>("chunk", "chunks");
        Ok(())
    }

    fn configure(config: Config, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let random = config.seed;
        let (chunk, clock) = (setup.output("chunk")?, setup.clock());
        Ok(Self { chunk, clock, config, random, pending: Vec::new(), sequence: 0 })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let now = tick.time_ns / 1_000_000;
        if now.is_multiple_of(200) && now <= self.config.end {
            self.sequence += 1;
            let delay = (self.random() * self.config.delay as f64) as u64;
            let phase = now as f64 * 3e-3 + (self.random() - 0.5) * self.config.jump;
            if self.random() >= self.config.lost {
                self.pending.push((now + delay, now, self.sequence, phase));
            }
            if self.random() < self.config.repeated {
                self.pending.push((now + delay + 30, now, self.sequence, phase));
            }
        }
        let Some(index) = self.pending.iter().position(|chunk| chunk.0 <= now) else { return Ok(()) };
        let (_, time, sequence, phase) = self.pending.swap_remove(index);
        let mut chunk = self.chunk.loan()?;
        chunk.time = self.clock.stamp_ns(time * 1_000_000);
        (chunk.period, chunk.width, chunk.sequence) = (20_000_000, 2, sequence);
        chunk.set_count(80);
        for (step, action) in chunk.value_mut().chunks_exact_mut(2).enumerate() {
            let angle = phase + step as f64 * 20.0 * 3e-3;
            action.copy_from_slice(&[0.5 * angle.sin(), 0.5 * angle.cos()]);
        }
        chunk.publish()
    }
}

const POLICY: &str = r#"
[component.policy.config.policy]
rate = 50.0
action = { joints = ["joint3", "joint1"], default_pose = [0.0, 0.0] }
"#;

fn play(faults: &str, chunks: &str, seconds: f64) -> (Value, Vec<Seen>) {
    let producer = format!("kind = \"test.chunks\"\nrate = \"1 kHz\"\nconfig = {{ {faults} }}");
    let config = format!("chunks = {chunks}\n{POLICY}");
    let (report, seen) = run(&producer, "chunk", &config, seconds);
    (report.results["policy"]["chunks"].clone(), seen)
}

/// The largest velocity and acceleration at the drives, from positions and from velocities.
fn extremes(seen: &[Seen]) -> (f64, f64) {
    let (mut velocity, mut acceleration) = (0.0_f64, 0.0_f64);
    for pair in seen.windows(3) {
        for joint in 0..3 {
            let step = |k: usize| (pair[k + 1].q[joint] - pair[k].q[joint]) * 1e3;
            assert!((step(1) - pair[2].v[joint]).abs() < 1e-6, "{pair:?}");
            velocity = velocity.max(step(1).abs());
            acceleration = acceleration.max((step(1) - step(0)).abs() * 1e3);
        }
    }
    (velocity, acceleration)
}

/// 0.9 times the arm's velocity limit, 5 rad/s, and the acceleration that reaches it in half a second.
/// Rounding errors of positions may make the velocities and accelerations computed from them exceed these
/// limits.
const LIMITS: (f64, f64) = (4.5 * (1.0 + 1e-9), 9.0);

#[test]
fn chunks_in_time_are_followed() {
    let (counts, seen) =
        play("delay = 0, lost = 0.0, repeated = 0.0, jump = 0.0, end = 9000, seed = 1", "{}", 5.0);
    let (velocity, acceleration) = extremes(&seen);
    assert!(velocity <= LIMITS.0 && acceleration <= LIMITS.1 * 1.001, "{velocity} {acceleration}");
    // the arm reads a command one step after its publication
    for seen in seen.iter().filter(|seen| seen.time > 1500) {
        let angle = (seen.time - 1) as f64 * 3e-3;
        assert!((seen.q[2] - 0.5 * angle.sin()).abs() < 0.01, "{seen:?}");
        assert!((seen.q[0] - 0.5 * angle.cos()).abs() < 0.02, "{seen:?}");
        assert_eq!(seen.q[1], 0.8);
    }
    assert_eq!((&counts["played"], &counts["late_actions"]), (&25.into(), &0.into()));
}

#[test]
fn late_lost_and_repeated_chunks_stay_within_limits() {
    for seed in 1..=5 {
        for (delay, jump) in [(400, 0.5), (400, 6.0), (150, 3.0)] {
            let faults = format!(
                "delay = {delay}, lost = 0.3, repeated = 0.3, jump = {jump:?}, end = 99000, seed = {seed}"
            );
            let (counts, seen) = play(&faults, "{ frozen = \"40 ms\", blend = \"120 ms\" }", 6.0);
            let (velocity, acceleration) = extremes(&seen);
            assert!(velocity <= LIMITS.0 && acceleration <= LIMITS.1 * 1.001, "{velocity} {acceleration}");
            assert!(counts["late_actions"].as_u64().unwrap() > 0, "{counts}");
            assert!(counts["played"].as_u64().unwrap() > 8, "{counts}");
        }
    }
}

#[test]
fn arm_rests_when_its_producer_dies() {
    // the last chunk begins at 2 s, and ends 780 ms later
    let faults = "delay = 100, lost = 0.0, repeated = 0.0, jump = 0.0, end = 2000, seed = 3";
    let (_, seen) = play(faults, "{}", 5.0);
    let (velocity, acceleration) = extremes(&seen);
    assert!(velocity <= LIMITS.0 && acceleration <= LIMITS.1 * 1.001, "{velocity} {acceleration}");
    // 4.5 rad/s are braked in 0.5 s
    let rest: Vec<&Seen> = seen.iter().filter(|seen| seen.time > 2780 + 30 + 1000).collect();
    assert!(rest.iter().all(|seen| seen.v.iter().all(|v| v.abs() < 1e-9)), "{:?}", rest[0]);
    let angle = (2000.0 + 780.0) * 3e-3_f64;
    assert!((rest[0].q[2] - 0.5 * angle.sin()).abs() < 1e-6, "{:?} {angle}", rest[0]);
}
