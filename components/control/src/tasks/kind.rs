//! Kinds of tasks: the configuration of a task, and how a controller checks and builds it.

use core::ops::RangeInclusive;

use motorium::prelude::*;
use motorium_worlds::World;

use super::context::TaskContext;
pub(super) use super::context::{GAINS, WEIGHTS};
use super::held::HeldTask;
use super::ramp::Ramped;

/// Defines the configuration of a kind of task: its type, the default name of the task, and its keys with
/// types and defaults. A key may have a rule:
///
/// - `live(range, unit, doc)`: a number that can be changed at run time as the parameter `NAME_KEY`,
/// - `within(range)`: a number within a range,
/// - `target(optional Message, doc)` or `target(required Message, doc)`: the name of the target's input port,
/// - `wrench(required Message, doc)`: the name of the input port for a measured wrench.
///
/// The keys `name` and `level` are common to all kinds.
macro_rules! task_config {
    (
        $(#[$meta:meta])*
        $config:ident $kind:literal {
            $( $(#[$doc:meta])* $key:ident: $type:ty = $default:expr $(=> $rule:ident($($args:tt)*))?; )*
        }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, serde::Deserialize, schemars::JsonSchema)]
        #[serde(default, deny_unknown_fields)]
        pub struct $config {
            #[doc = concat!("Name of the task, used as a prefix of its parameter names. Default \"", $kind, "\".")]
            pub name: String,
            /// Priority level of the task, 1 to 8; lower numbers have strict priority. Default 1.
            pub level: u32,
            $( $(#[$doc])* pub $key: $type, )*
        }

        impl Default for $config {
            fn default() -> Self {
                Self { name: $kind.to_owned(), level: 1, $( $key: $default, )* }
            }
        }

        impl $crate::tasks::kind::TaskTable for $config {
            fn table_head(&self) -> $crate::tasks::kind::TaskHead<'_> {
                let head = $crate::tasks::kind::TaskHead::new(&self.name, self.level);
                $( $( let head = task_key!(head head, self.$key, $rule($($args)*)); )? )*
                head
            }

            fn live(&self) -> Vec<$crate::tasks::kind::TaskParameter> {
                let parameters = [
                    $( $( task_key!(parameter stringify!($key), self.$key, $rule($($args)*)), )? )*
                ];
                parameters.into_iter().flatten().collect()
            }

            fn check_keys(
                &self,
                context: &$crate::tasks::context::TaskContext<'_>,
            ) -> Result<(), motorium::declare::ConfigError> {
                $( $( task_key!(check context, stringify!($key), self.$key, $rule($($args)*)); )? )*
                Ok(())
            }

            fn declare_inputs(&self, declare: &mut motorium::declare::Declare) {
                let _ = &declare; // there may be no input
                $( $( task_key!(declare declare, self.$key, $rule($($args)*)); )? )*
            }
        }
    };
}

/// Expands the rule of a key of [`task_config!`].
macro_rules! task_key {
    (head $head:ident, $value:expr, target($($args:tt)*)) => {
        $head.target(&$value)
    };
    (head $head:ident, $value:expr, wrench($($args:tt)*)) => {
        $head.wrench(&$value)
    };
    (head $head:ident, $value:expr, $rule:ident($($args:tt)*)) => {
        $head
    };
    (parameter $key:expr, $value:expr, live($range:expr, $unit:literal, $doc:literal)) => {
        Some($crate::tasks::kind::TaskParameter::new($key, $value, $range, $unit, $doc))
    };
    (parameter $key:expr, $value:expr, $rule:ident($($args:tt)*)) => {
        None
    };
    (check $context:ident, $key:expr, $value:expr, live($range:expr, $($args:tt)*)) => {
        $context.in_range($key, $value, $range)?
    };
    (check $context:ident, $key:expr, $value:expr, within($range:expr)) => {
        $context.in_range($key, $value, $range)?
    };
    (check $context:ident, $key:expr, $value:expr, $rule:ident($($args:tt)*)) => {};
    (declare $declare:ident, $value:expr, $input:ident(optional $message:ty, $doc:literal)) => {
        $declare.optional_input::<$message>(&$value, $doc)
    };
    (declare $declare:ident, $value:expr, $input:ident(required $message:ty, $doc:literal)) => {
        $declare.input::<$message>(&$value, $doc)
    };
    (declare $declare:ident, $value:expr, $rule:ident($($args:tt)*)) => {};
}

/// Defines [`TaskKind::check`] for a table with a method `build`.
macro_rules! check_by_building {
    () => {
        fn check(&self, context: &$crate::tasks::context::TaskContext<'_>) -> Result<(), ConfigError> {
            self.build(context).map(drop)
        }
    };
}

/// The keys of a kind of task, as defined by [`task_config!`].
pub(crate) trait TaskTable {
    /// Name, level and inputs.
    fn table_head(&self) -> TaskHead<'_>;

    /// Keys that can be changed at run time.
    fn live(&self) -> Vec<TaskParameter>;

    /// Checks that all numbers are within their ranges.
    fn check_keys(&self, context: &TaskContext<'_>) -> Result<(), ConfigError>;

    /// Declares the inputs.
    fn declare_inputs(&self, declare: &mut Declare);
}

/// A running task, built from its configuration.
pub(crate) type BuiltTask = Result<Box<dyn HeldTask>, ConfigureError>;

/// The configuration of one kind of task.
pub(crate) trait TaskKind: TaskTable {
    /// Name, level, inputs and supported formulations.
    fn head(&self) -> TaskHead<'_> {
        self.table_head()
    }

    /// Parameters, each of which can be changed at run time as `NAME_PARAMETER`.
    fn parameters(&self) -> Vec<TaskParameter> {
        self.live()
    }

    /// Returns `true` if the task has limits that involve a moving object of the world.
    fn has_moving_objects(&self, _world: &World) -> bool {
        false
    }

    /// Checks the configuration beyond the ranges of its keys.
    fn check(&self, context: &TaskContext<'_>) -> Result<(), ConfigError>;

    /// Builds the task, and opens inputs and parameters. All memory of the task is allocated here.
    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask;

    /// Checks the configuration, and declares inputs and parameters.
    fn declare(&self, context: &TaskContext<'_>, declare: &mut Declare) -> Result<(), ConfigError> {
        self.check_keys(context)?;
        self.check(context)?;
        self.declare_inputs(declare);
        let name = self.head().name;
        self.parameters().into_iter().for_each(|parameter| parameter.declare(name, declare));
        Ok(())
    }

    /// Opens all parameters, in the order of [`parameters`](Self::parameters).
    fn open<const N: usize>(&self, setup: &Setup) -> Result<[Ramped; N], ConfigureError>
    where
        Self: Sized,
    {
        let name = self.head().name;
        let parameters = self.parameters();
        let opened = parameters.iter().map(|parameter| {
            let is_weight = parameter.is_weight();
            setup.parameter(&parameter.key(name)).map(|parameter| Ramped::new(parameter, is_weight))
        });
        let opened = opened.collect::<Result<Vec<_>, _>>()?;
        let count = opened.len();
        opened
            .try_into()
            .map_err(|_| ConfigureError::failed(format!("a task that reads {N} of its {count} parameters")))
    }
}

/// Name, priority and inputs of a task.
pub(crate) struct TaskHead<'a> {
    /// Name of the task, used as a prefix of its parameter names.
    pub(crate) name: &'a str,
    /// Priority level; lower numbers have strict priority.
    pub(crate) level: u32,
    /// Name of the target's input, if the task has one.
    pub(crate) target: Option<&'a str>,
    /// Name of the input for a measured wrench, if the task has one.
    pub(crate) wrench: Option<&'a str>,
    /// Formulations of the controller that the task supports.
    pub(crate) formulations: Formulations,
    /// Unknowns of the controller that the task involves.
    pub(crate) acts_on: ActsOn,
}

impl<'a> TaskHead<'a> {
    /// Creates the head of a task without inputs, for velocities and torques.
    pub(super) fn new(name: &'a str, level: u32) -> Self {
        let (formulations, acts_on) = (Formulations::Both, ActsOn::Body);
        Self { name, level, target: None, wrench: None, formulations, acts_on }
    }

    pub(super) fn target(self, target: &'a str) -> Self {
        Self { target: Some(target), ..self }
    }

    pub(super) fn wrench(self, wrench: &'a str) -> Self {
        Self { wrench: Some(wrench), ..self }
    }

    pub(super) fn only(self, formulations: Formulations) -> Self {
        Self { formulations, ..self }
    }

    pub(super) fn acts_on(self, acts_on: ActsOn) -> Self {
        Self { acts_on, ..self }
    }
}

/// A parameter of a task.
pub(crate) struct TaskParameter {
    name: &'static str,
    default: f64,
    range: RangeInclusive<f64>,
    unit: &'static str,
    doc: &'static str,
}

impl TaskParameter {
    pub(super) fn new(
        name: &'static str,
        default: f64,
        range: RangeInclusive<f64>,
        unit: &'static str,
        doc: &'static str,
    ) -> Self {
        Self { name, default, range, unit, doc }
    }

    /// Returns `true` for a weight: the value 0 disables it.
    fn is_weight(&self) -> bool {
        self.name.ends_with("weight")
    }

    fn key(&self, task: &str) -> String {
        format!("{task}_{}", self.name)
    }

    /// Declares the input for the task of this name.
    fn declare(self, task: &str, declare: &mut Declare) {
        declare.float(&self.key(task), self.default, self.range, self.unit, self.doc);
    }
}

/// Formulations of the controller in which a kind of task has a cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Formulations {
    /// Velocities and torques.
    Both,
    /// Velocities only, and advice for torques.
    Velocity(&'static str),
    /// Torques alone.
    Torque,
}

/// Unknowns of the controller that a kind of task acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ActsOn {
    /// Body motion, caused by both joints and contact forces.
    Body,
    /// Joint motion only; contact forces have no effect.
    Joints,
    /// Contact forces and torques.
    Forces,
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use nalgebra::Vector3;
    use serde_json::json;

    use super::*;
    use crate::tasks::TaskConfig;

    /// The keys of all kinds of tasks except `constraint`.
    fn kinds() -> Vec<String> {
        let schema = schemars::schema_for!(TaskConfig);
        let kinds = schema.as_value()["oneOf"].as_array().expect("one schema per kind");
        let keys = kinds.iter().map(|kind| kind["required"][0].as_str().expect("a key").to_owned());
        keys.filter(|key| key != "constraint").collect()
    }

    fn task(kind: &str, keys: serde_json::Value) -> TaskConfig {
        serde_json::from_value(json!({ kind: keys })).expect("a task")
    }

    #[test]
    fn name_of_a_task_defaults_to_its_kind() {
        assert_eq!(kinds().len(), 15);
        for kind in kinds() {
            let task = task(&kind, json!({}));
            let configured = task.configured(3).expect("a task with a table");
            assert_eq!(configured.kind.head().name, kind);
            assert_eq!(configured.path, format!("tasks[3].{kind}"));
        }
    }

    #[test]
    fn live_parameters_are_keys_with_their_values() {
        for kind in kinds() {
            let default = task(&kind, json!({}));
            let parameters = default.configured(0).expect("a task with a table").kind.parameters();
            assert!(!parameters.is_empty(), "{kind}");
            for TaskParameter { name, default, range, .. } in parameters {
                assert!(range.contains(&default), "{kind}: {name}");
                let changed = 0.5 * default + 0.25;
                let task = task(&kind, json!({ name: changed }));
                let parameters = task.configured(0).expect("a task with a table").kind.parameters();
                let found = parameters.iter().find(|parameter| parameter.name == name);
                assert_eq!(found.map(|parameter| parameter.default), Some(changed), "{kind}: {name}");
            }
        }
    }

    #[test]
    fn live_numbers_out_of_range_are_rejected_by_key() {
        let panda = motorium_robots::load("panda", Path::new("."));
        let panda = panda.expect("a robot of the catalogue");
        let world = World::default();
        for kind in kinds() {
            let default = task(&kind, json!({}));
            for parameter in default.configured(0).expect("a task with a table").kind.parameters() {
                let mut keys = json!({ parameter.name: -1.0 });
                if kind == "rolling" {
                    keys["radius"] = json!(0.1);
                }
                let task = task(&kind, keys);
                let configured = task.configured(0).expect("a task with a table");
                let context = TaskContext {
                    model: &panda.model,
                    profile: panda.profile.as_ref(),
                    period: 0.0,
                    torque: true,
                    gravity: Vector3::zeros(),
                    world: &world,
                    contacts: &[],
                    wheels: &[],
                    is_constraint: false,
                    path: configured.path,
                };
                let key = context.key(parameter.name);
                let error = configured.kind.check_keys(&context).expect_err("a number out of range");
                assert_eq!(error.key, Some(key));
            }
        }
    }
}
