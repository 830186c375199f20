//! A planner of contact forces, contacts and swings.

use motorium_control::inverse_dynamics::MotionState;
use motorium_qp::SolveError;
use motorium_robots::{Dynamics, Kinematics, Model, Twist};
use nalgebra::{Isometry3, Matrix3, Matrix6xX, Quaternion, Rotation3, UnitQuaternion, Vector3};

use super::leg::Leg;
use super::{
    CentroidalMpc, CentroidalState, FootPlan, GroundModel, GroundPlane, Landing, MpcSettings, PlanarVelocity,
    PlannedFoot, Reference, Stepping, Swing, foothold,
};

/// Settings of a [`LegPlanner`].
#[derive(Clone, Debug, PartialEq)]
pub struct PlannerSettings {
    /// Settings of the centroidal controller. The mass in these settings is replaced by the mass of the
    /// model.
    pub mpc: MpcSettings,
    /// Interval between two solutions \[s\]; 0 solves in each step.
    pub solve_every: f64,
    /// Maximum acceleration of the reference \[m/s2, rad/s2\].
    pub acceleration: f64,
    /// Height of the centre of mass above the ground \[m\]; `None` uses the height of the rest pose.
    pub height: Option<f64>,
    /// Maximum horizontal distance between the reference and the measured centre of mass \[m\].
    pub max_lead: f64,
    /// Maximum angle between the reference and the measured heading \[rad\].
    pub max_turn: f64,
    /// Height of a foot at mid-swing \[m\].
    pub clearance: f64,
    /// Maximum correction of a foothold against a velocity error \[m\].
    pub max_capture: f64,
    /// Duration over which a foot is loaded after touchdown and unloaded before lift-off \[s\].
    pub ramp: f64,
    /// Ground model used by the planner.
    pub ground: GroundModel,
    /// Reaction to early and late touchdown.
    pub landing: Landing,
}

/// A planner for a legged robot. It computes foot forces (by [`CentroidalMpc`]), contacts (by a gait) and the
/// swings between contacts. Only construction allocates.
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
    /// Start time of the last step \[s\].
    began: f64,
}

impl LegPlanner {
    /// Creates a planner for these feet of `model`, a floating-base robot that stands on them in the
    /// configuration `rest` (length nq).
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
            let first = friction.len();
            friction.extend(foot.points.iter().map(|_| foot.friction));
            legs.push(Leg::new(ahead * (place - centre), first, place));
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

    /// Starts from a measured state, standing on all feet.
    pub fn begin(&mut self, state: &MotionState<'_>) {
        let MotionState { model, kinematics, .. } = *state;
        let centre = kinematics.centre_of_mass(model).position;
        self.reference.begin(&centre, heading(&base_rotation(state.q)));
        self.stepping.reset();
        self.mpc.reset();
        (self.solved, self.time) = (None, 0.0);
        self.reference.set_ground(GroundPlane::default());
        for (foot, leg) in self.feet.iter().zip(&mut self.legs) {
            let place = kinematics.pose(model, foot.frame).translation.vector - Vector3::z() * foot.radius;
            leg.begin(place);
        }
        self.find_ground(1.0);
    }

    /// Sets the measured contact of a foot from the next step on. `None` means no measurement; the gait alone
    /// then determines the contact.
    pub fn set_touching(&mut self, foot: usize, touches: Option<bool>) {
        self.legs[foot].touches = touches;
    }

    /// Plans a step of `dt` seconds from the measured state. The robot steps at the target velocity `desired`
    /// if `strides` is `true`, and otherwise stands on all feet.
    ///
    /// # Errors
    /// [`SolveError`] from the solver; the previous forces remain valid.
    pub fn step(
        &mut self,
        state: &MotionState<'_>,
        desired: &PlanarVelocity,
        strides: bool,
        dt: f64,
    ) -> Result<(), SolveError> {
        let MotionState { model, kinematics, q, v } = *state;
        let centre = kinematics.centre_of_mass(model);
        self.stepping.set(strides, self.time);
        // while standing, the body stays above the feet
        let desired = if strides { *desired } else { PlanarVelocity::default() };
        self.reference.follow(&desired, self.settings.acceleration, dt);
        self.place_feet(state, (&centre.position, &centre.velocity), dt);
        self.mpc.set_ground_axes(&self.reference.ground().axes());
        let base = base_rotation(q);
        let turned = base * self.reference.orientation(0.0).inverse();
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

    /// Returns the load fraction of a foot, from 0 (during its swing) to 1.
    pub fn load(&self, foot: usize) -> f64 {
        self.legs[foot].load
    }

    /// Returns the ground force on a foot and its torque about the origin of the foot's frame, in world axes
    /// \[N, Nm\].
    pub fn wrench(&self, foot: usize) -> Twist {
        let (mut wrench, leg) = (Twist::zero(), &self.legs[foot]);
        let (Some(solved), true) = (self.solved, leg.load > 0.0) else { return wrench };
        let settings = self.mpc.settings();
        let step = ((self.began - solved + 1e-9) / settings.step) as usize;
        let down = self.reference.ground().normal() * -self.feet[foot].radius;
        for (point, arm) in self.feet[foot].points.iter().enumerate() {
            let force = self.mpc.force(step.min(settings.steps - 1), leg.first + point);
            wrench.linear += force;
            wrench.angular += (leg.axes * arm + down).cross(&force);
        }
        wrench
    }

    /// Returns the target pose of a foot's frame in the world, and the velocity of its origin \[m/s\].
    pub fn target(&self, foot: usize) -> (Isometry3<f64>, Vector3<f64>) {
        let (place, velocity) = self.legs[foot].target;
        let translation = place + self.reference.ground().normal() * self.feet[foot].radius;
        (Isometry3::from_parts(translation.into(), self.reference.orientation(0.0).into()), velocity)
    }

    /// Returns the number of swings performed by a foot.
    pub fn swings(&self, foot: usize) -> u64 {
        self.legs[foot].swings
    }

    /// Returns the number of early and late touchdowns of a foot.
    pub fn early_and_late(&self, foot: usize) -> [u64; 2] {
        self.legs[foot].landings
    }

    /// Returns the reference motion.
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// Returns the centroidal state at the last step.
    pub fn state(&self) -> &CentroidalState {
        &self.state
    }

    /// Returns the centroidal controller.
    pub fn mpc(&self) -> &CentroidalMpc {
        &self.mpc
    }

    /// Computes loads, positions and swings of the feet.
    fn place_feet(
        &mut self,
        state: &MotionState<'_>,
        (centre, velocity): (&Vector3<f64>, &Vector3<f64>),
        dt: f64,
    ) {
        let MotionState { model, kinematics, .. } = *state;
        let (now, ramp) = (self.time, self.settings.ramp.max(1e-6));
        let ground = *self.reference.ground();
        let normal = ground.normal();
        for (index, (foot, leg)) in self.feet.iter().zip(&mut self.legs).enumerate() {
            let pose = kinematics.pose(model, foot.frame);
            leg.axes = pose.rotation.to_rotation_matrix();
            leg.place = pose.translation.vector - normal * foot.radius;
            leg.watch((&self.stepping, index), now, &self.settings.landing, &ground);
        }
        let share = match self.settings.ground {
            GroundModel::Fitted { smoothing } => dt / smoothing.max(dt),
            _ => 1.0,
        };
        self.find_ground(share);
        let (height, ground) = (self.reference.height(), *self.reference.ground());
        let (_, desired, _) = self.reference.after(0.0);
        let stance = self.stepping.gait().stance_time();
        for (index, leg) in self.legs.iter_mut().enumerate() {
            let Some((began, lands)) = leg.swing_at(&self.stepping, index, now) else {
                if leg.is_late() {
                    leg.load = 0.0;
                    continue;
                }
                if leg.swings == 0 {
                    leg.target = (leg.place, Vector3::zeros());
                }
                let left = self.stepping.lifts(index, now) - now;
                leg.load = ((now - leg.landed) / ramp).min(left / ramp).clamp(1e-2, 1.0);
                continue;
            };
            let plan = FootPlan {
                position: centre + velocity * (lands - now),
                velocity: *velocity,
                desired,
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
            leg.target = swing.point_at(now - began);
        }
    }

    /// Estimates the ground under the feet; a fit is updated by the fraction `share`.
    fn find_ground(&mut self, share: f64) {
        let now = self.time;
        let (mut sum, mut standing) = (Vector3::zeros(), 0.0);
        for (index, leg) in self.legs.iter_mut().enumerate() {
            if leg.swing_at(&self.stepping, index, now).is_none() && !leg.is_late() {
                leg.stood = leg.place;
                (sum, standing) = (sum + leg.place, standing + 1.0);
            }
        }
        if standing == 0.0 {
            return;
        }
        let mut ground = *self.reference.ground();
        match self.settings.ground {
            GroundModel::Level => ground = GroundPlane::through(&(sum / standing), &Vector3::z()),
            GroundModel::Normal(normal) => ground = GroundPlane::through(&(sum / standing), &normal),
            GroundModel::Fitted { .. } => ground.fit(self.legs.iter().map(|leg| leg.stood), share),
        }
        self.reference.set_ground(ground);
    }

    /// Writes the reference and the contact points into the horizon.
    fn fill_horizon(&mut self) {
        let (now, h) = (self.time, self.settings.mpc.step);
        let gravity = self.settings.mpc.gravity.norm();
        let (height, ground) = (self.reference.height(), *self.reference.ground());
        let (stance, swing_time) = (self.stepping.gait().stance_time(), self.stepping.gait().swing_time());
        for (step, horizon) in self.mpc.horizon_mut().iter_mut().enumerate() {
            let begins = step as f64 * h;
            (horizon.position, horizon.velocity, horizon.heading) = self.reference.after(begins + h);
            horizon.angular_velocity = self.reference.angular_velocity(begins + h);
            // the first step uses the current contacts
            let time = now + if step == 0 { 0.0 } else { begins + 0.5 * h };
            for (index, (foot, leg)) in self.feet.iter().zip(&self.legs).enumerate() {
                let points = &mut horizon.points[leg.first..][..foot.points.len()];
                // a late foot is expected to touch down at the next step
                let late = step == 0 && leg.is_late();
                if late || leg.swing_at(&self.stepping, index, time).is_some() {
                    points.fill(None);
                    continue;
                }
                let swing = leg.swing.zip(leg.swing_at(&self.stepping, index, now));
                // the foot is in stance from touchdown to its next lift-off
                let since = swing.map_or(now, |(_, (_, lands))| lands);
                let lifts = self.stepping.lifts(index, since);
                let (place, axes) = match swing {
                    _ if lifts < time => {
                        let lands = self.stepping.lifts(index, time) - stance;
                        let lands = if lands.is_finite() { lands } else { lifts + swing_time } - now;
                        let (position, desired, _) = self.reference.after(lands);
                        let heading = self.reference.after(lands + 0.5 * stance).2;
                        let velocity = desired;
                        let plan = FootPlan {
                            position,
                            velocity,
                            desired,
                            heading,
                            stance,
                            height,
                            gravity,
                            ground,
                        };
                        (foothold(&plan, &leg.rest, 0.0), self.reference.orientation(lands))
                    }
                    Some((swing, (_, lands))) => (swing.to, self.reference.orientation(lands - now)),
                    None => (leg.place, leg.axes),
                };
                for (point, arm) in points.iter_mut().zip(&foot.points) {
                    *point = Some(place + axes * arm);
                }
            }
        }
    }
}

/// Returns the orientation of a floating base.
fn base_rotation(q: &[f64]) -> Rotation3<f64> {
    let quaternion = Quaternion::new(q[6], q[3], q[4], q[5]);
    UnitQuaternion::from_quaternion(quaternion).to_rotation_matrix()
}

/// Returns the heading of a base: the direction of its x axis seen from above.
fn heading(base: &Rotation3<f64>) -> f64 {
    let ahead = base * Vector3::x();
    ahead.y.atan2(ahead.x)
}
