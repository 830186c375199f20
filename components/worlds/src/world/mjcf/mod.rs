//! Worlds from MJCF: gravity, planes, height fields, fixed geoms, free bodies, and connections.

mod contacts;
mod free_bodies;
mod height_fields;
mod held;
mod looks;

use std::collections::HashMap;
use std::path::Path;

use motorium_robots::mjcf::{
    Attributes, BODY, Compiler, DEEPEST, Element, FRAME, FREEJOINT, GEOM, Geom, Geoms, JOINT, MAIN, OPTION,
    body_name, expand, is_off, named, parse_document, pose, read_assets,
};
use motorium_robots::{
    BasePose, Colour, Geometry, MjcfError, MjcfProblem, ModelWarning, ShapeSource, TriangleMesh, nearest,
};
use nalgebra::Isometry3;
use roxmltree::Node;

use contacts::{Contacts, Surface, Surfaces, surface};
use free_bodies::{FreeGeom, Weight, object};
use held::{Held, connections};
use looks::Looks;

use super::reading::unique;
use super::{Ground, MeshCollision, MeshShape, Object, ObjectShape, World};
use crate::FrictionCombine;

/// A world read from MJCF.
#[derive(Clone, Debug)]
pub struct MjcfWorld {
    /// The world.
    pub world: World,
    /// `true` if the file specifies gravity.
    pub states_gravity: bool,
    /// Warnings about skipped elements, each with its position in the text.
    pub warnings: Vec<ModelWarning>,
}

/// Sections without effect on a world.
const SKIPPED: [&str; 5] = ["size", "visual", "statistic", "custom", "sensor"];

/// Values of flags that change the motion of objects.
const FLAGS: [(&str, &str, &str); 4] = [
    ("contact", "disable", "the objects of a world touch"),
    ("constraint", "disable", "the objects of a world touch"),
    ("equality", "disable", "remove the section <equality>"),
    ("override", "enable", "set friction and stiffness of the geoms"),
];

/// Name of the ground among the colours of a world.
const GROUND: &str = "ground";

/// Attributes of a free joint that objects do not have.
const ON_FREE_JOINTS: [(&str, &str); 5] = [
    ("damping", "an object moves freely; `drag` slows it down"),
    ("frictionloss", "an object moves freely"),
    ("armature", "an object has the inertia of its shape"),
    ("stiffness", "objects have no springs"),
    ("springdamper", "objects have no springs"),
];

/// Sections of robots.
const OF_ROBOTS: [&str; 3] = ["tendon", "actuator", "keyframe"];

/// Reads MJCF `text` as a world. `file` is the path of the text, which is used in messages and to find meshes
/// in the same folder.
///
/// Geoms of immovable bodies, including height fields, become fixed objects, and a level plane becomes the
/// ground. A body with a free joint becomes a moving object of one or more shapes, with the masses of its
/// geoms. Meshes collide with their convex hull, as in MuJoCo, and height fields with their triangles. An
/// object has the colour of its geoms. `<connect>` and `<weld>` become connections of objects. Bodies with
/// other joints, and other elements that a world cannot contain, are rejected with their position.
/// Non-colliding geoms without mass are skipped with a warning.
///
/// # Errors
///
/// [`MjcfError`], with the position in the text, if the text is not MJCF or contains a rejected element.
///
/// ```
/// let text = r#"<mujoco>
///   <option gravity="0 0 -1.62"/>
///   <worldbody>
///     <geom name="floor" type="plane" size="0 0 1" friction="0.7"/>
///     <geom name="table" type="box" size="0.4 0.6 0.02" pos="0.6 0 0.38"/>
///     <body name="ball" pos="0.6 0 0.5"><freejoint/><geom size="0.04" mass="0.1"/></body>
///   </worldbody>
/// </mujoco>"#;
/// let world = motorium_worlds::parse_mjcf_world(text, None)?.world;
/// assert_eq!((world.gravity[2], world.ground.unwrap().friction), (-1.62, 0.7));
/// assert_eq!((world.objects[0].name.as_str(), world.objects[1].mass), ("table", Some(0.1)));
/// # Ok::<(), motorium_robots::MjcfError>(())
/// ```
pub fn parse_mjcf_world(text: &str, file: Option<&Path>) -> Result<MjcfWorld, MjcfError> {
    let expanded = expand(text, file)?;
    let mut read = read(&expanded.text, file).map_err(|error| expanded.located(error))?;
    read.warnings = read.warnings.into_iter().map(|warning| expanded.located_warning(warning)).collect();
    Ok(read)
}

fn read(text: &str, file: Option<&Path>) -> Result<MjcfWorld, MjcfError> {
    let document = parse_document(text)?;
    let attributes = Attributes::new(&document)?;
    let root = document.root_element();
    if !root.has_tag_name("mujoco") {
        return Err(attributes.error(root, MjcfProblem::Root(root.tag_name().name().to_owned())));
    }
    let compiler = Compiler::read(root, &attributes)?;
    if compiler.total_mass.is_some() {
        let node = root.children().find(|node| node.has_attribute("settotalmass")).unwrap_or(root);
        let value = node.attribute("settotalmass").unwrap_or_default();
        let reason = "it changes masses; write the resulting masses to the file";
        return Err(attributes.refused(node, "settotalmass", value, reason));
    }
    let mut geoms = Geoms::new(&attributes, &compiler, ShapeSource::Collision);
    let mut world = World::default();
    let mut states_gravity = false;
    for section in root.children().filter(Node::is_element) {
        match section.tag_name().name() {
            "asset" => read_assets(section, &mut geoms, file)?,
            "option" => {
                let option = attributes.element(section, MAIN, &OPTION)?;
                if let Some(gravity) = option.numbers::<3>("gravity")? {
                    (world.gravity, states_gravity) = (gravity, true);
                }
                world.wind = option.numbers::<3>("wind")?.unwrap_or(world.wind);
                for node in section.children().filter(Node::is_element) {
                    if !node.has_tag_name("flag") {
                        let problem = format!("{}> of <option", node.tag_name().name());
                        return Err(attributes.error(node, MjcfProblem::Element(problem)));
                    }
                    if node.attribute("gravity") == Some("disable") {
                        (world.gravity, states_gravity) = ([0.0; 3], true);
                    }
                    for (name, value, reason) in FLAGS {
                        if node.attribute(name) == Some(value) {
                            return Err(attributes.refused(node, name, value, reason));
                        }
                    }
                }
            }
            "compiler" | "default" | "worldbody" | "equality" => {}
            name if SKIPPED.contains(&name) => {}
            name if OF_ROBOTS.contains(&name) => {
                let problem = format!(
                    "<{name}> describes a robot, which a world cannot contain; load the robot with a `[robot.NAME]` table"
                );
                return Err(attributes.error(section, MjcfProblem::Other(problem)));
            }
            name => return Err(attributes.error(section, MjcfProblem::Element(name.to_owned()))),
        }
    }
    let fields = height_fields::read(root, &attributes, &compiler, file)?;
    let (bodies, free, within) = (HashMap::new(), Vec::new(), Vec::new());
    let (looks, contacts, surfaces) = (Looks::default(), Contacts::default(), Surfaces::default());
    let mut reader = Reader { geoms: &geoms, fields, world, bodies, free, within, looks, contacts, surfaces };
    for section in root.children().filter(|section| section.has_tag_name("worldbody")) {
        reader.contents(section, &Place { within: Isometry3::identity(), class: MAIN, frees: false })?;
    }
    let Reader { mut world, bodies, looks, surfaces, .. } = reader;
    surfaces.apply(&attributes, &mut world);
    world.combine_frictions(FrictionCombine::Max);
    let objects = world.objects.iter().map(|object| object.name.as_str());
    world.appearance.colours = looks.colours(objects.chain(world.ground.map(|_| GROUND)));
    for section in root.children().filter(|section| section.has_tag_name("equality")) {
        world.connections.extend(connections(section, &attributes, &bodies)?);
    }
    Ok(MjcfWorld { world, states_gravity, warnings: attributes.warnings() })
}

/// The context of an element.
#[derive(Clone, Copy)]
struct Place<'a> {
    /// Frame of the enclosing element in the world.
    within: Isometry3<f64>,
    /// Default class.
    class: &'a str,
    /// `true` if the enclosing body has a free joint, or is fixed to a body with one.
    frees: bool,
}

struct Reader<'b, 'a, 'i> {
    geoms: &'b Geoms<'b, 'a, 'i>,
    /// The solids of height fields.
    fields: HashMap<String, TriangleMesh>,
    world: World,
    /// Placements of bodies by name.
    bodies: HashMap<String, Held>,
    /// Geoms of the current free body.
    free: Vec<FreeGeom<'a, 'i>>,
    /// Its bodies with their poses in the world.
    within: Vec<(String, Isometry3<f64>)>,
    looks: Looks,
    contacts: Contacts<'a, 'i>,
    surfaces: Surfaces<'a, 'i>,
}

impl<'a, 'i> Reader<'_, 'a, 'i> {
    fn attributes(&self) -> &Attributes<'a, 'i> {
        self.geoms.attributes
    }

    fn other(&self, node: Node<'a, 'i>, problem: &str) -> MjcfError {
        self.attributes().error(node, MjcfProblem::Other(problem.to_owned()))
    }

    fn contents(&mut self, node: Node<'a, 'i>, place: &Place<'a>) -> Result<(), MjcfError> {
        let attributes = self.geoms.attributes;
        if node.ancestors().nth(DEEPEST).is_some() {
            let problem = format!("more than {DEEPEST} nested bodies and frames are not supported");
            return Err(self.other(node, &problem));
        }
        for element in node.children().filter(Node::is_element) {
            match element.tag_name().name() {
                "frame" => {
                    let frame = attributes.element(element, MAIN, &FRAME)?;
                    let within = place.within * pose(&frame, self.geoms.compiler)?;
                    let class = element.attribute("childclass").unwrap_or(place.class);
                    attributes.known_class(element, class)?;
                    self.contents(element, &Place { within, class, ..*place })?;
                }
                "body" => self.body(element, place)?,
                "geom" => self.geom(element, place)?,
                "inertial" => {
                    return Err(self.other(
                        element,
                        "an object has the inertia of its shape; give its geom a mass or a density instead of an <inertial>",
                    ));
                }
                // Read with their body.
                "joint" | "freejoint" if node.has_tag_name("body") => {}
                "site" | "camera" | "light" => {}
                name => return Err(attributes.error(element, MjcfProblem::Element(name.to_owned()))),
            }
        }
        Ok(())
    }

    fn body(&mut self, node: Node<'a, 'i>, around: &Place<'a>) -> Result<(), MjcfError> {
        let attributes = self.geoms.attributes;
        let body = attributes.element(node, MAIN, &BODY)?;
        let class = node.attribute("childclass").unwrap_or(around.class);
        attributes.known_class(node, class)?;
        let within = around.within * pose(&body, self.geoms.compiler)?;
        let mut frees = false;
        for joint in node.children().filter(|child| ["joint", "freejoint"].contains(&child.tag_name().name()))
        {
            let free = match joint.has_tag_name("freejoint") {
                true => attributes.element(joint, MAIN, &FREEJOINT).map(|_| true)?,
                false => {
                    let joint = attributes.element(joint, class, &JOINT)?;
                    let free = joint.get("type") == Some("free");
                    for (name, reason) in ON_FREE_JOINTS.into_iter().filter(|_| free) {
                        if joint.get(name).is_some_and(|value| !is_off(value)) {
                            joint.ignore(name, reason);
                        }
                    }
                    free
                }
            };
            if !free {
                return Err(self.other(
                    joint,
                    "a body with a joint is part of a robot, but a world has only fixed and free bodies; load the robot with a `[robot.NAME]` table",
                ));
            }
            if around.frees {
                return Err(
                    self.other(joint, "a free joint inside a moving body; it belongs to a body of the world")
                );
            }
            frees = true;
        }
        let place = Place { within, class, frees: frees || around.frees };
        if !place.frees {
            self.bodies.insert(body_name(node), Held::world(within));
            return self.contents(node, &place);
        }
        self.within.push((body_name(node), within));
        let first = self.looks.len();
        self.contents(node, &place)?;
        if !frees {
            return Ok(());
        }
        let (free, bodies) = (std::mem::take(&mut self.free), std::mem::take(&mut self.within));
        let surface = free.first().map(|geom| (geom.node, geom.surface.clone()));
        let object = object(&self.world, attributes, (node, &within), free)?;
        if let Some((geom, surface)) = surface {
            self.surfaces.add(geom, &surface, true);
        }
        let frame = object.pose();
        for (name, pose) in bodies {
            self.bodies.insert(name, Held { object: object.name.clone(), frame: frame.inv_mul(&pose) });
        }
        self.looks.rename(first, &object.name);
        self.world.objects.push(object);
        Ok(())
    }

    /// Adds the object or ground of a geom.
    fn geom(&mut self, node: Node<'a, 'i>, place: &Place<'a>) -> Result<(), MjcfError> {
        let attributes = self.geoms.attributes;
        let read = attributes.element(node, place.class, &GEOM)?;
        let surface = surface(&read)?;
        if read.get("type") == Some("hfield") {
            return self.field(&read, place, surface);
        }
        let Geom { placement, geometry, kept, colour, is_seen, inertia, masks, .. } =
            self.geoms.read(node, place.class, !place.frees)?;
        if !kept && place.frees && !inertia.as_ref().is_ok_and(|inertia| inertia.mass == 0.0) {
            return Err(self.other(
                node,
                "a non-colliding geom has a mass, but only colliding geoms contribute to the mass of an object: set mass=\"0\"",
            ));
        }
        if !kept {
            self.looks.add(node, None, colour, is_seen);
            attributes.ignored(
                node,
                "geom".to_owned(),
                "it touches nothing, and a world contains only colliding geoms",
            );
            return Ok(());
        }
        self.contacts.add(attributes, node, masks)?;
        let pose = place.within * placement;
        if place.frees {
            if inertia.is_err() {
                self.geoms.check_solid(&read)?;
            }
            let weight = Weight::from_element(&geometry, inertia, &read)?;
            let shape = shape(&geometry, &read)?;
            // The name of its object is set after all of its geoms have been read.
            self.looks.add(node, Some(""), colour, is_seen);
            self.free.push(FreeGeom { node, pose, shape, weight, surface });
            return Ok(());
        }
        let size = read.first_numbers("size", [0.0; 3])?;
        let up = pose.rotation * nalgebra::Vector3::z();
        let (is_plane, has_ends) = (read.get("type") == Some("plane"), size[0] > 0.0 || size[1] > 0.0);
        if is_plane && up.z > 1.0 - 1e-9 {
            if self.world.ground.is_some() {
                return Err(self.other(
                    node,
                    "a second level plane: planes are infinite, and a world has one ground; use a box",
                ));
            }
            if has_ends {
                read.ignore("size", "a level plane is infinite, also for rays and cameras");
            }
            // The plane is the top of the box that represents it.
            let Geometry::Box { size } = geometry else { return Ok(()) };
            let height = pose.translation.z + 0.5 * size.z;
            self.looks.add(node, Some(GROUND), colour, is_seen);
            self.surfaces.set_ground(node, &surface);
            let Object { friction, torsional_friction, rolling_friction, .. } = surface.object;
            self.world.ground =
                Some(Ground { height, friction, torsional_friction, rolling_friction, ..Ground::default() });
            return Ok(());
        }
        if is_plane && has_ends {
            read.ignore(
                "size",
                "a sloped plane becomes a box of this size; in MuJoCo it is infinite for contacts",
            );
        }
        let shape = shape(&geometry, &read)?;
        self.fixed(node, shape, &pose, surface, (colour, is_seen));
        Ok(())
    }

    /// Adds a height field: a fixed object that collides with its triangles.
    fn field(
        &mut self,
        read: &Element<'_, 'a, 'i>,
        place: &Place<'a>,
        surface: Surface,
    ) -> Result<(), MjcfError> {
        if place.frees {
            return Err(read.refused("type", "a height field does not move"));
        }
        let name = read.get("hfield").ok_or_else(|| read.missing("hfield"))?;
        let Some(mesh) = self.fields.get(name) else {
            let nearest = nearest(name, self.fields.keys().map(String::as_str)).map(str::to_owned);
            let (element, name) = (named(read.node), name.to_owned());
            return Err(read.error(MjcfProblem::Unknown { element, what: "hfield", name, nearest }));
        };
        let masks = [read.number("contype", 1.0)?, read.number("conaffinity", 1.0)?];
        if masks == [0.0; 2] {
            let reason = "it touches nothing, and a world contains only colliding geoms";
            self.geoms.attributes.ignored(read.node, "geom".to_owned(), reason);
            return Ok(());
        }
        self.contacts.add(self.geoms.attributes, read.node, masks.map(|mask| mask as i32))?;
        let shape = MeshShape::of_mesh(name, mesh.clone(), MeshCollision::Triangles);
        let pose = place.within * pose(read, self.geoms.compiler)?;
        let look = self.geoms.look(read)?;
        self.fixed(read.node, ObjectShape::Mesh(shape), &pose, surface, look);
        Ok(())
    }

    /// Adds a fixed object, named after the geom, otherwise after its body.
    fn fixed(
        &mut self,
        node: Node<'a, 'i>,
        shape: ObjectShape,
        pose: &Isometry3<f64>,
        surface: Surface,
        (colour, is_seen): (Option<Colour>, bool),
    ) {
        let body = node.ancestors().find(|node| node.has_tag_name("body")).map(body_name);
        let name = node.attribute("name").map(str::to_owned).or(body);
        let name = unique(&self.world, name.as_deref().unwrap_or("geom"));
        let BasePose { position, rpy } = BasePose::from_isometry(pose);
        self.looks.add(node, Some(&name), colour, is_seen);
        self.surfaces.add(node, &surface, false);
        self.world.objects.push(Object { name, shape, position, rpy, ..surface.object });
    }
}

fn shape(geometry: &Geometry, read: &Element<'_, '_, '_>) -> Result<ObjectShape, MjcfError> {
    Ok(match geometry {
        Geometry::Box { size } => ObjectShape::Box { size: (*size).into() },
        Geometry::Cylinder { radius, length } => ObjectShape::Cylinder { radius: *radius, length: *length },
        Geometry::Sphere { radius } => ObjectShape::Sphere { radius: *radius },
        Geometry::Capsule { radius, length } => ObjectShape::Capsule { radius: *radius, length: *length },
        Geometry::Mesh { uri, inline: Some(mesh), scale, .. } => {
            let mesh = TriangleMesh::clone(mesh).scaled(scale);
            ObjectShape::Mesh(MeshShape::of_mesh(uri, mesh, MeshCollision::Hull))
        }
        Geometry::Mesh { path: Some(path), scale, .. } => {
            let shape = MeshShape::new(std::path::absolute(path).unwrap_or_else(|_| path.clone()));
            ObjectShape::Mesh(MeshShape { scale: (*scale).into(), ..shape })
        }
        Geometry::Mesh { uri, .. } => {
            return Err(read.fault(format!("its mesh \"{uri}\" was not found next to the file")));
        }
    })
}
