//! The end of a run: the safe state, the orderly stop.

use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use super::{Event, Launch};
use crate::os::monotonic_ns;
use crate::plan::{ClockKind, STOP_WITHIN_NS};
use crate::region::{Command, ComponentBlock, Phase};

/// State of an actuator after a safe stop was ordered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reached {
    /// Alive, has stepped since, and applies its safe state.
    Safe {
        /// Time at which it entered it, ns.
        since_ns: u64,
    },
    /// Applies its safe state, but joints still move that should be at rest.
    Moving,
    /// Alive, but has not reported its safe state.
    Not,
    /// Without a process, or failed: its last state is meaningless.
    Dead,
}

impl Reached {
    /// Derives it from the control block, unless the component has ended.
    pub(super) fn from_block(block: &ComponentBlock, ended: bool, noticed: u64) -> Self {
        let stepped = block.last_step_ns.load(Relaxed) >= noticed;
        let is_safe = stepped && block.safe.load(Relaxed) != 0;
        match block.phase() {
            // Killed: the phase is that of its last moment.
            Phase::Running if ended => Self::Dead,
            // An actuator that stayed there for the settling time may have left on its own.
            Phase::Running | Phase::Stopped if is_safe && block.gate.moves() => Self::Moving,
            Phase::Running | Phase::Stopped if is_safe => {
                Self::Safe { since_ns: block.safe_since_ns.load(Relaxed) }
            }
            Phase::Running => Self::Not,
            _ => Self::Dead,
        }
    }
}

impl Launch {
    /// Brings the actuators to their safe state and waits until the robot has settled.
    pub(super) fn safe_stop(&mut self, reason: &str, observe: &mut dyn FnMut(Event<'_>)) {
        let noticed = monotonic_ns();
        let header = self.region.header();
        header.safe_stop_ns.store(noticed, Relaxed);
        header.order(Command::SafeStop);
        self.signal_all();
        observe(Event::SafeStop { reason });
        let settle = Duration::from_nanos(self.plan.settle_ns());
        let until = Instant::now() + settle;
        let mut reported = false;
        while Instant::now() < until {
            self.relay_output(observe);
            if !reported && let Some(after_ns) = self.all_actuators_safe_since(noticed) {
                observe(Event::Safe { after_ns });
                reported = true;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        if !reported {
            self.report_unsafe(noticed, observe);
        }
    }

    /// Returns the actuators with their states since a safe stop was ordered at `noticed`.
    fn actuators(&mut self, noticed: u64) -> Vec<(usize, Reached)> {
        let components = self.plan.components.iter().enumerate().filter(|(_, component)| component.actuator);
        let actuators: Vec<usize> = components.map(|(index, _)| index).collect();
        let reached = |index: usize| {
            let ended = self.children[index].ended().is_some();
            Reached::from_block(&self.region.components()[index], ended, noticed)
        };
        actuators.iter().copied().zip(actuators.iter().copied().map(reached)).collect()
    }

    /// Returns the time from `noticed` until the last actuator was in its safe state; `None` unless all are
    /// alive, safe and at rest.
    fn all_actuators_safe_since(&mut self, noticed: u64) -> Option<u64> {
        let mut last = noticed;
        let actuators = self.actuators(noticed);
        for (_, reached) in &actuators {
            let Reached::Safe { since_ns } = reached else { return None };
            last = last.max(*since_ns);
        }
        (!actuators.is_empty()).then(|| last - noticed)
    }

    /// Records the actuators that did not hold their safe state until the end of the settling time.
    fn note_unsafe(&mut self, noticed: u64, observe: &mut dyn FnMut(Event<'_>)) {
        if self.plan.settle_ns() == 0 || self.all_actuators_safe_since(noticed).is_some() {
            return;
        }
        self.report_unsafe(noticed, observe);
        for (index, reached) in self.actuators(noticed) {
            let name = &self.plan.components[index].name;
            match reached {
                // Moving joints are recorded at the end (`note_rest`).
                Reached::Safe { .. } | Reached::Moving => {}
                Reached::Not => {
                    self.warnings.push(format!("`{name}` did not reach its safe state before the end"));
                }
                Reached::Dead => {
                    self.warnings
                        .push(format!("`{name}` ended before the robot had settled: nothing held it"));
                }
            }
        }
    }

    /// Reports the actuators outside their safe state.
    fn report_unsafe(&mut self, noticed: u64, observe: &mut dyn FnMut(Event<'_>)) {
        let actuators = self.actuators(noticed);
        let names = |wanted: fn(&Reached) -> bool| -> Vec<&str> {
            let those = actuators.iter().filter(|(_, reached)| wanted(reached));
            those.map(|(index, _)| self.plan.components[*index].name.as_str()).collect()
        };
        let dead = names(|reached| matches!(reached, Reached::Dead));
        let late = names(|reached| matches!(reached, Reached::Not));
        let moving = names(|reached| matches!(reached, Reached::Moving));
        let safe = names(|reached| matches!(reached, Reached::Safe { .. }));
        if !actuators.is_empty() {
            observe(Event::NotSafe { dead: &dead, late: &late, moving: &moving, safe: &safe });
        }
    }

    /// Ends all components: the actuators reach their safe state first, then all components receive the stop
    /// command, and those that do not stop are killed.
    pub(super) fn end(&mut self, observe: &mut dyn FnMut(Event<'_>)) {
        let running = self.plan.clock == ClockKind::Realtime
            && self.region.components().iter().any(|block| block.phase() == Phase::Running);
        let actuators = self.plan.components.iter().any(|component| component.actuator);
        if running && actuators && self.region.header().command() == Command::Run {
            let header = self.region.header();
            let noticed = monotonic_ns();
            header.safe_stop_ns.store(noticed, Relaxed);
            header.order(Command::SafeStop);
            self.signal_all();
            std::thread::sleep(Duration::from_nanos(self.plan.settle_ns()));
            self.note_unsafe(noticed, observe);
        }
        // The reserve for restarts makes space for results.
        self.spare.release();
        self.region.header().order(Command::Stop);
        self.ended_ns = Some(monotonic_ns());
        let ordered = Instant::now();
        for index in 0..self.children.len() {
            let within_ns = self.plan.components[index].stop_within_ns.unwrap_or(STOP_WITHIN_NS);
            let until = ordered + Duration::from_nanos(within_ns);
            self.children[index].finish(&self.region.components()[index], &self.folder);
            while self.children[index].ended().is_none() && Instant::now() < until {
                self.wake_triggered();
                self.signal_all();
                self.children[index].wait(Duration::from_millis(10));
            }
            self.children[index].kill();
        }
        // Their pipes are closed now: their last lines have arrived or will in a moment.
        std::thread::sleep(Duration::from_millis(2));
        self.relay_output(observe);
    }

    /// Wakes components that wait for a publication, so that they see the command.
    pub(super) fn wake_triggered(&self) {
        for topic in &self.services.waited_for {
            topic.interrupt();
        }
    }
}
