//! Joint commands before the first and after the last recorded command. They move a robot to the start pose
//! and bring it to rest, within its joint limits.

use motorium::declare::RobotReference;
use motorium::state::{JointCommand, JointState, StateBuffer as _, from_bytes};
use motorium::units::TimeSpan;

use crate::foxglove::load_robot;

/// Used fraction of a joint's velocity and acceleration limits, as in the recovery from a safe state.
const SHARE: f64 = 0.5;
/// Time in which a joint without an acceleration limit reaches its velocity limit, s, as in its command gate.
const TO_SPEED: f64 = 0.2;
/// Largest velocity and acceleration of the minimum-jerk quintic, for a distance of 1 in a time of 1.
const QUINTIC: [f64; 2] = [1.875, 5.773_502_691_896_258];

/// The limits of a joint.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rates {
    name: String,
    /// Largest velocity, rad/s or m/s.
    velocity: f64,
    /// Largest acceleration, rad/s^2 or m/s^2.
    acceleration: f64,
}

/// Error of moving a robot to the start pose of a recording, or of bringing it to rest afterwards.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum EaseError {
    /// The robot's files can no longer be read.
    #[error("the limits of robot `{robot}` are unknown: {reason}")]
    Robot { robot: String, reason: String },
    /// A recorded command has no stiffness.
    #[error(
        "the recorded commands have no stiffness at joint `{joint}` (kp = 0), and a robot cannot reach its start pose by efforts alone; \
         replay them unchanged with `--ease-in \"0 s\"`"
    )]
    Limp { joint: String },
    /// The number of measured joints differs from the number of commanded joints, so the states and the
    /// commands belong to different robots.
    #[error("{measured} joints are measured, but the recorded commands have {commanded}")]
    Joints { measured: usize, commanded: usize },
    /// The start pose is too far away for the available time.
    #[error(
        "joint `{joint}` is {distance:.3} from the first recorded command, and the approach takes {needed} within half of its limits \
         ({velocity:.3} and {acceleration:.3} per second), but only {given} are left; raise `--ease-in`"
    )]
    Far { joint: String, distance: f64, needed: TimeSpan, given: TimeSpan, velocity: f64, acceleration: f64 },
    /// The last command is too fast to come to rest in the available time.
    #[error(
        "joint `{joint}` moves at {velocity:.3} per second in the last recorded command, and coming to rest takes {needed} within \
         half of its limits, but only {given} are available; raise `--ramp-down`"
    )]
    Fast { joint: String, velocity: f64, needed: TimeSpan, given: TimeSpan },
}

/// The limits of the joints of a robot, in the order of its joint commands.
pub(super) fn rates(robot: &RobotReference) -> Result<Vec<Rates>, EaseError> {
    let wrong = |reason: String| EaseError::Robot { robot: robot.name.clone(), reason };
    let loaded = load_robot(robot).map_err(|error| wrong(error.to_string()))?;
    let model = &loaded.model;
    let of_profile = loaded.profile.as_ref().map(|profile| profile.acceleration_limit(model));
    let of_profile = of_profile.transpose().map_err(|error| wrong(error.to_string()))?;
    let of_joint = |(joint, name): (usize, &String)| {
        let velocity = model.velocity_limit()[joint];
        let known = of_profile.as_ref().map_or(f64::INFINITY, |limits| limits[joint]);
        let acceleration = if known.is_finite() { known } else { velocity / TO_SPEED };
        Rates { name: name.clone(), velocity, acceleration }
    };
    Ok(model.joint_names().iter().enumerate().map(of_joint).collect())
}

/// Command and its due time, ns.
type Due = (JointCommand, u64);

/// The first and the last command of an episode.
struct Ends {
    first: Due,
    last: Due,
    /// Recorded bytes of both commands.
    bytes: [Vec<u8>; 2],
    /// Deceleration time, s.
    ramp: f64,
}

/// Commands outside the recording: approach to its start and deceleration after its end.
pub(super) struct Ease {
    rates: Vec<Rates>,
    /// First and last command of each episode; `None` for an episode without commands.
    episodes: Vec<Option<Ends>>,
    episode: usize,
    /// Measured joint state at the start of the episode, and its time, ns.
    start: Option<(JointState, u64)>,
    /// Offsets of position, velocity and effort.
    offsets: [usize; 3],
    bytes: Vec<u8>,
    /// Number of commands generated so far.
    pub(super) made: u64,
}

impl Ease {
    /// Creates the commands for joints with these limits; `None` if the commands are not for joints.
    pub(super) fn new(rates: Vec<Rates>) -> Option<Self> {
        let layout = JointCommand::layout();
        let offset =
            |name: &str| layout.fields.iter().find(|field| field.name == name).map(|field| field.offset);
        let offsets = [offset("position")?, offset("velocity")?, offset("effort")?];
        let bytes = vec![0; layout.size];
        Some(Self { rates, episodes: Vec::new(), episode: 0, start: None, offsets, bytes, made: 0 })
    }

    /// Adds an episode with its first and last command, their due times \[ns\], and the deceleration time.
    pub(super) fn push(
        &mut self,
        ends: Option<[(&[u8], u64); 2]>,
        ramp_down: TimeSpan,
    ) -> Result<(), EaseError> {
        let read = |(bytes, due_ns): (&[u8], u64)| Some((from_bytes::<JointCommand>(bytes)?, due_ns));
        let ends = ends.and_then(|[first, last]| {
            Some(([read(first)?, read(last)?], [first.0.to_vec(), last.0.to_vec()]))
        });
        let Some(([first, last], bytes)) = ends else {
            self.episodes.push(None);
            return Ok(());
        };
        let mut ramp: f64 = 0.0;
        for joint in 0..first.0.position().len() {
            if [&first, &last].iter().any(|(command, _)| command.kp().get(joint).is_none_or(|kp| *kp <= 0.0))
            {
                return Err(EaseError::Limp { joint: self.name(joint) });
            }
            let velocity = last.0.velocity().get(joint).copied().unwrap_or(0.0);
            let needed = self.rates.get(joint).map_or(0.0, |it| velocity.abs() / (SHARE * it.acceleration));
            if needed > ramp_down.as_secs_f64() {
                let (joint, needed) = (self.name(joint), rounded_up(needed));
                return Err(EaseError::Fast { joint, velocity, needed, given: ramp_down });
            }
            ramp = ramp.max(needed);
        }
        self.episodes.push(Some(Ends { first, last, bytes, ramp }));
        Ok(())
    }

    fn name(&self, joint: usize) -> String {
        self.rates.get(joint).map_or_else(|| joint.to_string(), |it| it.name.clone())
    }

    fn ends(&self) -> Option<&Ends> {
        self.episodes.get(self.episode)?.as_ref()
    }

    /// Resets to the start of an episode.
    pub(super) fn reset(&mut self, episode: u64) {
        self.episode = usize::try_from(episode).unwrap_or(usize::MAX);
        self.start = None;
    }

    /// Returns `true` until a joint state has been measured as the start.
    pub(super) fn needs_start(&self) -> bool {
        self.start.is_none()
    }

    /// Returns `true` before the first command and after the last.
    pub(super) fn is_due(&self, time_ns: u64) -> bool {
        self.ends().is_some_and(|ends| time_ns < ends.first.1 || time_ns > ends.last.1)
    }

    /// Starts from a measured joint state, and its time \[ns\].
    pub(super) fn begin(&mut self, measured: &[u8], time_ns: u64) -> Result<(), EaseError> {
        let (Some(start), Some(ends)) = (from_bytes::<JointState>(measured), self.ends()) else {
            return Ok(());
        };
        let (from, to) = (start.position(), ends.first.0.position());
        if from.len() < to.len() {
            return Err(EaseError::Joints { measured: from.len(), commanded: to.len() });
        }
        let given = ends.first.1.saturating_sub(time_ns);
        for (joint, rates) in self.rates.iter().enumerate().take(to.len()) {
            let distance = (to[joint] - from[joint]).abs();
            let (velocity, acceleration) = (SHARE * rates.velocity, SHARE * rates.acceleration);
            let needed =
                (QUINTIC[0] * distance / velocity).max((QUINTIC[1] * distance / acceleration).sqrt());
            if needed > given as f64 * 1e-9 {
                let (joint, needed) = (rates.name.clone(), rounded_up(needed));
                let given = TimeSpan { ns: given };
                return Err(EaseError::Far { joint, distance, needed, given, velocity, acceleration });
            }
        }
        self.start = Some((start, time_ns));
        Ok(())
    }

    /// Returns the command at a time outside the recording. Before the first command it follows a
    /// minimum-jerk quintic from the measured pose; after the last one the velocity falls to zero. `None`
    /// while the pose is unknown.
    pub(super) fn command(&mut self, time_ns: u64) -> Option<&[u8]> {
        let Self { episodes, episode, start, offsets, bytes, .. } = self;
        let Ends { first, last, bytes: ends, ramp } = episodes.get(*episode)?.as_ref()?;
        let (start, began_ns) = start.as_ref()?;
        let [position, velocity, effort] = *offsets;
        if time_ns < first.1 {
            let duration = first.1.saturating_sub(*began_ns) as f64 * 1e-9;
            let passed = time_ns.saturating_sub(*began_ns) as f64 * 1e-9;
            let (share, rate) = quintic(passed / duration);
            bytes.copy_from_slice(&ends[0]);
            for (joint, goal) in first.0.position().iter().enumerate() {
                let from = start.position()[joint];
                put(bytes, position, joint, from + share * (goal - from));
                put(bytes, velocity, joint, rate * (goal - from) / duration);
                put(bytes, effort, joint, share * first.0.effort().get(joint).copied().unwrap_or(0.0));
            }
        } else {
            let passed = time_ns.saturating_sub(last.1) as f64 * 1e-9;
            bytes.copy_from_slice(&ends[1]);
            for (joint, from) in last.0.position().iter().enumerate() {
                let (way, left) = coast(last.0.velocity().get(joint).copied().unwrap_or(0.0), passed, *ramp);
                put(bytes, position, joint, from + way);
                put(bytes, velocity, joint, left);
            }
        }
        self.made += 1;
        Some(&self.bytes)
    }
}

/// Rounds a time up to hundredths of a second for a message.
fn rounded_up(seconds: f64) -> TimeSpan {
    TimeSpan { ns: (seconds * 1e2).ceil() as u64 * 10_000_000 }
}

/// Writes an entry of an array of a command.
fn put(bytes: &mut [u8], offset: usize, entry: usize, value: f64) {
    let from = offset + entry * size_of::<f64>();
    if let Some(place) = bytes.get_mut(from..from + size_of::<f64>()) {
        place.copy_from_slice(&value.to_ne_bytes());
    }
}

/// Returns the minimum-jerk quintic from 0 to 1, and its slope, at the fraction `part` of its duration.
fn quintic(part: f64) -> (f64, f64) {
    let t = part.clamp(0.0, 1.0);
    (t.powi(3) * (10.0 + t * (6.0 * t - 15.0)), 30.0 * (t * (1.0 - t)).powi(2))
}

/// Returns the distance covered and the velocity after `passed` of a uniform deceleration to zero that lasts
/// `within`.
fn coast(velocity: f64, passed: f64, within: f64) -> (f64, f64) {
    if within <= 0.0 {
        return (0.0, 0.0);
    }
    let passed = passed.min(within);
    (velocity * (passed - 0.5 * passed * passed / within), velocity * (1.0 - passed / within))
}

#[cfg(test)]
#[path = "ease_tests.rs"]
mod tests;
