//! The static plan: the tasks of every core, and their releases.
//!
//! A *task* is the unit of the analysis: a real-time component (the *head*) together with all components that
//! it triggers, directly or through others, on the same core. All of them have the same priority, or
//! priorities that rise along the chain but stay below every other priority. The *stages* of a task run one
//! after the other. The first stage is the head, the second stage consists of all components that the head
//! triggers, and so on. Under `SCHED_FIFO` a woken thread goes to the end of the queue of its priority, and
//! threads of that priority do not preempt each other. All components triggered by one stage therefore run
//! before the components that the next stage triggers. With rising priorities, a triggered component wakes
//! when the triggering step ends, and runs immediately. If priorities rise and a component triggers several
//! components, the order in which these components and the components that they trigger run is unknown. From
//! there on, all components form one stage. A component that is triggered from a different core, or by a
//! component of a different priority, is the head of a separate task.

use serde::Serialize;

use super::overheads::Overheads;
use crate::plan::{Activation, ComponentPlan, OnOverrun, Plan, SchedulingClass, Spin};

/// All real-time components of a graph as tasks, as input of the timing analysis.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StaticPlan {
    /// Tasks, each after the task that triggers it.
    pub tasks: Vec<Task>,
    /// For each component of the plan, its position among the tasks; `None` for a component that is not
    /// real-time or may run on several cores.
    pub places: Vec<Option<Place>>,
    /// Components under `SCHED_DEADLINE`, which run ahead of all tasks on any core.
    pub reservations: Vec<Reservation>,
    /// Number of cores that the graph uses, for real-time and shared work together.
    pub available_cores: usize,
}

/// A component that the kernel schedules by its deadline (`SCHED_DEADLINE`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Reservation {
    /// Step of the component.
    pub step: Step,
    /// Core time that the kernel grants in each period, ns.
    pub runtime_ns: u64,
    /// Period and relative deadline, ns.
    pub period_ns: u64,
    /// Offset of the first release, ns.
    pub phase_ns: u64,
    /// True if releases are always at a multiple of the period after the first release.
    pub fixed: bool,
}

impl Reservation {
    /// Returns the reserved fraction of a core, 0 to 1.
    pub fn share(&self) -> f64 {
        self.runtime_ns as f64 / self.period_ns as f64
    }
}

/// Position of a component in a static plan: its task, and its stage in the task.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Place {
    /// Index of the component's task.
    pub task: usize,
    /// Index of the component's stage in the task.
    pub stage: usize,
}

/// Components that trigger one another on one core at one priority.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Task {
    /// Index of the core.
    pub core: usize,
    /// `SCHED_FIFO` priority of the task's first component. Triggered components may have a higher priority.
    pub priority: u8,
    /// Time between two releases of the first component in the whole trigger chain, ns. The minimum time if
    /// events release this component.
    pub period_ns: u64,
    /// Condition that releases the first stage.
    pub release: Release,
    /// Stages, which run one after the other.
    pub stages: Vec<Stage>,
}

/// Condition that releases a task.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Release {
    /// By the clock, at `start + phase + n * period`.
    Timer {
        /// Offset of the first release, ns.
        phase_ns: u64,
        /// Maximum time before a release at which spinning starts, ns.
        spin_ns: u64,
        /// `true` if spinning may start less than `spin_ns` before the release, depending on the wake-up
        /// errors of the machine.
        tuned: bool,
        /// `true` if releases always follow the formula above; `false` if the overrun policy is `rephase`,
        /// which shifts later releases.
        fixed: bool,
    },
    /// By an event from outside the graph, signalled by a file descriptor, at any time but at least one
    /// period after the previous release (a sporadic task).
    Event,
    /// By a publication of another component.
    Trigger {
        /// Index of the publishing component in the plan.
        by: usize,
        /// Maximum time from the publication until the triggered component's core is notified, ns.
        delay_ns: u64,
    },
}

/// Components that are triggered together and run one after the other.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Stage {
    /// Steps of the components.
    pub steps: Vec<Step>,
}

/// One step of one component, with the load that it puts on its core.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Step {
    /// Index of the component in the plan.
    pub component: usize,
    /// Allowed execution time, ns; `None` if the graph sets no budget.
    pub budget_ns: Option<u64>,
    /// Overhead of the runtime and the machine, ns.
    pub overhead_ns: u64,
    /// Part of the overhead that follows the publication of the step, ns.
    pub after_ns: u64,
    /// Maximum time for which the step waits for an answer from outside the graph without using the core, ns.
    pub waits_ns: u64,
}

impl Step {
    /// Returns the cost of the step, ns of core time: budget plus overhead. If the step has no budget,
    /// returns the overhead alone.
    pub fn cost_ns(&self) -> u64 {
        self.budget_ns.unwrap_or(0) + self.overhead_ns
    }
}

impl Stage {
    /// Returns the cost of the stage, ns: the core time of all its steps.
    pub fn cost_ns(&self) -> u64 {
        self.steps.iter().map(Step::cost_ns).sum()
    }
}

impl Stage {
    /// Returns the maximum total time for which the steps of the stage wait without using the core, ns.
    pub fn waits_ns(&self) -> u64 {
        self.steps.iter().map(|step| step.waits_ns).sum()
    }
}

impl Task {
    /// Returns the time for which the head of the task spins before every release, ns.
    pub fn spin_ns(&self) -> u64 {
        match self.release {
            Release::Timer { spin_ns, .. } => spin_ns,
            Release::Trigger { .. } | Release::Event => 0,
        }
    }

    /// Returns the cost of one release of the task, ns: the core time for spinning and for all stages.
    pub fn cost_ns(&self) -> u64 {
        self.spin_ns() + self.stages.iter().map(Stage::cost_ns).sum::<u64>()
    }

    /// Returns the maximum total time for which the steps of one release wait without using the core, ns.
    pub fn waits_ns(&self) -> u64 {
        self.stages.iter().map(Stage::waits_ns).sum()
    }

    /// Returns the steps of all stages of the task.
    pub fn steps(&self) -> impl Iterator<Item = &Step> {
        self.stages.iter().flat_map(|stage| &stage.steps)
    }

    /// Returns the index in the plan of the component at the head of the task.
    pub fn head(&self) -> usize {
        self.stages[0].steps[0].component
    }
}

impl StaticPlan {
    /// Creates the tasks of a plan.
    pub fn from_plan(plan: &Plan, overheads: &Overheads) -> Self {
        let mut cores = plan.scheduling.shared_cores.clone();
        cores.extend(plan.components.iter().filter_map(|component| component.core));
        cores.sort_unstable();
        cores.dedup();
        let mut made = Self {
            tasks: Vec::new(),
            places: vec![None; plan.components.len()],
            reservations: plan
                .components
                .iter()
                .enumerate()
                .filter_map(|c| reservation(c, overheads))
                .collect(),
            available_cores: cores.len().max(1),
        };
        // writers precede the components they trigger, so that a task exists when its members are placed
        let mut order: Vec<usize> = (0..plan.components.len()).collect();
        order.sort_by_key(|component| plan.components[*component].order);
        for index in order {
            made.assign(plan, index, overheads);
        }
        made.join_open_stages(plan);
        made
    }

    /// Combines all components of unknown order into one stage.
    fn join_open_stages(&mut self, plan: &Plan) {
        for (index, task) in self.tasks.iter_mut().enumerate() {
            let rises = task.steps().any(|step| plan.components[step.component].rise > 0);
            let Some(open) = task.stages.iter().position(|stage| stage.steps.len() > 1).filter(|_| rises)
            else {
                continue;
            };
            let rest = task.stages.split_off(open + 1);
            task.stages[open].steps.extend(rest.into_iter().flat_map(|stage| stage.steps));
            for place in self.places.iter_mut().flatten().filter(|place| place.task == index) {
                place.stage = place.stage.min(open);
            }
        }
    }

    fn assign(&mut self, plan: &Plan, index: usize, overheads: &Overheads) {
        let component = &plan.components[index];
        let (Some(own), Some(core)) = (priority(component), core(plan, component)) else { return };
        let priority = own - component.rise.min(own);
        let spin_ns = component.spin.at_most_ns();
        let mut step = step(index, component, overheads);
        let release = match component.activation {
            Activation::Periodic { period_ns, phase_ns } => Release::Timer {
                phase_ns,
                // a component that always spins uses all the time
                spin_ns: spin_ns.min(period_ns),
                tuned: matches!(component.spin, Spin::Tuned { .. }),
                fixed: component.on_overrun != OnOverrun::Rephase,
            },
            Activation::Descriptor { .. } => Release::Event,
            Activation::Triggered { topic, .. } => {
                let by = plan.topics[topic].writer;
                let writer = &plan.components[by];
                // a component that runs on any core may have run on this core
                if has_deadline(writer) {
                    step.overhead_ns += overheads.hop_same_core_ns;
                }
                if self::core(plan, writer) == Some(core) {
                    step.overhead_ns += overheads.hop_same_core_ns;
                    let place = self.places[by].filter(|place| {
                        let task = &self.tasks[place.task];
                        (task.core, task.priority) == (core, priority)
                    });
                    if let Some(Place { task, stage }) = place {
                        let stages = &mut self.tasks[task].stages;
                        stages.resize_with(stages.len().max(stage + 2), Stage::default);
                        stages[stage + 1].steps.push(step);
                        self.places[index] = Some(Place { task, stage: stage + 1 });
                        return;
                    }
                    Release::Trigger { by, delay_ns: 0 }
                } else {
                    step.overhead_ns += overheads.look_ns;
                    step.after_ns += overheads.look_ns;
                    Release::Trigger { by, delay_ns: overheads.hop_cross_core_ns }
                }
            }
        };
        self.places[index] = Some(Place { task: self.tasks.len(), stage: 0 });
        self.tasks.push(Task {
            core,
            priority,
            period_ns: component.period_ns(),
            release,
            stages: vec![Stage { steps: vec![step] }],
        });
    }

    /// Returns a component's reservation and the index of the reservation; `None` if the component has no
    /// reservation.
    pub fn reservation(&self, component: usize) -> Option<(usize, &Reservation)> {
        self.reservations.iter().enumerate().find(|(_, reservation)| reservation.step.component == component)
    }

    /// Returns `true` if the static plan contains the component, in a task or as a reservation.
    pub fn knows(&self, component: usize) -> bool {
        self.places[component].is_some() || self.reservation(component).is_some()
    }

    /// Returns the cores that have tasks, in ascending order.
    pub fn cores(&self) -> Vec<usize> {
        let mut cores: Vec<usize> = self.tasks.iter().map(|task| task.core).collect();
        cores.sort_unstable();
        cores.dedup();
        cores
    }

    /// Returns the indices of the tasks on a core.
    pub fn on_core(&self, core: usize) -> Vec<usize> {
        (0..self.tasks.len()).filter(|task| self.tasks[*task].core == core).collect()
    }
}

/// Returns the kernel's reservation for a component scheduled by its deadline.
fn reservation(component: (usize, &ComponentPlan), overheads: &Overheads) -> Option<Reservation> {
    let (index, component) = component;
    let SchedulingClass::Deadline { runtime_ns, period_ns } = component.class else { return None };
    let phase_ns = match component.activation {
        Activation::Periodic { phase_ns, .. } => phase_ns,
        // refused when the graph is read
        Activation::Triggered { .. } | Activation::Descriptor { .. } => return None,
    };
    let step = step(index, component, overheads);
    let fixed = component.on_overrun != OnOverrun::Rephase;
    Some(Reservation { step, runtime_ns, period_ns, phase_ns, fixed })
}

/// Returns the step of a component, with the overhead common to all triggers.
fn step(index: usize, component: &ComponentPlan, overheads: &Overheads) -> Step {
    let timer_ns = match component.activation {
        Activation::Periodic { .. } | Activation::Descriptor { .. } => overheads.timer_ns,
        Activation::Triggered { .. } => 0,
    };
    let added_ns = overheads.worker_ns + timer_ns;
    Step {
        component: index,
        budget_ns: component.budget_ns,
        overhead_ns: added_ns,
        after_ns: added_ns,
        waits_ns: component.waits_ns,
    }
}

/// Returns `true` if the kernel schedules a component under `SCHED_DEADLINE`, on any core.
pub(in crate::schedule) fn has_deadline(component: &ComponentPlan) -> bool {
    matches!(component.class, SchedulingClass::Deadline { .. })
}

/// Returns the priority of a `SCHED_FIFO` component.
pub(in crate::schedule) fn priority(component: &ComponentPlan) -> Option<u8> {
    match component.class {
        SchedulingClass::Fifo(priority) => Some(priority),
        _ => None,
    }
}

/// Returns the core of a component that may only run on one core.
pub(in crate::schedule) fn core(plan: &Plan, component: &ComponentPlan) -> Option<usize> {
    if has_deadline(component) {
        return None;
    }
    match (component.core, plan.scheduling.shared_cores.as_slice()) {
        (Some(core), _) => Some(core),
        (None, [only]) => Some(*only),
        (None, _) => None,
    }
}
