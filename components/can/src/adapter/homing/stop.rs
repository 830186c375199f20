//! Homing of a joint at its mechanical stop.
//!
//! The joint moves towards the stop with the effort allowed at the stop. It comes to rest, backs off, and
//! comes to rest a second time at the same position. A joint that does not back off is jammed, or its brake
//! is engaged. A joint that comes to rest at two different positions has hit a movable obstacle. A joint
//! stopped only by its own weight also comes to rest at the same position, but sinks back when its effort is
//! halved.

use crate::protocols::entries::HomingEntry;
use crate::protocols::homing_fault::HomingFault;

/// Length of the window in which motion is detected, ns.
const WINDOW_NS: u64 = 200_000_000;
/// Consecutive windows without motion after which the joint is at rest.
const STILL_WINDOWS: u32 = 2;
/// Fraction of the commanded velocity below which a joint counts as at rest. Even a heavy joint accelerates
/// beyond it within the windows.
pub(crate) const STILL: f64 = 0.03;
/// Multiple of the commanded velocity beyond which the joint counts as running away.
pub(crate) const RUNAWAY: f64 = 5.0;
/// Largest difference between the two stop positions, as a fraction of the back-off distance.
const REPEATS_WITHIN: f64 = 0.4;
/// Fraction of the effort at which the joint has to stay at the stop.
pub(crate) const EASED: f64 = 0.5;
/// Largest distance that the joint may yield at that effort, as a fraction of the distance covered in a
/// window at the commanded velocity.
const GIVES_WITHIN: f64 = 0.2;

/// Stage of a homing at a stop. Positions are joint positions without the offset.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// Towards the stop.
    Approach,
    /// Away from the stop, from this position.
    BackOff(f64),
    /// Towards the stop again, which was first found at this position.
    ApproachAgain(f64),
    /// Against the stop with half of the effort, from this position. A joint stopped only by its weight sinks
    /// back.
    Ease(f64),
    /// Finally away from the stop.
    Leave(f64),
}

/// Homing at the mechanical stop of a joint.
#[derive(Clone, Debug)]
pub(in crate::adapter) struct Stop {
    velocity: f64,
    /// Velocity gain that yields the allowed effort at standstill against the stop.
    kd: f64,
    /// Position of the joint at the stop.
    pub(in crate::adapter) position: f64,
    back_off: f64,
    stage: Stage,
    /// `true` if the drive follows commands.
    pub(in crate::adapter) is_enabled: bool,
    window_ns: u64,
    from: Option<f64>,
    still: u32,
}

/// Outcome of one cycle of a homing at a stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::adapter) enum Outcome {
    /// The homing continues.
    Moving,
    /// The stop was found at this position, and the joint has backed off.
    Found(f64),
    /// The homing failed.
    Failed(HomingFault),
}

impl Stop {
    pub(super) fn from_entry(entry: &HomingEntry) -> Self {
        // the table has been checked
        let velocity = entry.velocity.unwrap_or(1.0);
        Self {
            velocity,
            kd: entry.effort.unwrap_or_default() / velocity.abs(),
            position: entry.position.unwrap_or_default(),
            back_off: entry.back_off(),
            stage: Stage::Approach,
            is_enabled: false,
            window_ns: 0,
            from: None,
            still: 0,
        }
    }

    pub(super) fn begin(&mut self) {
        (self.stage, self.is_enabled) = (Stage::Approach, false);
        self.begin_window(None);
        self.still = 0;
    }

    fn begin_window(&mut self, from: Option<f64>) {
        (self.window_ns, self.from) = (0, from);
    }

    fn enter(&mut self, stage: Stage) {
        (self.stage, self.still) = (stage, 0);
        self.begin_window(None);
    }

    fn direction(&self) -> f64 {
        match self.stage {
            Stage::Approach | Stage::ApproachAgain(_) | Stage::Ease(_) => self.velocity.signum(),
            Stage::BackOff(_) | Stage::Leave(_) => -self.velocity.signum(),
        }
    }

    /// Returns the velocity to command to a joint with this measured velocity, and the velocity gain;
    /// together they never exceed the allowed effort.
    pub(in crate::adapter) fn command(&self, measured: f64) -> (f64, f64) {
        let most = self.velocity.abs();
        let share = if matches!(self.stage, Stage::Ease(_)) { EASED } else { 1.0 };
        ((self.direction() * most).clamp(measured - most, measured + most), share * self.kd)
    }

    /// Processes a cycle that ends with the joint at this position.
    pub(in crate::adapter) fn step(&mut self, position: f64, cycle_ns: u64) -> Outcome {
        let forward = (position - self.from.unwrap_or(position)) * self.direction();
        if let Stage::BackOff(from) | Stage::Leave(from) = self.stage
            && (from - position) * self.velocity.signum() >= self.back_off
        {
            match self.stage {
                Stage::Leave(_) => return Outcome::Found(from),
                _ => self.enter(Stage::ApproachAgain(from)),
            }
            return Outcome::Moving;
        }
        if let Stage::Ease(from) = self.stage {
            let moved = (position - from) * self.velocity.signum();
            let most = GIVES_WITHIN * self.velocity.abs() * WINDOW_NS as f64 * 1e-9;
            if moved < -most {
                return Outcome::Failed(HomingFault::Balanced);
            } else if moved > most {
                return Outcome::Failed(HomingFault::Ambiguous(moved));
            }
        }
        if self.from.is_none() {
            self.begin_window(Some(position));
            return Outcome::Moving;
        }
        self.window_ns += cycle_ns;
        let share = |time_ns: u64| forward / (self.velocity.abs() * time_ns as f64 * 1e-9);
        // a runaway is detected as soon as the joint has moved farther than a whole window allows
        let gone = share(WINDOW_NS.max(self.window_ns)).abs();
        if gone > RUNAWAY {
            return Outcome::Failed(HomingFault::Runaway(share(self.window_ns).abs()));
        }
        if self.window_ns < WINDOW_NS {
            return Outcome::Moving;
        }
        let share = share(self.window_ns);
        self.begin_window(Some(position));
        self.still = if share.abs() < STILL { self.still + 1 } else { 0 };
        if self.still < STILL_WINDOWS {
            return Outcome::Moving;
        }
        match self.stage {
            Stage::Approach => self.enter(Stage::BackOff(position)),
            Stage::BackOff(_) | Stage::Leave(_) => return Outcome::Failed(HomingFault::Jammed),
            Stage::ApproachAgain(first) => {
                let apart = (position - first).abs();
                if apart > REPEATS_WITHIN * self.back_off {
                    return Outcome::Failed(HomingFault::Ambiguous(apart));
                }
                self.enter(Stage::Ease(position));
            }
            Stage::Ease(_) => self.enter(Stage::Leave(position)),
        }
        Outcome::Moving
    }
}
