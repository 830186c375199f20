//! Findings for the report of a run: requests that the system denied, and components that did not work as
//! required.

use std::sync::atomic::Ordering::Relaxed;

use super::accounts::gate_faults;
use super::hang::diagnose;
use super::idle_states::IdleStates;
use super::lost_steps::LostShare;
use super::run::Run;
use super::supervisor::Supervisor;
use super::watchdog::Counters;
use super::{Event, Hosting};
use crate::os::monotonic_ns;
use crate::plan::{ComponentPlan, SchedulingClass};
use crate::region::{ComponentBlock, Phase, TopicBlock};
use crate::state::{JointCommand, StateBuffer as _};

/// Share of refused commands above which an actuator is reported.
const REFUSED: f64 = 0.5;

/// Findings about a run, as text, for its report.
#[derive(Default)]
pub(super) struct Findings {
    /// Requests denied by the system.
    pub(super) denied: Vec<String>,
    /// Shortcomings of a run that ended normally.
    pub(super) warnings: Vec<String>,
}

impl Findings {
    /// Records denied requests, from the settings read back by the workers.
    pub(super) fn note_denied(
        &mut self,
        run: &Run,
        idle_states: &IdleStates,
        observe: &mut dyn FnMut(Event<'_>),
    ) {
        self.denied = denied(run, idle_states);
        if !self.denied.is_empty() {
            let line = format!(
                "without {}: timing will suffer; run as root or grant CAP_SYS_NICE and CAP_IPC_LOCK (see `motorium \
                 doctor`)",
                self.denied.join(" and ")
            );
            observe(Event::Lost(&line));
        }
    }

    /// Records components that do not meet the graph's requirements at the end of a real-time run.
    pub(super) fn note_unmet(
        &mut self,
        run: &Run,
        supervisor: &Supervisor,
        observe: &mut dyn FnMut(Event<'_>),
    ) {
        let now = monotonic_ns();
        // Without the requested priorities, punctual steps are not guaranteed.
        let has_priorities = run.options.hosting == Hosting::Processes && self.denied.is_empty();
        for (index, supervision) in supervisor.supervision().iter().enumerate() {
            let (component, block) = (&run.plan.components[index], &run.region.components()[index]);
            let name = &component.name;
            if let Some(reason) = supervision.lost() {
                self.warnings.push(format!("`{name}` ended before the run: {reason}"));
                continue;
            }
            if supervision.is_down(block.steps.load(Relaxed)) {
                self.warnings.push(format!("`{name}` was restarted and did not step again before the end"));
                continue;
            }
            let lost = LostShare::new(block.steps.load(Relaxed), block.skipped.load(Relaxed));
            if !supervision.is_gone() && lost.0 > component.liveness.lost_steps {
                let warning = format!("`{name}` lost {lost} of its steps");
                if has_priorities {
                    self.warnings.push(warning);
                } else {
                    observe(Event::Warning(&warning));
                }
            }
            // Too short for the watchdog, but long enough to report.
            let counters = Counters::read(&run.plan, &run.region, index);
            let overdue = supervision.watchdog.clone().with_half_the_timeout().check(&counters, now);
            if let Some(overdue) = overdue.filter(|_| !supervision.is_gone()) {
                let hang = diagnose(&run.plan, &run.region, index, overdue);
                self.warnings.push(format!("`{name}` did not step at the end: {hang}"));
            }
        }
        self.warnings.extend(supervisor.missing_guard());
        self.warnings.iter().for_each(|warning| observe(Event::Warning(warning)));
    }

    /// Records, before the components are ended, the actuators that did not follow their commands until
    /// `now_ns` on the run's clock.
    pub(super) fn note_gates(&mut self, run: &Run, now_ns: u64, observe: &mut dyn FnMut(Event<'_>)) {
        let topics = run.region.topics();
        let components = run.plan.components.iter().zip(run.region.components());
        let actuators = components.filter(|(component, _)| component.actuator);
        let found = actuators.flat_map(|(component, block)| shortfalls(component, (block, topics), now_ns));
        self.warn(found.collect(), observe);
    }

    /// Records, after the components have ended, those that did not end normally.
    pub(super) fn note_ends(
        &mut self,
        run: &Run,
        supervisor: &mut Supervisor,
        observe: &mut dyn FnMut(Event<'_>),
    ) {
        let mut found = Vec::new();
        for (index, component) in run.plan.components.iter().enumerate() {
            let name = &component.name;
            let supervision = supervisor.supervision().get(index);
            if let Some(supervision) = supervision.filter(|supervision| supervision.is_gone()) {
                // In real time this was recorded before the end.
                let lost = supervision.lost().filter(|_| run.is_lockstep());
                found.extend(lost.map(|reason| format!("`{name}` ended before the run: {reason}")));
                continue;
            }
            let block = &run.region.components()[index];
            if block.phase() != Phase::Stopped {
                let reason = match (block.failure(), supervisor.workers.child(index).ended()) {
                    (Some(failure), _) => failure.to_string(),
                    (None, Some(end)) => end.to_string(),
                    (None, None) => "it did not end".to_string(),
                };
                found.push(format!("`{name}` did not end in an orderly way: {reason}"));
            }
        }
        self.warn(found, observe);
    }

    /// Records the actuators that did not come to rest in their safe state, or were late to follow commands
    /// again.
    pub(super) fn note_rest(&mut self, run: &Run) {
        for (component, block) in run.plan.components.iter().zip(run.region.components()) {
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
    pub(super) fn note_results(&mut self, run: &Run, observe: &mut dyn FnMut(Event<'_>)) {
        let mut found = Vec::new();
        for component in &run.plan.components {
            let result = run.folder.result(&component.name);
            let warnings = result.as_ref().and_then(|result| result.get("shortfalls")?.as_array());
            let texts = warnings.into_iter().flatten().filter_map(|warning| warning.as_str());
            found.extend(texts.map(|text| format!("`{}`: {text}", component.name)));
        }
        self.warn(found, observe);
    }

    fn warn(&mut self, found: Vec<String>, observe: &mut dyn FnMut(Event<'_>)) {
        found.iter().for_each(|warning| observe(Event::Warning(warning)));
        self.warnings.extend(found);
    }
}

/// Returns the denied requests, as text.
fn denied(run: &Run, idle_states: &IdleStates) -> Vec<String> {
    if run.is_lockstep() || run.options.hosting != Hosting::Processes {
        return Vec::new();
    }
    let mut priority = Vec::new();
    let mut deadline = Vec::new();
    let mut memory = Vec::new();
    let mut core = Vec::new();
    for (component, block) in run.plan.components.iter().zip(run.region.components()) {
        let name = component.name.as_str();
        match component.class {
            SchedulingClass::Fifo(wanted) if block.fifo_priority.load(Relaxed) != u32::from(wanted) => {
                priority.push(name);
            }
            SchedulingClass::Deadline { .. } if block.deadline.load(Relaxed) == 0 => deadline.push(name),
            _ => {}
        }
        if component.class != SchedulingClass::Normal && block.memory_locked.load(Relaxed) == 0 {
            memory.push(name);
        }
        if component.core.is_some_and(|core| core < 32 && block.cores.load(Relaxed) != 1 << core) {
            core.push(name);
        }
    }
    let denied = [
        ("real-time priority", priority),
        ("reserved time in every period", deadline),
        ("locked memory", memory),
        ("the requested core", core),
    ];
    let idle = idle_states.denied.as_ref();
    denied
        .into_iter()
        .filter(|(_, names)| !names.is_empty())
        .map(|(what, names)| format!("{what} ({})", names.join(", ")))
        .chain(idle.map(|_| "a limit on idle states (/dev/cpu_dma_latency)".to_string()))
        .collect()
}

/// Returns the shortfalls of one actuator until `now_ns`, as text.
fn shortfalls(
    component: &ComponentPlan,
    (block, topics): (&ComponentBlock, &[TopicBlock]),
    now_ns: u64,
) -> Vec<String> {
    let name = &component.name;
    // A program outside the graph, behind a bridge, may never have sent a command.
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
