//! Chrome's trace events, as JSON for Perfetto and chrome://tracing.

use std::io::{self, Write};

use motorium::plan::{Activation, ClockKind, Plan};
use motorium::region::TraceEvent;
use motorium::schedule::Admission;
use serde_json::{Value, json};

use super::flows::{HandOver, Step, hand_overs, steps};

/// Process number of all rows.
const PROCESS: u64 = 1;

/// The trace of a run.
pub(super) struct Trace<'a> {
    pub(super) plan: &'a Plan,
    pub(super) admission: &'a Admission,
    /// Start of the run, `CLOCK_MONOTONIC` ns.
    pub(super) start_ns: u64,
    pub(super) duration_s: f64,
    /// Events of each component.
    pub(super) components: &'a [Vec<TraceEvent>],
    /// Events of each component that were overwritten before they were read.
    pub(super) lost: &'a [u64],
}

/// Numbers of written events.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) steps: usize,
    pub(super) hand_overs: usize,
}

impl Trace<'_> {
    /// Writes the trace, one event per line.
    pub(super) fn write(&self, file: &mut dyn Write) -> io::Result<Counts> {
        let components: Vec<Vec<Step>> = self.components.iter().map(|events| steps(events)).collect();
        let mut events = Events { file, any: false };
        events.begin()?;
        self.rows(&mut events)?;
        for (index, steps) in components.iter().enumerate() {
            let mut last_end_ns = 0;
            for step in steps {
                self.step(index, step, last_end_ns, &mut events)?;
                last_end_ns = step.end_ns;
            }
        }
        let hand_overs = hand_overs(self.plan, &components);
        for (number, hand_over) in hand_overs.iter().enumerate() {
            self.arrow(number + 1, hand_over, &mut events)?;
        }
        events.end(&self.facts())?;
        Ok(Counts { steps: components.iter().map(Vec::len).sum(), hand_overs: hand_overs.len() })
    }

    /// Names and order of the rows.
    fn rows(&self, events: &mut Events<'_>) -> io::Result<()> {
        let named = |name: &str, row: usize, args: Value| json!({ "ph": "M", "name": name, "pid": PROCESS, "tid": row, "args": args });
        events.write(&named("process_name", 0, json!({ "name": self.plan.name })))?;
        for (index, component) in self.plan.components.iter().enumerate() {
            events.write(&named("thread_name", row(index), json!({ "name": component.name })))?;
            events.write(&named("thread_sort_index", row(index), json!({ "sort_index": row(index) })))?;
        }
        Ok(())
    }

    fn step(&self, index: usize, step: &Step, last_end_ns: u64, events: &mut Events<'_>) -> io::Result<()> {
        let component = &self.plan.components[index];
        let bound = &self.admission.tasks.get(index);
        let realtime = self.plan.clock == ClockKind::Realtime;
        let mut args = serde_json::Map::from_iter([("step".to_string(), json!(step.number))]);
        let mut add = |name: &str, value: Option<Value>| {
            args.extend(value.map(|value| (name.to_string(), value)));
        };
        add("budget_us", component.budget_ns.map(|ns| json!(us(ns))));
        add("predicted_response_us", bound.and_then(|bound| bound.response_ns).map(|ns| json!(us(ns))));
        if realtime {
            // From the release; the step before may have ended after it.
            let released = step.release_ns.max(last_end_ns);
            if step.begin_ns > released {
                events.write(&json!({
                    "ph": "X", "cat": "wake-up", "name": "wake-up", "pid": PROCESS, "tid": row(index),
                    "ts": self.ts(released), "dur": us(step.begin_ns - released),
                    "args": { "released_by": self.released_by(index) },
                }))?;
            }
            add("lateness_us", Some(json!(us(step.begin_ns.saturating_sub(step.release_ns)))));
            add("response_us", Some(json!(us(step.end_ns.saturating_sub(step.release_ns)))));
            let deadline_ns = step.release_ns.saturating_add(component.period_ns());
            add("missed", (step.end_ns > deadline_ns).then_some(json!(true)));
        } else {
            add("simulated_time_s", Some(json!(step.release_ns as f64 * 1e-9)));
        }
        events.write(&json!({
            "ph": "X", "cat": "step", "name": component.name, "pid": PROCESS, "tid": row(index),
            "ts": self.ts(step.begin_ns), "dur": us(step.end_ns.saturating_sub(step.begin_ns)), "args": args,
        }))?;
        for sample in &step.published {
            let topic = self.plan.topics.get(sample.topic).map_or("", |topic| topic.name.as_str());
            events.write(&json!({
                "ph": "i", "s": "t", "cat": "publish", "name": topic, "pid": PROCESS, "tid": row(index),
                "ts": self.ts(sample.at_ns), "args": { "sequence": sample.sequence },
            }))?;
        }
        Ok(())
    }

    /// Returns the event that a component waits for before its steps.
    fn released_by(&self, index: usize) -> &str {
        match &self.plan.components[index].activation {
            Activation::Periodic { .. } => "its period",
            Activation::Triggered { topic, .. } => &self.plan.topics[*topic].name,
            Activation::Descriptor { .. } => "its descriptor",
        }
    }

    fn arrow(&self, number: usize, hand_over: &HandOver, events: &mut Events<'_>) -> io::Result<()> {
        let topic = &self.plan.topics[hand_over.topic];
        let cat = if hand_over.wakes { "wakes" } else { "read" };
        let args = json!({ "sequence": hand_over.sequence });
        let end = |ph: &str, component: usize, ns: u64| {
            json!({
                "ph": ph, "cat": cat, "name": topic.name, "id": number, "pid": PROCESS, "tid": row(component),
                "ts": self.ts(ns), "args": args,
            })
        };
        events.write(&end("s", topic.writer, hand_over.published_ns))?;
        let mut head = end("f", hand_over.reader, hand_over.read_ns);
        // To the step that encloses it, and not to the next one.
        head["bp"] = json!("e");
        events.write(&head)
    }

    fn facts(&self) -> Value {
        let names = self.plan.components.iter().map(|component| component.name.clone());
        let lost =
            names.zip(self.lost).filter(|(_, lost)| **lost > 0).map(|(name, lost)| (name, json!(lost)));
        json!({
            "motorium": env!("CARGO_PKG_VERSION"),
            "graph": self.plan.name,
            "clock": self.plan.clock,
            "duration_s": self.duration_s,
            "lost_events": serde_json::Map::from_iter(lost),
        })
    }

    /// Returns a time since the start of the run, us.
    fn ts(&self, ns: u64) -> f64 {
        (ns as i64).wrapping_sub(self.start_ns as i64) as f64 * 1e-3
    }
}

fn row(component: usize) -> usize {
    component + 1
}

fn us(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

/// The array of events in its object.
struct Events<'a> {
    file: &'a mut dyn Write,
    any: bool,
}

impl Events<'_> {
    fn begin(&mut self) -> io::Result<()> {
        self.file.write_all(b"{\"displayTimeUnit\":\"ns\",\"traceEvents\":[\n")
    }

    fn write(&mut self, event: &Value) -> io::Result<()> {
        if core::mem::replace(&mut self.any, true) {
            self.file.write_all(b",\n")?;
        }
        serde_json::to_writer(&mut self.file, event).map_err(io::Error::from)
    }

    fn end(&mut self, facts: &Value) -> io::Result<()> {
        writeln!(self.file, "\n],\"otherData\":{facts}}}")
    }
}
