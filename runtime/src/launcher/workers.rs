//! The components of a run: processes, threads, or hosted by the launcher's thread.

use std::os::fd::BorrowedFd;
use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use super::child::Child;
use super::run::Run;
use super::{Event, Hosting, LaunchError};
use crate::plan::{Program, STOP_WITHIN_NS};
use crate::region::{Command, End, Phase};
use crate::worker::{Host, Registry};

/// Time within which components must be configured.
const CONFIGURE_WITHIN: Duration = Duration::from_secs(30);

/// The components of a run, in the order of the plan.
pub(super) struct Workers {
    run: Rc<Run>,
    registry: Registry,
    children: Vec<Child>,
}

impl Workers {
    /// Creates an empty set.
    pub(super) fn new(run: &Rc<Run>, registry: &Registry) -> Self {
        Self { run: run.clone(), registry: registry.clone(), children: Vec::new() }
    }

    /// Starts all components.
    ///
    /// # Errors
    /// A component cannot be started.
    pub(super) fn start_all(&mut self) -> Result<(), LaunchError> {
        for index in 0..self.run.plan.components.len() {
            let child = self.start(index)?;
            self.children.push(child);
        }
        Ok(())
    }

    /// Restarts a component that has ended.
    ///
    /// # Errors
    /// The component cannot be started.
    pub(super) fn replace(&mut self, index: usize) -> Result<(), LaunchError> {
        self.children[index] = self.start(index)?;
        Ok(())
    }

    fn start(&self, index: usize) -> Result<Child, LaunchError> {
        let Run { plan, options, folder, region, program, .. } = &*self.run;
        let component = &plan.components[index];
        let block = &region.components()[index];
        if self.run.is_played(&component.name) {
            return Ok(Child::played(&component.name, block));
        }
        let child = match (&component.program, options.hosting) {
            (Program::Exec { path } | Program::Sibling { path, .. }, _) => {
                Child::process(path, folder, &component.name, (region, index))?
            }
            (Program::Builtin { .. }, Hosting::Processes) => {
                Child::process(program.path(), folder, &component.name, (region, index))?
            }
            (Program::Builtin { kind }, Hosting::Threads) => {
                Child::thread(self.registry.find(kind), folder, &component.name)?
            }
            (Program::Builtin { kind }, Hosting::Inline) => {
                let mut child =
                    Child::inline(self.registry.find(kind), &Host { folder, plan, region }, index)?;
                // A restarted component joins a run that has passed its barrier.
                if region.header().command() as u32 >= Command::Run as u32 {
                    child.connect(block);
                    child.begin(block);
                }
                child
            }
        };
        block.pid.store(child.pid(), Relaxed);
        Ok(child)
    }

    /// Connects the ports of all components, once all are configured. Returns `false` if a signal arrived
    /// first.
    ///
    /// # Errors
    /// A component failed, or is not ready in time.
    pub(super) fn pass_barrier(&mut self, observe: &mut dyn FnMut(Event<'_>)) -> Result<bool, LaunchError> {
        if !self.await_phase(Phase::Ready, observe)? {
            return Ok(false);
        }
        let run = self.run.clone();
        run.region.header().order(Command::Connect);
        self.children.iter_mut().zip(run.region.components()).for_each(|(child, block)| child.connect(block));
        self.await_phase(Phase::Connected, observe)
    }

    fn await_phase(
        &mut self,
        wanted: Phase,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Result<bool, LaunchError> {
        let until = Instant::now() + CONFIGURE_WITHIN;
        let run = self.run.clone();
        for (index, block) in run.region.components().iter().enumerate() {
            loop {
                self.relay_output(observe);
                if run.signals.is_raised() {
                    return Ok(false);
                }
                let phase = block.phase();
                let child = &mut self.children[index];
                let name = child.name().to_string();
                if phase == Phase::Faulted || child.ended().is_some() {
                    child.wait(Duration::from_millis(200));
                    let end = child.ended().unwrap_or(End::Failed);
                    self.relay_output(observe);
                    let reason = match block.failure() {
                        Some(failure) => failure.to_string(),
                        None => crate::os::with_shortage(end.to_string(), run.folder.path()),
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

    /// Begins the run of all components.
    pub(super) fn begin(&mut self) {
        let blocks = self.run.region.components();
        self.children.iter_mut().zip(blocks).for_each(|(child, block)| child.begin(block));
        self.interrupt_all();
    }

    /// Returns a component.
    #[inline]
    pub(super) fn child(&mut self, index: usize) -> &mut Child {
        &mut self.children[index]
    }

    /// Interrupts every component, so that it reads the command.
    pub(super) fn interrupt_all(&self) {
        for (child, block) in self.children.iter().zip(self.run.region.components()) {
            child.interrupt(block.thread.load(Relaxed) as i32);
        }
    }

    /// Forwards the lines printed by the components.
    pub(super) fn relay_output(&self, observe: &mut dyn FnMut(Event<'_>)) {
        for child in &self.children {
            for line in child.printed() {
                observe(Event::Output { component: child.name(), line: &line });
            }
            let dropped = child.dropped();
            if dropped > 0 {
                let line = format!("({dropped} lines were dropped because they came too fast)");
                observe(Event::Output { component: child.name(), line: &line });
            }
        }
    }

    /// Returns the descriptors that become readable when a process ends.
    pub(super) fn descriptors(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        self.children.iter().flat_map(Child::descriptors)
    }

    /// Waits for the end of all components, which have received the stop command, and kills those that do not
    /// stop. `wake` wakes components that wait for a publication.
    pub(super) fn end_all(&mut self, wake: impl Fn()) {
        let run = self.run.clone();
        let ordered = Instant::now();
        for (index, block) in run.region.components().iter().enumerate() {
            let within_ns = run.plan.components[index].stop_within_ns.unwrap_or(STOP_WITHIN_NS);
            let until = ordered + Duration::from_nanos(within_ns);
            self.children[index].finish(block, &run.folder);
            while self.children[index].ended().is_none() && Instant::now() < until {
                wake();
                self.interrupt_all();
                self.children[index].wait(Duration::from_millis(10));
            }
            self.children[index].kill();
        }
    }

    /// Kills the remaining processes and releases all resources of hosted components.
    pub(super) fn kill_all(&mut self) {
        self.interrupt_all();
        self.children.iter_mut().for_each(Child::kill);
        self.children.clear();
    }
}
