//! Shortfalls of a run that ended normally: actuators and components that did not do their job.

use std::sync::atomic::Ordering::Relaxed;

use super::accounts::gate_faults;
use super::lost_steps::LostShare;
use super::{Event, Launch};
use crate::os::monotonic_ns;
use crate::plan::{ClockKind, ComponentPlan};
use crate::region::{ComponentBlock, Phase, TopicBlock};
use crate::state::{JointCommand, StateBuffer as _};

/// Share of refused commands above which an actuator did not do its job.
const REFUSED: f64 = 0.5;

impl Launch {
    /// Records, before the components are ended, which actuators did not follow their commands.
    pub(super) fn note_gates(&mut self, observe: &mut dyn FnMut(Event<'_>)) {
        let now_ns = match self.plan.clock {
            ClockKind::Lockstep => self.reached_ns,
            ClockKind::Realtime => monotonic_ns(),
        };
        let topics = self.region.topics();
        let components = self.plan.components.iter().zip(self.region.components());
        let actuators = components.filter(|(component, _)| component.actuator);
        let found: Vec<String> =
            actuators.flat_map(|(component, block)| shortfalls(component, (block, topics), now_ns)).collect();
        found.iter().for_each(|warning| observe(Event::Warning(warning)));
        self.warnings.extend(found);
    }

    /// Records, after the components have ended, which of them did not end normally.
    pub(super) fn note_ends(&mut self, observe: &mut dyn FnMut(Event<'_>)) {
        let mut found = Vec::new();
        for (index, component) in self.plan.components.iter().enumerate() {
            let name = &component.name;
            if let Some(supervision) = self.supervision.get(index).filter(|supervision| supervision.is_gone())
            {
                // In real time this was recorded before the end.
                let lost = supervision.lost().filter(|_| self.plan.clock == ClockKind::Lockstep);
                found.extend(lost.map(|reason| format!("`{name}` ended before the run: {reason}")));
                continue;
            }
            let block = &self.region.components()[index];
            if block.phase() != Phase::Stopped {
                let reason = match (block.failure(), self.children[index].ended()) {
                    (Some(failure), _) => failure.to_string(),
                    (None, Some(end)) => end.to_string(),
                    (None, None) => "it did not end".to_string(),
                };
                found.push(format!("`{name}` did not end in good order: {reason}"));
            }
        }
        found.iter().for_each(|warning| observe(Event::Warning(warning)));
        self.warnings.extend(found);
    }

    /// Records for the report which actuators did not come to rest in their safe state, and which were late
    /// to follow commands again.
    pub(super) fn note_rest(&mut self) {
        for (component, block) in self.plan.components.iter().zip(self.region.components()) {
            let name = &component.name;
            let [unsettled, late] = gate_faults(block);
            if unsettled > 0 {
                self.warnings.push(format!(
                    "`{name}` did not come to rest in its safe state within 1 s, {unsettled}x"
                ));
            }
            if late > 0 {
                self.warnings.push(format!("`{name}` was resuming for more than 2 s, {late}x"));
            }
        }
    }

    /// Records the components' own `shortfalls` from their results.
    pub(super) fn note_results(&mut self, observe: &mut dyn FnMut(Event<'_>)) {
        let mut found = Vec::new();
        for component in &self.plan.components {
            let result = self.folder.result(&component.name);
            let warnings = result.as_ref().and_then(|result| result.get("shortfalls")?.as_array());
            let texts = warnings.into_iter().flatten().filter_map(|warning| warning.as_str());
            found.extend(texts.map(|text| format!("`{}`: {text}", component.name)));
        }
        found.iter().for_each(|warning| observe(Event::Warning(warning)));
        self.warnings.extend(found);
    }
}

/// Returns the shortfalls of one actuator until `now_ns`, as text.
fn shortfalls(
    component: &ComponentPlan,
    (block, topics): (&ComponentBlock, &[TopicBlock]),
    now_ns: u64,
) -> Vec<String> {
    let name = &component.name;
    // A program outside the graph, behind a bridge, may never have commanded anything.
    let is_commanded = component.inputs.iter().any(|port| {
        port.layout.type_name == JointCommand::NAME
            && port.topic.is_some_and(|topic| topics[topic].published.load(Relaxed) > 0)
    });
    let first_ns = block.first_step_ns.load(Relaxed);
    let lasted_ns = now_ns.saturating_sub(first_ns);
    if !is_commanded || lasted_ns == 0 || block.gate.report().is_none() {
        return Vec::new();
    }
    let mut found = Vec::new();
    let steps = block.steps.load(Relaxed).max(1);
    let refused: u64 = block.gate.refusals().iter().fold(0, |sum, count| sum.saturating_add(*count));
    if refused as f64 >= REFUSED * steps as f64 {
        found.push(format!("`{name}` refused {refused} commands in {steps} steps"));
    }
    let share = block.gate.safe_ns(now_ns) as f64 / lasted_ns as f64;
    let allowed = component.liveness.lost_steps;
    if !block.gate.has_followed() && found.is_empty() && allowed < 1.0 {
        found.push(format!("`{name}` was in its safe state for the whole run: no command was applied"));
    } else if share > allowed {
        let (share, allowed) = (LostShare(share), LostShare(allowed));
        found.push(format!(
            "`{name}` was in its safe state for {share} of the run (`lost_steps` allows {allowed})"
        ));
    }
    found
}
