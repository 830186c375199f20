//! The step: implicit drives in the mass matrix, and the contacts found by MuJoCo.

use motorium_robots::{Coordinate, Reference};
use motorium_worlds::ObjectMass;
use nalgebra::{Point3, Vector3};

use super::Mujoco;
use super::contact::{Seen, Touch};
use super::native::{Native, Parts};
use super::placed;
use super::places::{ObjectPlace, pose_at};
use crate::air::Air;
use crate::articulated::Laws;
use crate::joint::JointProperties;
use crate::robot::{Articulation, Robot, State, base_pose};
use crate::simulation::Engine as _;
use crate::{StepError, StepReport};

/// Largest number of solutions of one integration step, in each of which drives may enter or leave
/// saturation.
const ATTEMPTS: usize = 10;

impl Mujoco {
    /// Computes the next state of robot and objects.
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
                self.sums.add_moment([second, first], &(touch.torque * h));
            }
        }
        if self.native.is_full() { Err(StepError::TooManyContacts) } else { Ok(report) }
    }

    /// Runs one integration step of `h` \[s\] on the next state.
    ///
    /// A drive's effort `c - s v+` at the end velocity `v+` equals the effort `c - s v` with an additional
    /// inertia of `h s` on the diagonal of the mass matrix: `(M + h s) (v+ - v) / h = c - s v - ...`.
    /// MuJoCo's solver of contacts, stops and friction therefore accounts for the drive. Damping is handled
    /// in the same way.
    fn integrate(&mut self, robot: &mut Robot, h: f64, report: &mut StepReport) {
        self.write_state(&robot.articulations, &robot.state);
        self.set_external(robot);
        self.add_drag(&robot.gravity, h);
        let Robot { articulations, joints, commands, state, .. } = robot;
        for own in &*articulations {
            let drives = joints[own.joints()].iter().zip(&commands[own.drives()]);
            let positions = own.model.joints_of_q(&state.q_next[own.q()]);
            let laws = self.laws[own.joints()].iter_mut().zip(drives).zip(positions);
            for ((laws, (joint, command)), q) in laws {
                *laws = Laws::new(joint, command, [-joint.effort_limit, joint.effort_limit], (*q, h));
            }
        }
        self.native.get_state(Parts::MOTION, &mut self.motion);
        for attempt in 1..=ATTEMPTS {
            self.native.forces_mut().copy_from_slice(&self.forces);
            for ((own, places), armatures) in
                articulations.iter().zip(&self.places.articulations).zip(&self.armatures)
            {
                placed::set_base_inertia(&mut self.native, places, own.placed);
                if own.placed {
                    placed::hold_joints(&mut self.native, places);
                    continue;
                }
                let v = own.model.joints_of_v(&state.v_next[own.v()]);
                for (index, body) in own.model.bodies().iter().enumerate() {
                    let (_, dof) = places.joints[index];
                    let coordinate = &body.joint.coordinate;
                    let (mut constant, mut slope) = (0.0, body.joint.dynamics.damping);
                    if let Coordinate::Independent(i) = *coordinate {
                        let joint = own.joints().start + i;
                        let (drive, of_drive) = self.laws[joint].drive_force(self.drives[joint]);
                        (constant, slope) = (drive, slope + of_drive);
                        let JointProperties { stiffness, rest, .. } = joints[joint];
                        constant += stiffness * (rest - own.model.joints_of_q(&state.q_next[own.q()])[i]);
                        slope += h * stiffness;
                    }
                    let v = coordinate.multiplier() * v[coordinate.index()];
                    self.native.set_armature(dof, armatures[index] + h * slope);
                    self.native.forces_mut()[dof] += constant - slope * v;
                }
            }
            self.native.step();
            let mut settled = true;
            let dofs = self
                .places
                .articulations
                .iter()
                .flat_map(|part| part.drives.iter().map(|body| part.joints[*body].1));
            for ((laws, drive), dof) in self.laws.iter().zip(&mut self.drives).zip(dofs) {
                let x = self.native.qvel()[dof];
                let found = laws.drive_mode(*drive, x);
                settled &= found == *drive || !x.is_finite();
                *drive = found;
            }
            if settled || attempt == ATTEMPTS {
                break;
            }
            self.native.set_state(Parts::MOTION, &self.motion);
        }
        self.read_state(articulations, state);
        let (mut saturated, mut at_limit) = (0, 0);
        for own in articulations.iter().filter(|own| !own.placed) {
            let State { q_next, v_next, tau_next, .. } = state;
            let (q, v) = (own.model.joints_of_q(&q_next[own.q()]), own.model.joints_of_v(&v_next[own.v()]));
            let (joints, laws) = (&joints[own.joints()], &self.laws[own.joints()]);
            let efforts = &mut tau_next[own.drives()];
            for (i, (joint, laws)) in joints.iter().zip(laws).enumerate() {
                efforts[i] = laws.drive(v[i]);
                saturated += usize::from(laws.is_saturated(v[i]));
                at_limit += usize::from(q[i] <= joint.lower || q[i] >= joint.upper);
            }
        }
        report.saturated = report.saturated.max(saturated);
        report.at_limit = at_limit;
    }

    /// Sets the generalized forces other than the drives', in MuJoCo's order: rotors and external forces.
    fn set_external(&mut self, robot: &mut Robot) {
        let Robot { articulations, commands, state, .. } = robot;
        self.forces.fill(0.0);
        self.generalized.copy_from_slice(&self.external);
        for ((own, places), jacobian) in
            articulations.iter().zip(&self.places.articulations).zip(&mut self.jacobians)
        {
            let (model, joints) = (&own.model, own.model.joint_count());
            let generalized = &mut self.generalized[own.v()];
            let commands = &commands[own.drives()][joints..];
            let thrusts = &mut state.tau_next[own.drives()][joints..];
            for ((rotor, command), thrust) in own.rotors.iter().zip(commands).zip(thrusts) {
                *thrust = rotor.thrust(command);
                own.kinematics.jacobian(model, rotor.frame, Reference::Local, jacobian);
                for (force, column) in generalized.iter_mut().zip(jacobian.column_iter()) {
                    *force += *thrust * (column[2] + rotor.torque_per_thrust * column[5]);
                }
            }
            for (body, force) in places.drives.iter().zip(model.joints_of_v(generalized)) {
                self.forces[places.joints[*body].1] = *force;
            }
            if let Some((_, dof)) = places.base {
                let rotation = base_pose(&state.q_next[own.q()]).rotation;
                let linear = rotation * Vector3::from_column_slice(&generalized[..3]);
                self.forces[dof..dof + 3].copy_from_slice(linear.as_slice());
                self.forces[dof + 3..dof + 6].copy_from_slice(&generalized[3..6]);
            }
        }
    }

    /// Adds the forces of the air on free objects in an integration step of `h` \[s\].
    fn add_drag(&mut self, gravity: &Vector3<f64>, h: f64) {
        let air = Air::new(&self.world);
        for (index, object) in self.world.objects.iter().enumerate() {
            let ObjectPlace::Free(_, dof) = &self.places.objects[index] else { continue };
            let Some(ObjectMass { mass, frame, .. }) = self.places.masses[index] else { continue };
            if object.drag == 0.0 {
                continue;
            }
            let velocity = self.object_velocity(index).0;
            let force = air.force((object.drag, mass), velocity, gravity, h);
            let dof = *dof;
            self.forces[dof..dof + 3].copy_from_slice(force.as_slice());
            if let Some(frame) = frame {
                let force = self.object_pose(index).rotation.inverse_transform_vector(&force);
                let torque = frame.translation.vector.cross(&force);
                self.forces[dof + 3..dof + 6].copy_from_slice(torque.as_slice());
            }
        }
    }

    /// Writes the next state of the robots to MuJoCo. Mimic joints follow exactly.
    fn write_state(&mut self, articulations: &[Articulation], state: &State) {
        for (own, places) in articulations.iter().zip(&self.places.articulations) {
            let (q, v) = (&state.q_next[own.q()], &state.v_next[own.v()]);
            let (joints_q, joints_v) = (own.model.joints_of_q(q), own.model.joints_of_v(v));
            if let Some((place, dof)) = places.base {
                let (qpos, pose) = (&mut self.native.qpos_mut()[place..place + 7], base_pose(q));
                let r = pose.rotation;
                qpos[..3].copy_from_slice(&q[..3]);
                qpos[3..].copy_from_slice(&[r.w, r.i, r.j, r.k]);
                let linear = r * Vector3::from_column_slice(&v[..3]);
                let qvel = &mut self.native.qvel_mut()[dof..dof + 6];
                qvel[..3].copy_from_slice(linear.as_slice());
                qvel[3..].copy_from_slice(&v[3..6]);
            }
            for (coordinate, (place, dof)) in places.coordinates.iter().zip(&places.joints) {
                self.native.qpos_mut()[*place] = coordinate.position(joints_q);
                self.native.qvel_mut()[*dof] = coordinate.multiplier() * joints_v[coordinate.index()];
            }
        }
    }

    /// Reads the next state of the robots from MuJoCo.
    fn read_state(&self, articulations: &[Articulation], state: &mut State) {
        let (qpos, qvel) = (self.native.qpos(), self.native.qvel());
        for (own, places) in articulations.iter().zip(&self.places.articulations) {
            let (q, v) = (&mut state.q_next[own.q()], &mut state.v_next[own.v()]);
            let (mut offset, mut base) = (0, 0);
            if let Some((place, dof)) = places.base {
                (offset, base) = (7, 6);
                let (position, rotation) = pose_at(&qpos[place..]);
                q[..3].copy_from_slice(position.as_slice());
                q[3..7].copy_from_slice(rotation.coords.as_slice());
                let linear =
                    rotation.inverse_transform_vector(&Vector3::from_column_slice(&qvel[dof..dof + 3]));
                v[..3].copy_from_slice(linear.as_slice());
                v[3..6].copy_from_slice(&qvel[dof + 3..dof + 6]);
            }
            for (i, body) in places.drives.iter().enumerate() {
                let (place, dof) = places.joints[*body];
                (q[offset + i], v[base + i]) = (qpos[place], qvel[dof]);
            }
        }
    }

    /// Records the contact points of the last integration step.
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

/// Returns contact point `index` between two colliders if it touches.
fn touch(native: &Native, index: usize, colliders: [usize; 2]) -> Option<Touch> {
    let contact = &native.contacts()[index];
    let force = if contact.row >= 0 { native.contact_force(index) } else { [0.0; 6] };
    let row = |row: usize| Vector3::from_column_slice(&contact.frame[3 * row..3 * row + 3]);
    (contact.distance <= 0.0 || force[0] > 0.0).then(|| Touch {
        colliders,
        point: Point3::from(Vector3::from(contact.position)),
        normal: row(0),
        depth: (-contact.distance).max(0.0),
        force: force[0],
        friction: row(1) * force[1] + row(2) * force[2],
        torque: row(0) * force[3] + row(1) * force[4] + row(2) * force[5],
    })
}
