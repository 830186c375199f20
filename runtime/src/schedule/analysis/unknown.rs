//! The unknown times of a graph, and the bounds that depend on them.

use super::tasks::{Release, StaticPlan};
use crate::plan::{Activation, Plan};

/// The unknown times of a graph, and the tasks whose bounds depend on them.
#[derive(Debug)]
pub(in crate::schedule) struct Unknown {
    /// Real-time components without a budget.
    pub without_budget: Vec<usize>,
    /// Real-time components triggered by components that are not real-time.
    pub released_by_others: Vec<usize>,
    /// Real-time components that may run on several cores.
    pub without_core: Vec<usize>,
    /// For each task of the static plan, `true` if the bounds of the task rest (depend) on an unknown time.
    pub rests: Vec<bool>,
}

impl Unknown {
    /// Finds the unknown times of a plan.
    pub(in crate::schedule) fn from_plan(plan: &Plan, tasks: &StaticPlan) -> Self {
        let fifo = |component: usize| super::tasks::priority(&plan.components[component]).is_some();
        let all = 0..plan.components.len();
        let without_budget: Vec<usize> =
            all.clone().filter(|c| fifo(*c) && plan.components[*c].budget_ns.is_none()).collect();
        let released_by_others: Vec<usize> = all
            .clone()
            .filter(|component| match plan.components[*component].activation {
                Activation::Triggered { topic, .. } => {
                    let writer = plan.topics[topic].writer;
                    fifo(*component) && !fifo(writer) && tasks.reservation(writer).is_none()
                }
                Activation::Periodic { .. } | Activation::Descriptor { .. } => false,
            })
            .collect();
        let without_core = all.filter(|c| fifo(*c) && tasks.places[*c].is_none()).collect();
        let mut rests: Vec<bool> = tasks
            .tasks
            .iter()
            .map(|task| {
                let releaser_unknown =
                    matches!(task.release, Release::Trigger { by, .. } if !tasks.knows(by));
                releaser_unknown || task.steps().any(|step| step.budget_ns.is_none())
            })
            .collect();
        // it propagates to every task that can be delayed, and to every task that is released
        for _ in 0..rests.len() {
            let spread: Vec<bool> = tasks
                .tasks
                .iter()
                .map(|task| {
                    let held_up = tasks.tasks.iter().zip(&rests).any(|(other, rests)| {
                        *rests && other.core == task.core && other.priority >= task.priority
                    });
                    let releaser = match task.release {
                        Release::Trigger { by, .. } => tasks.places[by].map(|place| place.task),
                        Release::Timer { .. } | Release::Event => None,
                    };
                    held_up || releaser.is_some_and(|releaser| rests[releaser])
                })
                .collect();
            rests.iter_mut().zip(spread).for_each(|(rests, spread)| *rests |= spread);
        }
        Self { without_budget, released_by_others, without_core, rests }
    }
}
