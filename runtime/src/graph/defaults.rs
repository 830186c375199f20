//! Defaults of the graph file. The JSON Schema shows the same values.

use super::values::{Schedule, Share, SpinChoice};
use crate::plan::{
    ClockKind, LimitPolicy, OnDenied, OnError, OnFailure, OnMiss, OnOverrun, RestartWhen, ResumeRule,
    SafeState,
};
use crate::units::TimeSpan;

const MILLISECOND: u64 = 1_000_000;
const SECOND: u64 = 1_000_000_000;

pub(super) const CLOCK: ClockKind = ClockKind::Realtime;
pub(super) const SEED: u64 = 0;
pub(super) const EPISODES: u64 = 1;
pub(super) const SPIN: SpinChoice = SpinChoice::Auto;
pub(super) const SPIN_SHARE: Share = Share(0.1);
pub(super) const ON_DENIED: OnDenied = OnDenied::Warn;
pub(super) const IDLE_EXIT: TimeSpan = TimeSpan { ns: 0 };
/// Periods without a step after which a component counts as hung.
pub(super) const HANG_PERIODS: u64 = 20;
/// Minimum time without a step after which a real-time component counts as hung.
pub(super) const HANG_REALTIME: TimeSpan = TimeSpan { ns: 200 * MILLISECOND };
/// Minimum time without a step after which a component on shared cores counts as hung.
pub(super) const HANG_NORMAL: TimeSpan = TimeSpan { ns: SECOND };
/// Number of budgets (or periods, without a budget) for which a component may compute without sleeping.
pub(super) const CPU_LIMIT_STEPS: u64 = 10;
/// Minimum of the resulting time. The kernel counts ticks at which a component has the core, even if the host
/// of a virtual machine has used the core for most of the time in between.
pub(super) const CPU_LIMIT: TimeSpan = TimeSpan { ns: 50 * MILLISECOND };
pub(super) const LOST_STEPS: Share = Share(0.05);
pub(super) const PHASE: TimeSpan = TimeSpan { ns: 0 };
pub(super) const SCHEDULE: Schedule = Schedule::Fifo;
pub(super) const ON_OVERRUN: OnOverrun = OnOverrun::Skip;
pub(super) const ON_ERROR: OnError = OnError::Fail;
pub(super) const ON_FAILURE: OnFailure = OnFailure::SafeStop;
pub(super) const RESTART_WHEN: RestartWhen = RestartWhen::Never;
pub(super) const RESTART_AT_MOST: u32 = 5;
pub(super) const RESTART_WINDOW: TimeSpan = TimeSpan { ns: 10 * SECOND };
pub(super) const RESTART_WITHIN: TimeSpan = TimeSpan { ns: SECOND };
pub(super) const STOP_WITHIN: TimeSpan = TimeSpan { ns: crate::plan::STOP_WITHIN_NS };
pub(super) const ON_MISS: OnMiss = OnMiss::Warn;
pub(super) const STALE_AFTER: TimeSpan = TimeSpan { ns: 5 * MILLISECOND };
pub(super) const SAFE_STATE: SafeState = SafeState::Hold;
pub(super) const LIMITS: LimitPolicy = LimitPolicy::Clamp;
pub(super) const RESUME: ResumeRule = ResumeRule::Near;
pub(super) const EMERGENCY_STOP_MAX_AGE: TimeSpan = TimeSpan { ns: 500 * MILLISECOND };
pub(super) const SETTLE: TimeSpan = TimeSpan { ns: 500 * MILLISECOND };

/// Priority of the fastest real-time component; each slower rate gets [`PRIORITY_STEP`] less.
pub(super) const FASTEST_PRIORITY: u8 = 80;
/// Distance between the priorities of two rates, which leaves room for explicit priorities in between.
pub(super) const PRIORITY_STEP: u8 = 5;
