//! The table `[safety]`.

use schemars::JsonSchema;

use crate::graph::defaults;
use crate::graph::diagnostic::Report;
use crate::graph::read::{At, Keys, Read, Value};
use crate::graph::values::TopicName;
use crate::plan::{LimitPolicy, ResumeRule, SafeState};
use crate::units::TimeSpan;

/// Limits and states for the safety of the robot. The actuator enforces them even if other processes have
/// died.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Safety")]
pub(in crate::graph) struct SafetyTable {
    /// Maximum age of a command since its publication. Older commands are never applied.
    #[schemars(extend("default" = defaults::STALE_AFTER))]
    pub stale_after: Option<At<TimeSpan>>,
    /// Safe state: the state that an actuator applies without a valid command.
    #[schemars(extend("default" = defaults::SAFE_STATE))]
    pub safe_state: Option<At<SafeState>>,
    /// Time for which actuators stay in the safe state before they are stopped, at every end of a run.
    #[schemars(extend("default" = defaults::SETTLE))]
    pub settle: Option<At<TimeSpan>>,
    /// Maximum age of the measurement from which a command was computed. Commands from older measurements are
    /// never applied. Default: `stale_after` plus twice the sum of the periods of all components on the path
    /// from the measurement to the command.
    pub source_stale_after: Option<At<TimeSpan>>,
    /// Policy for a command that exceeds a limit of the robot's joints.
    #[schemars(extend("default" = defaults::LIMITS))]
    pub limits: Option<At<LimitPolicy>>,
    /// Recovery from the safe state once commands are fresh again.
    #[schemars(extend("default" = defaults::RESUME))]
    pub resume: Option<At<ResumeRule>>,
    /// Topic of type `motorium.EmergencyStop`. A pressed stop keeps every actuator in its safe state until
    /// `motorium resume`.
    pub emergency_stop: Option<At<TopicName>>,
    /// Maximum age of the newest message on the emergency-stop topic. A longer silence counts as a pressed
    /// emergency stop.
    #[schemars(extend("default" = defaults::EMERGENCY_STOP_MAX_AGE))]
    pub emergency_stop_max_age: Option<At<TimeSpan>>,
    /// For an actuator with several robots. If true, one robot without a valid command puts all of them into
    /// the safe state; otherwise each robot stops independently.
    #[schemars(extend("default" = false))]
    pub stop_together: Option<At<bool>>,
}

impl<'i> Read<'i> for SafetyTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(key, value, report)?;
        let table = take_fields!(
            keys,
            stale_after,
            safe_state,
            settle,
            source_stale_after,
            limits,
            resume,
            emergency_stop,
            emergency_stop_max_age,
            stop_together
        );
        keys.finish("`[safety]`");
        Some(table)
    }
}

/// Safety settings of one actuator, which override `[safety]`.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "ActuatorSafety")]
pub(in crate::graph) struct ActuatorSafetyTable {
    /// Maximum age of a command since its publication, at least one period of the component that writes the
    /// commands. Older commands are never applied. The maximum age of measurements changes by the same
    /// amount.
    pub stale_after: Option<At<TimeSpan>>,
    /// Safe state: the state that an actuator applies without a valid command.
    pub safe_state: Option<At<SafeState>>,
    /// Recovery from the safe state once commands are fresh again.
    pub resume: Option<At<ResumeRule>>,
    /// Time for which this actuator stays in the safe state before it is stopped, at every end of a run. All
    /// actuators wait for the longest of these times.
    pub settle: Option<At<TimeSpan>>,
}

impl<'i> Read<'i> for ActuatorSafetyTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(key, value, report)?;
        let table = take_fields!(keys, stale_after, safe_state, resume, settle);
        keys.finish("the `safety` of a component");
        Some(table)
    }
}
