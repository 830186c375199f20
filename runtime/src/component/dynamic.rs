//! Components whose kind, ports and configuration are only known at run time.

use serde_json::Value;

use super::{ConfigureError, Episode, Setup, Tick};
use crate::declare::{ConfigError, Declare, StepError};

/// A component as a trait object, for programs that run scripts and for bindings to other languages, which
/// have no Rust type for each component.
///
/// The trait has the methods of [`Component`](super::Component), but passes the configuration as JSON.
/// Components usually open the ports of [`raw`](crate::raw), whose types are also only known at run time.
/// [`Declare::resets`] declares that the component can be reset. The `main` function of its program calls
/// `program::main_of`, and a graph names the program by `exec`.
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
    /// Returns the component's kind, `family.name`, for messages and lists.
    fn kind(&self) -> &str;

    /// Returns a one-line summary for lists.
    fn summary(&self) -> &str;

    /// Returns the JSON Schema (draft 7) of the `config` table. The default schema accepts any table.
    fn schema(&self) -> Value {
        serde_json::json!({ "type": "object" })
    }

    /// Declares ports and parameters, and checks the `config` table.
    ///
    /// # Errors
    /// The configuration is invalid. The graph is then rejected before anything starts.
    fn declare(&self, config: &Value, declare: &mut Declare) -> Result<(), ConfigError>;

    /// Opens the ports and allocates all memory that the component will need. Called once.
    ///
    /// # Errors
    /// The component cannot run with this configuration or on this machine.
    fn configure(&mut self, config: Value, setup: &mut Setup) -> Result<(), ConfigureError>;

    /// Computes one step. The rules of [`Component::step`](super::Component::step) apply.
    ///
    /// # Errors
    /// The step failed. The policy `on_error` in the graph file decides on the consequence.
    fn step(&mut self, tick: &Tick) -> Result<(), StepError>;

    /// Resets to the state after [`configure`](Self::configure) for a new episode. Only called if the
    /// component declared [`Declare::resets`].
    ///
    /// # Errors
    /// The component cannot continue. The run then ends.
    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        Err(StepError::failed("it cannot be reset"))
    }

    /// Begins an episode in real time, like [`Component::begin_episode`](super::Component::begin_episode).
    ///
    /// # Errors
    /// The component cannot begin the episode. The policy `on_error` in the graph file decides on the
    /// consequence.
    fn begin_episode(&mut self, _: &Episode) -> Result<(), StepError> {
        Ok(())
    }

    /// Stops the component. Called once at the end of the run, unless the process is killed.
    fn stop(&mut self) {}

    /// Returns the component's entry under `results` in the report of the finished run.
    fn result(&self) -> Option<Value> {
        None
    }
}
