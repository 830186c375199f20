//! The ground and the objects of a graph's world, as a scene for viewers.

use foxglove::messages::{
    Color, CubePrimitive, CylinderPrimitive, Pose, Quaternion, SceneEntity, SceneUpdate, SpherePrimitive,
    Vector3,
};
use foxglove::{Encode as _, Schema};
use motorium::plan::Plan;
use motorium::state::{ObjectPoses, StateBuffer as _};
use motorium_robots::{Appearance, BasePose, Colour};
use serde::Deserialize;

/// The frame in which robots and objects stand.
const WORLD: &str = "world";
/// Sides of the part of the ground that is drawn, and its thickness, m.
const GROUND: [f64; 3] = [6.0, 6.0, 0.002];

const FIXED: Color = Color { r: 0.55, g: 0.58, b: 0.62, a: 1.0 };
const FREE: Color = Color { r: 0.85, g: 0.55, b: 0.2, a: 1.0 };
const EARTH: Color = Color { r: 0.8, g: 0.82, b: 0.84, a: 0.6 };

/// The part of a world that can be drawn; other keys are those of the component that simulates it.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct World {
    ground: Option<Ground>,
    objects: Vec<Object>,
    appearance: Appearance,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Ground {
    height: f64,
}

#[derive(Debug, Deserialize)]
struct Object {
    name: String,
    shape: Shape,
    mass: Option<f64>,
    position: [f64; 3],
    #[serde(default)]
    rpy: [f64; 3],
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Shape {
    Box { size: [f64; 3] },
    Sphere { radius: f64 },
    Cylinder { radius: f64, length: f64 },
}

/// The world of a plan as a scene: schema and message. `None` if it has none, or none that can be drawn.
///
/// An object that moves stands in a frame of its own, of its name, if a topic tells where it is.
pub(crate) fn scene(plan: &Plan) -> Option<(Schema, Vec<u8>)> {
    let configs = plan.components.iter().map(|component| &component.config["world"]);
    let world = configs.filter(|world| world.is_object()).find_map(|world| World::deserialize(world).ok())?;
    let told = plan.topics.iter().any(|topic| topic.layout.type_name == ObjectPoses::NAME);
    let mut entities: Vec<SceneEntity> = world
        .objects
        .iter()
        .map(|object| entity(object, world.appearance.colours.get(&object.name), told))
        .collect();
    if let Some(Ground { height }) = world.ground {
        let position = [0.0, 0.0, height - 0.5 * GROUND[2]];
        let cube =
            CubePrimitive { pose: pose(position, [0.0; 3]), size: Some(vector(GROUND)), color: Some(EARTH) };
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
    Some((SceneUpdate::get_schema()?, message))
}

/// An object, in the colour that the world gives it.
fn entity(object: &Object, colour: Option<&Colour>, told: bool) -> SceneEntity {
    let moves = object.mass.is_some();
    let of_its_own = moves && told;
    let pose = if of_its_own { pose([0.0; 3], [0.0; 3]) } else { pose(object.position, object.rpy) };
    let color = match colour {
        Some([r, g, b]) => Some(Color { r: *r, g: *g, b: *b, a: 1.0 }),
        None => Some(if moves { FREE } else { FIXED }),
    };
    let mut entity = SceneEntity {
        frame_id: if of_its_own { object.name.clone() } else { WORLD.to_string() },
        id: object.name.clone(),
        frame_locked: true,
        ..SceneEntity::default()
    };
    match object.shape {
        Shape::Box { size } => {
            entity.cubes.push(CubePrimitive { pose, size: Some(vector(size)), color });
        }
        Shape::Sphere { radius } => {
            entity.spheres.push(SpherePrimitive { pose, size: Some(vector([2.0 * radius; 3])), color });
        }
        Shape::Cylinder { radius, length } => {
            let size = Some(vector([2.0 * radius, 2.0 * radius, length]));
            let (bottom_scale, top_scale) = (1.0, 1.0);
            entity.cylinders.push(CylinderPrimitive { pose, size, bottom_scale, top_scale, color });
        }
    }
    entity
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

    fn object(text: &str) -> Object {
        serde_json::from_str(text).unwrap()
    }

    #[test]
    fn a_fixed_object_stands_in_the_world_and_a_free_one_in_its_own_frame() {
        let table =
            object(r#"{"name": "table", "shape": {"box": {"size": [1, 2, 0.04]}}, "position": [0.4, 0, 0]}"#);
        let ball = object(
            r#"{"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "mass": 1, "position": [0, 0, 1], "friction": 1}"#,
        );
        let (table, free) = (entity(&table, None, true), entity(&ball, Some(&[0.9, 0.1, 0.2]), true));
        assert_eq!(free.spheres[0].color.map(|color| [color.r, color.g, color.b]), Some([0.9, 0.1, 0.2]));
        assert_eq!((table.frame_id.as_str(), table.cubes[0].size.unwrap().y), ("world", 2.0));
        assert_eq!(table.cubes[0].pose.unwrap().position.unwrap().x, 0.4);
        assert_eq!((free.frame_id.as_str(), free.spheres[0].size.unwrap().z), ("ball", 0.2));
        assert_eq!(free.spheres[0].pose.unwrap().position.unwrap().z, 0.0);
        // nobody tells where it is
        let still = entity(&ball, None, false);
        assert_eq!(
            (still.frame_id.as_str(), still.spheres[0].pose.unwrap().position.unwrap().z),
            ("world", 1.0)
        );
    }
}
