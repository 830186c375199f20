//! Rapier's sets of bodies, colliders and joints, including the objects of the world.

use motorium_worlds::{FrictionCombine, ObjectMass};
use nalgebra::{Isometry3, Matrix3, Vector3};
use rapier3d_f64::dynamics::{
    CCDSolver, CoefficientCombineRule, ImpulseJointSet, IntegrationParameters, IslandManager,
    MultibodyJointSet, RigidBodyBuilder, RigidBodyHandle, RigidBodySet, SoftBodySet, SpringCoefficients,
};
use rapier3d_f64::geometry::{
    BroadPhaseBvh, ColliderBuilder, ColliderHandle, ColliderSet, NEW_CONTACT_BIT, NarrowPhase, SharedShape,
};
use rapier3d_f64::math::Vector;
use rapier3d_f64::pipeline::{ActiveHooks, PhysicsPipeline};

use super::convert;
use super::inertia::{MILLIGRAMS, mass_properties};
use super::shapes::PairTable;
use crate::air::Air;
use crate::contact::Collider;
use crate::{Contact, World};

/// A function that executes the call it receives, for example to count its allocations separately.
pub type Enclose = fn(&mut dyn FnMut());

/// Returns rapier's combine rule for the friction of a collider. Rapier orders its rules like
/// [`FrictionCombine`].
fn combine_rule(collider: &Collider) -> CoefficientCombineRule {
    match FrictionCombine::of_surface(collider.friction, collider.friction_combine) {
        FrictionCombine::Mean => CoefficientCombineRule::Average,
        FrictionCombine::Min => CoefficientCombineRule::Min,
        FrictionCombine::Multiply => CoefficientCombineRule::Multiply,
        FrictionCombine::Max => CoefficientCombineRule::Max,
    }
}

/// Rapier's world.
pub(super) struct Scene {
    pub(super) bodies: RigidBodySet,
    pub(super) colliders: ColliderSet,
    pub(super) multibodies: MultibodyJointSet,
    pub(super) objects: Vec<RigidBodyHandle>,
    air: Air,
    /// Drag area \[m2\] and mass \[kg\] of each object; `None` if the air does not move it.
    drags: Vec<Option<(f64, f64)>>,
    enclose: Enclose,
    parameters: IntegrationParameters,
    pipeline: PhysicsPipeline,
    islands: IslandManager,
    broad_phase: BroadPhaseBvh,
    narrow_phase: NarrowPhase,
    joints: ImpulseJointSet,
    soft_bodies: SoftBodySet,
    ccd: CCDSolver,
}

/// All sets of a [`Scene`], including contacts with their warm starts.
pub(super) struct SceneState {
    bodies: RigidBodySet,
    colliders: ColliderSet,
    multibodies: MultibodyJointSet,
    islands: IslandManager,
    broad_phase: BroadPhaseBvh,
    narrow_phase: NarrowPhase,
    joints: ImpulseJointSet,
    soft_bodies: SoftBodySet,
    ccd: CCDSolver,
}

impl Scene {
    pub(super) fn save(&self) -> SceneState {
        SceneState {
            bodies: self.bodies.clone(),
            colliders: self.colliders.clone(),
            multibodies: self.multibodies.clone(),
            islands: self.islands.clone(),
            broad_phase: self.broad_phase.clone(),
            narrow_phase: self.narrow_phase.clone(),
            joints: self.joints.clone(),
            soft_bodies: self.soft_bodies.clone(),
            ccd: self.ccd.clone(),
        }
    }

    /// Returns `true` if the state has the same numbers of bodies and colliders.
    pub(super) fn fits(&self, state: &SceneState) -> bool {
        self.bodies.len() == state.bodies.len() && self.colliders.len() == state.colliders.len()
    }

    /// Restores a saved state. The pipeline itself contains only working memory.
    pub(super) fn restore(&mut self, state: &SceneState) {
        self.bodies.clone_from(&state.bodies);
        self.colliders.clone_from(&state.colliders);
        self.multibodies.clone_from(&state.multibodies);
        self.islands.clone_from(&state.islands);
        self.broad_phase.clone_from(&state.broad_phase);
        self.narrow_phase.clone_from(&state.narrow_phase);
        self.joints.clone_from(&state.joints);
        self.soft_bodies.clone_from(&state.soft_bodies);
        self.ccd.clone_from(&state.ccd);
    }

    /// Creates a scene with the objects of `world`, without their colliders.
    pub(super) fn new(world: &World, contact_iterations: usize, enclose: Enclose) -> Self {
        // Rapier's contacts are springs on the effective mass. Its default of 30 Hz lets a gripper's finger
        // of 15 g sink in by a centimetre under 20 N; 500 Hz reduces this to a tenth of a millimetre.
        // Penetration decays in 3 ms, without bouncing.
        let softness = SpringCoefficients::new(500.0, 5.0);
        let parameters = IntegrationParameters {
            num_solver_iterations: contact_iterations,
            // Contacts are predicted 5 mm ahead; nothing here is fast and thin enough to need continuous
            // detection.
            normalized_prediction_distance: 0.005,
            max_ccd_substeps: 0,
            contact_softness: softness,
            static_contact_softness: softness,
            // Both trade accuracy of the contact points for speed in scenes with thousands of bodies.
            contact_clustering: false,
            contact_recycling: false,
            ..IntegrationParameters::default()
        };
        let mut bodies = RigidBodySet::new();
        let objects: Vec<_> = world
            .objects
            .iter()
            .map(|object| {
                let builder = match object.mass_properties() {
                    Some(ObjectMass { mass, frame, moments }) => {
                        let frame = frame.unwrap_or_else(Isometry3::identity);
                        let turn = frame.rotation.to_rotation_matrix().into_inner();
                        let inertia = turn * Matrix3::from_diagonal(&moments) * turn.transpose();
                        let mass = mass_properties(mass, &frame.translation.vector, &inertia);
                        RigidBodyBuilder::dynamic().additional_mass_properties(mass)
                    }
                    None => RigidBodyBuilder::fixed(),
                };
                // A sleeping object would wake a step late, and falling asleep would add one more event to a
                // step.
                bodies.insert(
                    builder
                        .pose(convert::pose(&object.pose()))
                        .can_sleep(false)
                        .gyroscopic_forces_enabled(true),
                )
            })
            .collect();
        let drags = world.objects.iter().map(|object| {
            let mass = object.mass_properties().filter(|_| object.drag > 0.0);
            mass.map(|ObjectMass { mass, .. }| (object.drag, mass))
        });
        let drags = drags.collect();
        Self {
            bodies,
            colliders: ColliderSet::new(),
            multibodies: MultibodyJointSet::new(),
            objects,
            air: Air::new(world),
            drags,
            enclose,
            parameters,
            pipeline: PhysicsPipeline::new(),
            islands: IslandManager::new(),
            broad_phase: BroadPhaseBvh::new(),
            narrow_phase: NarrowPhase::new(),
            joints: ImpulseJointSet::new(),
            soft_bodies: SoftBodySet::new(),
            ccd: CCDSolver::new(),
        }
    }

    /// Fixes collider `index` with its shape and placement to `body`, or to the world.
    pub(super) fn attach(
        &mut self,
        index: usize,
        collider: &Collider,
        (shape, placement): (SharedShape, Isometry3<f64>),
        body: Option<RigidBodyHandle>,
    ) -> ColliderHandle {
        let builder = ColliderBuilder::new(shape)
            .position(convert::pose(&placement))
            .density(0.0)
            .friction(collider.friction)
            .restitution(collider.restitution)
            .friction_combine_rule(combine_rule(collider))
            .restitution_combine_rule(CoefficientCombineRule::Average)
            .active_hooks(ActiveHooks::FILTER_CONTACT_PAIRS)
            .user_data(index as u128);
        match body {
            Some(body) => self.colliders.insert_with_parent(builder, body, &mut self.bodies),
            None => self.colliders.insert(builder),
        }
    }

    /// Advances all enabled bodies by one step of `dt` \[s\].
    pub(super) fn step(&mut self, dt: f64, gravity: &Vector3<f64>, pairs: &PairTable) {
        self.parameters.dt = dt;
        self.set_drag(dt, gravity);
        let gravity = convert::vector(gravity);
        let enclose = self.enclose;
        enclose(&mut || {
            self.pipeline.step(
                gravity,
                &self.parameters,
                &mut self.islands,
                &mut self.broad_phase,
                &mut self.narrow_phase,
                &mut self.bodies,
                &mut self.colliders,
                &mut self.joints,
                &mut self.multibodies,
                &mut self.soft_bodies,
                &mut self.ccd,
                pairs,
                &(),
            );
        });
    }

    /// Sets the drag forces for the next step of `dt` \[s\]; they replace the last step's.
    fn set_drag(&mut self, dt: f64, gravity: &Vector3<f64>) {
        for (handle, drag) in self.objects.iter().zip(&self.drags) {
            let Some(drag) = *drag else { continue };
            let body = &mut self.bodies[*handle];
            let force = self.air.force(drag, convert::vector_back(body.linvel()), gravity, dt);
            body.reset_forces(true);
            body.add_force(convert::vector(&(force * MILLIGRAMS)), true);
        }
    }

    pub(super) fn enclosure(&self) -> Enclose {
        self.enclose
    }

    pub(super) fn set_enclosure(&mut self, enclose: Enclose) {
        self.enclose = enclose;
    }

    /// Returns the integration step inside a step of `dt` \[s\].
    pub(super) fn substep(&self, dt: f64) -> f64 {
        dt / self.parameters.num_solver_iterations as f64
    }

    pub(super) fn object_pose(&self, index: usize) -> Isometry3<f64> {
        convert::pose_back(self.bodies[self.objects[index]].position())
    }

    pub(super) fn object_velocity(&self, index: usize) -> (Vector3<f64>, Vector3<f64>) {
        let body = &self.bodies[self.objects[index]];
        (convert::vector_back(body.linvel()), convert::vector_back(body.angvel()))
    }

    /// Sets the velocity of an object if it is movable.
    pub(super) fn set_object_velocity(
        &mut self,
        index: usize,
        linear: &Vector3<f64>,
        angular: &Vector3<f64>,
    ) {
        let body = &mut self.bodies[self.objects[index]];
        if body.is_dynamic() {
            body.set_linvel(convert::vector(linear), true);
            body.set_angvel(convert::vector(angular), true);
        }
    }

    /// Moves an object to a pose, at rest.
    pub(super) fn set_object_pose(&mut self, index: usize, pose: &Isometry3<f64>) {
        let body = &mut self.bodies[self.objects[index]];
        // Rapier disables a body whose state is no longer finite.
        body.set_enabled(true);
        body.set_position(convert::pose(pose), true);
        body.set_linvel(Vector::ZERO, true);
        body.set_angvel(Vector::ZERO, true);
    }

    /// Returns the first object whose state is not finite.
    pub(super) fn diverged_object(&self) -> Option<usize> {
        self.objects.iter().position(|handle| {
            let body = &self.bodies[*handle];
            !body.is_enabled()
                || !body.position().is_finite()
                || !body.linvel().is_finite()
                || !body.angvel().is_finite()
        })
    }

    /// Passes the contact points of the last step, of `dt` \[s\], to `visit`.
    pub(super) fn visit_contacts(
        &self,
        colliders: &[Collider],
        dt: f64,
        visit: &mut dyn FnMut(&Contact<'_>),
    ) {
        for pair in self.narrow_phase.contact_pairs() {
            let index = |handle| self.colliders.get(handle).map(|collider| collider.user_data as usize);
            let (Some(first), Some(second)) = (index(pair.collider1), index(pair.collider2)) else {
                continue;
            };
            for manifold in pair.manifolds() {
                // The solver uses four points of a larger manifold; the impulses of the other points date
                // from the last step that used them.
                for solved in &manifold.data.solver_contacts {
                    let index = (solved.contact_id[0] & !NEW_CONTACT_BIT) as usize;
                    let Some(point) = manifold.points.get(index) else { continue };
                    // Rapier also keeps points that may touch soon.
                    if point.dist > 0.0 && point.data.impulse <= 0.0 {
                        continue;
                    }
                    let on_first = self.colliders[pair.collider1].position() * point.local_p1;
                    visit(&Contact {
                        first: &colliders[first].name,
                        second: &colliders[second].name,
                        point: convert::point_back(on_first),
                        normal: convert::vector_back(manifold.data.normal),
                        depth: (-point.dist).max(0.0),
                        force: point.data.impulse / (MILLIGRAMS * dt),
                        friction: nalgebra::Vector3::zeros(),
                    });
                }
            }
        }
    }
}
