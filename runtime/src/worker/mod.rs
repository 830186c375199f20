//! The loop of one component: wait, read, step, publish, account.
//!
//! The same loop is used for a component in a separate process and for hosted components, in real time and in
//! lockstep.

mod account;
mod config;
mod failure;
mod grid;
mod hosted;
mod lockstep;
mod margin;
mod output;
mod protocol;
mod realtime;
mod registry;
mod rest;
mod rounds;
mod sporadic;
mod stepper;
mod timing;
mod verdict;
mod watcher;

pub use failure::Failure;
pub(crate) use hosted::{Host, Hosted};
pub use protocol::{
    CLEANER, DESCRIBE, DescribeAnswer, DescribeError, DescribeRequest, GUARD, KINDS, KindAnswer, KindsAnswer,
    WORKER,
};
pub(crate) use registry::declare_dynamic;
pub use registry::{ConfigProblem, GravityOfFile, Kind, Registry, RobotCheck, RobotSource, Sibling};
pub(crate) use rounds::Rounds;

use std::os::fd::OwnedFd;
use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use crate::component::{Component, DynamicComponent, Prepared, Setup};
use crate::context::Context;
use crate::declare::ConfigError;
use crate::os::{self, Request};
use crate::plan::{Activation, ClockKind, ComponentPlan, OnDenied, Plan};
use crate::region::{Command, Phase, Region};
use crate::run_folder::RunFolder;
use crate::transport::{Connect, Trigger};
use failure::Cause;
use stepper::{AnyComponent, Stepper};

/// A component of a run that is ready to be configured and run.
#[derive(Debug)]
pub struct Worker {
    folder: RunFolder,
    plan: Plan,
    region: Region,
    index: usize,
    own_process: bool,
}

/// Outcome of running a component from configuration to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The component ended in an orderly way.
    Stopped,
    /// The component failed. The reason is in the component's part of the control block.
    Failed,
}

impl Worker {
    /// Opens the worker of a component in a separate process.
    ///
    /// # Errors
    /// The folder of the run cannot be read, or the run has no such component.
    pub fn open(folder: RunFolder, component: &str) -> Result<Self, String> {
        let plan = folder.plan().map_err(|error| error.to_string())?;
        let region = folder.region().map_err(|error| error.to_string())?;
        if !region.fits(&plan) {
            return Err(format!(
                "the control block of {} does not match its plan: it is damaged",
                folder.id()
            ));
        }
        let index = plan
            .components
            .iter()
            .position(|candidate| candidate.name == component)
            .ok_or_else(|| format!("the run {} has no component `{component}`", folder.id()))?;
        Ok(Self { folder, plan, region, index, own_process: true })
    }

    /// Converts the worker to one hosted in the launcher's process.
    pub(crate) fn hosted(mut self) -> Self {
        self.own_process = false;
        self
    }

    /// Returns the component's entry in the plan.
    pub fn component(&self) -> &crate::plan::ComponentPlan {
        &self.plan.components[self.index]
    }
}

/// Runs a component that is only known at run time, from configuration to its end.
pub(crate) fn run_dynamic(worker: Worker, component: Box<dyn DynamicComponent>) -> Outcome {
    let make = move |config: serde_json::Value| -> Result<Configure, ConfigError> {
        Ok(Box::new(move |setup: &mut Setup| {
            let mut component = component;
            match component.configure(config, setup) {
                Ok(()) => Ok(Box::new(stepper::Dynamic(component)) as Box<dyn AnyComponent>),
                Err(error) => Err(error.with_advice()),
            }
        }))
    };
    run(worker, Box::new(make))
}

/// Runs a component from configuration to its end.
fn run(worker: Worker, make: Make) -> Outcome {
    let index = worker.index;
    let region = Rc::new(worker.region);
    let block = &region.components()[index];
    block.thread.store(os::thread_id() as u32, Relaxed);
    failure::catch_panic_messages();
    let result = live(&worker.folder, &worker.plan, index, &region, worker.own_process, make);
    match result {
        Ok(()) => {
            block.enter(Phase::Stopped);
            Outcome::Stopped
        }
        Err(failure) => {
            block.set_failure(&failure);
            block.enter(Phase::Faulted);
            Outcome::Failed
        }
    }
}

fn live(
    folder: &RunFolder,
    plan: &Plan,
    index: usize,
    region: &Rc<Region>,
    own_process: bool,
    make: Make,
) -> Result<(), Failure> {
    let component = &plan.components[index];
    let block = &region.components()[index];
    let at_setup = |text: String| Failure::error(block.steps.load(Relaxed), text);
    let context = Rc::new(Context::new(plan, index, region.clone()).traced());
    os::install_interrupt().map_err(|error| at_setup(format!("signal handling: {error}")))?;
    let _watcher = if own_process {
        Some(
            watcher::start(&context)
                .map_err(|error| at_setup(format!("watching the launcher: {}", os::named(&error))))?,
        )
    } else {
        None
    };
    if own_process {
        // Without it, the launcher notices its end a few milliseconds later.
        let _ = os::held_word::hold(&block.held);
    }
    let realtime = plan.clock == ClockKind::Realtime && own_process;
    if realtime {
        stand_aside(plan, component);
    } else {
        apply_realtime(plan, index, region, false);
    }

    let Configured { mut stepper, ports, trigger, descriptor } =
        configure(folder, plan, index, context.clone(), make)?;

    // No component steps before all ports of all components are connected.
    block.enter(Phase::Ready);
    if !await_command(&context, |command| command != Command::Configure) {
        return Ok(());
    }
    failure::guard(|| connect(&ports).map_err(Cause::from))
        .map_err(|cause| cause.into_failure(block.steps.load(Relaxed)))?;
    if realtime {
        let denied = apply_realtime(plan, index, region, true);
        if !denied.is_empty() && plan.scheduling.on_denied == OnDenied::Strict {
            let list: Vec<_> = denied.iter().map(ToString::to_string).collect();
            return Err(at_setup(format!("denied by the system: {}", list.join(", "))));
        }
    }
    os::prefault_stack();
    block.enter(Phase::Connected);
    if await_command(&context, |command| command != Command::Configure && command != Command::Connect) {
        context.clock().begin();
        block.enter(Phase::Running);
        match (plan.clock, &component.activation, trigger) {
            (ClockKind::Lockstep, ..) => lockstep::run(&mut stepper, &ports, (plan, region), index)?,
            (ClockKind::Realtime, Activation::Triggered { .. }, Some(trigger)) => {
                let longest_wait = component.actuator.then(|| plan.safety_of(component).stale_after_ns);
                let rest = rest::Rest::new(component);
                realtime::run_triggered(&mut stepper, &trigger, longest_wait, rest)?;
            }
            (ClockKind::Realtime, Activation::Periodic { period_ns, phase_ns }, _) => {
                realtime::run_periodic(
                    &mut stepper,
                    *period_ns,
                    *phase_ns,
                    margin::Margin::new(component.spin),
                    rest::Rest::new(component),
                )?;
            }
            (ClockKind::Realtime, Activation::Descriptor { .. }, _) => {
                let Some(descriptor) = descriptor else { return Err(at_setup(NO_DESCRIPTOR.to_string())) };
                let readiness = os::Readiness::new(descriptor)
                    .map_err(|error| at_setup(format!("waiting for its descriptor: {error}")))?;
                let longest_wait = component.actuator.then(|| plan.safety_of(component).stale_after_ns);
                sporadic::run(&mut stepper, &readiness, longest_wait, rest::Rest::new(component))?;
            }
            (ClockKind::Realtime, Activation::Triggered { .. }, None) => {
                return Err(at_setup("its trigger was not opened".to_string()));
            }
        }
    }
    // Saving a result is not part of a step. An actuator keeps its priority: stopping a drive must not wait
    // for others.
    if realtime && !component.actuator {
        os::leave_realtime();
    }
    stepper.finish(folder)
}

/// A configured component and the ports that are not connected yet.
struct Configured {
    stepper: Stepper,
    ports: Vec<Rc<dyn Connect>>,
    trigger: Option<Trigger>,
    descriptor: Option<OwnedFd>,
}

const NO_DESCRIPTOR: &str =
    "its steps are released by a descriptor, but its `configure` set none with `Setup::wake_on`";

/// The type-specific part of a configuration: it reads the `config` table.
type Make = Box<dyn FnOnce(serde_json::Value) -> Result<Configure, ConfigError>>;
/// Creates the component from a parsed configuration, or returns the reason why it cannot be created.
type Configure = Box<dyn FnOnce(&mut Setup) -> Result<Box<dyn AnyComponent>, String>>;

/// Like [`Make`], for one type.
type MakeType = fn(serde_json::Value) -> Result<Configure, ConfigError>;

/// Reads the configuration of a component. The surrounding code is compiled once for all types.
fn make<C: Component>(config: serde_json::Value) -> Result<Configure, ConfigError> {
    let config = config::read(config)?;
    Ok(Box::new(|setup| match C::configure(config, setup) {
        Ok(component) => Ok(Box::new(component)),
        Err(error) => Err(error.with_advice()),
    }))
}

/// Configures a component: reads its configuration, opens its ports, and allocates its memory.
fn configure(
    folder: &RunFolder,
    plan: &Plan,
    index: usize,
    context: Rc<Context>,
    make: Make,
) -> Result<Configured, Failure> {
    let component = &plan.components[index];
    let tick = context.block().steps.load(Relaxed);
    let at_setup = |cause: Cause| cause.into_failure(tick);
    let configure = make(component.config.clone())
        .map_err(|error| Failure::error(tick, format!("its configuration: {}", error.message)))?;
    // Before the lines of its ports, because the number of lines is limited.
    context.note_first_lines();
    let setup = failure::guard(|| Setup::new(folder, plan, index, context.clone()).map_err(Cause::from));
    let mut setup = setup.map_err(at_setup)?;
    let made = failure::guard(|| configure(&mut setup).map_err(Cause::from)).map_err(at_setup)?;
    let Prepared { ports, parameters, trigger, descriptor, helpers } = setup.finish();
    let stepper = Stepper::new(made, context, parameters, helpers, component);
    Ok(Configured { stepper, ports, trigger, descriptor })
}

/// Connects the ports of a component, after the ports of all components were opened.
fn connect(ports: &[Rc<dyn Connect>]) -> Result<(), String> {
    ports.iter().try_for_each(|port| port.connect().map_err(|error| format!("connecting its ports: {error}")))
}

/// Keeps a component that is being configured off the real-time cores, at normal priority, so that a
/// restarting component does not delay others.
fn stand_aside(plan: &Plan, component: &ComponentPlan) {
    let class = crate::plan::SchedulingClass::Normal;
    let lock_memory = component.class != class;
    let cores = plan.scheduling.shared_cores.clone();
    // A denial is repeated, and then reported, before the first step.
    let _ = os::apply(&Request { class, cores, lock_memory });
}

/// Waits for the launcher's command. Returns `false` if the run ends instead.
fn await_command(context: &Context, wanted: impl Fn(Command) -> bool) -> bool {
    let header = context.region().header();
    loop {
        let command = header.command();
        if command == Command::Stop || context.must_leave() {
            return false;
        }
        if wanted(command) {
            return true;
        }
        os::futex_wait(header.command_word(), command as u32, Some(Duration::from_millis(50)));
    }
}

/// Requests the class, core and locked memory of a component, and records the granted settings.
fn apply_realtime(plan: &Plan, index: usize, region: &Region, own_process: bool) -> Vec<os::Denied> {
    let component = &plan.components[index];
    let block = &region.components()[index];
    // In lockstep only one process runs at a time. All share one core, on which passing the turn is cheapest.
    let lockstep_core = plan.components.iter().find_map(|component| component.core);
    let core = if plan.clock == ClockKind::Lockstep { lockstep_core } else { component.core };
    let cores = core.map_or_else(|| plan.scheduling.shared_cores.clone(), |core| vec![core]);
    let realtime = plan.clock == ClockKind::Realtime && own_process;
    let class = if realtime { component.class } else { crate::plan::SchedulingClass::Normal };
    let lock_memory = class != crate::plan::SchedulingClass::Normal;
    if plan.clock == ClockKind::Lockstep {
        os::hand_over_when_asleep();
    }
    let (applied, mut denied) = os::apply(&Request { class, cores, lock_memory });
    if let Some(limit_ns) = component.liveness.cpu_limit_ns.filter(|_| applied.fifo_priority > 0)
        && let Err(error) = os::limit_cpu(limit_ns)
    {
        denied.push(os::Denied::CpuLimit(error.to_string()));
    }
    block.fifo_priority.store(u32::from(applied.fifo_priority), Relaxed);
    block.deadline.store(u32::from(applied.deadline), Relaxed);
    block.cores.store(applied.cores.iter().filter(|c| **c < 32).fold(0, |mask, c| mask | 1 << c), Relaxed);
    block.memory_locked.store(u32::from(applied.memory_locked), Relaxed);
    denied
}
