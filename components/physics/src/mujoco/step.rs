//! The step: drives that are implicit in the mass matrix, and the contacts that MuJoCo found.

use motorium_robots::{Coordinate, Reference};
use nalgebra::{Point3, Quaternion, UnitQuaternion, Vector3};

use super::Mujoco;
use super::contact::{Seen, Touch};
use super::native::{Native, Parts};
use crate::articulated::Laws;
use crate::robot::{Robot, State, base_pose};
use crate::{StepError, StepReport};

/// Solutions of one integration step in which drives may turn out to be saturated, or not to be any more.
const ATTEMPTS: usize = 10;

impl Mujoco {
    /// The next state of robot and objects.
    pub(super) fn advance_by(&mut self, robot: &mut Robot, dt: f64) -> Result<StepReport, StepError> {
        self.native.get_state(Parts::INTEGRATION, &mut self.before);
        let steps = if self.seen.near { self.options.contact_iterations } else { self.options.substeps };
        let h = dt / steps as f64;
        self.native.set_options(h, robot.gravity.into());
        let mut report = StepReport::default();
        self.sums.clear();
        for _ in 0..steps {
            self.integrate(robot, h, &mut report);
            self.look_at_contacts(&mut report);
            for touch in &self.seen_next.touches {
                let ([first, second], force) = (touch.colliders, touch.normal * touch.force + touch.friction);
                self.sums.add([second, first], &touch.point, &(force * h));
            }
        }
        if self.native.is_full() { Err(StepError::TooManyContacts) } else { Ok(report) }
    }

    /// One integration step of `h` \[s\] of the next state.
    ///
    /// A drive's effort `c - s v+` at the end velocity `v+` is the effort `c - s v` with an inertia of `h s` more on the diagonal of the
    /// mass matrix: `(M + h s) (v+ - v) / h = c - s v - ...`. So MuJoCo's solver of contacts, stops and friction sees the
    /// drive as it acts. Damping is treated in the same way.
    fn integrate(&mut self, robot: &mut Robot, h: f64, report: &mut StepReport) {
        self.write_state(&robot.state);
        self.set_external(robot);
        let Robot { model, joints, commands, state, .. } = robot;
        let base = model.nv() - model.joint_count();
        for (i, (joint, command)) in joints.iter().zip(commands.iter()).enumerate() {
            let q = state.q_next[model.nq() - model.joint_count() + i];
            self.laws[i] = Laws::new(joint, command, [-joint.effort_limit, joint.effort_limit], (q, h));
        }
        self.native.get_state(Parts::MOTION, &mut self.motion);
        for attempt in 1..=ATTEMPTS {
            self.native.forces_mut().copy_from_slice(&self.forces);
            for (index, body) in model.bodies().iter().enumerate() {
                let (_, dof) = self.places.joints[index];
                let coordinate = &body.joint.coordinate;
                let (mut constant, mut slope) = (0.0, body.joint.dynamics.damping);
                if let Coordinate::Independent(i) = *coordinate {
                    let (drive, of_drive) = self.laws[i].drive_force(self.drives[i]);
                    (constant, slope) = (drive, slope + of_drive);
                }
                let v = coordinate.multiplier() * state.v_next[base + coordinate.index()];
                self.native.set_armature(dof, self.armatures[index] + h * slope);
                self.native.forces_mut()[dof] += constant - slope * v;
            }
            self.native.step();
            let mut settled = true;
            for (i, (laws, drive)) in self.laws.iter().zip(&mut self.drives).enumerate() {
                let x = self.native.qvel()[self.places.joints[model.joint_body(i)].1];
                let found = laws.drive_mode(*drive, x);
                settled &= found == *drive || !x.is_finite();
                *drive = found;
            }
            if settled || attempt == ATTEMPTS {
                break;
            }
            self.native.set_state(Parts::MOTION, &self.motion);
        }
        self.read_state(state);
        let (mut saturated, mut at_limit) = (0, 0);
        for (i, (joint, laws)) in joints.iter().zip(&self.laws).enumerate() {
            let (q, v) = (model.joints_of_q(&state.q_next)[i], model.joints_of_v(&state.v_next)[i]);
            state.tau_next[i] = laws.drive(v);
            saturated += usize::from(laws.is_saturated(v));
            at_limit += usize::from(q <= joint.lower || q >= joint.upper);
        }
        report.saturated = report.saturated.max(saturated);
        report.at_limit = at_limit;
    }

    /// Generalized forces besides those of the drives, in MuJoCo's order: rotors, and what acts from outside.
    fn set_external(&mut self, robot: &mut Robot) {
        let Robot { model, rotors, commands, state, kinematics, .. } = robot;
        self.forces.fill(0.0);
        self.generalized.copy_from_slice(&self.external);
        let joints = model.joint_count();
        for (index, rotor) in rotors.iter().enumerate() {
            let thrust = rotor.thrust(&commands[joints + index]);
            state.tau_next[joints + index] = thrust;
            kinematics.jacobian(model, rotor.frame, Reference::Local, &mut self.jacobian);
            for (force, column) in self.generalized.iter_mut().zip(self.jacobian.column_iter()) {
                *force += thrust * (column[2] + rotor.torque_per_thrust * column[5]);
            }
        }
        let base = model.nv() - joints;
        for i in 0..joints {
            self.forces[self.places.joints[model.joint_body(i)].1] = self.generalized[base + i];
        }
        if let Some((_, dof)) = self.places.base {
            let rotation = base_pose(&state.q_next).rotation;
            let linear = rotation * Vector3::from_column_slice(&self.generalized[..3]);
            self.forces[dof..dof + 3].copy_from_slice(linear.as_slice());
            self.forces[dof + 3..dof + 6].copy_from_slice(&self.generalized[3..6]);
        }
    }

    /// Places MuJoCo's robot in the next state of ours. Mimic joints follow exactly.
    fn write_state(&mut self, state: &State) {
        let (q, v) = (&state.q_next, &state.v_next);
        let (mut offset, mut base) = (0, 0);
        if let Some((place, dof)) = self.places.base {
            (offset, base) = (7, 6);
            let (qpos, pose) = (&mut self.native.qpos_mut()[place..place + 7], base_pose(q));
            let r = pose.rotation;
            qpos[..3].copy_from_slice(&q[..3]);
            qpos[3..].copy_from_slice(&[r.w, r.i, r.j, r.k]);
            let linear = r * Vector3::from_column_slice(&v[..3]);
            let qvel = &mut self.native.qvel_mut()[dof..dof + 6];
            qvel[..3].copy_from_slice(linear.as_slice());
            qvel[3..].copy_from_slice(&v[3..6]);
        }
        for (coordinate, (place, dof)) in self.places.coordinates.iter().zip(&self.places.joints) {
            self.native.qpos_mut()[*place] = coordinate.position(&q[offset..]);
            self.native.qvel_mut()[*dof] = coordinate.multiplier() * v[base + coordinate.index()];
        }
    }

    /// Reads the robot's next state.
    fn read_state(&self, state: &mut State) {
        let (qpos, qvel) = (self.native.qpos(), self.native.qvel());
        let (q, v) = (&mut state.q_next, &mut state.v_next);
        let (mut offset, mut base) = (0, 0);
        if let Some((place, dof)) = self.places.base {
            (offset, base) = (7, 6);
            let (position, rotation) = pose_at(&qpos[place..]);
            q[..3].copy_from_slice(position.as_slice());
            q[3..7].copy_from_slice(rotation.coords.as_slice());
            let linear = rotation.inverse_transform_vector(&Vector3::from_column_slice(&qvel[dof..dof + 3]));
            v[..3].copy_from_slice(linear.as_slice());
            v[3..6].copy_from_slice(&qvel[dof + 3..dof + 6]);
        }
        for (i, body) in self.places.drives.iter().enumerate() {
            let (place, dof) = self.places.joints[*body];
            (q[offset + i], v[base + i]) = (qpos[place], qvel[dof]);
        }
    }

    /// Notes the contact points of the integration step that was the last.
    fn look_at_contacts(&mut self, report: &mut StepReport) {
        let Self { native, seen_next: Seen { near, touches }, geometries, colliders, .. } = self;
        touches.clear();
        *near = false;
        for (index, contact) in native.contacts().iter().enumerate() {
            let place = |geometry: i32| geometries[geometry as usize];
            let pair = contact.geometries.map(place);
            *near = true;
            report.near_contact |= pair.iter().any(|index| colliders.colliders[*index].owner.is_robot());
            if let Some(touch) = touch(native, index, pair) {
                touches.push(touch);
            }
        }
    }
}

/// The contact point `index` between two colliders, if it touches.
fn touch(native: &Native, index: usize, colliders: [usize; 2]) -> Option<Touch> {
    let contact = &native.contacts()[index];
    let force = if contact.row >= 0 { native.contact_force(index) } else { [0.0; 3] };
    let row = |row: usize| Vector3::from_column_slice(&contact.frame[3 * row..3 * row + 3]);
    (contact.distance <= 0.0 || force[0] > 0.0).then(|| Touch {
        colliders,
        point: Point3::from(Vector3::from(contact.position)),
        normal: row(0),
        depth: (-contact.distance).max(0.0),
        force: force[0],
        friction: row(1) * force[1] + row(2) * force[2],
    })
}

/// Position and rotation at the beginning of a part of MuJoCo's positions.
pub(super) fn pose_at(qpos: &[f64]) -> (Vector3<f64>, UnitQuaternion<f64>) {
    let rotation = Quaternion::new(qpos[3], qpos[4], qpos[5], qpos[6]);
    (Vector3::from_column_slice(&qpos[..3]), UnitQuaternion::new_normalize(rotation))
}
