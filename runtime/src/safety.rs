//! The last word on commands, spoken on the side that applies them.

use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use crate::component::Setup;
use crate::plan::SafeState;
use crate::region::{Command, MissCause, add};
use crate::state::{Field as _, JointCommand};
use crate::transport::{Context, Input, Reading};

/// Decides at every step of an actuator whether the command may be applied.
///
/// A command is applied only while it is fresh and the run is not in a safe stop, whoever else is still alive. The
/// actuator then applies the safe state by itself.
#[derive(Debug)]
pub struct CommandGuard {
    context: Rc<Context>,
    stale_after_ns: u64,
    safe_state: SafeState,
    armed: bool,
}

/// What an actuator is to do in this step.
#[derive(Debug)]
pub enum Judgement<'a> {
    /// Apply this command, within the limits of the robot.
    Apply(Reading<'a, JointCommand>),
    /// Apply the safe state. `entered` is true in the first step of it.
    Safe {
        /// Which safe state.
        state: SafeState,
        /// Whether it has just begun: hold the position of this moment.
        entered: bool,
    },
}

impl Setup {
    /// The guard that decides whether commands may be applied. For components that declared
    /// [`actuator`](crate::declare::Declare::actuator).
    pub fn command_guard(&self) -> CommandGuard {
        let safety = &self.plan().safety;
        CommandGuard::new(self.context().clone(), safety.stale_after_ns, safety.safe_state)
    }
}

impl CommandGuard {
    fn new(context: Rc<Context>, stale_after_ns: u64, safe_state: SafeState) -> Self {
        Self { context, stale_after_ns, safe_state, armed: false }
    }

    /// Judges the newest command. Before the first command ever, and from the moment the command is older than
    /// `stale_after` or the run is stopping, the safe state applies; a fresh command ends it unless the run is
    /// stopping.
    pub fn judge<'a>(&mut self, input: &'a mut Input<JointCommand>) -> Judgement<'a> {
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
            self.armed = true;
            if block.safe.load(Relaxed) != 0 {
                block.safe.store(0, Relaxed);
            }
            return Judgement::Apply(command);
        }
        let entered = block.safe.load(Relaxed) == 0;
        if entered {
            block.safe_since_ns.store(crate::os::monotonic_ns(), Relaxed);
            block.safe.store(1, Relaxed);
        }
        if self.armed && !stopping {
            block.miss(MissCause::LateInput);
        }
        Judgement::Safe { state: self.safe_state, entered }
    }
}
