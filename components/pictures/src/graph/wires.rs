//! The edges of a graph: from the writer of a topic to each of its readers.

use motorium::plan::{Activation, Plan};

/// One edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Wire {
    /// Index of the topic.
    pub(super) topic: usize,
    /// The component that writes it.
    pub(super) writer: usize,
    /// Its number among the writer's drawn outputs.
    pub(super) output: usize,
    /// The component that reads it.
    pub(super) reader: usize,
    /// Index of the reader's port.
    pub(super) input: usize,
    /// `true` if it wakes the reader.
    pub(super) wakes: bool,
    /// `true` if a latency budget is measured along it.
    pub(super) budgeted: bool,
}

/// The topics that a component writes, in the order of its outputs.
pub(super) fn outputs(plan: &Plan, component: usize) -> Vec<usize> {
    plan.components[component].outputs.iter().filter_map(|port| port.topic).collect()
}

/// All edges, by reader and port.
pub(super) fn wires(plan: &Plan) -> Vec<Wire> {
    let budgeted = budgeted(plan);
    let mut wires = Vec::new();
    for (reader, component) in plan.components.iter().enumerate() {
        for (input, port) in component.inputs.iter().enumerate() {
            let Some(topic) = port.topic else { continue };
            let writer = plan.topics[topic].writer;
            let output = outputs(plan, writer).iter().position(|written| *written == topic).unwrap_or(0);
            let wakes = matches!(component.activation, Activation::Triggered { input: trigger, .. } if trigger == input);
            let budgeted = budgeted.contains(&(reader, input));
            wires.push(Wire { topic, writer, output, reader, input, wakes, budgeted });
        }
    }
    wires
}

/// The inputs, as component and port, on the data path of a latency budget.
fn budgeted(plan: &Plan) -> Vec<(usize, usize)> {
    let mut inputs = Vec::new();
    for latency in &plan.latencies {
        let mut topic = latency.to;
        // a path passes each topic once
        for _ in 0..plan.topics.len() {
            let writer = plan.topics[topic].writer;
            if topic == latency.from {
                break;
            }
            let Some(cause) = plan.components[writer].cause else { break };
            let Some(next) = plan.components[writer].inputs.get(cause).and_then(|port| port.topic) else {
                break;
            };
            inputs.push((writer, cause));
            topic = next;
        }
    }
    inputs
}
