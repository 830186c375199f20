//! A planner of contact forces, contacts and swings.

use motorium_robots::{Dynamics, FrameId, Kinematics, Model, Twist};
use nalgebra::{Isometry3, Matrix3, Matrix6xX, Quaternion, Rotation3, UnitQuaternion, Vector3};

use super::{
    CentroidalMpc, CentroidalState, FootPlan, MpcSettings, PlanarVelocity, Reference, Stepping, Swing,
    foothold,
};
use crate::inverse_dynamics::MotionState;
use crate::solver::SolveError;

/// A foot of a [`LegPlanner`].
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedFoot {
    /// Its frame.
    pub frame: FrameId,
    /// Points at which the ground pushes, from the ground below the origin of the frame, in its axes \[m\]: the corners of a sole, or zero
    /// alone.
    pub points: Vec<Vector3<f64>>,
    /// Distance of the ground below the origin of the frame: the radius of a ball \[m\].
    pub radius: f64,
    /// Coefficient of friction.
    pub friction: f64,
}

/// Settings of a [`LegPlanner`].
#[derive(Clone, Debug, PartialEq)]
pub struct PlannerSettings {
    /// The horizon; its mass is that of the model.
    pub mpc: MpcSettings,
    /// Time between two solutions \[s\]; 0: each step has one.
    pub solve_every: f64,
    /// Largest acceleration of the reference \[m/s2, rad/s2\].
    pub acceleration: f64,
    /// Height of the centre of mass above the ground \[m\]; none: that of the pose at rest.
    pub height: Option<f64>,
    /// Largest distance of the reference from the measured centre of mass in the plane \[m\].
    pub max_lead: f64,
    /// Largest angle of the reference from the measured heading \[rad\].
    pub max_turn: f64,
    /// Height by which a foot is lifted half-way \[m\].
    pub clearance: f64,
    /// Largest distance by which a step is moved against a velocity error \[m\].
    pub max_capture: f64,
    /// Time within which a foot is loaded and unloaded \[s\].
    pub ramp: f64,
}

/// A foot on its way.
#[derive(Clone, Copy, Debug)]
struct Leg {
    /// Place of the ground below it in the pose at rest, from the centre of mass, axes of the heading \[m\].
    rest: Vector3<f64>,
    /// First of its points among those of all feet.
    first: usize,
    /// Place of the ground below it \[m\], and the orientation of its frame.
    place: Vector3<f64>,
    axes: Rotation3<f64>,
    swing: Option<Swing>,
    /// Time at which it landed \[s\].
    landed: f64,
    load: f64,
    /// Target of the ground below it \[m\], and its velocity \[m/s\].
    target: (Vector3<f64>, Vector3<f64>),
    /// Number of its swings.
    swings: u64,
}

/// A planner of the forces of the feet, by [`CentroidalMpc`], of the contacts, by a gait, and of the swings between them. Nothing
/// allocates after construction.
#[derive(Debug)]
pub struct LegPlanner {
    settings: PlannerSettings,
    feet: Vec<PlannedFoot>,
    legs: Vec<Leg>,
    stepping: Stepping,
    reference: Reference,
    mpc: CentroidalMpc,
    dynamics: Dynamics,
    momentum: Matrix6xX<f64>,
    state: CentroidalState,
    /// Time of the last solution \[s\].
    solved: Option<f64>,
    time: f64,
    /// Time at which the last step began \[s\].
    began: f64,
}

impl LegPlanner {
    /// For these feet of `model`, a robot with a floating base, which stands on them at the configuration `rest` (nq).
    pub fn new(
        model: &Model,
        feet: Vec<PlannedFoot>,
        stepping: Stepping,
        settings: PlannerSettings,
        rest: &[f64],
    ) -> Self {
        let mut kinematics = Kinematics::new(model);
        kinematics.update(model, rest);
        let centre = kinematics.centre_of_mass(model).position;
        let ahead = Rotation3::from_axis_angle(&Vector3::z_axis(), -heading(&base_rotation(rest)));
        let (mut legs, mut friction) = (Vec::new(), Vec::new());
        for foot in &feet {
            let place = kinematics.pose(model, foot.frame).translation.vector - Vector3::z() * foot.radius;
            let (first, zero) = (friction.len(), Vector3::zeros());
            friction.extend(foot.points.iter().map(|_| foot.friction));
            legs.push(Leg {
                rest: ahead * (place - centre),
                first,
                place,
                axes: Rotation3::identity(),
                swing: None,
                landed: f64::NEG_INFINITY,
                load: 1.0,
                target: (place, zero),
                swings: 0,
            });
        }
        let below: f64 = legs.iter().map(|leg| -leg.rest.z).sum::<f64>() / legs.len().max(1) as f64;
        let mpc = MpcSettings { mass: model.mass(), ..settings.mpc };
        Self {
            mpc: CentroidalMpc::new(mpc, &friction),
            reference: Reference::new(settings.height.unwrap_or(below)),
            dynamics: Dynamics::new(model),
            momentum: Matrix6xX::zeros(model.nv()),
            state: CentroidalState::default(),
            solved: None,
            time: 0.0,
            began: 0.0,
            feet,
            legs,
            stepping,
            settings,
        }
    }

    /// Begins at a state, on all feet.
    pub fn begin(&mut self, state: &MotionState<'_>) {
        let MotionState { model, kinematics, .. } = *state;
        let centre = kinematics.centre_of_mass(model).position;
        self.reference.begin(&centre, heading(&base_rotation(state.q)));
        self.stepping.reset();
        self.mpc.reset();
        (self.solved, self.time) = (None, 0.0);
        for leg in &mut self.legs {
            (leg.swing, leg.landed, leg.swings) = (None, f64::NEG_INFINITY, 0);
        }
    }

    /// Plans a step of `dt` seconds from the measured state: in strides at a wanted velocity, or at rest on all feet.
    ///
    /// # Errors
    /// [`SolveError`]: the forces before still hold.
    pub fn step(
        &mut self,
        state: &MotionState<'_>,
        wanted: &PlanarVelocity,
        strides: bool,
        dt: f64,
    ) -> Result<(), SolveError> {
        let MotionState { model, kinematics, q, v } = *state;
        let centre = kinematics.centre_of_mass(model);
        self.stepping.set(strides, self.time);
        // on all feet the body does not leave them
        let wanted = if strides { *wanted } else { PlanarVelocity::default() };
        self.reference.follow(&wanted, self.settings.acceleration, dt);
        self.place_feet(state, (&centre.position, &centre.velocity));
        let base = base_rotation(q);
        let turned = base * Rotation3::from_axis_angle(&Vector3::z_axis(), -self.reference.heading());
        self.state = CentroidalState {
            turn: turned.scaled_axis(),
            position: centre.position,
            angular_momentum: self.dynamics.momentum(model, q, v).angular,
            velocity: centre.velocity,
        };
        let elapsed = self.solved.map(|solved| self.time - solved);
        let due = elapsed.is_none_or(|elapsed| elapsed + 0.5 * dt >= self.settings.solve_every);
        let solved = if due {
            self.fill_horizon();
            self.dynamics.centroidal_map(model, q, &mut self.momentum);
            let inertia: Matrix3<f64> = self.momentum.fixed_view::<3, 3>(3, 3) * base.matrix().transpose();
            let about = (&inertia, self.reference.heading());
            let solved = self.mpc.solve(&self.state, about, elapsed.unwrap_or(0.0));
            if solved.is_ok() {
                self.solved = Some(self.time);
            }
            solved
        } else {
            Ok(())
        };
        let most = (self.settings.max_lead, self.settings.max_turn);
        self.reference.advance(dt, (&centre.position, heading(&base)), most);
        self.began = self.time;
        self.time += dt;
        solved
    }

    /// Share of its load that a foot may carry: 0 while it swings.
    pub fn load(&self, foot: usize) -> f64 {
        self.legs[foot].load
    }

    /// Force of the ground on a foot, and its torque about the origin of the foot's frame, axes of the world \[N, Nm\].
    pub fn wrench(&self, foot: usize) -> Twist {
        let (mut wrench, leg) = (Twist::zero(), &self.legs[foot]);
        let (Some(solved), true) = (self.solved, leg.load > 0.0) else { return wrench };
        let settings = self.mpc.settings();
        let step = ((self.began - solved + 1e-9) / settings.step) as usize;
        let down = Vector3::z() * -self.feet[foot].radius;
        for (point, arm) in self.feet[foot].points.iter().enumerate() {
            let force = self.mpc.force(step.min(settings.steps - 1), leg.first + point);
            wrench.linear += force;
            wrench.angular += (leg.axes * arm + down).cross(&force);
        }
        wrench
    }

    /// Target of the frame of a foot in the world, and the velocity of its origin \[m/s\].
    pub fn target(&self, foot: usize) -> (Isometry3<f64>, Vector3<f64>) {
        let (place, velocity) = self.legs[foot].target;
        let translation = place + Vector3::z() * self.feet[foot].radius;
        (Isometry3::from_parts(translation.into(), level(&self.reference, 0.0).into()), velocity)
    }

    /// Number of swings of a foot.
    pub fn swings(&self, foot: usize) -> u64 {
        self.legs[foot].swings
    }

    /// The motion that is wanted.
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// The state at the last step.
    pub fn state(&self) -> &CentroidalState {
        &self.state
    }

    /// The horizon.
    pub fn mpc(&self) -> &CentroidalMpc {
        &self.mpc
    }

    /// Loads, places and swings of the feet.
    fn place_feet(&mut self, state: &MotionState<'_>, (centre, velocity): (&Vector3<f64>, &Vector3<f64>)) {
        let MotionState { model, kinematics, .. } = *state;
        let (now, ramp) = (self.time, self.settings.ramp.max(1e-6));
        let (mut ground, mut standing) = (0.0, 0.0);
        for (index, (foot, leg)) in self.feet.iter().zip(&mut self.legs).enumerate() {
            let pose = kinematics.pose(model, foot.frame);
            leg.axes = pose.rotation.to_rotation_matrix();
            leg.place = pose.translation.vector - Vector3::z() * foot.radius;
            if self.stepping.swing(index, now).is_none() {
                (ground, standing) = (ground + leg.place.z, standing + 1.0);
            }
        }
        if standing > 0.0 {
            self.reference.set_ground(ground / standing);
        }
        let (height, ground) = self.reference.heights();
        let (_, wanted, _) = self.reference.after(0.0);
        let stance = self.stepping.gait().stance_time();
        for (index, leg) in self.legs.iter_mut().enumerate() {
            let Some((began, lands)) = self.stepping.swing(index, now) else {
                if let Some(swing) = leg.swing.take() {
                    leg.landed = now;
                    leg.target = (swing.to, Vector3::zeros());
                } else if leg.swings == 0 {
                    leg.target = (leg.place, Vector3::zeros());
                }
                let left = self.stepping.lifts(index, now) - now;
                leg.load = ((now - leg.landed) / ramp).min(left / ramp).clamp(1e-2, 1.0);
                continue;
            };
            let plan = FootPlan {
                position: centre + velocity * (lands - now),
                velocity: *velocity,
                wanted,
                heading: self.reference.after(lands - now + 0.5 * stance).2,
                stance,
                height,
                gravity: self.settings.mpc.gravity.norm(),
                ground,
            };
            let to = foothold(&plan, &leg.rest, self.settings.max_capture);
            let swing = leg.swing.get_or_insert_with(|| {
                leg.swings += 1;
                Swing { from: leg.place, to, clearance: self.settings.clearance, time: lands - began }
            });
            swing.to = to;
            leg.load = 0.0;
            leg.target = swing.at(now - began);
        }
    }

    /// Writes the reference and the points that touch into the horizon.
    fn fill_horizon(&mut self) {
        let (now, h) = (self.time, self.settings.mpc.step);
        let gravity = self.settings.mpc.gravity.norm();
        let (height, ground) = self.reference.heights();
        let (stance, swing_time) = (self.stepping.gait().stance_time(), self.stepping.gait().swing_time());
        for (step, horizon) in self.mpc.horizon_mut().iter_mut().enumerate() {
            let begins = step as f64 * h;
            (horizon.position, horizon.velocity, horizon.heading) = self.reference.after(begins + h);
            horizon.angular_velocity = Vector3::z() * self.reference.velocity().yaw_rate;
            // in the first step the contacts are those of now
            let time = now + if step == 0 { 0.0 } else { begins + 0.5 * h };
            for (index, (foot, leg)) in self.feet.iter().zip(&self.legs).enumerate() {
                let points = &mut horizon.points[leg.first..][..foot.points.len()];
                if self.stepping.swing(index, time).is_some() {
                    points.fill(None);
                    continue;
                }
                let swing = leg.swing.zip(self.stepping.swing(index, now));
                // it stands from then on, until it lifts
                let since = swing.map_or(now, |(_, (_, lands))| lands);
                let lifts = self.stepping.lifts(index, since);
                let (place, axes) = match swing {
                    _ if lifts < time => {
                        let lands = self.stepping.lifts(index, time) - stance;
                        let lands = if lands.is_finite() { lands } else { lifts + swing_time } - now;
                        let (position, wanted, _) = self.reference.after(lands);
                        let heading = self.reference.after(lands + 0.5 * stance).2;
                        let velocity = wanted;
                        let plan =
                            FootPlan { position, velocity, wanted, heading, stance, height, gravity, ground };
                        (foothold(&plan, &leg.rest, 0.0), level(&self.reference, lands))
                    }
                    Some((swing, (_, lands))) => (swing.to, level(&self.reference, lands - now)),
                    None => (leg.place, leg.axes),
                };
                for (point, arm) in points.iter_mut().zip(&foot.points) {
                    *point = Some(place + axes * arm);
                }
            }
        }
    }
}

/// The orientation of a floating base.
fn base_rotation(q: &[f64]) -> Rotation3<f64> {
    let quaternion = Quaternion::new(q[6], q[3], q[4], q[5]);
    UnitQuaternion::from_quaternion(quaternion).to_rotation_matrix()
}

/// The heading of a base: where its x points, from above.
fn heading(base: &Rotation3<f64>) -> f64 {
    let ahead = base * Vector3::x();
    ahead.y.atan2(ahead.x)
}

/// The axes of the heading of the reference after `time` seconds.
fn level(reference: &Reference, time: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), reference.after(time).2)
}
