//! The check of every command before an actuator applies it.

use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use crate::component::Setup;
use crate::plan::SafeState;
use crate::region::{Command, MissCause, add};
use crate::state::{Field as _, JointCommand};
use crate::transport::{Context, Input, Reading};

/// A check, at every step of an actuator, of the command it is about to apply.
///
/// A command is applied only while it is fresh and the run is not in a safe stop, whichever other processes still live.
/// Otherwise the actuator applies the safe state by itself. One guard checks one command input.
///
/// ```
/// use motorium::prelude::*;
/// use motorium::safety::{CommandGuard, Verdict};
///
/// struct Drive {
///     command: Input<JointCommand>,
///     guard: CommandGuard,
///     held: [f64; MAX_JOINTS],
///     position: [f64; MAX_JOINTS],
/// }
///
/// impl Drive {
///     fn configure(setup: &mut Setup) -> Result<Self, ConfigureError> {
///         let zero = [0.0; MAX_JOINTS];
///         let guard = setup.command_guard();
///         Ok(Self { command: setup.input("joint_command")?, guard, held: zero, position: zero })
///     }
///
///     fn setpoint(&mut self) -> [f64; MAX_JOINTS] {
///         match self.guard.check(&mut self.command) {
///             Verdict::Apply(command) => self.held[..command.count()].copy_from_slice(command.position()),
///             Verdict::Safe { entered: true, .. } => self.held = self.position,
///             Verdict::Safe { entered: false, .. } => {}
///         }
///         self.held
///     }
/// }
/// ```
#[derive(Debug)]
pub struct CommandGuard {
    context: Rc<Context>,
    stale_after_ns: u64,
    safe_state: SafeState,
    /// A command has been applied before: from then on a stale one is a miss.
    armed: bool,
    /// The safe state was the verdict of the last check.
    safe: bool,
}

/// The verdict on the command of one step.
#[derive(Debug)]
pub enum Verdict<'a> {
    /// Apply this command, within the limits of the robot.
    Apply(Reading<'a, JointCommand>),
    /// Apply the safe state.
    Safe {
        /// The safe state of the graph.
        state: SafeState,
        /// True in the first step of the safe state: `hold` then keeps the position of this moment.
        entered: bool,
    },
}

impl Setup {
    /// The check of a command input. For components that declared [`actuator`](crate::declare::Declare::actuator).
    pub fn command_guard(&self) -> CommandGuard {
        let safety = &self.plan().safety;
        CommandGuard {
            context: self.context().clone(),
            stale_after_ns: safety.stale_after_ns,
            safe_state: safety.safe_state,
            armed: false,
            safe: false,
        }
    }
}

impl CommandGuard {
    /// Checks the newest command. The safe state applies before the first command, from the moment the command is older
    /// than `stale_after`, and while the run is stopping; a fresh command ends it unless the run is stopping.
    pub fn check<'a>(&mut self, input: &'a mut Input<JointCommand>) -> Verdict<'a> {
        let stopping = self.context.is_stopping() || self.context.region().header().command() != Command::Run;
        let block = self.context.block();
        let fresh = !stopping
            && input.latest().is_some_and(|command| {
                let is_valid = command.check().is_ok();
                if !is_valid {
                    add(&block.refused, 1);
                }
                is_valid && command.age_ns() <= self.stale_after_ns
            });
        if fresh && let Some(command) = input.current() {
            (self.armed, self.safe) = (true, false);
            if block.safe.load(Relaxed) != 0 {
                block.safe.store(0, Relaxed);
            }
            return Verdict::Apply(command);
        }
        // Of this process: its predecessor may have been killed in the safe state and left the flag set.
        let entered = !self.safe;
        self.safe = true;
        if entered {
            block.safe_since_ns.store(crate::os::monotonic_ns(), Relaxed);
            block.safe.store(1, Relaxed);
        }
        if self.armed && !stopping {
            block.miss(MissCause::LateInput);
        }
        Verdict::Safe { state: self.safe_state, entered }
    }
}
