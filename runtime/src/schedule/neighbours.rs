//! Analysis of a graph together with running graphs.

use crate::plan::{Activation, OnOverrun, Plan};

/// Returns the plan of a graph, extended by the components of running graphs, for [`admit`](super::admit)
/// only. The added components are named `RUN/component`. They may be released at any time, because their runs
/// started independently. Running graphs in lockstep are ignored.
///
/// `others` contains the ids and plans of the running graphs.
pub fn beside(plan: &Plan, others: &[(String, Plan)]) -> Plan {
    let mut merged = plan.clone();
    for (run, other) in others.iter().filter(|(_, other)| other.clock == plan.clock) {
        add(&mut merged, run, other);
    }
    merged
}

fn add(merged: &mut Plan, run: &str, other: &Plan) {
    let (first_component, first_topic) = (merged.components.len(), merged.topics.len());
    for component in &other.components {
        let mut component = component.clone();
        component.name = format!("{run}/{}", component.name);
        component.order += first_component;
        match &mut component.activation {
            Activation::Triggered { topic, .. } => *topic += first_topic,
            Activation::Periodic { .. } => component.on_overrun = OnOverrun::Rephase,
            Activation::Descriptor { .. } => {}
        }
        for port in component.inputs.iter_mut().chain(&mut component.outputs) {
            port.topic = port.topic.map(|topic| topic + first_topic);
        }
        merged.components.push(component);
    }
    for topic in &other.topics {
        let mut topic = topic.clone();
        topic.name = format!("{run}/{}", topic.name);
        topic.writer += first_component;
        topic
            .readers
            .iter_mut()
            .chain(&mut topic.triggers)
            .for_each(|component| *component += first_component);
        merged.topics.push(topic);
    }
    merged.scheduling.shared_cores.extend(&other.scheduling.shared_cores);
    merged.scheduling.shared_cores.sort_unstable();
    merged.scheduling.shared_cores.dedup();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::ClockKind;
    use crate::schedule::tests::graphs::{When, graph, node};
    use crate::schedule::{Overheads, RtLimit, Verdict, admit};

    /// Returns a plan of physics and a triggered controller with these budgets on core 0.
    fn chain(physics_us: u64, controller_us: u64) -> Plan {
        let mut nodes =
            [node("physics", When::Every(1_000_000, 0), 1), node("controller", When::After(0), 1)];
        nodes[0].budget_ns = Some(physics_us * 1_000);
        nodes[1].budget_ns = Some(controller_us * 1_000);
        graph(&nodes, 0, &[])
    }

    fn verdict(plan: &Plan) -> Verdict {
        admit(plan, &Overheads::NONE, RtLimit::NONE).verdict
    }

    #[test]
    fn graphs_on_one_core_are_admitted_together() {
        let (light, heavy) = (chain(100, 200), chain(300, 400));
        let runs = |plan: &Plan| vec![("other-1".to_string(), plan.clone())];
        assert_eq!([verdict(&light), verdict(&heavy)], [Verdict::Holds; 2]);
        assert_eq!(verdict(&beside(&light, &runs(&light))), Verdict::Holds);
        assert_eq!(verdict(&beside(&heavy, &runs(&heavy))), Verdict::Exceeds);
    }

    #[test]
    fn load_of_other_runs_is_named_in_the_sum() {
        let merged = beside(&chain(100, 200), &[("other-1".to_string(), chain(300, 400))]);
        let admission = admit(&merged, &Overheads::NONE, RtLimit::NONE);
        let core = &admission.cores[0];
        assert!((core.share - 1.0).abs() < 1e-9, "{}", core.share);
        assert!(core.arithmetic.contains("other-1/controller"), "{}", core.arithmetic);
    }

    #[test]
    fn lockstep_graph_is_no_load_for_a_real_time_graph() {
        let mut lockstep = chain(900, 50);
        lockstep.clock = ClockKind::Lockstep;
        let own = chain(100, 200);
        assert_eq!(beside(&own, &[("other-1".to_string(), lockstep)]), own);
    }
}
