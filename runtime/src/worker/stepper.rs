//! One step of a component, and its counters.

use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use super::account::{self, Accounts, Consequence};
use super::failure::{self, Cause, Failure};
use super::rest::Rest;
use super::timing::Timing;
use crate::component::{Component, DynamicComponent, Episode, Helpers, Tick};
use crate::context::{Access, Context};
use crate::declare::StepError;
use crate::os;
use crate::parameter::ParameterReader;
use crate::plan::{ComponentPlan, OnError, OnOverrun, component_seed};
use crate::region::{Command, EpisodeStart, add};
use crate::run_folder::RunFolder;
use crate::telemetry::{Allocations, allocations, counts_allocations};

/// Number of steps after which a component counts as warmed up. Allocations and page faults are counted from
/// then on.
pub(crate) const WARM_UP: u64 = 100;

/// Number of cache lines of a component that are prefetched when its thread wakes; they usually contain its
/// ports.
const COMPONENT_LINES: usize = 8;

/// A component of any type, so that the loops around its steps are compiled only once and their instructions
/// are contiguous.
pub(super) trait AnyComponent {
    fn step(&mut self, tick: &Tick) -> Result<(), StepError>;
    fn begin_episode(&mut self, episode: &Episode) -> Result<(), StepError>;
    fn reset(&mut self, episode: &Episode) -> Result<(), StepError>;
    fn stop(&mut self);
    fn result(&self) -> Option<serde_json::Value>;
}

impl<C: Component> AnyComponent for C {
    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        Component::step(self, tick)
    }

    fn begin_episode(&mut self, episode: &Episode) -> Result<(), StepError> {
        Component::begin_episode(self, episode)
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        Component::reset(self, episode)
    }

    fn stop(&mut self) {
        Component::stop(self);
    }

    fn result(&self) -> Option<serde_json::Value> {
        Component::result(self)
    }
}

/// A component that is only known at run time.
pub(super) struct Dynamic(pub(super) Box<dyn DynamicComponent>);

impl AnyComponent for Dynamic {
    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.0.step(tick)
    }

    fn begin_episode(&mut self, episode: &Episode) -> Result<(), StepError> {
        self.0.begin_episode(episode)
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        self.0.reset(episode)
    }

    fn stop(&mut self) {
        self.0.stop();
    }

    fn result(&self) -> Option<serde_json::Value> {
        self.0.result()
    }
}

/// A component ready to step.
pub(super) struct Stepper {
    component: Box<dyn AnyComponent>,
    context: Rc<Context>,
    parameters: ParameterReader,
    plan: ComponentPlan,
    period: Duration,
    /// Number of steps before the current episode of simulated time.
    first: u64,
    /// Episode that the next step begins, if it was already detected.
    next_episode: Option<Episode>,
    own_steps: u64,
    faults_before: u64,
    accounts: Accounts,
    /// Dropped after the component, which passes data to them at its end.
    helpers: Helpers,
}

/// Failure of a step.
enum Wrong {
    Error(StepError),
    Panic(Cause),
}

impl From<Cause> for Wrong {
    fn from(cause: Cause) -> Self {
        Self::Panic(cause)
    }
}

impl Stepper {
    pub(super) fn new(
        component: Box<dyn AnyComponent>,
        context: Rc<Context>,
        parameters: ParameterReader,
        helpers: Helpers,
        plan: &ComponentPlan,
    ) -> Self {
        let period = Duration::from_nanos(plan.period_ns());
        let block = context.block();
        block.counts_allocations.store(u32::from(counts_allocations()), Relaxed);
        // The previous process may have died within a step.
        block.begun.store(block.steps.load(Relaxed), Relaxed);
        let first = block.episode_first.load(Relaxed);
        let accounts = Accounts::new(plan);
        let (first_line, bytes) = ((&raw const *component).cast::<u8>(), size_of_val(&*component));
        context.first_lines().note_range(first_line, bytes, Access::Write, COMPONENT_LINES);
        Self {
            component,
            context,
            parameters,
            plan: plan.clone(),
            period,
            first,
            next_episode: None,
            own_steps: 0,
            faults_before: 0,
            accounts,
            helpers,
        }
    }

    pub(super) fn context(&self) -> &Context {
        &self.context
    }

    pub(super) fn period_ns(&self) -> u64 {
        self.plan.period_ns()
    }

    pub(super) fn on_overrun(&self) -> OnOverrun {
        self.plan.on_overrun
    }

    /// Checks for a real-time episode that has begun and computes its seed ahead of the next step.
    pub(super) fn look_for_episode(&mut self) {
        if let Some(start) = self.context.new_episode() {
            self.next_episode = Some(self.episode(start));
        }
    }

    /// Returns the episode for the component.
    fn episode(&self, start: EpisodeStart) -> Episode {
        Episode { index: start.index, seed: component_seed(start.seed, &self.plan.name) }
    }

    /// Returns the episode that this step begins, if any.
    #[inline(always)]
    fn begun_episode(&mut self) -> Option<Episode> {
        let index = self.context.new_episode_index()?;
        let found = self.next_episode.take().filter(|episode| episode.index == index);
        let begun = found.or_else(|| self.context.new_episode().map(|start| self.episode(start)))?;
        self.context.enter_episode(begun.index);
        Some(begun)
    }

    /// Runs one step and counts it. Returns its end, ns on `CLOCK_MONOTONIC` (simulated time in lockstep).
    ///
    /// It is inlined into each loop, because after a sleep every page of instructions costs an address
    /// translation.
    #[inline(always)]
    pub(super) fn step(&mut self, timing: Timing) -> Result<u64, Failure> {
        let begun = self.begun_episode();
        let context = &*self.context;
        let block = context.block();
        let steps = block.steps.load(Relaxed);
        let start_ns = context.clock().start_ns();
        let tick = Tick {
            index: steps - self.first,
            time_ns: timing.release_ns.saturating_sub(start_ns),
            deadline_ns: timing.deadline_ns.saturating_sub(start_ns),
            period: self.period,
            episode: context.episode(),
            begins_episode: steps == self.first || begun.is_some(),
            settling: context.region().header().command() != Command::Run,
        };
        context.enter_step(timing.release_ns, timing.wake_ns, timing.deadline_ns);
        // The watchdog reads this: a step has begun.
        block.last_step_ns.store(timing.wake_ns, Relaxed);
        block.begun.store(steps + 1, Relaxed);
        if steps == self.first {
            block.first_step_ns.store(timing.wake_ns, Relaxed);
        }
        let begin_ns = context.traced_ns(timing.wake_ns);
        let before = allocations();
        self.parameters.refresh();
        let component = &mut self.component;
        let result = failure::guard(|| {
            if let Some(episode) = begun {
                block.episode.store(episode.index, Relaxed);
                component.begin_episode(&episode).map_err(Wrong::Error)?;
            }
            component.step(&tick).map_err(Wrong::Error)
        });
        let after = allocations();
        let end = if context.clock().is_lockstep() {
            timing.release_ns
        } else {
            let end = os::monotonic_ns();
            // The outputs are published. Triggered components of higher priority on this core run before the
            // next line.
            context.deferred().wake();
            self.accounts.handed_over(os::monotonic_ns() - end);
            end
        };
        context.deferred().finish(context.first_lines());
        context.note_step(steps, timing.release_ns, begin_ns, context.traced_ns(end));

        self.own_steps += 1;
        block.steps.store(steps + 1, Relaxed);
        if self.own_steps > WARM_UP {
            self.count_allocations(before, after);
        } else if self.own_steps == WARM_UP {
            self.faults_before = os::page_faults();
        }
        if let Err(wrong) = result {
            self.apply_error_policy(wrong, steps)?;
        }
        Ok(end)
    }

    /// Resets the component, its ports and its clock for an episode with this index and seed.
    pub(super) fn reset(&mut self, index: u64, seed: u64) -> Result<(), Failure> {
        let tick = self.context.block().steps.load(Relaxed);
        self.first = tick;
        self.context.begin_episode(index);
        self.context.block().episode.store(index, Relaxed);
        let episode = Episode { index, seed: component_seed(seed, &self.plan.name) };
        let component = &mut self.component;
        failure::guard(|| component.reset(&episode).map_err(|error| Cause::from(error.to_string())))
            .map_err(|cause| cause.during(&format!("its reset for episode {index}")).into_failure(tick))
    }

    fn count_allocations(&self, before: Allocations, after: Allocations) {
        let block = self.context.block();
        if after.own != before.own {
            add(&block.allocations, after.own - before.own);
        }
        if after.set_apart != before.set_apart {
            add(&block.allocations_apart, after.set_apart - before.set_apart);
        }
    }

    #[cold]
    fn apply_error_policy(&self, wrong: Wrong, tick: u64) -> Result<(), Failure> {
        match wrong {
            // A panic cannot be tolerated, because it leaves the component in an unknown state.
            Wrong::Panic(cause) => Err(cause.into_failure(tick)),
            Wrong::Error(error) if self.plan.on_error == OnError::Fail => {
                Err(Failure::error(tick, error.to_string()))
            }
            Wrong::Error(error) => {
                let block = self.context.block();
                if block.errors.load(Relaxed) == 0 {
                    block.set_failure(&Failure::error(tick, error.to_string()));
                }
                add(&block.errors, 1);
                Ok(())
            }
        }
    }

    /// Starts the statistics before the first step.
    pub(super) fn open_accounts(&mut self) {
        self.accounts.open();
    }

    /// Records a wake-up at `wake_ns`. A loop that has not `slept` rests if a rest is due. Returns the time
    /// of waking, ns, which is later after a rest.
    pub(super) fn woke(&mut self, wake_ns: u64, slept: bool, rest: &mut Rest) -> u64 {
        if slept {
            rest.slept(wake_ns);
        } else if rest.is_due(wake_ns) {
            rest.take();
        } else {
            return wake_ns;
        }
        self.slept();
        if slept { wake_ns } else { os::monotonic_ns() }
    }

    /// Records that the worker slept before the next step.
    pub(super) fn slept(&mut self) {
        self.accounts.slept();
    }

    /// Adds time spent spinning before the next release, ns.
    pub(super) fn spun(&mut self, margin_ns: u64, spun_ns: u64) {
        account::show_spin(self.context.block(), margin_ns, spun_ns);
        self.accounts.spun(spun_ns);
    }

    /// Records the timing of a finished step in real time.
    pub(super) fn account(&mut self, timing: Timing, end_ns: u64) {
        if self.accounts.enter(self.context.block(), timing, end_ns) == Consequence::SafeStop {
            self.context.region().header().order(Command::SafeStop);
        }
    }

    /// Records the duration of a finished step in lockstep.
    pub(super) fn account_lockstep(&mut self, execution_ns: u64) {
        let block = self.context.block();
        self.accounts.charge(block);
        block.execution.record(execution_ns);
        block.lateness.record(0);
    }

    /// Records the duration of a finished step of a component that shares its thread with others. Reading the
    /// thread's CPU time would cost a system call per step.
    pub(super) fn account_inline(&mut self, execution_ns: u64) {
        let block = self.context.block();
        block.execution.record(execution_ns);
        block.lateness.record(0);
    }

    /// Stops the component and saves its result.
    pub(super) fn finish(mut self, folder: &RunFolder) -> Result<(), Failure> {
        let block = self.context.block();
        if self.own_steps > WARM_UP {
            block.page_faults.store(os::page_faults() - self.faults_before, Relaxed);
        }
        let tick = block.steps.load(Relaxed);
        let component = &mut self.component;
        let result = failure::guard(|| {
            component.stop();
            Ok(component.result())
        });
        let result = result.map_err(|cause: Cause| cause.into_failure(tick))?;
        if let Some(result) = result {
            folder
                .save_result(&self.plan.name, &result)
                .map_err(|error| Failure::error(tick, error.to_string()))?;
        }
        self.helpers.stop().map_err(|text| Failure::error(tick, text))
    }
}
