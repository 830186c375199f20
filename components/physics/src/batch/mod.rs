//! Many worlds stepped together, on all cores.

mod workers;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use crate::{
    BuildError, Engine, JointSetpoint, Properties, ResetError, Simulation, Simulator, StepError, StepReport,
};
use workers::Workers;

/// Blocks of worlds per thread. A thread that finishes early steps blocks of other threads; the others wait
/// for the last block, so blocks are small.
const BLOCKS: usize = 16;

/// Many simulations of robots with the same number of joints, stepped together on several threads.
///
/// States, commands and [observations](Self::observing) of all worlds are contiguous, one world after the
/// other. Each world computes the same result as it would alone, bit for bit, on any number of threads. The
/// threads live as long as the batch: between two calls they poll for 0.03 to 0.5 ms, depending on the
/// processor, and then sleep.
///
/// [`step`](Self::step) advances all worlds under the commands of the batch. [`each`](Self::each) visits all
/// worlds, each with its user data `W` ([`with_data`](Self::with_data)). One visit can set commands, step,
/// observe, compute a reward, reset and randomise, on the thread that steps the world.
///
/// # Example
///
/// ```
/// use std::path::Path;
/// use motorium_physics::{ArticulatedSimulator, Batch, JointSetpoint, Options, World};
/// use motorium_robots::load;
///
/// let model = load("cart-pole", Path::new("."))?.model;
/// let build = |world: usize| {
///     let q = [0.0, 0.01 * world as f64];
///     ArticulatedSimulator::new(model.clone(), World::default(), &q, Options::default())
/// };
/// let mut batch = Batch::new(64, 2, build)?;
/// batch.commands_mut().fill(JointSetpoint::default());
/// let failures = batch.step(1e-3, 100).iter().filter(|outcome| outcome.is_err()).count();
/// assert_eq!(failures, 0);
/// // The pole that leans most has fallen farthest.
/// assert!(batch.positions(63)[1] > batch.positions(1)[1]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Batch<E, W = ()> {
    worlds: Vec<Simulation<E>>,
    data: Vec<W>,
    workers: Workers,
    /// Sizes of one world.
    nq: usize,
    nv: usize,
    drives: usize,
    commands: Vec<JointSetpoint>,
    positions: Vec<f64>,
    velocities: Vec<f64>,
    /// Number of values in an observation of one world, and the function that writes them.
    observed: usize,
    observe: Observe<E>,
    observations: Vec<f64>,
    outcomes: Vec<Result<StepReport, StepError>>,
}

/// Writes an observation of a world.
type Observe<E> = Arc<dyn Fn(&Simulation<E>, &mut [f64]) + Send + Sync>;

/// A block of worlds, visited by one thread.
struct Block<'a, E, W> {
    /// Index of the first world.
    first: usize,
    worlds: &'a mut [Simulation<E>],
    data: &'a mut [W],
    positions: &'a mut [f64],
    velocities: &'a mut [f64],
    observations: &'a mut [f64],
    outcomes: &'a mut [Result<StepReport, StepError>],
}

impl<E: Engine + Send> Batch<E> {
    /// Builds `count` worlds and starts `threads` - 1 threads; the calling thread also steps worlds. `build`
    /// receives the index of each world. All robots must have the same number of joints.
    ///
    /// # Errors
    ///
    /// Returns the first error of `build`.
    ///
    /// # Panics
    ///
    /// If `count` is zero, the robots differ in size, or the system cannot start a thread.
    pub fn new(
        count: usize,
        threads: usize,
        build: impl FnMut(usize) -> Result<Simulation<E>, BuildError>,
    ) -> Result<Self, BuildError> {
        let worlds = (0..count).map(build).collect::<Result<Vec<_>, _>>()?;
        let size = |world: &Simulation<E>| {
            (world.configuration().len(), world.velocity().len(), world.joint_names().len())
        };
        let (nq, nv, drives) = worlds.first().map(size).expect("a batch of at least one world");
        assert!(worlds.iter().all(|world| size(world) == (nq, nv, drives)), "robots of one size");
        let mut batch = Self {
            data: vec![(); count],
            workers: Workers::new(threads.clamp(1, count) - 1),
            commands: vec![JointSetpoint::default(); count * drives],
            positions: vec![0.0; count * nq],
            velocities: vec![0.0; count * nv],
            observed: 0,
            observe: Arc::new(|_, _| {}),
            observations: Vec::new(),
            outcomes: vec![Ok(StepReport::default()); count],
            worlds,
            nq,
            nv,
            drives,
        };
        (0..count).for_each(|world| batch.read(world));
        Ok(batch)
    }
}

impl<E: Engine + Send, W: Send> Batch<E, W> {
    /// Replaces the user data of all worlds with the values that `make` returns for the index of each world.
    /// Such data may be a history of observations, random numbers or a reward.
    #[must_use]
    pub fn with_data<T: Send>(self, make: impl FnMut(usize) -> T) -> Batch<E, T> {
        let data = (0..self.worlds.len()).map(make).collect();
        Batch {
            worlds: self.worlds,
            data,
            workers: self.workers,
            nq: self.nq,
            nv: self.nv,
            drives: self.drives,
            commands: self.commands,
            positions: self.positions,
            velocities: self.velocities,
            observed: self.observed,
            observe: self.observe,
            observations: self.observations,
            outcomes: self.outcomes,
        }
    }

    /// Adds an observation of `count` numbers per world. `observe` writes the
    /// [observations](Self::observations) after every [`step`](Self::step), visit and reset, on the thread
    /// that performs it.
    ///
    /// ```
    /// use std::path::Path;
    /// use motorium_physics::{ArticulatedSimulator, Batch, Options, Simulator, World};
    /// use motorium_robots::load;
    ///
    /// let model = load("pendulum", Path::new("."))?.model;
    /// let build = |world: usize| {
    ///     ArticulatedSimulator::new(model.clone(), World::default(), &[0.1 * world as f64], Options::default())
    /// };
    /// let mut batch = Batch::new(4, 2, build)?.observing(2, |world, out| {
    ///     let angle = world.configuration()[0];
    ///     out.copy_from_slice(&[angle.cos(), angle.sin()]);
    /// });
    /// batch.step(1e-3, 10);
    /// assert_eq!(batch.observations().len(), 8);
    /// assert_eq!(batch.observation(3)[1], batch.positions(3)[0].sin());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn observing(
        mut self,
        count: usize,
        observe: impl Fn(&Simulation<E>, &mut [f64]) + Send + Sync + 'static,
    ) -> Self {
        (self.observed, self.observe) = (count, Arc::new(observe));
        self.observations = vec![0.0; count * self.worlds.len()];
        (0..self.worlds.len()).for_each(|world| self.read(world));
        self
    }

    /// Returns the number of worlds.
    pub fn count(&self) -> usize {
        self.worlds.len()
    }

    /// Returns the number of threads that visit the worlds, including the calling thread.
    pub fn threads(&self) -> usize {
        self.workers.threads()
    }

    /// Calls `work` once on each thread with the index of the thread, from 0, and returns when all calls have
    /// returned. Other work can thereby use the threads of the batch between two steps.
    ///
    /// # Panics
    ///
    /// Resumes the first panic of a call once all threads have finished.
    pub fn on_threads(&mut self, work: &(dyn Fn(usize) + Sync)) {
        self.workers.run(work);
    }

    /// Returns the simulation of a world, for example to read its objects and contacts.
    pub fn world(&self, index: usize) -> &Simulation<E> {
        &self.worlds[index]
    }

    /// Returns the user data of all worlds, in the order of the worlds.
    pub fn data(&self) -> &[W] {
        &self.data
    }

    /// Returns the user data of all worlds for modification between two steps.
    pub fn data_mut(&mut self) -> &mut [W] {
        &mut self.data
    }

    /// Returns the commands of all drives of all worlds for modification, world by world. Commands persist
    /// until changed.
    pub fn commands_mut(&mut self) -> &mut [JointSetpoint] {
        &mut self.commands
    }

    /// Returns the configurations of all worlds, world by world, each with nq numbers.
    pub fn all_positions(&self) -> &[f64] {
        &self.positions
    }

    /// Returns the velocities of all worlds, world by world, each with nv numbers.
    pub fn all_velocities(&self) -> &[f64] {
        &self.velocities
    }

    /// Returns the configuration (nq) of a world.
    pub fn positions(&self, world: usize) -> &[f64] {
        &self.positions[world * self.nq..][..self.nq]
    }

    /// Returns the velocity (nv) of a world.
    pub fn velocities(&self, world: usize) -> &[f64] {
        &self.velocities[world * self.nv..][..self.nv]
    }

    /// Returns the [observations](Self::observing) of all worlds, world by world; empty if nothing is
    /// observed.
    pub fn observations(&self) -> &[f64] {
        &self.observations
    }

    /// Returns the observation of a world.
    pub fn observation(&self, world: usize) -> &[f64] {
        &self.observations[world * self.observed..][..self.observed]
    }

    /// Advances every world by `steps` steps of `dt` \[s\] under the commands of the batch. Returns the
    /// outcome of each world's last step. A world whose step fails keeps its state from before that step.
    pub fn step(&mut self, dt: f64, steps: usize) -> &[Result<StepReport, StepError>] {
        let commands = core::mem::take(&mut self.commands);
        let drives = self.drives;
        self.visit(&|index, world, _, outcome| {
            world.commands_mut().copy_from_slice(&commands[index * drives..][..drives]);
            for _ in 0..steps {
                *outcome = world.step(dt);
                if outcome.is_err() {
                    break;
                }
            }
        });
        self.commands = commands;
        &self.outcomes
    }

    /// Calls `visit` once for every world with its index, simulation and user data, distributed over all
    /// threads. Returns when all calls have returned. States and observations are read after each visit.
    ///
    /// The effect of a visit must depend only on its arguments. The result is then the same bit for bit on
    /// any number of threads. The commands of the batch are not used: a visit sets the commands of the
    /// simulation itself.
    ///
    /// ```
    /// use std::path::Path;
    /// use motorium_physics::{ArticulatedSimulator, Batch, JointSetpoint, Options, Simulator, World};
    /// use motorium_robots::load;
    ///
    /// let model = load("pendulum", Path::new("."))?.model;
    /// let build = |_| ArticulatedSimulator::new(model.clone(), World::default(), &[0.1], Options::default());
    /// let mut batch = Batch::new(8, 2, build)?.with_data(|world| (world as f64, 0_usize));
    /// for _ in 0..100 {
    ///     batch.each(|_, simulation, (effort, failures)| {
    ///         simulation.commands_mut()[0] = JointSetpoint::effort(0.01 * *effort);
    ///         if simulation.step(1e-3).is_err() {
    ///             *failures += 1;
    ///         }
    ///     });
    /// }
    /// assert!(batch.data().iter().all(|(_, failures)| *failures == 0));
    /// assert!(batch.positions(7)[0] > batch.positions(0)[0]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Panics
    ///
    /// Resumes the first panic of a visit once all threads have finished.
    pub fn each(&mut self, visit: impl Fn(usize, &mut Simulation<E>, &mut W) + Sync) {
        self.visit(&|index, world, data, _| visit(index, world, data));
    }

    fn visit(&mut self, visit: &Visit<'_, E, W>) {
        let count = self.worlds.len().div_ceil(self.workers.threads() * BLOCKS);
        let (nq, nv, observed) = (self.nq, self.nv, self.observed);
        let mut observations = self.observations.chunks_mut((count * observed).max(1));
        let observe: &Observe<E> = &self.observe;
        let blocks: Vec<_> = self
            .worlds
            .chunks_mut(count)
            .zip(self.data.chunks_mut(count))
            .zip(self.positions.chunks_mut((count * nq).max(1)))
            .zip(self.velocities.chunks_mut((count * nv).max(1)))
            .zip(self.outcomes.chunks_mut(count))
            .enumerate()
            .map(|(block, ((((worlds, data), positions), velocities), outcomes))| Block {
                first: block * count,
                worlds,
                data,
                positions,
                velocities,
                observations: observations.next().unwrap_or_default(),
                outcomes,
            })
            .map(|block| (AtomicBool::new(false), Mutex::new(block)))
            .collect();
        let threads = self.workers.threads();
        self.workers.run(&|thread| {
            // Each thread begins with its own worlds, which are in its caches, and then helps with the rest.
            let start = thread * blocks.len() / threads;
            for (claimed, block) in blocks[start..].iter().chain(&blocks[..start]) {
                if !claimed.swap(true, Ordering::Relaxed) {
                    let mut block = block.lock().unwrap_or_else(PoisonError::into_inner);
                    block.visit((nq, nv), (observed, observe), visit);
                }
            }
        });
    }

    /// Resets one world to configuration `q` (nq) and velocity `v` (nv), its objects to their start
    /// states, and its commands to zero efforts.
    ///
    /// # Errors
    ///
    /// [`ResetError`] if the state is invalid. The world is then unchanged.
    pub fn reset(&mut self, world: usize, q: &[f64], v: &[f64]) -> Result<(), ResetError> {
        self.worlds[world].reset(q, v)?;
        self.commands[world * self.drives..][..self.drives].fill(JointSetpoint::default());
        self.read(world);
        Ok(())
    }

    /// Resets one world like [`reset`](Self::reset), but with new physical `properties`, which persist until
    /// the next call of this method.
    ///
    /// # Errors
    ///
    /// [`ResetError`] if the state is invalid. The world is then unchanged.
    pub fn reset_with(
        &mut self,
        world: usize,
        properties: &Properties,
        q: &[f64],
        v: &[f64],
    ) -> Result<(), ResetError> {
        self.worlds[world].reset_with(properties, q, v)?;
        self.commands[world * self.drives..][..self.drives].fill(JointSetpoint::default());
        self.read(world);
        Ok(())
    }

    fn read(&mut self, world: usize) {
        let simulation = &self.worlds[world];
        self.positions[world * self.nq..][..self.nq].copy_from_slice(simulation.configuration());
        self.velocities[world * self.nv..][..self.nv].copy_from_slice(simulation.velocity());
        (self.observe)(simulation, &mut self.observations[world * self.observed..][..self.observed]);
    }
}

/// A visitor of a world: receives its index, simulation, data, and the outcome of its last step.
type Visit<'a, E, W> =
    dyn Fn(usize, &mut Simulation<E>, &mut W, &mut Result<StepReport, StepError>) + Sync + 'a;

impl<E: Engine, W> Block<'_, E, W> {
    fn visit(
        &mut self,
        (nq, nv): (usize, usize),
        (observed, observe): (usize, &Observe<E>),
        visit: &Visit<'_, E, W>,
    ) {
        let worlds = self.worlds.iter_mut().zip(&mut *self.data).zip(&mut *self.outcomes);
        for (index, ((world, data), outcome)) in worlds.enumerate() {
            visit(self.first + index, world, data, outcome);
            self.positions[index * nq..][..nq].copy_from_slice(world.configuration());
            self.velocities[index * nv..][..nv].copy_from_slice(world.velocity());
            observe(world, &mut self.observations[index * observed..][..observed]);
        }
    }
}
