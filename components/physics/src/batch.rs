//! Many worlds stepped together, on all cores.

use std::sync::Arc;
use std::thread;

use crate::{
    BuildError, Engine, JointCommand, Properties, ResetError, Simulation, Simulator, StepError, StepReport,
};

/// Many simulations of robots of one kind, stepped together on several threads.
///
/// States, commands and [observations](Self::observing) of all worlds lie one after the other in memory. Each world computes what it would compute
/// alone, to the last bit, on however many threads.
///
/// # Example
///
/// ```
/// use std::path::Path;
/// use motorium_physics::{ArticulatedSimulator, Batch, JointCommand, Options, World};
/// use motorium_robots::load;
///
/// let model = load("cart-pole", Path::new("."))?.model;
/// let build = |world: usize| {
///     let q = [0.0, 0.01 * world as f64];
///     ArticulatedSimulator::new(model.clone(), World::default(), &q, Options::default())
/// };
/// let mut batch = Batch::new(64, 2, build)?;
/// batch.commands_mut().fill(JointCommand::default());
/// let failures = batch.step(1e-3, 100).iter().filter(|outcome| outcome.is_err()).count();
/// assert_eq!(failures, 0);
/// // The pole that leans most has fallen farthest.
/// assert!(batch.positions(63)[1] > batch.positions(1)[1]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Batch<E> {
    worlds: Vec<Simulation<E>>,
    threads: usize,
    /// Sizes of one world.
    nq: usize,
    nv: usize,
    drives: usize,
    commands: Vec<JointCommand>,
    positions: Vec<f64>,
    velocities: Vec<f64>,
    /// Numbers of an observation of one world, and what writes them.
    observed: usize,
    observe: Observe<E>,
    observations: Vec<f64>,
    outcomes: Vec<Result<StepReport, StepError>>,
}

/// Writes an observation of a world.
type Observe<E> = Arc<dyn Fn(&Simulation<E>, &mut [f64]) + Send + Sync>;

/// The part of a batch that one thread steps.
struct Share<'a, E> {
    worlds: &'a mut [Simulation<E>],
    commands: &'a [JointCommand],
    positions: &'a mut [f64],
    velocities: &'a mut [f64],
    observations: &'a mut [f64],
    outcomes: &'a mut [Result<StepReport, StepError>],
}

impl<E: Engine + Send> Batch<E> {
    /// `count` worlds, each made by `build` from its index, for `threads` threads (at least one). All must have robots with as
    /// many joints.
    ///
    /// # Errors
    ///
    /// The first that `build` gives.
    ///
    /// # Panics
    ///
    /// If `count` is zero, or robots differ in size.
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
            threads: threads.clamp(1, count),
            commands: vec![JointCommand::default(); count * drives],
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

    /// The same batch, which after every [`step`](Self::step) and reset has `count` numbers of each world in
    /// [`observations`](Self::observations), as `observe` writes them: on the thread that steps the world.
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

    /// Number of worlds.
    pub fn count(&self) -> usize {
        self.worlds.len()
    }

    /// A world, such as to look at its objects and contacts.
    pub fn world(&self, index: usize) -> &Simulation<E> {
        &self.worlds[index]
    }

    /// The commands of all drives of all worlds, one world after the other; they stay until changed.
    pub fn commands_mut(&mut self) -> &mut [JointCommand] {
        &mut self.commands
    }

    /// Configurations of all worlds (nq each), one after the other.
    pub fn all_positions(&self) -> &[f64] {
        &self.positions
    }

    /// Velocities of all worlds (nv each), one after the other.
    pub fn all_velocities(&self) -> &[f64] {
        &self.velocities
    }

    /// Configuration (nq) of a world.
    pub fn positions(&self, world: usize) -> &[f64] {
        &self.positions[world * self.nq..][..self.nq]
    }

    /// Velocity (nv) of a world.
    pub fn velocities(&self, world: usize) -> &[f64] {
        &self.velocities[world * self.nv..][..self.nv]
    }

    /// [Observations](Self::observing) of all worlds, one after the other; none where nothing is observed.
    pub fn observations(&self) -> &[f64] {
        &self.observations
    }

    /// The observation of a world.
    pub fn observation(&self, world: usize) -> &[f64] {
        &self.observations[world * self.observed..][..self.observed]
    }

    /// Advances every world by `steps` steps of `dt` \[s\] with the commands as they are. Returns the outcome of the last
    /// step of each; a world whose step fails stays where it was before that step.
    pub fn step(&mut self, dt: f64, steps: usize) -> &[Result<StepReport, StepError>] {
        let count = self.worlds.len().div_ceil(self.threads);
        let (nq, nv, drives, observed) = (self.nq, self.nv, self.drives, self.observed);
        let mut observations = self.observations.chunks_mut((count * observed).max(1));
        let observe: &Observe<E> = &self.observe;
        let shares = self
            .worlds
            .chunks_mut(count)
            .zip(self.commands.chunks((count * drives).max(1)))
            .zip(self.positions.chunks_mut(count * nq))
            .zip(self.velocities.chunks_mut(count * nv))
            .zip(self.outcomes.chunks_mut(count))
            .map(|((((worlds, commands), positions), velocities), outcomes)| Share {
                worlds,
                commands,
                positions,
                velocities,
                observations: observations.next().unwrap_or_default(),
                outcomes,
            });
        thread::scope(|scope| {
            let mut shares = shares;
            let own = shares.next();
            for mut share in shares {
                scope.spawn(move || share.step((nq, nv, drives), (observed, observe), (dt, steps)));
            }
            if let Some(mut share) = own {
                share.step((nq, nv, drives), (observed, observe), (dt, steps));
            }
        });
        &self.outcomes
    }

    /// Puts one world at `q` (nq) with velocity `v` (nv), its objects where they began; its commands become zero efforts.
    ///
    /// # Errors
    ///
    /// [`ResetError`]; nothing has changed then.
    pub fn reset(&mut self, world: usize, q: &[f64], v: &[f64]) -> Result<(), ResetError> {
        self.worlds[world].reset(q, v)?;
        self.commands[world * self.drives..][..self.drives].fill(JointCommand::default());
        self.read(world);
        Ok(())
    }

    /// [`reset`](Self::reset) with other physical properties, which stay until the next call.
    ///
    /// # Errors
    ///
    /// [`ResetError`]; nothing has changed then.
    pub fn reset_with(
        &mut self,
        world: usize,
        properties: &Properties,
        q: &[f64],
        v: &[f64],
    ) -> Result<(), ResetError> {
        self.worlds[world].reset_with(properties, q, v)?;
        self.commands[world * self.drives..][..self.drives].fill(JointCommand::default());
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

impl<E: Engine> Share<'_, E> {
    fn step(
        &mut self,
        (nq, nv, drives): (usize, usize, usize),
        (observed, observe): (usize, &Observe<E>),
        (dt, steps): (f64, usize),
    ) {
        for (index, (world, outcome)) in self.worlds.iter_mut().zip(&mut *self.outcomes).enumerate() {
            world.commands_mut().copy_from_slice(&self.commands[index * drives..][..drives]);
            for _ in 0..steps {
                *outcome = world.step(dt);
                if outcome.is_err() {
                    break;
                }
            }
            self.positions[index * nq..][..nq].copy_from_slice(world.configuration());
            self.velocities[index * nv..][..nv].copy_from_slice(world.velocity());
            observe(world, &mut self.observations[index * observed..][..observed]);
        }
    }
}
