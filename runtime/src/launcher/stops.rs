//! Stops of the robot while the graph runs, as events: `motorium stop --now`, emergency stops, latched safe
//! states.

use std::sync::atomic::Ordering::Relaxed;

use super::Event;
use crate::os::monotonic_ns;
use crate::plan::{ClockKind, Plan, ResumeRule};
use crate::region::{Latch, Region};
use crate::units::TimeSpan;

/// A stop, and the index of the actuator that latched it, if any.
type Stop = (Latch, Option<usize>);

/// The reported stop of a run.
#[derive(Debug, Default)]
pub(super) struct Stops {
    reported: Option<Stop>,
}

impl Stops {
    /// Reports a stop that started or ended since the last call.
    pub(super) fn report(&mut self, plan: &Plan, region: &Region, observe: &mut dyn FnMut(Event<'_>)) {
        let stop = current(plan, region);
        if stop == self.reported {
            return;
        }
        match stop {
            Some((latch, component)) => {
                let silent = silent(plan, region);
                let cause = cause(plan, latch, component, silent);
                observe(Event::Stopped { latch, cause: &cause });
            }
            None => observe(Event::Resumed),
        }
        self.reported = stop;
    }
}

/// Returns the stop of the whole run, or else of the first actuator with a latched gate.
fn current(plan: &Plan, region: &Region) -> Option<Stop> {
    if let Some(latch) = region.header().latched() {
        return Some((latch, None));
    }
    let blocks = plan.components.iter().zip(region.components()).enumerate();
    let mut actuators = blocks.filter(|(_, (component, _))| component.actuator);
    actuators.find_map(|(index, (_, block))| match block.gate.latch() {
        // A gate that has not stepped since the run's latch was released still shows it.
        Some(Latch::SafeState) => Some((Latch::SafeState, Some(index))),
        _ => None,
    })
}

/// Returns the emergency-stop topic that has been silent for too long, if any.
fn silent(plan: &Plan, region: &Region) -> Option<usize> {
    let max_age_ns = plan.safety.emergency_stop_max_age_ns;
    let header = region.header();
    let (now_ns, start_ns) = match plan.clock {
        ClockKind::Lockstep => (header.reached_ns.load(Relaxed), 0),
        ClockKind::Realtime => (monotonic_ns(), header.start_ns.load(Relaxed)),
    };
    plan.emergency_stops().find(|topic| {
        let heard_ns = region.topics()[*topic].last_publish_ns.load(Relaxed).max(start_ns);
        max_age_ns != 0 && now_ns.saturating_sub(heard_ns) > max_age_ns
    })
}

/// Describes the cause of a stop. `silent` is an emergency-stop topic without a fresh value.
fn cause(plan: &Plan, latch: Latch, component: Option<usize>, silent: Option<usize>) -> String {
    match latch {
        Latch::Stop => "by `motorium stop --now`".to_string(),
        Latch::EmergencyStop if silent.is_some() => {
            let topic = &plan.topics[silent.unwrap_or_default()];
            let writer = &plan.components[topic.writer].name;
            let max_age = TimeSpan { ns: plan.safety.emergency_stop_max_age_ns };
            format!(
                "since no value of the emergency stop `{}` came from `{writer}` for {max_age} (`emergency_stop_max_age`)",
                topic.name
            )
        }
        Latch::EmergencyStop => {
            let topic = plan.emergency_stops().next();
            topic.map(|topic| &plan.topics[topic]).map_or_else(
                || "by an emergency stop".to_string(),
                |topic| {
                    let writer = &plan.components[topic.writer].name;
                    format!("by the emergency stop of `{writer}` on `{}`", topic.name)
                },
            )
        }
        Latch::SafeState => {
            let actuator = component.map_or("an actuator", |index| &plan.components[index].name);
            let own = component.map(|index| plan.safety_of(&plan.components[index]));
            match own.map_or(plan.safety.gate, |own| own.gate).resume {
                ResumeRule::Latch => {
                    format!("since `{actuator}` entered its safe state and `resume` is \"latch\"")
                }
                _ => format!("since `{actuator}` tripped, for a reason given in its result"),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{EMERGENCY_STOP_PORT, PortPlan};
    use crate::schedule::tests::graphs::{When, graph, node};

    #[test]
    fn cause_of_a_stop_is_named() {
        let nodes = [node("physics", When::Every(1_000_000, 0), 1), node("button", When::After(0), 1)];
        let mut plan = graph(&nodes, 0, &[]);
        assert_eq!(cause(&plan, Latch::Stop, None, None), "by `motorium stop --now`");
        let tripped = "since `physics` tripped, for a reason given in its result";
        assert_eq!(cause(&plan, Latch::SafeState, Some(0), None), tripped);
        plan.safety.gate.resume = ResumeRule::Latch;
        assert_eq!(
            cause(&plan, Latch::SafeState, Some(0), None),
            "since `physics` entered its safe state and `resume` is \"latch\""
        );
        plan.components[0].actuator = true;
        let topic = plan.topics.iter().position(|topic| topic.writer == 1).expect("it writes one");
        let port = PortPlan {
            port: EMERGENCY_STOP_PORT.to_string(),
            topic: Some(topic),
            ..plan.components[1].outputs[0].clone()
        };
        plan.components[0].inputs.push(port);
        assert_eq!(
            cause(&plan, Latch::EmergencyStop, None, None),
            "by the emergency stop of `button` on `topic/button`"
        );
        assert_eq!(
            cause(&plan, Latch::EmergencyStop, None, Some(topic)),
            "since no value of the emergency stop `topic/button` came from `button` for 500 ms (`emergency_stop_max_age`)"
        );
    }
}
