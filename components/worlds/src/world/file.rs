//! Worlds in third-party formats: MJCF, URDF and SDF.

use std::collections::BTreeMap;
use std::path::Path;

use motorium_robots::{
    Geometry, LinkColours, LoadOptions, ModelWarning, Position, Shape, is_mjcf, parse_urdf_with, read_bounded,
};
use roxmltree::{Document, Node};

use super::WorldFileError;
use super::mjcf::{MjcfWorld, parse_mjcf_world};
use super::reading::{Read, fixed, mesh, position, problem, unique};
use super::{EARTH, Object, ObjectShape, World, sdf};

/// Maximum size of a world file, bytes.
const LONGEST: u64 = 64 * 1024 * 1024;

impl World {
    /// Adds the ground and the objects of a file before this world's objects, with their colours unless
    /// overridden, and its gravity unless this world states its own.
    pub(super) fn add_file(&mut self, path: &Path) -> Result<Vec<ModelWarning>, WorldFileError> {
        let Read { mut world, states_gravity, warnings } = read(path)?;
        if states_gravity && !self.states_gravity && self.gravity == EARTH {
            self.gravity = world.gravity;
        }
        if self.wind == [0.0; 3] {
            self.wind = world.wind;
        }
        if self.ground.is_none() && self.terrain.is_none() {
            self.ground = world.ground;
        } else {
            world.appearance.colours.remove("ground");
        }
        for (name, colour) in world.appearance.colours {
            self.appearance.colours.entry(name).or_insert(colour);
        }
        self.objects.splice(0..0, world.objects);
        self.connections.splice(0..0, world.connections);
        Ok(warnings)
    }
}

/// Reads a world from a file.
pub(super) fn read(path: &Path) -> Result<Read, WorldFileError> {
    let failed = |reason: String| WorldFileError::Read { path: path.to_owned(), reason };
    let bytes = read_bounded(path, LONGEST).map_err(|error| failed(error.to_string()))?;
    let text = String::from_utf8(bytes).map_err(|_| failed("not a text file in UTF-8".to_owned()))?;
    if is_mjcf(&text) {
        let MjcfWorld { world, states_gravity, warnings } = parse_mjcf_world(&text, Some(path))?;
        return Ok(Read { world, states_gravity, warnings });
    }
    let document = Document::parse(&text).map_err(|error| {
        let at = Position { line: error.pos().row, column: error.pos().col };
        WorldFileError::Problem {
            path: path.to_owned(),
            at,
            problem: format!("not well-formed XML: {error}"),
        }
    })?;
    match document.root_element().tag_name().name() {
        "robot" => urdf(&text, path, &document),
        "sdf" => sdf::read(path, &document),
        root => Err(WorldFileError::Format { path: path.to_owned(), root: root.to_owned() }),
    }
}

/// Returns the collision shapes of a URDF without movable joints as fixed objects.
fn urdf(text: &str, path: &Path, document: &Document<'_>) -> Result<Read, WorldFileError> {
    let robot = parse_urdf_with(text, Some(path), &LoadOptions::default())?;
    let moving = document.root_element().children().find(|node| {
        node.has_tag_name("joint") && node.attribute("type").is_some_and(|kind| kind != "fixed")
    });
    if let Some(joint) = moving {
        let name = joint.attribute("name").unwrap_or_default();
        return Err(problem(
            path,
            joint,
            format!("joint \"{name}\" moves: a world from a URDF must be fixed; load the file as a robot"),
        ));
    }
    let base = robot.model.base();
    let (mut world, mut warnings) = (World::default(), robot.warnings);
    warnings.extend(surfaces(document));
    let (colours, mut used) = (LinkColours::of_urdf(text), BTreeMap::<&str, usize>::new());
    for shape in base.shapes.iter().chain(&base.world_shapes) {
        let named = |uri: &str| {
            let mesh = document.descendants().find(|node| node.attribute("filename") == Some(uri));
            mesh.unwrap_or(document.root_element())
        };
        let missing = |uri: &str| {
            let advice = "add the folder of its package to ROS_PACKAGE_PATH";
            problem(path, named(uri), format!("its mesh \"{uri}\" was not found; {advice}"))
        };
        let (object, reason) = object(&world, shape).map_err(|uri| missing(&uri))?;
        if let (Some(reason), Geometry::Mesh { uri, .. }) = (reason, &shape.geometry) {
            let at = position(named(uri));
            let what = format!("concavity of the mesh \"{uri}\"");
            warnings.push(ModelWarning::Ignored { what, at, count: 1, reason });
        }
        let place = used.entry(&shape.link).or_default();
        if let Some(colour) = colours.stated(&shape.link, *place) {
            world.appearance.colours.insert(object.name.clone(), colour);
        }
        *place += 1;
        world.objects.push(object);
    }
    Ok(Read { world, states_gravity: false, warnings })
}

/// Returns warnings about surfaces in the dialects of other programs; URDF itself has no surfaces.
fn surfaces(document: &Document<'_>) -> impl Iterator<Item = ModelWarning> {
    const DIALECTS: [(&str, &[&str]); 3] = [
        (
            "contact",
            &["lateral_friction", "rolling_friction", "spinning_friction", "restitution", "stiffness"],
        ),
        ("gazebo", &["mu1", "mu2", "kp", "kd", "minDepth", "maxVel", "fdir1", "collision"]),
        (
            "proximity_properties",
            &["mu_static", "mu_dynamic", "compliant_hydroelastic", "rigid_hydroelastic"],
        ),
    ];
    DIALECTS.into_iter().filter_map(|(element, values)| {
        let holds =
            |node: &Node<'_, '_>| node.children().any(|child| values.contains(&child.tag_name().name()));
        let is_it = |node: &Node<'_, '_>| node.tag_name().name() == element && holds(node);
        let mut all = document.descendants().filter(is_it);
        let at = position(all.next()?);
        let what = format!("the surface in <{element}>");
        let reason = "objects of a URDF have the default friction; describe them in TOML, MJCF or SDF";
        Some(ModelWarning::Ignored { what, at, count: 1 + all.count(), reason })
    })
}

/// Returns a fixed object for a shape, and the reason for a warning; the error is the name of a missing mesh.
fn object(world: &World, shape: &Shape) -> Result<(Object, Option<&'static str>), String> {
    let mut reason = None;
    let kind = match &shape.geometry {
        Geometry::Box { size } => ObjectShape::Box { size: (*size).into() },
        Geometry::Cylinder { radius, length } => ObjectShape::Cylinder { radius: *radius, length: *length },
        Geometry::Sphere { radius } => ObjectShape::Sphere { radius: *radius },
        Geometry::Capsule { radius, length } => ObjectShape::Capsule { radius: *radius, length: *length },
        Geometry::Mesh { path: Some(path), scale, .. } => {
            let (shape, concave) = mesh(path, (*scale).into(), false);
            reason = concave;
            shape
        }
        Geometry::Mesh { uri, .. } => return Err(uri.clone()),
    };
    Ok((fixed(unique(world, &shape.link), kind, &shape.placement), reason))
}
