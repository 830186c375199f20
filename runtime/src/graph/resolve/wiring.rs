//! Ports wired to topics.

use super::draft::Draft;
use crate::declare::{Direction, PortDeclaration, TopicPattern};
use crate::graph::diagnostic::Report;
use crate::graph::model::GraphTable;
use crate::graph::read::{At, good};
use crate::graph::source::Span;
use crate::graph::values::{Named, TopicName};
use crate::nearest::{list, nearest};
use crate::plan::EMERGENCY_STOP_PORT;

/// A port wired to a topic, as in the file.
#[derive(Debug)]
pub(super) struct Wire {
    /// Index of the component.
    pub component: usize,
    /// Name of the port.
    pub port: String,
    /// Index of the port among the declared ports of its direction; `None` for an unknown port.
    pub index: Option<usize>,
    /// Direction of the port.
    pub direction: Direction,
    /// Index of the topic; `None` if its name is invalid. The error has then been reported.
    pub topic: Option<usize>,
    /// Position of the topic's name in the file.
    pub span: Span,
}

impl Wire {
    /// Returns the declared port.
    pub(super) fn declared<'d>(&self, drafts: &'d [Draft<'_, '_>]) -> Option<&'d PortDeclaration> {
        drafts[self.component].ports(self.direction).nth(self.index?)
    }
}

/// All wires of a graph.
#[derive(Debug)]
pub(super) struct Wiring {
    /// Names of the topics, in the order of their first mention.
    pub topics: Vec<String>,
    /// All wires, per component, in file order.
    pub wires: Vec<Wire>,
    /// True if the wiring is incomplete because outputs were rejected. A topic may therefore have a writer
    /// that is not listed.
    pub incomplete: bool,
}

impl Wiring {
    /// Wires the emergency-stop topic of `[safety]` to an actuator, unless its `subscribe` table does.
    fn emergency_stop(&mut self, graph: &GraphTable<'_>, component: usize, draft: &Draft<'_, '_>) {
        let stop = good(&graph.safety).and_then(|table| table.emergency_stop.as_ref());
        let Some((at, TopicName(name))) = stop.and_then(|at| Some((at, at.get()?))) else { return };
        let port = EMERGENCY_STOP_PORT.to_string();
        let direction = Direction::Input;
        let Some(index) = draft.ports(direction).position(|declared| declared.name == port) else { return };
        if self.of_port(component, direction, index).is_some() {
            return;
        }
        let topic = Some(self.topic(name).unwrap_or_else(|| {
            self.topics.push(name.clone());
            self.topics.len() - 1
        }));
        self.wires.push(Wire {
            component,
            port,
            index: Some(index),
            direction,
            topic,
            span: at.span.clone(),
        });
    }

    /// Returns the wires of one topic and direction.
    pub(super) fn of_topic(&self, topic: usize, direction: Direction) -> impl Iterator<Item = &Wire> {
        self.wires.iter().filter(move |wire| wire.topic == Some(topic) && wire.direction == direction)
    }

    /// Returns the wire that writes a topic; the first if there are several, after an error report.
    pub(super) fn writer(&self, topic: usize) -> Option<&Wire> {
        self.of_topic(topic, Direction::Output).next()
    }

    /// Returns the wires of one component and direction.
    pub(super) fn of_component(&self, component: usize, direction: Direction) -> impl Iterator<Item = &Wire> {
        self.wires.iter().filter(move |wire| wire.component == component && wire.direction == direction)
    }

    /// Returns the wire of a component's port, by its index among the declared ports of its direction.
    pub(super) fn of_port(&self, component: usize, direction: Direction, index: usize) -> Option<&Wire> {
        self.of_component(component, direction).find(|wire| wire.index == Some(index))
    }

    /// Returns the topics that carry a type.
    pub(super) fn that_carry<'w>(&'w self, type_name: &str, drafts: &[Draft<'_, '_>]) -> Vec<&'w str> {
        let carries = |wire: &&Wire| {
            wire.direction == Direction::Output
                && wire.declared(drafts).is_some_and(|port| port.layout.type_name == type_name)
        };
        self.wires.iter().filter(carries).filter_map(|wire| Some(self.topics[wire.topic?].as_str())).collect()
    }

    /// Returns the topic with this name.
    pub(super) fn topic(&self, name: &str) -> Option<usize> {
        self.topics.iter().position(|topic| topic == name)
    }

    /// Returns the names of the topics that have a writer.
    pub(super) fn written(&self) -> impl Iterator<Item = &str> + Clone {
        let written = |topic: &usize| self.writer(*topic).is_some();
        (0..self.topics.len()).filter(written).map(|topic| self.topics[topic].as_str())
    }
}

/// Describes the pattern and type of a port, for messages.
pub(super) fn carries(port: &PortDeclaration) -> String {
    match port.pattern {
        TopicPattern::State => port.layout.type_name.clone(),
        TopicPattern::Stream { .. } => format!("stream of {}", port.layout.type_name),
        TopicPattern::Slices { .. } => format!("slices of {}", port.layout.type_name),
    }
}

/// Finds the port and the topic of every wire.
pub(super) fn resolve(graph: &GraphTable<'_>, drafts: &[Draft<'_, '_>], report: &mut Report) -> Wiring {
    let components = good(&graph.component).map_or(0, |components| components.0.len());
    let refused = |draft: &Draft<'_, '_>| draft.table.publish.as_ref().is_some_and(|at| at.get().is_none());
    let incomplete = drafts.len() < components || drafts.iter().any(refused);
    let mut wiring = Wiring { topics: Vec::new(), wires: Vec::new(), incomplete };
    for (component, draft) in drafts.iter().enumerate() {
        let mut entries: Vec<(Direction, &(String, At<TopicName>))> = Vec::new();
        let sides = [(Direction::Input, &draft.table.subscribe), (Direction::Output, &draft.table.publish)];
        for (direction, side) in sides {
            let Some(Named(side)) = good(side) else { continue };
            used_twice(side, direction, report);
            entries.extend(side.iter().map(|entry| (direction, entry)));
        }
        entries.sort_by_key(|(_, (_, at))| at.key.start);
        for (direction, (port, at)) in entries {
            let index = draft.ports(direction).position(|declared| declared.name == *port);
            if index.is_none() && draft.declaration.is_some() {
                unknown_port(draft, direction, port, &at.key, report);
            }
            let topic = at.get().map(|TopicName(name)| {
                wiring.topic(name).unwrap_or_else(|| {
                    wiring.topics.push(name.clone());
                    wiring.topics.len() - 1
                })
            });
            wiring.incomplete |= topic.is_none() && direction == Direction::Output;
            let (port, span) = (port.clone(), at.span.clone());
            wiring.wires.push(Wire { component, port, index, direction, topic, span });
        }
        wiring.emergency_stop(graph, component, draft);
    }
    for (component, draft) in drafts.iter().enumerate() {
        required(component, drafts, &wiring, report);
        nothing_to_do(component, draft, &wiring, report);
    }
    wiring
}

/// Reports two ports of one table on one topic.
fn used_twice(side: &[(String, At<TopicName>)], direction: Direction, report: &mut Report) {
    for (index, (port, at)) in side.iter().enumerate() {
        let Some(topic) = at.get() else { continue };
        let Some((other, first)) = side[..index].iter().find(|(_, other)| other.get() == Some(topic)) else {
            continue;
        };
        let (verb, advice) = match direction {
            Direction::Input => ("subscribe to", "wire one of them to the topic that was meant"),
            Direction::Output => ("publish", "give each output a separate topic"),
        };
        report
            .error(format!("the ports `{other}` and `{port}` both {verb} `{}`", topic.0))
            .label(&at.span, "the same topic again")
            .and(&first.span, "first here")
            .advise(advice);
    }
}

fn unknown_port(draft: &Draft<'_, '_>, direction: Direction, port: &str, place: &Span, report: &mut Report) {
    let (word, other_side, other_table) = match direction {
        Direction::Input => ("input", Direction::Output, "publish"),
        Direction::Output => ("output", Direction::Input, "subscribe"),
    };
    let ports = |direction: Direction| {
        let ports: Vec<String> =
            draft.ports(direction).map(|port| format!("`{}` ({})", port.name, carries(port))).collect();
        if ports.is_empty() { "none".to_string() } else { ports.join(", ") }
    };
    let advice = if draft.ports(other_side).any(|declared| declared.name == port) {
        let article = if other_side == Direction::Input { "an input" } else { "an output" };
        format!("`{port}` is {article}: wire it in `{other_table}`")
    } else {
        let names = draft.ports(direction).map(|declared| declared.name.as_str());
        match nearest(port, names) {
            Some(near) => format!("did you mean `{near}`?"),
            None => "wire one of them, or remove this entry".to_string(),
        }
    };
    report
        .error(format!("{} has no {word} `{port}`", draft.what()))
        .label(place, format!("unknown {word}"))
        .note(format!("its {word}s: {}", ports(direction)))
        .advise(advice);
}

/// Checks that all required inputs are wired.
fn required(component: usize, drafts: &[Draft<'_, '_>], wiring: &Wiring, report: &mut Report) {
    let draft = &drafts[component];
    if draft.table.subscribe.as_ref().is_some_and(|at| at.get().is_none()) {
        return;
    }
    for (index, port) in draft.ports(Direction::Input).enumerate() {
        if !port.required || wiring.of_port(component, Direction::Input, index).is_some() {
            continue;
        }
        let misspelt =
            |wire: &Wire| wire.index.is_none() && nearest(&wire.port, [port.name.as_str()]).is_some();
        if wiring.of_component(component, Direction::Input).any(misspelt) {
            continue;
        }
        let (place, table) = match &draft.table.subscribe {
            Some(subscribe) => (&subscribe.key, ""),
            None => (&draft.place, "`subscribe`: "),
        };
        let topics = match port.layout.is_any() {
            true => wiring.written().collect(),
            false => wiring.that_carry(&port.layout.type_name, drafts),
        };
        let advice = match topics.as_slice() {
            [] => format!("no topic carries {}: add a component that publishes one", port.layout.type_name),
            [topic] => format!("add {table}`{} = \"{topic}\"`", port.name),
            topics => format!("wire it to one of {}", list(topics.iter().copied())),
        };
        report
            .error(format!("input `{}` of component `{}` is not wired", port.name, draft.name))
            .label(place, format!("`{}` ({}) is missing", port.name, carries(port)))
            .note(format!("`{}`: {}", port.name, port.doc))
            .advise(advice);
    }
}

/// Warns about a component without a wired port.
fn nothing_to_do(component: usize, draft: &Draft<'_, '_>, wiring: &Wiring, report: &mut Report) {
    let Some(declaration) = &draft.declaration else { return };
    if declaration.taps.is_some() || wiring.wires.iter().any(|wire| wire.component == component) {
        return;
    }
    if declaration.ports.is_empty() {
        report
            .warning(format!(
                "component `{}` has no ports, so the graph cannot check its data flow",
                draft.name
            ))
            .label(&draft.place, "neither reads nor writes")
            .advise("this is harmless if the component only acts outside the graph");
    } else if declaration.ports.iter().all(|port| !port.required) {
        // a missing required port has been reported already
        let ports: Vec<String> =
            declaration.ports.iter().map(|port| format!("`{}` ({})", port.name, carries(port))).collect();
        report
            .error(format!("component `{}` has nothing to do: none of its ports is wired", draft.name))
            .label(&draft.place, "neither reads nor writes")
            .note(format!("its ports: {}", ports.join(", ")))
            .advise("wire at least one of them in `subscribe` or `publish`, or leave the component out");
    }
}
