//! Robot and world as the shapes that rays hit.

use motorium_robots::{Attachment, CollisionModel, CollisionOptions, FrameId, Kinematics, MeshMode, Model};
use motorium_worlds::{RayScene, World};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

/// The shapes around a ray-casting sensor: a world, and the solids of the robot if the sensor sees them.
///
/// Sensors of a graph and the cameras of a learner's environment share this type, so equal states give equal
/// hits. Only [`new`](Self::new) allocates.
#[derive(Clone, Debug)]
pub struct Scenery {
    scene: RayScene,
    /// Moving links as shapes of the scene.
    links: Vec<Link>,
    root: FrameId,
    /// Number of the first object among the shapes.
    first_object: usize,
    object_count: usize,
}

#[derive(Clone, Debug)]
struct Link {
    target: usize,
    attachment: Attachment,
    placement: Isometry3<f64>,
}

impl Scenery {
    /// Creates the scene of a world whose file paths are [located](World::locate), with the [`solids`] of the
    /// robot if they are visible. Objects have their initial poses; links are placed by
    /// [`place_links`](Self::place_links).
    pub fn new(model: &Model, solids: Option<&CollisionModel>, world: &World) -> Self {
        let mut scene = RayScene::default();
        let mut links = Vec::new();
        if let Some(solids) = solids {
            scene.add_solids(solids);
            links.extend((0..solids.solid_count()).filter_map(|target| {
                let attachment = solids.attachment(target);
                let placement = solids.placement(target);
                (attachment != Attachment::World).then_some(Link { target, attachment, placement })
            }));
        }
        let first_object = scene.add_world(world);
        let root = model.frame(&model.frames()[0].name).expect("a frame of the model itself");
        Self { scene, links, root, first_object, object_count: world.objects.len() }
    }

    /// Returns the scene, to cast rays.
    pub fn scene_mut(&mut self) -> &mut RayScene {
        &mut self.scene
    }

    /// Returns the number of objects of the world.
    pub fn objects(&self) -> usize {
        self.object_count
    }

    /// Moves an object to a position \[m\] and an orientation (x y z w), which is normalised first.
    ///
    /// # Panics
    ///
    /// If the world has no object with this index.
    pub fn set_object(&mut self, object: usize, position: [f64; 3], [x, y, z, w]: [f64; 4]) {
        assert!(object < self.object_count, "object {object} of {}", self.object_count);
        let rotation = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        let pose = Isometry3::from_parts(Translation3::from(position), rotation);
        self.scene.set_pose(self.first_object + object, &pose);
    }

    /// Moves the links of the robot to their poses.
    pub fn place_links(&mut self, model: &Model, kinematics: &Kinematics) {
        let base = kinematics.pose(model, self.root);
        for link in &self.links {
            let carrier = match link.attachment {
                Attachment::Body(body) => kinematics.body_pose(body),
                Attachment::Base => base,
                Attachment::World => continue,
            };
            self.scene.set_pose(link.target, &(carrier * link.placement));
        }
    }
}

/// Returns the solids of a robot for ray casting. Meshes are replaced by their convex hulls.
pub fn solids(model: &Model) -> CollisionModel {
    let options = CollisionOptions {
        meshes: MeshMode::Hull { most_corners: 5000 },
        self_collision: false,
        leave_out_defects: true,
        ..CollisionOptions::default()
    };
    CollisionModel::new(model, &options).expect("invalid shapes are left out, so no error remains")
}
