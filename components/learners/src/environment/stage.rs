//! A task bound to the simulation of a robot: terms, starts of episodes, and physics steps.

use motorium_drive::{JointSetpoint, within_range, within_rate};
use motorium_locomotion::wheels::{BaseKind, PlanarTwist, RobotWheels, WheelsConfig};
use motorium_models::policy::{ActionKind, BaseMotion, projected_gravity};
use motorium_physics::randomise::{Draws, RandomiseConfig, Start};
use motorium_physics::{Engine, ObjectId, Simulation, Simulator as _};
use motorium_robots::FrameId;
use nalgebra::{Point3, Vector3};
use rand::RngExt as _;

use super::EnvironmentError;
use super::eyes::Eyes;
use crate::random::{Counter, Purpose};
use crate::task::{PointMotion, Pushes, Rhythm, RobotState, Task, TaskError, Terms};

/// Data shared by all worlds of a task.
#[derive(Debug)]
pub(super) struct Stage {
    pub(super) terms: Terms,
    /// The wheels that a base twist moves, before an episode.
    pub(super) wheels: Option<RobotWheels>,
    /// The objects whose motion is measured.
    objects: Vec<ObjectId>,
    /// Cameras, before an episode.
    eyes: Option<Eyes>,
    draws: Option<Draws>,
    /// Pushes, and the link of the base.
    pushes: Option<(Pushes, FrameId)>,
    /// Minimum and maximum number of physics steps before an action takes effect.
    delay: [usize; 2],
    /// Range and velocity limit of each joint of the action within which its setpoint moves.
    limits: Option<Vec<SetpointLimits>>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    velocity_spread: f64,
    free_steps: usize,
    /// Physics steps per policy step, and their duration \[s\].
    decimation: usize,
    step: f64,
}

/// Range of a position setpoint \[rad or m\] and its velocity limit \[rad/s or m/s\].
#[derive(Clone, Copy, Debug)]
struct SetpointLimits {
    lower: f64,
    upper: f64,
    velocity: f64,
}

impl SetpointLimits {
    /// Moves a command from the position setpoint `before` towards its target for `dt` s. The drive brakes
    /// beyond the velocity limit.
    fn bound(self, command: JointSetpoint, before: f64, dt: f64) -> JointSetpoint {
        let Self { lower, upper, velocity } = self;
        let position = within_range(command.position, lower, upper).unwrap_or(command.position);
        let position = within_rate(position, before, velocity * dt).unwrap_or(position);
        JointSetpoint { position, min_velocity: -velocity, max_velocity: velocity, ..command }
    }
}

/// The actions of a step of the policy, and what they command.
#[derive(Debug)]
pub(super) struct Motion<'a> {
    /// The action of the step before.
    pub(super) before: &'a [f64],
    pub(super) action: &'a [f64],
    pub(super) rhythm: Option<&'a mut Rhythm>,
    pub(super) wheels: Option<&'a mut RobotWheels>,
}

/// Memory for the measurements of a state around its joints.
#[derive(Clone, Debug)]
pub(super) struct Surroundings {
    /// Force on each link whose contacts are measured.
    forces: Vec<f64>,
    /// Motion of each measured object.
    objects: Vec<PointMotion>,
    eyes: Option<Eyes>,
}

impl Surroundings {
    /// Starts an episode.
    pub(super) fn begin(&mut self, counter: Counter) {
        if let Some(eyes) = &mut self.eyes {
            eyes.begin(counter);
        }
    }
}

impl Stage {
    /// Binds a task to a simulation, which is left at the start of an episode without randomisation.
    pub(super) fn new<E: Engine>(task: &Task, simulation: &mut Simulation<E>) -> Result<Self, TaskError> {
        let terms = Terms::new(task, simulation.model())?;
        let wheels = wheels(task, &terms, simulation)?;
        let objects = terms.objects().iter().map(|name| {
            simulation.object(name).ok_or_else(|| {
                let expected = "a link of the robot, an object of the world, or \"target\"";
                TaskError::value("points", format!("\"{name}\""), expected)
            })
        });
        let objects = objects.collect::<Result<_, _>>()?;
        let eyes = Eyes::new(task, &terms, simulation)?;
        let (nq, nv) = (simulation.configuration().len(), simulation.velocity().len());
        let position = task.start.position.clone();
        let velocity = task.start.velocity.clone().unwrap_or_else(|| vec![0.0; nv]);
        for (key, found, expected) in
            [("start.position", position.len(), nq), ("start.velocity", velocity.len(), nv)]
        {
            if found != expected {
                return Err(TaskError::value(key, format!("{found} numbers"), expected.to_string()));
            }
        }
        simulation
            .reset(&position, &velocity)
            .map_err(|error| TaskError::value("start", error, "a state of the robot"))?;
        if let Some(every) = task.randomise.every {
            let expected = "no value, because properties are sampled only at the start of an episode";
            return Err(TaskError::value("randomise.every", every, expected));
        }
        let draws = (task.randomise != RandomiseConfig::default())
            .then(|| Draws::for_one_robot(&task.randomise, simulation))
            .transpose()
            .map_err(TaskError::Range)?;
        let pushes = match task.pushes {
            None => None,
            Some(_) if !simulation.model().base().floating => {
                let expected = "a robot with a floating base";
                return Err(TaskError::value("pushes", "a robot with a fixed base", expected));
            }
            Some(pushes) => {
                simulation.model().frame(&simulation.model().frames()[0].name).ok().map(|base| (pushes, base))
            }
        };
        let limits = task.within_limits.then(|| {
            let model = simulation.model();
            let (range, velocities) = ((model.lower(), model.upper()), model.velocity_limit());
            let targets = terms.targets().targets().iter();
            targets
                .map(|target| SetpointLimits {
                    lower: range.0[target.joint],
                    upper: range.1[target.joint],
                    velocity: velocities[target.joint],
                })
                .collect()
        });
        Ok(Self {
            terms,
            wheels,
            objects,
            eyes,
            draws,
            pushes,
            delay: task.delay,
            limits,
            position,
            velocity,
            velocity_spread: task.start.velocity_spread,
            free_steps: task.start.free_steps,
            decimation: task.decimation,
            step: task.step,
        })
    }

    /// Returns memory for the measurements of a world.
    pub(super) fn surroundings(&self) -> Surroundings {
        Surroundings {
            forces: vec![0.0; self.terms.links().len()],
            objects: vec![PointMotion::default(); self.terms.objects().len()],
            eyes: self.eyes.clone(),
        }
    }

    /// Returns the number of physics steps before an action takes effect in the episode of the counter.
    pub(super) fn delay(&self, counter: Counter) -> usize {
        let [fewest, most] = self.delay;
        if fewest == most { fewest } else { counter.stream(Purpose::Delay).random_range(fewest..=most) }
    }

    /// Resets a simulation to the start of an episode. Physical properties and the start state are sampled
    /// with `seed`, as in a physics component of a graph. `drives` receives the gain and strength factors of
    /// each drive.
    pub(super) fn begin<E: Engine>(
        &self,
        simulation: &mut Simulation<E>,
        (counter, seed): (Counter, u64),
        drives: &mut [[f64; 2]],
    ) -> Result<(), EnvironmentError> {
        let mut random = counter.stream(Purpose::Start);
        let velocity = self.velocity.iter().map(|v| {
            let share: f64 = random.random();
            v + self.velocity_spread * (2.0 * share - 1.0)
        });
        let velocity: Vec<f64> = velocity.collect();
        let (world, episode) = (counter.world, counter.episode);
        let started = match &self.draws {
            None => simulation.reset(&self.position, &velocity),
            Some(draws) => {
                let Start { properties, q, lifts, drives: factors, .. } = draws.draw(seed, 0);
                for (drive, factors) in drives.iter_mut().zip(&factors[0]) {
                    *drive = *factors;
                }
                let placed = simulation.reset_with(&properties, &q, &velocity);
                if simulation.model().base().floating && lifts[0] != 0.0 {
                    let mut q = simulation.configuration().to_vec();
                    q[2] += lifts[0];
                    placed.and_then(|()| simulation.reset(&q, &velocity))
                } else {
                    placed
                }
            }
        };
        started.map_err(|source| EnvironmentError::Reset { world, episode, source })?;
        for _ in 0..self.free_steps {
            let stepped = simulation.step(self.step);
            stepped.map_err(|source| EnvironmentError::FreeStep { world, episode, source })?;
        }
        Ok(())
    }

    /// Applies an action within its bounds, after the one before, for a step of the policy, by the pattern
    /// generator or the wheels where the task has them; false where physics could not make it. The step of
    /// the counter is its number in the episode. The action takes effect after `delay` physics steps;
    /// `drives` are the factors of the gain and of the strength of each drive.
    pub(super) fn advance<E: Engine>(
        &self,
        simulation: &mut Simulation<E>,
        (counter, motion): (Counter, Motion<'_>),
        (delay, drives): (usize, &[[f64; 2]]),
    ) -> bool {
        let Motion { before, action, mut rhythm, mut wheels } = motion;
        let targets = self.terms.targets();
        (0..self.decimation).all(|physics_step| {
            // setpoints within limits move in every physics step, during the delay to the previous action
            if physics_step == delay || (physics_step > delay && self.limits.is_some()) {
                self.command(simulation, action, drives);
            } else if self.limits.is_some() && counter.step > 0 {
                self.command(simulation, before, drives);
            }
            if physics_step == delay
                && let Some(rhythm) = &mut rhythm
                && !rhythm.command(targets, action)
            {
                return false;
            }
            if let Some(rhythm) = &mut rhythm {
                rhythm.step(self.step);
                let commands = simulation.commands_mut();
                for (index, position) in rhythm.targets() {
                    commands[targets.targets()[index].joint].position = position;
                }
            }
            if let (Some(wheels), Some(ranges)) = (wheels.as_deref_mut(), self.terms.twist()) {
                let twist = match (physics_step >= delay, counter.step) {
                    (true, _) => ranges.twist(action),
                    (false, 0) => [0.0; 3],
                    (false, _) => ranges.twist(before),
                };
                self.roll(simulation, (wheels, twist), drives);
            }
            if let Some((pushes, base)) = self.pushes {
                let time = (counter.step * self.decimation as u64 + physics_step as u64) as f64 * self.step;
                if let Some([x, y]) = pushes.force(counter, time) {
                    let force = Vector3::new(x, y, 0.0);
                    simulation.apply_wrench(base, Point3::origin(), force, Vector3::zeros());
                }
            }
            simulation.step(self.step).is_ok()
        })
    }

    /// Commands the drives of all joints by a velocity of the base, as `control.wheels` does.
    fn roll<E: Engine>(
        &self,
        simulation: &mut Simulation<E>,
        (wheels, [x, y, yaw]): (&mut RobotWheels, [f64; 3]),
        drives: &[[f64; 2]],
    ) {
        let joints = wheels.position().len();
        wheels.follow(&PlanarTwist { x, y, yaw }, &simulation.positions()[..joints], self.step);
        let (positions, velocities, efforts) = (wheels.position(), wheels.velocity(), wheels.effort());
        let commands = simulation.commands_mut()[..joints].iter_mut().zip(drives);
        for (joint, (command, [gain, strength])) in commands.enumerate() {
            *command = JointSetpoint {
                position: positions[joint],
                velocity: velocities[joint],
                effort: efforts[joint] * strength,
                kp: wheels.gains().kp[joint] * gain * strength,
                kd: wheels.gains().kd[joint] * gain * strength,
                ..JointSetpoint::default()
            };
        }
    }

    /// Commands the drives of all joints of the action.
    fn command<E: Engine>(&self, simulation: &mut Simulation<E>, action: &[f64], drives: &[[f64; 2]]) {
        let targets = self.terms.targets();
        let (kind, gains) = self.terms.drives();
        for (index, ((target, action), [kp, kd])) in
            targets.targets().iter().zip(action).zip(gains).enumerate()
        {
            let value = targets.target(index, *action);
            let [gain, strength] = drives[target.joint];
            let (kp, kd) = (kp * gain * strength, kd * gain * strength);
            let command = match kind {
                ActionKind::Effort => JointSetpoint::effort(value * strength),
                ActionKind::Velocity => JointSetpoint { velocity: value, kd, ..JointSetpoint::default() },
                ActionKind::Position => JointSetpoint::hold(value, kp, kd),
                // its wheels have no joint of the action
                ActionKind::BaseTwist => continue,
            };
            let measured = simulation.positions()[target.joint];
            let slot = &mut simulation.commands_mut()[target.joint];
            let before = if slot.kp > 0.0 { slot.position } else { measured };
            *slot = match &self.limits {
                Some(limits) => limits[index].bound(command, before, self.step),
                None => command,
            };
        }
    }

    /// Measures the state of the robot and of objects into the buffers.
    pub(super) fn state<'a, E: Engine>(
        &self,
        simulation: &'a Simulation<E>,
        Surroundings { forces, objects, eyes }: &'a mut Surroundings,
    ) -> RobotState<'a> {
        for (motion, id) in objects.iter_mut().zip(&self.objects) {
            motion.position = simulation.object_pose(*id).translation.vector.into();
            motion.velocity = simulation.object_velocity(*id).0.into();
        }
        let links = self.terms.links();
        if !links.is_empty() {
            forces.fill(0.0);
            simulation.visit_contacts(&mut |contact| {
                let force = (contact.normal * contact.force + contact.friction).norm();
                for (sum, link) in forces.iter_mut().zip(links) {
                    if link == contact.first || link == contact.second {
                        *sum += force;
                    }
                }
            });
        }
        let (mut base, mut height) = (BaseMotion::default(), 0.0);
        if simulation.model().base().floating {
            let (q, v) = (simulation.configuration(), simulation.velocity());
            height = q[2];
            base.linear_velocity.copy_from_slice(&v[..3]);
            base.angular_velocity.copy_from_slice(&v[3..6]);
            base.gravity = projected_gravity([q[3], q[4], q[5], q[6]]).unwrap_or_default();
        }
        RobotState {
            positions: simulation.positions(),
            velocities: simulation.velocities(),
            efforts: simulation.efforts(),
            base,
            height,
            forces,
            objects,
            images: eyes.as_mut().map_or(&[], |eyes| eyes.look(simulation)),
        }
    }
}

/// The wheels of the robot of a task whose action is a base twist.
fn wheels<E: Engine>(
    task: &Task,
    terms: &Terms,
    simulation: &Simulation<E>,
) -> Result<Option<RobotWheels>, TaskError> {
    let Some(ranges) = terms.twist() else { return Ok(None) };
    let settings = task.wheels.clone().unwrap_or_default();
    let config = WheelsConfig { gravity: simulation.gravity().into(), ..settings };
    let longest = config.target_timeout.as_secs_f64();
    let period = task.step * task.decimation as f64;
    if period > longest {
        let expected = format!("at most {longest} s for a base twist, after which `control.wheels` brakes");
        return Err(TaskError::value("decimation", format!("a policy step of {period} s"), expected));
    }
    let profile = simulation.articulations()[0].profile();
    let wheels = RobotWheels::new((&task.robot, simulation.model()), profile, &config)?;
    let kind = wheels.drive().base().kind();
    if ranges.left.is_some() && !matches!(kind, BaseKind::Mecanum | BaseKind::Planar) {
        let expected = "no range, because this base cannot move sideways";
        return Err(TaskError::value("action.twist.left", format!("{:?}", ranges.left), expected));
    }
    Ok(Some(wheels))
}
