//! Checks of topics, which have one writer and readers of the same type.

use super::draft::Draft;
use super::wiring::{Wire, Wiring, carries};
use crate::declare::{Direction, TopicPattern};
use crate::graph::diagnostic::Report;
use crate::nearest::{list, nearest};

/// Checks every topic.
pub(super) fn check(drafts: &[Draft<'_, '_>], wiring: &Wiring, report: &mut Report) {
    for topic in 0..wiring.topics.len() {
        one_writer(topic, drafts, wiring, report);
        let Some(writer) = wiring.writer(topic) else {
            without_writer(topic, drafts, wiring, report);
            continue;
        };
        for reader in wiring.of_topic(topic, Direction::Input) {
            agree(topic, writer, reader, drafts, wiring, report);
        }
    }
}

fn one_writer(topic: usize, drafts: &[Draft<'_, '_>], wiring: &Wiring, report: &mut Report) {
    let mut writers = wiring.of_topic(topic, Direction::Output);
    let Some(first) = writers.next() else { return };
    // two ports of one component on one topic have been reported already
    for other in writers.filter(|other| other.component != first.component) {
        let name = &wiring.topics[topic];
        let (first_name, other_name) = (drafts[first.component].name, drafts[other.component].name);
        report
            .error(format!("topic `{name}` has two writers: `{first_name}` and `{other_name}`"))
            .label(&other.span, format!("`{other_name}` writes it too"))
            .and(&first.span, format!("`{first_name}` writes it"))
            .advise(format!("a topic has one writer; let `{other_name}` publish another topic"));
    }
}

fn without_writer(topic: usize, drafts: &[Draft<'_, '_>], wiring: &Wiring, report: &mut Report) {
    let name = &wiring.topics[topic];
    if wiring.incomplete {
        return;
    }
    for reader in wiring.of_topic(topic, Direction::Input) {
        let declared = reader.declared(drafts).filter(|port| !port.layout.is_any());
        let wanted = declared.map(|port| port.layout.type_name.as_str());
        let fitting = wanted.map(|wanted| wiring.that_carry(wanted, drafts)).unwrap_or_default();
        let near = nearest(name, fitting.iter().copied()).or_else(|| nearest(name, wiring.written()));
        let advice = match (near, wanted) {
            (Some(near), _) => format!("did you mean `{near}`?"),
            (None, Some(wanted)) if !fitting.is_empty() => {
                format!("topics that carry {wanted}: {}", list(fitting))
            }
            (None, Some(wanted)) => format!("add a component that publishes {wanted} on `{name}`"),
            (None, None) => format!("the topics of this graph are {}", list(wiring.written())),
        };
        let component = drafts[reader.component].name;
        report
            .error(format!("topic `{name}`, which `{component}` reads, has no writer"))
            .label(&reader.span, "a topic without a writer")
            .advise(advice);
    }
}

/// Checks that reader and writer agree on the type, its layout, and on state or stream.
fn agree(
    topic: usize,
    writer: &Wire,
    reader: &Wire,
    drafts: &[Draft<'_, '_>],
    wiring: &Wiring,
    report: &mut Report,
) {
    let (Some(written), Some(read)) = (writer.declared(drafts), reader.declared(drafts)) else { return };
    let any = read.layout.is_any();
    let name = &wiring.topics[topic];
    let (from, to) = (drafts[writer.component].name, drafts[reader.component].name);
    let (of_writer, of_reader) = (format!("{from}.{}", writer.port), format!("{to}.{}", reader.port));
    let labels = (
        format!("`{of_reader}` reads {}", carries(read)),
        format!("`{of_writer}` writes {}", carries(written)),
    );
    if !any && written.layout.type_name != read.layout.type_name {
        let topics = wiring.that_carry(&read.layout.type_name, drafts);
        let diagnostic = report
            .error(format!(
                "topic `{name}` carries {}, but `{of_reader}` reads {}",
                written.layout.type_name, read.layout.type_name
            ))
            .label(&reader.span, labels.0)
            .and(&writer.span, labels.1);
        match topics.as_slice() {
            [] => diagnostic.advise(format!("no topic of this graph carries {}", read.layout.type_name)),
            topics => diagnostic.advise(format!(
                "topics that carry {}: {}",
                read.layout.type_name,
                list(topics.iter().copied())
            )),
        };
    } else if !any && written.layout != read.layout {
        report
            .error(format!(
                "`{of_writer}` and `{of_reader}` have different layouts of {} on topic `{name}`",
                read.layout.type_name
            ))
            .label(&reader.span, labels.0)
            .and(&writer.span, labels.1)
            .note(format!(
                "the layouts, `!` where they differ:\n{}",
                written.layout.difference(&of_writer, &read.layout, &of_reader).trim_end()
            ))
            .advise("the programs were built from different versions of this type; build both again");
    } else if matches!(written.pattern, TopicPattern::Slices { .. })
        != matches!(read.pattern, TopicPattern::Slices { .. })
    {
        report
            .error(format!("topic `{name}` has slices at one port and single values at the other"))
            .label(&reader.span, labels.0)
            .and(&writer.span, labels.1)
            .advise("a slice output is read by slice inputs");
    } else if written.pattern == TopicPattern::State && matches!(read.pattern, TopicPattern::Stream { .. }) {
        report
            .error(format!(
                "topic `{name}` is a state with only its newest sample, but `{of_reader}` reads every sample"
            ))
            .label(&reader.span, labels.0)
            .and(&writer.span, labels.1)
            .advise(format!(
                "`{of_writer}` is a state; read it with a state input, or write it from a stream output"
            ));
    }
}
