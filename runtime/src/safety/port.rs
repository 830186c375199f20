//! The command gate of an actuator: the logic connected to its input, the run's latch and the statistics.

use motorium_drive::JointSetpoint;
use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use super::account::{Account as _, GroupAccount, NoAccount};
use super::emergency::{StopInput, StopSignal};
use super::freshness::{Age, Freshness, SuspendClock};
use super::gate::Gate;
use super::group::Group;
use super::limits::JointLimits;
use super::offer::{Measured, Offer, Verdict};
use crate::component::{ConfigureError, Setup};
use crate::context::{Access, Context};
use crate::os::{boottime_ns, monotonic_ns};
use crate::region::{Command, GateState, Latch, MissCause};
use crate::state::{JointCommand, MAX_JOINTS, Stamp};
use crate::transport::Input;

/// Number of cache lines of each part of a gate's memory that are prefetched before a step, enough for the
/// largest arm.
const GATE_LINES: usize = 12;

/// State of a gate as shown in the control block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Shown {
    state: GateState,
    latch: Option<Latch>,
    /// True if joints move that should be at rest or braking in the safe state.
    moves: bool,
    /// True if they still move after the time limit.
    unsettled: bool,
    /// True if the gate has been resuming for too long.
    late: bool,
}

/// The gate that checks the commands of an actuator at every step.
///
/// A command is only applied while it is fresh, valid and within the limits, and the run is neither stopping
/// nor latched. Otherwise the gate applies the safe state that the graph sets. These checks work even if all
/// other processes are dead. Each gate serves one command input; an actuator with two inputs needs two gates.
///
/// ```
/// use motorium::prelude::*;
/// use motorium::safety::{CommandGate, JointLimits, Measured};
///
/// struct Drive {
///     command: Input<JointCommand>,
///     gate: CommandGate,
///     position: [f64; 1],
///     velocity: [f64; 1],
/// }
///
/// impl Drive {
///     fn configure(setup: &mut Setup) -> Result<Self, ConfigureError> {
///         let elbow = JointLimits { velocity: 2.175, acceleration: 12.5, kp: 600.0, kd: 40.0, ..JointLimits::new("elbow") };
///         let gate = setup.command_gate(vec![elbow.with_effort(87.0)])?;
///         Ok(Self { command: setup.input("joint_command")?, gate, position: [0.0], velocity: [0.0] })
///     }
///
///     /// The effort to apply, N m.
///     fn effort(&mut self) -> f64 {
///         let mut gravity = |effort: &mut [f64]| effort.fill(0.0); // this joint stands upright
///         let measured = Measured { position: &self.position, velocity: &self.velocity, gravity: &mut gravity };
///         self.gate.check(&mut self.command, measured);
///         self.gate.setpoints()[0].effort_at(self.position[0], self.velocity[0], 87.0)
///     }
/// }
/// ```
#[derive(Debug)]
pub struct CommandGate {
    context: Rc<Context>,
    gate: Gate,
    freshness: Freshness,
    clock: SuspendClock,
    emergency_stop: Option<StopInput>,
    /// True once a command has been applied. From then on a stale command counts as a miss.
    armed: bool,
    /// Number of `motorium resume` commands that this gate has seen.
    resumes: u32,
    /// True from [`trip`](Self::trip) until the next resume.
    tripped: bool,
    /// Stamp of the command offered last.
    offered: Option<Stamp>,
    period_ns: u64,
    /// Time of the last step whose duration was computed, ns.
    stepped_ns: u64,
    /// Time of the last step in which a command was checked, ns. A step counts as one miss, regardless of the
    /// number of periods it catches up.
    checked_ns: u64,
    shown: Option<Shown>,
    /// True if the gate's memory is recorded among the lines that a step needs first.
    is_noted: bool,
    /// The gates of the same actuator, and this gate's index among them.
    group: Rc<Group>,
    place: usize,
    /// Copies of constants of the group: whether a stale command of another gate stops this one, and the
    /// index of the first joint among the actuator's joints.
    stops_together: bool,
    first_joint: usize,
}

impl Setup {
    /// Creates the gate of a command input. `joints` is in the order of the joints in each command. The
    /// component must have declared [`actuator`](crate::declare::Declare::actuator).
    ///
    /// # Errors
    /// There are no joints or more than [`MAX_JOINTS`], or the emergency-stop topic cannot be joined.
    pub fn command_gate(&mut self, joints: Vec<JointLimits>) -> Result<CommandGate, ConfigureError> {
        Ok(self.command_gates(vec![joints])?.swap_remove(0))
    }

    /// Creates the gates of an actuator that moves several robots: one gate per robot, each with its own
    /// command input. A stale command stops the robot that it is for, or all robots if the graph sets
    /// `[safety] stop_together`.
    ///
    /// # Errors
    /// Same as [`command_gate`](Self::command_gate), or all gates together have more than [`MAX_JOINTS`]
    /// joints.
    pub fn command_gates(
        &mut self,
        robots: Vec<Vec<JointLimits>>,
    ) -> Result<Vec<CommandGate>, ConfigureError> {
        let total: usize = robots.iter().map(Vec::len).sum();
        if robots.is_empty() || robots.iter().any(Vec::is_empty) || total > MAX_JOINTS {
            let message = format!("command gates for {total} joints, expected 1 to {MAX_JOINTS}");
            return Err(ConfigureError::failed(message));
        }
        self.context().block().gate.open(robots.iter().flatten().map(|joint| joint.name.as_str()));
        let group = Rc::new(Group::new(robots.iter().map(Vec::len), self.plan().safety.stop_together));
        let gates = robots.into_iter().enumerate();
        gates.map(|(place, joints)| self.gate_of(joints, group.clone(), place)).collect()
    }

    fn gate_of(
        &mut self,
        joints: Vec<JointLimits>,
        group: Rc<Group>,
        place: usize,
    ) -> Result<CommandGate, ConfigureError> {
        let emergency_stop = StopInput::open(self)?;
        let safety = self.plan().safety_of(self.component());
        let context = self.context().clone();
        let mut gate = Gate::new(joints, safety.gate);
        if context.restart_count() > 0 {
            // The robot was without its actuator. With `resume = "latch"` an operator must release it.
            gate.latch();
        }
        Ok(CommandGate {
            gate,
            freshness: Freshness::new(safety.stale_after_ns, safety.source_stale_after_ns),
            clock: SuspendClock::new(monotonic_ns(), boottime_ns()),
            emergency_stop,
            armed: false,
            resumes: context.region().header().resumes(),
            tripped: false,
            offered: None,
            period_ns: self.period().as_nanos().max(1) as u64,
            stepped_ns: 0,
            checked_ns: 0,
            shown: None,
            is_noted: false,
            context,
            stops_together: group.stops_together(),
            first_joint: group.first_joint(place),
            group,
            place,
        })
    }
}

impl CommandGate {
    /// Returns the setpoints that the drives apply in this step, one per joint.
    pub fn setpoints(&self) -> &[JointSetpoint] {
        self.gate.setpoints()
    }

    /// Returns the limits of all joints, in the order of the joints in each command.
    pub fn joints(&self) -> &[JointLimits] {
        self.gate.joints()
    }

    /// Returns the number of `motorium resume` commands seen so far. An actuator that latches itself, for
    /// example after a drive fault, releases its latch when this number changes.
    pub fn resumes(&self) -> u32 {
        self.resumes
    }

    /// Latches the gate: from the next check on, it stays in its safe state until `motorium resume`. Intended
    /// for faults that only the actuator knows, such as a drive fault. The run is shown as latched.
    pub fn trip(&mut self) {
        self.tripped = true;
    }

    /// Resets to the initial state for a new episode. The statistics of the run continue.
    pub fn reset(&mut self) {
        self.gate.reset();
        self.freshness.reset();
        self.emergency_stop.iter_mut().for_each(StopInput::reset);
        (self.armed, self.tripped) = (false, false);
        self.group.reset(self.place);
        self.context.block().gate.begin_episode();
        (self.offered, self.stepped_ns, self.checked_ns, self.shown) = (None, 0, 0, None);
    }

    /// Returns `true` while the gate is latched: it stays in its safe state until `motorium resume`, for
    /// example after a restart of the actuator with `resume = "latch"`. Motions that bypass the gate, such as
    /// homing, must wait until this returns `false`.
    pub fn is_latched(&self) -> bool {
        self.gate.is_latched()
    }

    /// Resets the gate after the joint positions were unknown, for example after homing. Keeps the latch,
    /// whereas [`reset`](Self::reset) clears it.
    pub fn relocate(&mut self) {
        let latched = self.gate.is_latched();
        self.reset();
        if latched {
            self.gate.latch();
        }
    }

    /// Applies the safe state without checking a command, and sets the [`setpoints`](Self::setpoints). Call
    /// this function instead of [`check`](Self::check) while the joint positions are unknown. Emergency stops
    /// and `motorium resume` take effect as in `check`.
    pub fn withhold(&mut self, measured: Measured<'_>) -> Verdict {
        let dt = self.step_time();
        let latch = self.latch();
        let verdict = self.gate.make_safe(measured, dt);
        self.show(latch, verdict);
        verdict
    }

    /// Notes which joints their drives held back in the last step because of the acceleration limit in the
    /// setpoint. The step lasted `dt` s and ended at `position`. Call this function before
    /// [`check_for`](Self::check_for) if the drives report this.
    #[inline]
    pub fn note_restrained(&mut self, restrained: &[bool], position: &[f64], dt: f64) {
        let account = GroupAccount::new(self.context.block(), self.first_joint);
        self.gate.note_restrained(restrained, position, dt, &account);
    }

    /// Checks the newest command and sets the [`setpoints`](Self::setpoints) of this step. Call this function
    /// once per step.
    pub fn check(&mut self, input: &mut Input<JointCommand>, measured: Measured<'_>) -> Verdict {
        let dt = self.step_time();
        self.check_for(input, measured, dt)
    }

    /// Same as [`check`](Self::check), but for a period of `dt` s of simulated time. An actuator that
    /// simulates several periods in one late step calls this function once per period.
    pub fn check_for(&mut self, input: &mut Input<JointCommand>, measured: Measured<'_>, dt: f64) -> Verdict {
        let stopping = self.context.is_stopping() || self.context.region().header().command() != Command::Run;
        let step_ns = self.context.clock().step_ns();
        let is_first = core::mem::replace(&mut self.checked_ns, step_ns) != step_ns;
        let latch = self.latch();
        let held = stopping || latch.is_some() || self.tripped;
        let verdict = if held { self.gate.make_safe(measured, dt) } else { self.offer(input, measured, dt) };
        match verdict {
            Verdict::Applied | Verdict::Resuming => self.armed = true,
            Verdict::Safe { .. } if is_first && self.armed && !held && !self.gate.is_latched() => {
                self.context.block().miss(MissCause::LateInput);
            }
            Verdict::Safe { .. } => {}
        }
        self.show(latch, verdict);
        verdict
    }

    /// Offers the newest command, if it is fresh.
    #[inline]
    fn offer(&mut self, input: &mut Input<JointCommand>, measured: Measured<'_>, dt: f64) -> Verdict {
        let step_ns = self.context.clock().step_ns();
        let Some(reading) = input.latest() else {
            self.group.set_good(self.place, false, step_ns);
            return self.gate.make_safe(measured, dt);
        };
        let stamp = reading.stamp();
        let before = self.offered.replace(stamp);
        let is_same = |before: &Stamp| {
            (before.sequence, before.publisher, before.restart_count)
                == (stamp.sequence, stamp.publisher, stamp.restart_count)
        };
        let is_new = !before.as_ref().is_some_and(is_same);
        let block = self.context.block();
        let clock = self.context.clock();
        let now_ns = if clock.is_lockstep() { clock.now_ns() } else { self.clock.now_ns(boottime_ns()) };
        let mut age = self.freshness.check(&stamp, now_ns);
        if age != Age::Fresh && !clock.is_lockstep() {
            let monotonic_ns = monotonic_ns();
            if self.clock.compare(monotonic_ns, boottime_ns()) {
                age = self.freshness.check(&stamp, monotonic_ns);
            }
        }
        if self.clock.is_from_before(stamp.publish_time) && !clock.is_lockstep() {
            age = Age::Stale;
        }
        let ahead_ns = before.map_or(0, |before| stamp.state_time.saturating_sub(before.state_time));
        let ahead = ahead_ns.min(self.freshness.stale_after_ns) as f64 * 1e-9;
        let offer = Offer { command: &reading, is_new, ahead };
        if self.stops_together {
            let good = age == Age::Fresh && self.gate.take(&offer, &NoAccount).is_ok();
            self.group.set_good(self.place, good, step_ns);
        }
        match age {
            Age::Fresh => {
                let account = GroupAccount::new(block, self.first_joint);
                if self.stops_together && self.group.holds(step_ns) {
                    if let Err(reason) = self.gate.take(&offer, &account)
                        && is_new
                    {
                        account.refused(reason);
                    }
                    return self.gate.make_safe(measured, dt);
                }
                let verdict = self.gate.offer(offer, measured, dt, &account);
                if account.has_refused.get() {
                    self.group.set_good(self.place, false, step_ns);
                }
                verdict
            }
            Age::Stale => self.gate.make_safe(measured, dt),
            Age::Refused(reason) => {
                if is_new {
                    block.refused(reason);
                }
                self.gate.make_safe(measured, dt)
            }
        }
    }

    /// Returns the time since the previous step, s, clamped to between half a period and the age at which a
    /// command is stale.
    #[inline]
    fn step_time(&mut self) -> f64 {
        let now_ns = self.context.clock().step_ns();
        let last_ns = core::mem::replace(&mut self.stepped_ns, now_ns);
        let elapsed_ns = if last_ns == 0 { self.period_ns } else { now_ns.saturating_sub(last_ns) };
        let longest_ns = self.freshness.stale_after_ns.max(self.period_ns);
        elapsed_ns.max(self.period_ns / 2).min(longest_ns) as f64 * 1e-9
    }

    /// Reads the emergency stop and returns the latch of the run.
    #[inline]
    fn latch(&mut self) -> Option<Latch> {
        let header = self.context.region().header();
        let mut awaited = None;
        if let Some(input) = &mut self.emergency_stop {
            match input.read(&self.context) {
                StopSignal::Released => {}
                StopSignal::Awaited => awaited = Some(Latch::EmergencyStop),
                StopSignal::Pressed => header.latch(Latch::EmergencyStop),
            }
        }
        let resumes = header.resumes();
        if resumes != self.resumes {
            (self.resumes, self.tripped) = (resumes, false);
            self.gate.release();
        }
        header.latched().or(awaited)
    }

    /// Writes changes of the state to the control block.
    #[inline]
    fn show(&mut self, latch: Option<Latch>, verdict: Verdict) {
        let safe = matches!(verdict, Verdict::Safe { .. });
        let state = if safe { GateState::Safe } else { self.gate.state() };
        let latch = latch.or((self.gate.is_latched() || self.tripped).then_some(Latch::SafeState));
        let shown = Shown {
            state,
            latch,
            moves: self.gate.is_moving_in_safe_state(),
            unsettled: !self.gate.is_safe_state_reached(),
            late: self.gate.is_resuming_late(),
        };
        if self.shown != Some(shown) {
            let before = self.shown.replace(shown);
            self.note_first_lines();
            self.write(shown, before, verdict);
        }
    }

    /// Records the memory of a common step among the lines that a step needs first, once the gate has its
    /// final address.
    fn note_first_lines(&mut self) {
        if core::mem::replace(&mut self.is_noted, true) {
            return;
        }
        let (lines, (bounds, setpoints)) = (self.context.first_lines(), self.gate.memory());
        lines.note_values(core::slice::from_ref(self), Access::Write, GATE_LINES);
        lines.note_values(bounds, Access::Read, GATE_LINES);
        lines.note_values(setpoints, Access::Write, GATE_LINES);
    }

    /// Writes the state to the control block.
    #[cold]
    #[inline(never)]
    fn write(&self, shown: Shown, before: Option<Shown>, verdict: Verdict) {
        let block = self.context.block();
        let (state, latch) = self.group.show(self.place, shown.state, shown.latch);
        // Before the state, so that no reader considers it reached too early.
        block.gate.set_moves(self.group.show_moves(self.place, shown.moves));
        if shown.unsettled && !before.is_some_and(|before| before.unsettled) {
            block.gate.count_unsettled();
        }
        if shown.late && !before.is_some_and(|before| before.late) {
            block.gate.count_late_resume();
        }
        block.gate.set(state, latch, self.context.clock().step_ns());
        // Set by this process, because its predecessor may have been killed in the safe state and left the
        // flag set.
        if let Verdict::Safe { entered: true, .. } = verdict {
            block.safe_since_ns.store(monotonic_ns(), Relaxed);
        }
        block.safe.store(u32::from(state == GateState::Safe), Relaxed);
    }
}
