//! Components whose kind, ports and configuration are known at run time only.

use serde_json::Value;

use super::{ConfigureError, Episode, Setup, Tick};
use crate::declare::{ConfigError, Declare, StepError};

/// A component as an object, for programs that run scripts and for bindings to other languages, which have no
/// Rust type for each component.
///
/// Its methods are the methods of [`Component`](super::Component). Its configuration is JSON, its ports are
/// usually from [`raw`](crate::raw), and it declares by [`Declare::resets`] that it can be reset.
/// `program::main_of` is the `main` of its program, which a graph names by `exec`.
///
/// ```no_run
/// use motorium::component::{ConfigureError, DynamicComponent, Setup, Tick};
/// use motorium::declare::{ConfigError, Declare, StepError};
/// use motorium::raw::RawInput;
///
/// /// Counts the values of a topic of any type.
/// #[derive(Default)]
/// struct Counter {
///     input: Option<RawInput>,
///     count: u64,
/// }
///
/// impl DynamicComponent for Counter {
///     fn kind(&self) -> &str {
///         "example.counter"
///     }
///
///     fn summary(&self) -> &str {
///         "counts values"
///     }
///
///     fn declare(&self, _: &serde_json::Value, declare: &mut Declare) -> Result<(), ConfigError> {
///         declare.raw_input("input", "any topic");
///         Ok(())
///     }
///
///     fn configure(&mut self, _: serde_json::Value, setup: &mut Setup) -> Result<(), ConfigureError> {
///         self.input = Some(setup.raw_input("input")?);
///         Ok(())
///     }
///
///     fn step(&mut self, _: &Tick) -> Result<(), StepError> {
///         self.count += u64::from(self.input.as_mut().is_some_and(|input| input.next_unread().is_some()));
///         Ok(())
///     }
/// }
///
/// fn main() -> std::process::ExitCode {
///     motorium::program::main_of(Counter::default())
/// }
/// ```
pub trait DynamicComponent: 'static {
    /// Returns the name of its kind, `family.name`, for messages and lists.
    fn kind(&self) -> &str;

    /// Returns a one-line summary for lists.
    fn summary(&self) -> &str;

    /// Returns the JSON Schema (draft 7) of its `config` table. The default accepts any table.
    fn schema(&self) -> Value {
        serde_json::json!({ "type": "object" })
    }

    /// Declares ports and parameters, and checks the `config` table.
    ///
    /// # Errors
    /// The configuration is invalid; the graph is rejected before anything starts.
    fn declare(&self, config: &Value, declare: &mut Declare) -> Result<(), ConfigError>;

    /// Opens the ports and allocates all memory that it will ever need. Called once.
    ///
    /// # Errors
    /// The component cannot run.
    fn configure(&mut self, config: Value, setup: &mut Setup) -> Result<(), ConfigureError>;

    /// Computes one step, with the rules of [`Component::step`](super::Component::step).
    ///
    /// # Errors
    /// The step failed; the policy `on_error` of the graph file decides on the consequence.
    fn step(&mut self, tick: &Tick) -> Result<(), StepError>;

    /// Resets to the state after [`configure`](Self::configure) for a new episode, if it declared that it can
    /// be reset.
    ///
    /// # Errors
    /// The component cannot continue; the run ends.
    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        Err(StepError::failed("it cannot be reset"))
    }

    /// Begins an episode in real time, as [`Component::begin_episode`](super::Component::begin_episode).
    ///
    /// # Errors
    /// The component cannot begin the episode; the policy `on_error` of the graph file decides on the
    /// consequence.
    fn begin_episode(&mut self, _: &Episode) -> Result<(), StepError> {
        Ok(())
    }

    /// Called once when the run ends in an orderly way.
    fn stop(&mut self) {}

    /// Returns the component's entry under `results` in the report of the finished run.
    fn result(&self) -> Option<Value> {
        None
    }
}
