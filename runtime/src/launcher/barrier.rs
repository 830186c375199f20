//! The barrier before the first step: every port is connected.

use std::time::{Duration, Instant};

use super::{Event, Hosting, Launch, LaunchError};
use crate::plan::{ClockKind, SchedulingClass};
use crate::region::{Command, End, Phase};
use std::sync::atomic::Ordering::Relaxed;

/// Time within which components must be configured.
const CONFIGURE_WITHIN: Duration = Duration::from_secs(30);

impl Launch {
    /// Waits until all components are configured, then until all are connected; `false` if a signal arrived
    /// first.
    pub(super) fn pass_barrier(&mut self, observe: &mut dyn FnMut(Event<'_>)) -> Result<bool, LaunchError> {
        if !self.await_phase(Phase::Ready, observe)? {
            return Ok(false);
        }
        self.region.header().order(Command::Connect);
        self.children
            .iter_mut()
            .zip(self.region.components())
            .for_each(|(child, block)| child.connect(block));
        if !self.await_phase(Phase::Connected, observe)? {
            return Ok(false);
        }
        self.lost = self.losses();
        if !self.lost.is_empty() {
            let line = format!(
                "without {}: timing will suffer; run as root or grant CAP_SYS_NICE and CAP_IPC_LOCK (see `motorium \
                 doctor`)",
                self.lost.join(" and ")
            );
            observe(Event::Lost(&line));
        }
        Ok(true)
    }

    fn await_phase(
        &mut self,
        wanted: Phase,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Result<bool, LaunchError> {
        let until = Instant::now() + CONFIGURE_WITHIN;
        for index in 0..self.children.len() {
            loop {
                self.relay_output(observe);
                if self.signals.is_raised() {
                    return Ok(false);
                }
                let block = &self.region.components()[index];
                let phase = block.phase();
                let child = &mut self.children[index];
                let name = child.name().to_string();
                if phase == Phase::Faulted || child.ended().is_some() {
                    child.wait(Duration::from_millis(200));
                    let end = child.ended().unwrap_or(End::Failed);
                    self.relay_output(observe);
                    let block = &self.region.components()[index];
                    let reason = match block.failure() {
                        Some(failure) => failure.to_string(),
                        None => crate::os::with_shortage(end.to_string(), self.folder.path()),
                    };
                    return Err(LaunchError::Component { name, reason });
                }
                if phase as u32 >= wanted as u32 {
                    break;
                }
                if Instant::now() > until {
                    let reason = format!("it is not ready after {} s", CONFIGURE_WITHIN.as_secs());
                    return Err(LaunchError::Component { name, reason });
                }
                crate::os::futex_wait(block.phase_word(), phase as u32, Some(Duration::from_millis(20)));
            }
        }
        Ok(true)
    }

    /// Returns the denied requests, from the settings read back by the workers.
    fn losses(&self) -> Vec<String> {
        if self.plan.clock == ClockKind::Lockstep || self.options.hosting != Hosting::Processes {
            return Vec::new();
        }
        let mut priority = Vec::new();
        let mut deadline = Vec::new();
        let mut memory = Vec::new();
        let mut core = Vec::new();
        for (component, block) in self.plan.components.iter().zip(self.region.components()) {
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
                core.push(component.name.as_str());
            }
        }
        let lost = [
            ("real-time priority", priority),
            ("time of its own in every period", deadline),
            ("locked memory", memory),
            ("the core asked for", core),
        ];
        let idle = self
            .idle_states
            .denied
            .as_ref()
            .map(|_| "a limit on idle states (/dev/cpu_dma_latency)".to_string());
        lost.into_iter()
            .filter(|(_, names)| !names.is_empty())
            .map(|(what, names)| format!("{what} ({})", names.join(", ")))
            .chain(idle)
            .collect()
    }

    /// Passes on the lines that the components have printed.
    pub(super) fn relay_output(&self, observe: &mut dyn FnMut(Event<'_>)) {
        for child in &self.children {
            for line in child.printed() {
                observe(Event::Output { component: child.name(), line: &line });
            }
            let dropped = child.dropped();
            if dropped > 0 {
                let line = format!("({dropped} lines were dropped: they came too fast)");
                observe(Event::Output { component: child.name(), line: &line });
            }
        }
    }
}
