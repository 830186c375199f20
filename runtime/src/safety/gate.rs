//! The command gate as pure logic: limits, safe states and recovery, without ports and processes.

use motorium_drive::JointSetpoint;

use super::account::Account;
use super::arrival::Arrivals;
use super::limits::{Before, Bounds, JointLimits, SLOWEST_LIMIT};
use super::offer::{Measured, Offer, Verdict};
use super::rest::{Rest, Reversals};
use super::resume::Resume;
use super::states::{Joint, enter, soften, stay};
use super::within::Envelope;
use crate::plan::{GateRules, LimitPolicy, ResumeRule, SafeState};
use crate::region::{GateState, LimitKind, Refusal};
use crate::state::Field as _;

/// Minimum time for which the positions of a late command are extrapolated with its velocities, s. Without
/// extrapolation a late command would brake the robot harder than any safe state.
const GOES_ON_FOR: f64 = 0.02;

/// Fraction of the velocity limits available to a command plus its fading difference.
const FADING_SHARE: f64 = 0.95;

/// The command gate of one actuator, a state machine over its joints.
///
/// In each step, the actuator passes the newest fresh command to [`offer`](Self::offer), or calls
/// [`make_safe`](Self::make_safe) if there is no fresh command. The drives then apply
/// [`setpoints`](Self::setpoints). A command within all limits is forwarded bit for bit. Until the next
/// command arrives, its positions are extrapolated with its velocities.
///
/// ```
/// use motorium::plan::{GateRules, LimitPolicy, ResumeRule, SafeState};
/// use motorium::safety::{Account, Gate, JointLimits, Measured, Verdict};
///
/// let elbow = JointLimits { kp: 600.0, kd: 40.0, ..JointLimits::new("elbow") }.with_effort(87.0);
/// let rules =
///     GateRules { safe_state: SafeState::Hold, limits: LimitPolicy::Clamp, resume: ResumeRule::Near };
/// let mut gate = Gate::new(vec![elbow], rules);
/// let mut gravity = |effort: &mut [f64]| effort.fill(21.0);
/// let measured = Measured { position: &[-1.2], velocity: &[0.0], gravity: &mut gravity };
/// assert_eq!(gate.make_safe(measured, 1e-3), Verdict::Safe { state: SafeState::Hold, entered: true });
/// assert_eq!((gate.setpoints()[0].position, gate.setpoints()[0].effort), (-1.2, 21.0));
/// ```
#[derive(Debug)]
pub struct Gate {
    joints: Vec<JointLimits>,
    rules: GateRules,
    state: GateState,
    /// True from entering the safe state until leaving it.
    in_safe: bool,
    /// True if the safe state stays until [`release`](Self::release).
    latched: bool,
    /// Time since the newest command arrived, s.
    held_for: f64,
    /// Time for which the positions of the newest command are extrapolated with its velocities, s.
    goes_on_for: f64,
    setpoints: Vec<JointSetpoint>,
    /// Setpoints of the step that is being computed.
    next: Vec<JointSetpoint>,
    gravity: Vec<f64>,
    envelope: Envelope,
    resume: Resume,
    arrivals: Arrivals,
    rest: Rest,
    reversals: Vec<Reversals>,
}

impl Gate {
    /// Creates a gate for `joints`, in the order of the joints in each command.
    pub fn new(mut joints: Vec<JointLimits>, rules: GateRules) -> Self {
        let count = joints.len();
        joints.iter_mut().for_each(|joint| joint.velocity = joint.velocity.max(SLOWEST_LIMIT));
        Self {
            rules,
            state: GateState::Safe,
            in_safe: false,
            latched: false,
            held_for: 0.0,
            goes_on_for: 0.0,
            setpoints: vec![JointSetpoint::default(); count],
            next: vec![JointSetpoint::default(); count],
            gravity: vec![0.0; count],
            envelope: Envelope::from_limits(&joints),
            resume: Resume::new(count),
            arrivals: Arrivals::new(count),
            rest: Rest::default(),
            reversals: vec![Reversals::default(); count],
            joints,
        }
    }

    /// Resets to the initial state: safe, not latched, all setpoints zero.
    pub fn reset(&mut self) {
        (self.state, self.in_safe, self.latched) = (GateState::Safe, false, false);
        self.setpoints.fill(JointSetpoint::default());
        self.next.fill(JointSetpoint::default());
        self.gravity.fill(0.0);
        (self.held_for, self.goes_on_for) = (0.0, 0.0);
        self.arrivals.reset();
        self.rest = Rest::default();
    }

    /// Returns the limits of all joints, in the order of the joints in each command.
    pub fn joints(&self) -> &[JointLimits] {
        &self.joints
    }

    /// Returns the setpoints that the drives apply in this step.
    pub fn setpoints(&self) -> &[JointSetpoint] {
        &self.setpoints
    }

    /// Returns the memory that a common step reads and writes. Its address does not change.
    pub(super) fn memory(&self) -> (&[Bounds], &[JointSetpoint]) {
        (self.envelope.bounds(), &self.setpoints)
    }

    /// Returns the state of the gate: safe, resuming or following.
    pub fn state(&self) -> GateState {
        self.state
    }

    /// Returns `true` if the gate stays in its safe state until [`release`](Self::release) is called.
    pub fn is_latched(&self) -> bool {
        self.latched
    }

    /// Latches the gate if the graph sets `resume = "latch"`: it then stays in its safe state until
    /// [`release`](Self::release) is called.
    pub fn latch(&mut self) {
        self.latched = self.rules.resume == ResumeRule::Latch;
    }

    /// Releases the latch, so that the gate can leave its safe state.
    pub fn release(&mut self) {
        self.latched = false;
    }

    /// Offers the newest fresh command to the gate, `dt` s after the previous step. `account` counts exceeded
    /// limits and refusals.
    pub fn offer(
        &mut self,
        offer: Offer<'_>,
        measured: Measured<'_>,
        dt: f64,
        account: &impl Account,
    ) -> Verdict {
        let follows = self.state == GateState::Following && !self.latched && !self.resume.fades();
        let follows = follows && !self.arrivals.any();
        let (position, over) = (measured.position, offer.ahead.max(dt));
        let at = (position, measured.velocity);
        if follows && offer.is_new && self.envelope.apply(offer.command, at, over, &mut self.setpoints) {
            self.take_time(&offer);
            return Verdict::Applied;
        }
        let verdict = self.check_command(offer, measured, dt, account);
        self.bound_velocities(position);
        if self.state != GateState::Safe {
            self.arrivals.bound(&mut self.setpoints, self.envelope.bounds());
        }
        verdict
    }

    /// Notes which joints their drives held back in the last step because of the acceleration limit in the
    /// setpoint ([`max_acceleration`](JointSetpoint::max_acceleration)). The step lasted `dt` s and ended at
    /// `position`. Call this function before the next [`offer`](Self::offer) if the drives report this. A
    /// noted joint that follows a command counts as limited once per step.
    #[inline]
    pub fn note_restrained(
        &mut self,
        restrained: &[bool],
        position: &[f64],
        dt: f64,
        account: &impl Account,
    ) {
        let at = (self.setpoints.as_slice(), position);
        self.arrivals.note(restrained, at, self.envelope.bounds(), dt);
        if self.arrivals.any() && self.state == GateState::Following {
            let limited = restrained.iter().enumerate().filter(|(_, restrained)| **restrained);
            limited.for_each(|(joint, _)| account.limited(joint, LimitKind::Acceleration));
        }
    }

    /// Starts to extrapolate the positions of the command with its velocities, until the next command is due.
    #[inline]
    fn take_time(&mut self, offer: &Offer<'_>) {
        (self.held_for, self.goes_on_for) = (0.0, GOES_ON_FOR.max(2.0 * offer.ahead));
    }

    /// Checks a command joint by joint and returns the verdict.
    #[cold]
    #[inline(never)]
    pub(super) fn check_command(
        &mut self,
        offer: Offer<'_>,
        measured: Measured<'_>,
        dt: f64,
        account: &impl Account,
    ) -> Verdict {
        if !offer.is_new {
            self.held_for += dt;
        }
        if self.latched {
            return self.make_safe(measured, dt);
        }
        if let Err(reason) = self.take(&offer, account) {
            if offer.is_new {
                account.refused(reason);
            }
            return self.make_safe(measured, dt);
        }
        match self.state {
            GateState::Following => self.follow(&offer, measured, dt, account),
            GateState::Safe => {
                // A process starts in its safe state.
                if !self.in_safe {
                    self.enter_safe(measured.position, measured.velocity, measured.gravity);
                }
                self.leave_safe(measured, dt)
            }
            GateState::Resuming if self.resume.fades() => self.follow(&offer, measured, dt, account),
            GateState::Resuming => self.approach(measured, dt),
        }
    }

    /// Applies the safe state for one step, `dt` s after the previous step.
    #[cold]
    #[inline(never)]
    pub fn make_safe(&mut self, measured: Measured<'_>, dt: f64) -> Verdict {
        let state = self.rules.safe_state;
        let position = measured.position;
        let entered = !self.in_safe;
        if entered {
            self.enter_safe(measured.position, measured.velocity, measured.gravity);
        } else if matches!(state, SafeState::Hold | SafeState::Brake) {
            // The pose, and therefore gravity, changes until the joints are at rest.
            (measured.gravity)(&mut self.gravity);
            for (i, (setpoint, limits)) in self.setpoints.iter_mut().zip(&self.joints).enumerate() {
                let joint =
                    Joint::measured(measured.position, measured.velocity, self.gravity[i], i, setpoint);
                *setpoint = stay(state, &joint, limits, setpoint, dt);
                if self.reversals[i].step(joint.velocity, dt) && state == SafeState::Hold {
                    soften(setpoint, &joint, limits);
                }
            }
        }
        self.bound_velocities(position);
        self.rest.step(state, (measured.velocity, &self.joints), dt, entered);
        Verdict::Safe { state, entered }
    }

    /// Returns `true` in a safe state that should bring all joints to rest, while at least one joint still
    /// moves.
    pub fn is_moving_in_safe_state(&self) -> bool {
        self.state == GateState::Safe && self.rest.moves()
    }

    /// Returns `false` if a joint still moves [`REST_WITHIN`](super::REST_WITHIN) after the gate entered a
    /// safe state that should have brought it to rest.
    pub fn is_safe_state_reached(&self) -> bool {
        self.state != GateState::Safe || self.rest.is_reached()
    }

    /// Sets the velocities beyond which the drives brake, depending on the joint positions.
    #[inline]
    pub(super) fn bound_velocities(&mut self, position: &[f64]) {
        if self.state == GateState::Safe && self.rules.safe_state == SafeState::ZeroTorque {
            return;
        }
        self.envelope.bound_velocities(&mut self.setpoints, position);
    }

    fn enter_safe(&mut self, position: &[f64], velocity: &[f64], gravity: &mut dyn FnMut(&mut [f64])) {
        gravity(&mut self.gravity);
        self.reversals.fill(Reversals::default());
        let followed = self.state != GateState::Safe;
        for (i, (setpoint, limits)) in self.setpoints.iter_mut().zip(&self.joints).enumerate() {
            let joint = Joint::measured(position, velocity, self.gravity[i], i, setpoint);
            let last = *setpoint;
            *setpoint = enter(self.rules.safe_state, &joint, limits, &last);
            if followed && self.rules.safe_state == SafeState::Hold {
                // Without a step in the effort, which would be a step in the acceleration.
                let (q, v) = (joint.position, joint.velocity);
                // Damping that is not kept may have shaken the joint, so its current effort is arbitrary.
                let last = JointSetpoint { kd: last.kd.min(setpoint.kd), ..last };
                let jump = last.effort_at(q, v, limits.effort) - setpoint.effort_at(q, v, f64::INFINITY);
                setpoint.effort = (setpoint.effort + jump).clamp(-limits.effort, limits.effort);
            }
        }
        (self.state, self.in_safe) = (GateState::Safe, true);
        if followed {
            self.latch();
        }
    }

    /// Copies the command to `next`, with all values clamped that do not depend on the previous step. Returns
    /// the reason if the command is refused.
    #[inline]
    pub(super) fn take(&mut self, offer: &Offer<'_>, account: &impl Account) -> Result<(), Refusal> {
        let command = offer.command;
        if command.check().is_err() {
            return Err(Refusal::Content);
        }
        if command.count() != self.joints.len() {
            return Err(Refusal::Count);
        }
        let (position, velocity, effort) = (command.position(), command.velocity(), command.effort());
        let (kp, kd) = (command.kp(), command.kd());
        let mut exceeds = false;
        if offer.is_new {
            self.take_time(offer);
        }
        let held_for = self.held_for.min(self.goes_on_for);
        for (i, (next, limits)) in self.next.iter_mut().zip(&self.joints).enumerate() {
            if kp[i] < 0.0 || kd[i] < 0.0 {
                return Err(Refusal::NegativeGain);
            }
            *next = JointSetpoint {
                position: position[i],
                velocity: velocity[i],
                effort: effort[i],
                kp: kp[i],
                kd: kd[i],
                ..JointSetpoint::default()
            };
            limits.clamp(next, |kind| {
                exceeds = true;
                if offer.is_new {
                    account.limited(i, kind);
                }
            });
            if !offer.is_new {
                limits.go_on(next, held_for);
            }
        }
        if exceeds && self.rules.limits == LimitPolicy::Refuse { Err(Refusal::Limits) } else { Ok(()) }
    }

    /// Applies the command in `next` plus any fading difference, as fast as the rate limits allow.
    #[inline]
    fn follow(
        &mut self,
        offer: &Offer<'_>,
        measured: Measured<'_>,
        dt: f64,
        account: &impl Account,
    ) -> Verdict {
        let over = if offer.is_new { offer.ahead.max(dt) } else { dt };
        // The command is not at fault for the fading difference.
        let fades = self.state == GateState::Resuming;
        self.resume.fade(&mut self.next, dt);
        let mut exceeds = false;
        for (i, (next, limits)) in self.next.iter_mut().zip(&self.joints).enumerate() {
            let last = &self.setpoints[i];
            // A drive without a gain follows no setpoint, so the measured position is used.
            let before = Before {
                position: if last.kp > 0.0 { last.position } else { measured.position[i] },
                velocity: if last.kd > 0.0 { last.velocity } else { measured.velocity[i] },
                effort: last.effort,
            };
            // The sum of command and difference may reach the limit, which a drive would overshoot.
            let share = if fades { FADING_SHARE } else { 1.0 };
            if fades {
                let fastest = share * limits.velocity;
                next.velocity = next.velocity.max(-fastest).min(fastest);
            }
            let mut is_clamped = false;
            let rate = (next.position - before.position) / over;
            limits.clamp_rates(next, before, (share, over), |kind| {
                exceeds |= !fades;
                is_clamped |= kind == LimitKind::PositionRate;
                if offer.is_new && !fades {
                    account.limited(i, kind);
                }
            });
            if offer.is_new {
                self.arrivals.note_rate(i, (!is_clamped).then_some(rate));
            }
        }
        if exceeds && self.rules.limits == LimitPolicy::Refuse {
            if offer.is_new {
                account.refused(Refusal::Limits);
            }
            return self.make_safe(measured, dt);
        }
        self.setpoints.copy_from_slice(&self.next);
        if fades && self.resume.fades() {
            return Verdict::Resuming;
        }
        self.state = GateState::Following;
        Verdict::Applied
    }

    /// Returns `true` if the gate has been resuming for longer than [`RESUME_WITHIN`](super::RESUME_WITHIN).
    pub fn is_resuming_late(&self) -> bool {
        self.state == GateState::Resuming && self.resume.is_late()
    }

    /// Leaves the safe state for the command in `next`. A near command is followed immediately; a distant one
    /// is approached at limited rates.
    fn leave_safe(&mut self, measured: Measured<'_>, dt: f64) -> Verdict {
        self.in_safe = false;
        let joints = self.setpoints.iter().enumerate().map(|(i, setpoint)| {
            (setpoint, Joint::measured(measured.position, measured.velocity, self.gravity[i], i, setpoint))
        });
        self.resume.begin(joints);
        let pairs = self.next.iter().zip(&self.setpoints).zip(&self.joints).enumerate();
        let resume = &self.resume;
        let near = |(i, ((next, safe), limits))| resume.is_near(i, next, limits, safe);
        if self.rules.resume != ResumeRule::AtOnce {
            if !pairs.into_iter().all(near) {
                self.state = GateState::Resuming;
                return self.approach(measured, dt);
            }
            self.resume.begin_fading(&self.next, &self.setpoints);
            self.resume.fade(&mut self.next, dt);
        }
        self.state = GateState::Following;
        self.setpoints.copy_from_slice(&self.next);
        Verdict::Applied
    }

    /// Performs one step of the approach to the command in `next`.
    fn approach(&mut self, measured: Measured<'_>, dt: f64) -> Verdict {
        (measured.gravity)(&mut self.gravity);
        let mut all_met = true;
        for (i, (next, limits)) in self.next.iter().zip(&self.joints).enumerate() {
            let joint =
                Joint::measured(measured.position, measured.velocity, self.gravity[i], i, &self.setpoints[i]);
            let (setpoint, met) = self.resume.advance(i, next, limits, &joint, dt);
            self.setpoints[i] = setpoint;
            all_met &= met;
        }
        if self.resume.end_step(all_met, &self.joints, dt) {
            self.state = GateState::Following;
        }
        Verdict::Resuming
    }
}
