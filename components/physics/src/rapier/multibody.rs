//! The robot as rapier's reduced-coordinate multibody.

use motorium_robots::{Body, Coordinate, JointKind, Model};
use nalgebra::{Isometry3, Unit, UnitQuaternion, Vector3};
use rapier3d_f64::dynamics::{
    GenericJoint, JointAxesMask, JointAxis, MultibodyDofCoupling, MultibodyJoint, MultibodyJointHandle,
    RigidBodyBuilder, RigidBodyHandle, SpringCoefficients,
};

use super::convert;
use super::inertia::{MILLIGRAMS, mass_properties};
use super::scene::Scene;
use crate::JointSetpoint;
use crate::joint::JointProperties;

/// The robot as rapier's multibody: handles of its parts.
pub(super) struct Multibody {
    /// One handle per body of the model.
    pub(super) links: Vec<RigidBodyHandle>,
    joints: Vec<MultibodyJointHandle>,
    /// Displacement of every coordinate in rapier's order.
    displacement: Vec<f64>,
}

/// The law of a drive in the next step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum DriveAction {
    /// The impedance law of the command.
    Law(JointSetpoint),
    /// A constant effort \[Nm or N\].
    Constant(f64),
}

/// Stiffness of the spring that emulates a constant effort \[Nm/rad or N/m\]: over a millisecond at 10 rad/s
/// the effort changes by a hundred-millionth.
const CONSTANT: f64 = 1e-6;

/// Share of a limit violation that rapier removes per second \[1/s\], as in the joint-space integrator.
const RECOVERY_RATE: f64 = 20.0;

impl Multibody {
    /// Builds the multibody at zero joint positions. The caller attaches the colliders.
    pub(super) fn new(model: &Model, joints: &[JointProperties], scene: &mut Scene) -> Self {
        let base = scene.bodies.insert(RigidBodyBuilder::fixed());
        let mut links = Vec::with_capacity(model.bodies().len());
        let mut handles = Vec::with_capacity(model.bodies().len());
        for body in model.bodies() {
            let inertia = &body.inertia;
            let mass = mass_properties(inertia.mass, &inertia.com, &inertia.rotational);
            let builder = RigidBodyBuilder::dynamic().additional_mass_properties(mass).can_sleep(false);
            let link = scene.bodies.insert(builder);
            let parent = body.parent.map_or(base, |parent| links[parent]);
            let handle = scene
                .multibodies
                .insert(parent, link, joint(body), true)
                .expect("every body has one parent, which comes before it, so no loop can arise");
            links.push(link);
            handles.push(handle);
        }
        let mut multibody = Self { links, joints: handles, displacement: Vec::new() };
        multibody.couple(model, scene);
        multibody.set_passive(model, joints, scene);
        multibody
    }

    /// Adds mimic joints: rapier enforces `q2 = multiplier q1 + offset` by a constraint.
    fn couple(&mut self, model: &Model, scene: &mut Scene) {
        for (index, body) in model.bodies().iter().enumerate() {
            let Coordinate::Mimic { of, multiplier, offset } = body.joint.coordinate else { continue };
            let master = model.joint_body(of);
            let (_, link1) = self.link(scene, master);
            let (multibody, link2) = self.link_mut(scene, index);
            multibody.add_dof_coupling(MultibodyDofCoupling {
                link1,
                dof1: 0,
                axis1: axis(model.bodies()[master].joint.kind) as usize,
                link2,
                dof2: 0,
                axis2: axis(body.joint.kind) as usize,
                coeff: multiplier,
                offset,
            });
        }
    }

    /// Sets friction and armature. Damping is part of the drives' damping.
    fn set_passive(&mut self, model: &Model, joints: &[JointProperties], scene: &mut Scene) {
        for (index, body) in model.bodies().iter().enumerate() {
            let (multibody, link) = self.link_mut(scene, index);
            let dof = dof(multibody, link);
            multibody.frictions_mut()[dof] = MILLIGRAMS * body.joint.dynamics.friction;
            multibody.damping_mut()[dof] = MILLIGRAMS * body.joint.dynamics.damping;
        }
        self.set_inertia(model, joints, scene, None);
        if let Some(handle) = self.joints.first() {
            let (multibody, _) =
                scene.multibodies.get_mut(*handle).expect("the multibody stays for the scene's lifetime");
            // The joint set keeps the six degrees of freedom of a free root until it has seen that the base
            // is fixed.
            multibody.forward_kinematics(&scene.bodies, true);
            self.displacement = vec![0.0; multibody.ndofs()];
        }
    }

    /// Sets the inertia of every joint in addition to its links' inertia \[kg m2 or kg\]; `None` sets the
    /// joint's armature.
    pub(super) fn set_inertia(
        &self,
        model: &Model,
        joints: &[JointProperties],
        scene: &mut Scene,
        inertia: Option<f64>,
    ) {
        for (index, body) in model.bodies().iter().enumerate() {
            let armature = match body.joint.coordinate {
                Coordinate::Independent(column) => joints[column].armature,
                Coordinate::Mimic { .. } => 0.0,
            };
            let (multibody, link) = self.link_mut(scene, index);
            let dof = dof(multibody, link);
            multibody.armature_mut()[dof] = MILLIGRAMS * inertia.unwrap_or(armature);
        }
    }

    /// Sets the links to the positions `q`.
    pub(super) fn set_positions(&mut self, model: &Model, scene: &mut Scene, q: &[f64]) {
        let Some(first) = self.joints.first().copied() else { return };
        for (index, body) in model.bodies().iter().enumerate() {
            let (multibody, id) = self.link_mut(scene, index);
            let dof = dof(multibody, id);
            let link = multibody.link_mut(id).expect("the id is the joint's own link");
            link.joint = MultibodyJoint::new(link.joint.data, false);
            self.displacement[dof] = body.joint.coordinate.position(q);
        }
        let (multibody, _) = scene.multibodies.get_mut(first).expect("the multibody stays");
        multibody.apply_displacements(&self.displacement);
        multibody.forward_kinematics(&scene.bodies, true);
        multibody.update_rigid_bodies(&mut scene.bodies, true);
    }

    /// Sets the joint velocities to `v`.
    pub(super) fn set_velocity(&mut self, model: &Model, scene: &mut Scene, v: &[f64]) {
        for (index, body) in model.bodies().iter().enumerate() {
            let coordinate = &body.joint.coordinate;
            let (multibody, id) = self.link_mut(scene, index);
            let dof = dof(multibody, id);
            multibody.generalized_velocity_mut()[dof] = coordinate.multiplier() * v[coordinate.index()];
        }
    }

    /// Sets the drive of independent joint `column` at position `q`.
    ///
    /// The law becomes an implicit spring and damper in the mass matrix, which is exact and stable for any
    /// gains. Rapier's motors would instead be rows of an unconverged iteration. Velocity setpoint and
    /// feed-forward shift the spring's rest position.
    pub(super) fn drive(
        &mut self,
        model: &Model,
        scene: &mut Scene,
        (column, q): (usize, f64),
        action: DriveAction,
        JointProperties { stiffness: spring, rest: relaxed, .. }: &JointProperties,
    ) {
        let index = model.joint_body(column);
        let joint = &model.bodies()[index].joint;
        let (stiffness, push, damping) = match action {
            DriveAction::Law(c) => (c.kp, c.kp * (c.position - q) + c.kd * c.velocity + c.effort, c.kd),
            DriveAction::Constant(effort) => (0.0, effort, 0.0),
        };
        let (stiffness, push) = ((stiffness + spring).max(CONSTANT), push + spring * (relaxed - q));
        let (multibody, id) = self.link_mut(scene, index);
        let dof = dof(multibody, id);
        multibody.damping_mut()[dof] = MILLIGRAMS * (joint.dynamics.damping + damping);
        let link = multibody.link_mut(id).expect("the id is the joint's own link");
        link.joint.set_spring(axis(joint.kind) as usize, MILLIGRAMS * stiffness, q + push / stiffness);
    }

    /// Applies a force and a torque \[N, Nm, world axes\] at the centre of mass of a body until
    /// [`let_go`](Self::let_go).
    pub(super) fn push(&self, scene: &mut Scene, body: usize, [force, torque]: [Vector3<f64>; 2]) {
        let link = &mut scene.bodies[self.links[body]];
        link.add_force(convert::vector(&(force * MILLIGRAMS)), true);
        link.add_torque(convert::vector(&(torque * MILLIGRAMS)), true);
    }

    /// Removes all forces applied by [`push`](Self::push).
    pub(super) fn let_go(&self, scene: &mut Scene) {
        for link in &self.links {
            scene.bodies[*link].reset_forces(false);
            scene.bodies[*link].reset_torques(false);
        }
    }

    /// Reads positions and velocities of the independent joints.
    pub(super) fn read(&self, model: &Model, scene: &Scene, q: &mut [f64], v: &mut [f64]) {
        for (column, (q, v)) in q.iter_mut().zip(v).enumerate() {
            let index = model.joint_body(column);
            let (multibody, id) = self.link(scene, index);
            let link = multibody.link(id).expect("the id is the joint's own link");
            *q = link.joint().coords()[axis(model.bodies()[index].joint.kind) as usize];
            *v = multibody.generalized_velocity()[link.assembly_id()];
        }
    }

    fn link<'a>(&self, scene: &'a Scene, index: usize) -> (&'a rapier3d_f64::dynamics::Multibody, usize) {
        scene.multibodies.get(self.joints[index]).expect("joints stay for the scene's lifetime")
    }

    fn link_mut<'a>(
        &self,
        scene: &'a mut Scene,
        index: usize,
    ) -> (&'a mut rapier3d_f64::dynamics::Multibody, usize) {
        scene.multibodies.get_mut(self.joints[index]).expect("joints stay for the scene's lifetime")
    }
}

/// Returns the index of a link's only degree of freedom in rapier's generalized vectors.
fn dof(multibody: &rapier3d_f64::dynamics::Multibody, link: usize) -> usize {
    multibody.link(link).expect("the id is the joint's own link").assembly_id()
}

fn axis(kind: JointKind) -> JointAxis {
    if kind == JointKind::Prismatic { JointAxis::LinX } else { JointAxis::AngX }
}

/// Creates rapier's joint about or along its x axis, rotated onto the joint's axis.
fn joint(body: &Body) -> GenericJoint {
    let joint = &body.joint;
    let turn = Isometry3::from_parts(Default::default(), onto(&joint.axis));
    let axis = axis(joint.kind);
    let mut rapier = GenericJoint::new(JointAxesMask::all() ^ JointAxesMask::from(axis));
    rapier.set_local_frame1(convert::pose(&(joint.placement * turn)));
    rapier.set_local_frame2(convert::pose(&turn));
    if joint.limits.lower.is_finite() || joint.limits.upper.is_finite() {
        rapier.set_limits(axis, [joint.limits.lower, joint.limits.upper]);
    }
    // A stiff limit whose violation decays at RECOVERY_RATE. Rapier's default corrects it within one step,
    // which causes an impact.
    let omega = 1e6 * std::f64::consts::TAU;
    rapier.softness = SpringCoefficients::new(1e6, 0.5 * omega / RECOVERY_RATE);
    rapier
}

/// Returns the shortest rotation from x onto `axis`.
fn onto(axis: &Unit<Vector3<f64>>) -> UnitQuaternion<f64> {
    motorium_robots::lie::so3::least_rotation(&Vector3::x_axis(), axis)
}
