//! Statistics of a command gate: its state, and the commands it limited and refused.

use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicU8, AtomicU32, AtomicU64};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::add;
use crate::state::MAX_JOINTS;

/// Maximum length of a stored joint name, bytes.
const NAME: usize = 48;

/// The state of an actuator's command gate.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[repr(u32)]
pub enum GateState {
    /// The gate applies the safe state.
    #[default]
    Safe = 0,
    /// The gate moves the joints at limited rates from the held pose towards the setpoints of fresh commands,
    /// until it reaches them.
    Resuming = 1,
    /// The gate applies the commands, within the limits.
    Following = 2,
}

/// Reason why a gate stays in its safe state until `motorium resume`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[repr(u32)]
pub enum Latch {
    /// The command `motorium stop --now`.
    Stop = 1,
    /// A message on the emergency-stop topic.
    EmergencyStop = 2,
    /// The gate entered the safe state, and the graph sets `resume = "latch"`.
    SafeState = 4,
}

impl Latch {
    /// Decodes a word of flags to the most severe latch; `None` if no flag is set.
    pub fn from_word(word: u32) -> Option<Self> {
        [Self::EmergencyStop, Self::Stop, Self::SafeState].into_iter().find(|latch| word & *latch as u32 != 0)
    }
}

/// Limit of a joint that a command exceeded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[repr(u32)]
pub enum LimitKind {
    /// The position setpoint is outside the joint's range.
    Position = 0,
    /// The position setpoint changes faster than the velocity limit of the joint.
    PositionRate = 1,
    /// The velocity setpoint exceeds the velocity limit.
    Velocity = 2,
    /// The velocity setpoint, or the joint, accelerates beyond the acceleration limit.
    Acceleration = 3,
    /// The feed-forward effort exceeds the effort limit.
    Effort = 4,
    /// The position gain exceeds the largest useful gain of the drive.
    Kp = 5,
    /// The velocity gain exceeds the largest useful gain of the drive.
    Kd = 6,
    /// The feed-forward effort changes faster than the effort rate limit allows.
    EffortRate = 7,
}

impl LimitKind {
    /// All limits, in the order of their numbers.
    pub const ALL: [Self; 8] = [
        Self::Position,
        Self::PositionRate,
        Self::Velocity,
        Self::Acceleration,
        Self::Effort,
        Self::Kp,
        Self::Kd,
        Self::EffortRate,
    ];
}

/// Reason why a gate refused a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[repr(u32)]
pub enum Refusal {
    /// A number in the command is not finite, or the count of joints exceeds the capacity of the buffer.
    Content = 0,
    /// The number of joints differs from the gate's number of joints.
    Count = 1,
    /// A gain is negative.
    NegativeGain = 2,
    /// A joint limit was exceeded, and the graph sets `limits = "refuse"`.
    Limits = 3,
    /// The stamp is more than 1 ms in the future.
    Future = 4,
    /// The command was published before the last command that the gate checked.
    Sequence = 5,
    /// The measurement from which the command was computed is older than `source_stale_after`.
    StaleSource = 6,
}

impl Refusal {
    /// All reasons, in the order of their numbers.
    pub const ALL: [Self; 7] = [
        Self::Content,
        Self::Count,
        Self::NegativeGain,
        Self::Limits,
        Self::Future,
        Self::Sequence,
        Self::StaleSource,
    ];
}

/// Statistics of the command gate of one actuator. Written by the actuator's worker.
#[derive(Debug)]
#[repr(C)]
pub struct GateBlock {
    state: AtomicU32,
    latch: AtomicU32,
    joints: AtomicU32,
    moves: AtomicU32,
    unsettled: AtomicU32,
    late_resumes: AtomicU32,
    /// 1 once a command has been applied.
    has_followed: AtomicU32,
    entries: AtomicU64,
    /// Start of the current state, ns on the clock of stamps; 0 before the first step.
    since_ns: AtomicU64,
    /// Total duration of completed safe states since the first command, ns. Safe states caused by `motorium
    /// stop --now` do not count.
    safe_ns: AtomicU64,
    refused: [AtomicU64; Refusal::ALL.len()],
    limited: [[AtomicU64; LimitKind::ALL.len()]; MAX_JOINTS],
    names: [[AtomicU8; NAME]; MAX_JOINTS],
}

impl GateBlock {
    /// Opens the statistics of a gate for joints with these names.
    pub fn open<'a>(&self, names: impl Iterator<Item = &'a str>) {
        let mut count = 0;
        for (cells, name) in self.names.iter().zip(names) {
            let bytes = name.bytes().chain(std::iter::repeat(0));
            cells.iter().zip(bytes).for_each(|(cell, byte)| cell.store(byte, Relaxed));
            count += 1;
        }
        self.joints.store(count, Release);
    }

    /// Sets the state and the latch of the gate, which apply from `now_ns` on.
    pub fn set(&self, state: GateState, latch: Option<Latch>, now_ns: u64) {
        self.safe_ns.store(self.safe_ns(now_ns), Relaxed);
        self.since_ns.store(now_ns.max(1), Relaxed);
        if state != GateState::Safe {
            self.has_followed.store(1, Relaxed);
        }
        if state == GateState::Safe && self.state() != GateState::Safe {
            add(&self.entries, 1);
        }
        self.state.store(state as u32, Relaxed);
        self.latch.store(latch.map_or(0, |latch| latch as u32), Relaxed);
    }

    /// Records whether joints still move in a safe state that should bring them to rest.
    pub fn set_moves(&self, moves: bool) {
        self.moves.store(u32::from(moves), Relaxed);
    }

    /// Counts a safe state in which the joints did not come to rest in time.
    pub fn count_unsettled(&self) {
        self.unsettled.fetch_add(1, Relaxed);
    }

    /// Counts a recovery that lasted longer than [`RESUME_WITHIN`](crate::safety::RESUME_WITHIN).
    pub fn count_late_resume(&self) {
        self.late_resumes.fetch_add(1, Relaxed);
    }

    /// Returns `true` while joints still move in a safe state that should bring them to rest.
    pub fn moves(&self) -> bool {
        self.moves.load(Relaxed) != 0
    }

    /// Returns the number of safe states in which the joints did not come to rest in time.
    pub fn unsettled(&self) -> u32 {
        self.unsettled.load(Relaxed)
    }

    /// Returns the number of recoveries that lasted longer than
    /// [`RESUME_WITHIN`](crate::safety::RESUME_WITHIN).
    pub fn late_resumes(&self) -> u32 {
        self.late_resumes.load(Relaxed)
    }

    /// Resets the gate to the safe state for a new episode. This does not count as an entry, because no
    /// command has been applied in the new episode yet.
    pub fn begin_episode(&self) {
        self.state.store(GateState::Safe as u32, Relaxed);
        self.since_ns.store(0, Relaxed);
    }

    /// Returns `true` once a command has been applied.
    pub fn has_followed(&self) -> bool {
        self.has_followed.load(Relaxed) != 0
    }

    /// Returns the time that the gate has spent in the safe state from the first command until `now_ns`, ns.
    /// Safe states caused by `motorium stop --now` do not count.
    pub fn safe_ns(&self, now_ns: u64) -> u64 {
        let before_ns = self.safe_ns.load(Relaxed);
        let since_ns = self.since_ns.load(Relaxed);
        let counts = since_ns != 0
            && self.has_followed()
            && self.state() == GateState::Safe
            && self.latch() != Some(Latch::Stop);
        before_ns + if counts { now_ns.saturating_sub(since_ns) } else { 0 }
    }

    /// Counts a command that exceeded a limit of a joint.
    pub fn limit(&self, joint: usize, kind: LimitKind) {
        if let Some(joint) = self.limited.get(joint) {
            add(&joint[kind as usize], 1);
        }
    }

    /// Counts a command that was refused.
    pub fn refuse(&self, reason: Refusal) {
        add(&self.refused[reason as usize], 1);
    }

    /// Returns the state of the gate.
    pub fn state(&self) -> GateState {
        match self.state.load(Relaxed) {
            1 => GateState::Resuming,
            2 => GateState::Following,
            _ => GateState::Safe,
        }
    }

    /// Returns the reason why the gate is latched, or `None` if it is not.
    pub fn latch(&self) -> Option<Latch> {
        Latch::from_word(self.latch.load(Relaxed))
    }

    /// Returns the number of refused commands by reason, in the order of [`Refusal::ALL`].
    pub fn refusals(&self) -> [u64; Refusal::ALL.len()] {
        core::array::from_fn(|reason| self.refused[reason].load(Relaxed))
    }

    /// Returns the number of times that the gate entered the safe state after a command had been applied.
    pub fn entries(&self) -> u64 {
        self.entries.load(Relaxed)
    }

    /// Returns the statistics so far, or `None` if the component has not opened them.
    pub fn report(&self) -> Option<GateReport> {
        let joints = (self.joints.load(Acquire) as usize).min(MAX_JOINTS);
        if joints == 0 {
            return None;
        }
        let count = |cell: &AtomicU64| Some(cell.load(Relaxed)).filter(|count| *count > 0);
        let limited = (0..joints).flat_map(|joint| {
            LimitKind::ALL.into_iter().filter_map(move |limit| {
                let count = count(&self.limited[joint][limit as usize])?;
                Some(Limited { joint: self.name(joint), limit, count })
            })
        });
        let refused = Refusal::ALL
            .into_iter()
            .filter_map(|reason| Some(Refused { reason, count: count(&self.refused[reason as usize])? }));
        Some(GateReport {
            state: self.state(),
            latch: self.latch(),
            entries: self.entries.load(Relaxed),
            limited: limited.collect(),
            refused: refused.collect(),
        })
    }

    fn name(&self, joint: usize) -> String {
        let bytes = self.names[joint].iter().map(|cell| cell.load(Relaxed));
        let bytes: Vec<u8> = bytes.take_while(|byte| *byte != 0).collect();
        String::from_utf8_lossy(&bytes).into_owned()
    }
}

/// Statistics of an actuator's command gate, in the report.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct GateReport {
    /// State of the gate at the time of the report.
    pub state: GateState,
    /// Reason why the gate stays in the safe state until `motorium resume`; `null` if it is not latched.
    pub latch: Option<Latch>,
    /// Number of times that the gate entered the safe state after a command had been applied.
    pub entries: u64,
    /// Limits that commands exceeded, per joint. Such commands are clamped, or refused if the graph sets
    /// `limits = "refuse"`.
    pub limited: Vec<Limited>,
    /// Numbers of refused commands, by reason.
    pub refused: Vec<Refused>,
}

/// Number of commands that exceeded one limit of one joint.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Limited {
    /// Name of the joint, truncated to 48 bytes.
    pub joint: String,
    /// The limit that was exceeded.
    pub limit: LimitKind,
    /// Number of commands that exceeded the limit.
    pub count: u64,
}

/// Number of commands that were refused for one reason.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Refused {
    /// Reason for the refusal.
    pub reason: Refusal,
    /// Number of commands refused for this reason.
    pub count: u64,
}
