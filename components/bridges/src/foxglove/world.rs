//! The ground and the objects of a graph's world, as a scene for viewers.

use foxglove::Encode as _;
use foxglove::messages::{
    Color, CubePrimitive, CylinderPrimitive, Point3, Pose, Quaternion, SceneEntity, SceneUpdate,
    SpherePrimitive, TriangleListPrimitive, Vector3,
};
use motorium::plan::Plan;
use motorium::state::{ObjectPoses, StateBuffer as _};
use motorium_pictures::robot::terrain_mesh;
use motorium_robots::{BasePose, Colour};
use motorium_worlds::{HeightField, Object, ObjectShape, World};
use serde::Deserialize;

use super::Schema;
use super::robots::WORLD;

/// Topic of the [scene](world_scene) of the world.
pub const WORLD_SCENE: &str = "/world/scene";

/// Side lengths and thickness of the drawn part of the ground, m.
const PLANE: [f64; 3] = [6.0, 6.0, 0.002];

/// Opacity of the plane, so that objects below it stay visible.
const THROUGH: f64 = 0.6;

/// Returns the world of a plan, with its colours, as a scene for viewers: a schema, and a message of type
/// [`SceneUpdate`]. Returns `None` if the plan has no world.
///
/// If a topic provides the pose of a moving object, the object has its own frame, named after the object.
///
/// ```
/// # fn of(plan: &motorium::plan::Plan) {
/// use motorium_bridges::foxglove::world_scene;
///
/// if let Some((schema, message)) = world_scene(plan) {
///     assert_eq!(schema.name, "foxglove.SceneUpdate");
///     println!("{} bytes", message.len());
/// }
/// # }
/// ```
pub fn world_scene(plan: &Plan) -> Option<(Schema, Vec<u8>)> {
    let world = world_of(plan)?;
    let has_poses = plan.topics.iter().any(|topic| topic.layout.type_name == ObjectPoses::NAME);
    let looks = &world.appearance;
    let mut entities: Vec<SceneEntity> =
        world.objects.iter().map(|object| entity(object, &looks.object(object), has_poses)).collect();
    // The files may have changed since the start of the graph.
    if let Ok(Some(field)) = world.height_field() {
        entities.push(terrain(&field, &looks.ground()));
    }
    if let Some(ground) = world.ground {
        let position = [0.0, 0.0, ground.height - 0.5 * PLANE[2]];
        let color = Some(Color { a: THROUGH, ..opaque(&looks.ground()) });
        let cube = CubePrimitive { pose: pose(position, [0.0; 3]), size: Some(vector(PLANE)), color };
        entities.push(SceneEntity {
            frame_id: WORLD.to_string(),
            id: "ground".to_string(),
            cubes: vec![cube],
            ..SceneEntity::default()
        });
    }
    let update = SceneUpdate { deletions: Vec::new(), entities };
    let mut message = Vec::new();
    update.encode(&mut message).ok()?;
    Some((Schema::of::<SceneUpdate>(), message))
}

/// World of the first component of a plan that simulates one.
pub(crate) fn world_of(plan: &Plan) -> Option<World> {
    let mut simulated = plan.components.iter().filter(|component| component.config["world"].is_object());
    simulated.find_map(|component| {
        let mut world = World::deserialize(&component.config["world"]).ok()?;
        world.locate(&component.folder).ok()?;
        Some(world)
    })
}

/// Terrain with this colour.
fn terrain(field: &HeightField, colour: &Colour) -> SceneEntity {
    let mesh = terrain_mesh(field);
    let point = |point: &nalgebra::Vector3<f64>| Point3 { x: point.x, y: point.y, z: point.z };
    let triangles = TriangleListPrimitive {
        pose: pose([0.0; 3], [0.0; 3]),
        points: mesh.points.iter().map(point).collect(),
        color: Some(opaque(colour)),
        colors: Vec::new(),
        indices: mesh.triangles.into_iter().flatten().collect(),
    };
    SceneEntity {
        frame_id: WORLD.to_string(),
        id: "terrain".to_string(),
        triangles: vec![triangles],
        ..SceneEntity::default()
    }
}

/// Object with this colour.
fn entity(object: &Object, colour: &Colour, has_poses: bool) -> SceneEntity {
    let of_its_own = object.is_dynamic() && has_poses;
    let (position, rpy) = if of_its_own { ([0.0; 3], [0.0; 3]) } else { (object.position, object.rpy) };
    let mut entity = SceneEntity {
        frame_id: if of_its_own { object.name.clone() } else { WORLD.to_string() },
        id: object.name.clone(),
        frame_locked: true,
        ..SceneEntity::default()
    };
    add_shape(&mut entity, &object.shape, (position, rpy), Some(opaque(colour)));
    entity
}

/// Adds the visual of a shape at a pose.
fn add_shape(
    entity: &mut SceneEntity,
    shape: &ObjectShape,
    (position, rpy): ([f64; 3], [f64; 3]),
    color: Option<Color>,
) {
    let pose = pose(position, rpy);
    match *shape {
        ObjectShape::Box { size } => {
            entity.cubes.push(CubePrimitive { pose, size: Some(vector(size)), color });
        }
        ObjectShape::Sphere { radius } => {
            entity.spheres.push(sphere(pose, radius, color));
        }
        ObjectShape::Cylinder { radius, length } | ObjectShape::Capsule { radius, length } => {
            let size = Some(vector([2.0 * radius, 2.0 * radius, length]));
            let (bottom_scale, top_scale) = (1.0, 1.0);
            if matches!(shape, ObjectShape::Capsule { .. }) {
                let ends = [-0.5 * length, 0.5 * length].map(|z| moved(position, rpy, z));
                entity.spheres.extend(ends.map(|end| sphere(end, radius, color)));
            }
            entity.cylinders.push(CylinderPrimitive { pose, size, bottom_scale, top_scale, color });
        }
        // The file may have been deleted since the start of the graph.
        ObjectShape::Mesh(ref mesh) => entity.triangles.extend(mesh.body().ok().map(|body| {
            let corners = body.visual.triangles().iter().flat_map(|triangle| triangle.corners);
            let points: Vec<Point3> = corners.map(|at| Point3 { x: at.x, y: at.y, z: at.z }).collect();
            let indices = (0..points.len() as u32).collect();
            TriangleListPrimitive { pose, points, color, colors: Vec::new(), indices }
        })),
        ObjectShape::Compound(_) => {
            let around = BasePose { position, rpy }.isometry();
            for (frame, part) in shape.shapes() {
                let BasePose { position, rpy } = BasePose::from_isometry(&(around * frame));
                add_shape(entity, part, (position, rpy), color);
            }
        }
    }
}

fn sphere(pose: Option<Pose>, radius: f64, color: Option<Color>) -> SpherePrimitive {
    SpherePrimitive { pose, size: Some(vector([2.0 * radius; 3])), color }
}

/// Pose translated along its own z axis.
fn moved(position: [f64; 3], rpy: [f64; 3], z: f64) -> Option<Pose> {
    let from = BasePose { position, rpy }.isometry();
    let mut shift = from.translation.vector;
    (shift.x, shift.y, shift.z) = (0.0, 0.0, z);
    pose((from.translation.vector + from.rotation * shift).into(), rpy)
}

fn opaque([r, g, b]: &Colour) -> Color {
    Color { r: *r, g: *g, b: *b, a: 1.0 }
}

fn vector([x, y, z]: [f64; 3]) -> Vector3 {
    Vector3 { x, y, z }
}

fn pose(position: [f64; 3], rpy: [f64; 3]) -> Option<Pose> {
    let pose = BasePose { position, rpy }.isometry();
    let q = pose.rotation.coords;
    let orientation = Quaternion { x: q.x, y: q.y, z: q.z, w: q.w };
    Some(Pose { position: Some(vector(position)), orientation: Some(orientation) })
}

#[cfg(test)]
mod tests {
    use super::*;

    const GREY: Colour = [0.5; 3];

    fn object(text: &str) -> Object {
        serde_json::from_str(text).unwrap()
    }

    #[test]
    fn capsule_has_a_sphere_at_each_end() {
        let capsule = object(
            r#"{"name": "bar", "shape": {"capsule": {"radius": 0.1, "length": 0.6}}, "position": [1, 0, 0], "rpy": [0, 1.5707963267948966, 0]}"#,
        );
        let drawn = entity(&capsule, &GREY, true);
        let ends: Vec<f64> = drawn.spheres.iter().map(|end| end.pose.unwrap().position.unwrap().x).collect();
        assert!((ends[0] - 0.7).abs() < 1e-12 && (ends[1] - 1.3).abs() < 1e-12, "{ends:?}");
        assert_eq!(drawn.cylinders[0].size.unwrap().z, 0.6);
    }

    #[test]
    fn terrain_is_drawn_in_place_at_limited_resolution() {
        let text = r#"{"size": [12, 6], "centre": [4, 0], "spacing": 0.02, "layers": [{"slope": {"angle": 0.1, "from": 1}}]}"#;
        let field = serde_json::from_str::<motorium_worlds::Terrain>(text).unwrap().height_field().unwrap();
        let drawn = terrain(&field, &GREY);
        let TriangleListPrimitive { points, indices, .. } = &drawn.triangles[0];
        assert!((10_000..20_000).contains(&points.len()), "{}", points.len());
        for point in points {
            assert!((-2.0..=10.0).contains(&point.x) && (-3.0..=3.0).contains(&point.y), "{point:?}");
            assert!((point.z - field.height(point.x, point.y)).abs() < 1e-12);
        }
        // Two triangles per square, all facing upwards.
        for corners in indices.as_chunks::<3>().0 {
            let [a, b, c] = corners.map(|index| &points[index as usize]);
            assert!((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x) > 0.0);
        }
        let area: f64 = (points.last().unwrap().x - points[0].x) * (points.last().unwrap().y - points[0].y);
        assert!((area - 72.0).abs() < 1.0, "{area}");
    }

    #[test]
    fn fixed_objects_use_the_world_frame_free_ones_their_own() {
        let table =
            object(r#"{"name": "table", "shape": {"box": {"size": [1, 2, 0.04]}}, "position": [0.4, 0, 0]}"#);
        let ball = object(
            r#"{"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "mass": 1, "position": [0, 0, 1], "friction": 1}"#,
        );
        let (table, free) = (entity(&table, &GREY, true), entity(&ball, &[0.9, 0.1, 0.2], true));
        assert_eq!(free.spheres[0].color.map(|color| [color.r, color.g, color.b]), Some([0.9, 0.1, 0.2]));
        assert_eq!((table.frame_id.as_str(), table.cubes[0].size.unwrap().y), ("world", 2.0));
        assert_eq!(table.cubes[0].pose.unwrap().position.unwrap().x, 0.4);
        assert_eq!((free.frame_id.as_str(), free.spheres[0].size.unwrap().z), ("ball", 0.2));
        assert_eq!(free.spheres[0].pose.unwrap().position.unwrap().z, 0.0);
        // no topic provides the pose
        let still = entity(&ball, &GREY, false);
        assert_eq!(
            (still.frame_id.as_str(), still.spheres[0].pose.unwrap().position.unwrap().z),
            ("world", 1.0)
        );
    }
}
