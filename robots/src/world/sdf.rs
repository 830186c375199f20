//! Worlds from SDF (SDFormat 1.4 to 1.11), a subset: models of one link or fixed ones, with primitives,
//! planes and meshes.

mod schema;
mod surface;

use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use roxmltree::{Document, Node};

use self::schema::Treatment;
use super::reading::{Read, WorldFileError, fixed, mesh, position, problem, unique};
use super::{Ground, Object, ObjectShape, World};
use crate::{FrictionCombine, ModelWarning};

/// Thickness and sides of the box that represents a plane on a slope \[m\].
const THICK: f64 = 1.0;
const WIDE: f64 = 100.0;

/// Reads the first `<world>`, else the `<model>`s, of an SDF document.
pub(super) fn read(path: &Path, document: &Document<'_>) -> Result<Read, WorldFileError> {
    let root = document.root_element();
    let around = root.children().find(|node| node.has_tag_name("world")).unwrap_or(root);
    let mut reader = Reader { path, world: World::default(), states_gravity: false, warnings: Vec::new() };
    for node in around.children().filter(Node::is_element) {
        match node.tag_name().name() {
            "gravity" => {
                (reader.world.gravity, reader.states_gravity) = (reader.numbers(node)?, true);
            }
            "wind" => {
                if let Some(velocity) = child(node, "linear_velocity") {
                    reader.world.wind = reader.numbers(velocity)?;
                }
            }
            "model" => reader.model(node)?,
            // as in SDF up to 1.4
            "physics" => {
                if let Some(gravity) = child(node, "gravity").filter(|_| !reader.states_gravity) {
                    (reader.world.gravity, reader.states_gravity) = (reader.numbers(gravity)?, true);
                }
            }
            "world" => return Err(problem(path, node, "a second <world>: a file holds one")),
            "include" => {
                return Err(problem(path, node, "<include> is not read; write the model into the file"));
            }
            _ => reader.leave_out("world", node)?,
        }
    }
    let Reader { mut world, states_gravity, warnings, .. } = reader;
    world.combine_frictions(FrictionCombine::Min);
    Ok(Read { world, states_gravity, warnings })
}

struct Reader<'p> {
    path: &'p Path,
    world: World,
    states_gravity: bool,
    warnings: Vec<ModelWarning>,
}

/// Returns `true` for a true value; case does not matter, as in libsdformat.
fn is_true(value: &str) -> bool {
    value.trim().eq_ignore_ascii_case("true") || value.trim() == "1"
}

/// The text of an element, with comments left out.
fn text(node: Node<'_, '_>) -> String {
    node.children().filter(|child| child.is_text()).filter_map(|child| child.text()).collect()
}

fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| child.has_tag_name(name))
}

impl Reader<'_> {
    fn unread(&self, node: Node<'_, '_>, name: &str) -> WorldFileError {
        problem(
            self.path,
            node,
            format!("<{name}> is not among the SDF read here; leave it out, or write the world in TOML"),
        )
    }

    fn numbers<const N: usize>(&self, node: Node<'_, '_>) -> Result<[f64; N], WorldFileError> {
        let text = text(node);
        let numbers: Vec<f64> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        let whole = numbers.len() == text.split_whitespace().count();
        match <[f64; N]>::try_from(numbers) {
            Ok(numbers) if whole && numbers.iter().all(|number| number.is_finite()) => Ok(numbers),
            _ => {
                let name = node.tag_name().name();
                Err(problem(
                    self.path,
                    node,
                    format!("<{name}> is \"{}\", expected {N} numbers", text.trim()),
                ))
            }
        }
    }

    fn number(&self, node: Node<'_, '_>, name: &str) -> Result<f64, WorldFileError> {
        let Some(inside) = child(node, name) else {
            return Err(problem(self.path, node, format!("<{}> without a <{name}>", node.tag_name().name())));
        };
        self.numbers::<1>(inside).map(|[number]| number)
    }

    fn pose(&self, node: Node<'_, '_>) -> Result<Isometry3<f64>, WorldFileError> {
        let Some(pose) = child(node, "pose") else { return Ok(Isometry3::identity()) };
        // `frame` is the name of SDF 1.5 and 1.6 for the same
        for attribute in ["relative_to", "frame"] {
            if let Some(frame) = pose.attribute(attribute).filter(|frame| !frame.is_empty()) {
                let text = format!(
                    "a pose relative to another frame is not read, found {attribute}=\"{frame}\"; write it relative to what \
                     it stands in"
                );
                return Err(problem(self.path, pose, text));
            }
        }
        if let Some(format) = pose.attribute("rotation_format").filter(|format| *format != "euler_rpy") {
            let text = format!("rotation_format=\"{format}\" is not read, expected euler_rpy");
            return Err(problem(self.path, pose, text));
        }
        if text(pose).trim().is_empty() {
            return Ok(Isometry3::identity());
        }
        let [x, y, z, mut roll, mut pitch, mut yaw] = self.numbers(pose)?;
        if pose.attribute("degrees").is_some_and(is_true) {
            [roll, pitch, yaw] = [roll, pitch, yaw].map(f64::to_radians);
        }
        Ok(Isometry3::from_parts(
            Translation3::new(x, y, z),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        ))
    }

    fn model(&mut self, model: Node<'_, '_>) -> Result<(), WorldFileError> {
        let pose = self.pose(model)?;
        if let Some(frame) = model.attribute("placement_frame").filter(|frame| !frame.is_empty()) {
            let text = format!("placement_frame=\"{frame}\" is not read; write the pose of the model itself");
            return Err(problem(self.path, model, text));
        }
        let is_static = child(model, "static").map_or(Ok(false), |node| self.boolean(node))?;
        let name = model.attribute("name").unwrap_or("model");
        let links = || model.children().filter(|node| node.has_tag_name("link"));
        for node in model.children().filter(Node::is_element) {
            match node.tag_name().name() {
                "pose" | "static" | "link" => {}
                "joint" if is_static => {}
                "joint" => {
                    return Err(problem(
                        self.path,
                        node,
                        format!(
                            "model \"{name}\" has a joint: it is a robot; a world holds fixed models and bodies that move freely"
                        ),
                    ));
                }
                _ => self.leave_out("model", node)?,
            }
        }
        if let Some(second) = links().nth(1).filter(|_| !is_static) {
            return Err(problem(
                self.path,
                second,
                "a second link of a model that moves is not read: an object is one body",
            ));
        }
        for link in links() {
            self.link(link, name, &pose, !is_static)?;
        }
        Ok(())
    }

    fn link(
        &mut self,
        link: Node<'_, '_>,
        model: &str,
        pose: &Isometry3<f64>,
        moves: bool,
    ) -> Result<(), WorldFileError> {
        let within = self.pose(link)?;
        let mut found = 0;
        let mut mass = None;
        for node in link.children().filter(Node::is_element) {
            match node.tag_name().name() {
                "pose" => {}
                "gravity" | "kinematic" => self.check_motion(node, moves)?,
                "inertial" if moves => mass = self.mass(node, link)?,
                "inertial" => {}
                "collision" => found += 1,
                _ => self.leave_out("link", node)?,
            }
        }
        if moves && found != 1 {
            let problem_of = format!(
                "model \"{model}\" moves and has {found} collisions, expected one: an object has one shape"
            );
            return Err(problem(self.path, link, problem_of));
        }
        for collision in link.children().filter(|node| node.has_tag_name("collision")) {
            self.collision(collision, model, (pose, &within), moves.then(|| mass.unwrap_or(1.0)))?;
        }
        Ok(())
    }

    /// Refuses a link that moves otherwise than free bodies do.
    fn check_motion(&self, node: Node<'_, '_>, moves: bool) -> Result<(), WorldFileError> {
        let name = node.tag_name().name();
        if moves && self.boolean(node)? != (name == "gravity") {
            let message = format!(
                "<{name}> is \"{}\": an object that moves is free, and gravity pulls it; make its model <static>",
                text(node).trim()
            );
            return Err(problem(self.path, node, message));
        }
        Ok(())
    }

    fn boolean(&self, node: Node<'_, '_>) -> Result<bool, WorldFileError> {
        let text = text(node);
        if is_true(&text) {
            return Ok(true);
        }
        if text.trim().eq_ignore_ascii_case("false") || text.trim() == "0" {
            return Ok(false);
        }
        let name = node.tag_name().name();
        Err(problem(self.path, node, format!("<{name}> is \"{}\", expected true or false", text.trim())))
    }

    /// Accepts, warns of or rejects an unread element.
    fn leave_out(&mut self, section: &'static str, node: Node<'_, '_>) -> Result<(), WorldFileError> {
        let name = node.tag_name().name();
        match schema::treatment(section, name) {
            Some(Treatment::NoEffect) => Ok(()),
            Some(Treatment::Ignored(reason)) => {
                self.ignore(node, &format!("<{name}> of <{section}>"), reason);
                Ok(())
            }
            Some(Treatment::Refused(reason)) => {
                Err(problem(self.path, node, format!("<{name}> of <{section}> is not read: {reason}")))
            }
            None => Err(self.unread(node, name)),
        }
    }

    /// Warns of an ignored element, once per file.
    fn ignore(&mut self, node: Node<'_, '_>, element: &str, because: &'static str) {
        for warning in &mut self.warnings {
            if let ModelWarning::Ignored { what, count, .. } = warning
                && what == element
            {
                *count += 1;
                return;
            }
        }
        let (at, what) = (position(node), element.to_owned());
        self.warnings.push(ModelWarning::Ignored { what, at, count: 1, reason: because });
    }

    /// Adds a collision of a link with a pose in its model. A fixed one is an object at its own pose; one
    /// that moves, with a mass, is an object at the pose of the model.
    fn collision(
        &mut self,
        collision: Node<'_, '_>,
        model: &str,
        (model_pose, link_pose): (&Isometry3<f64>, &Isometry3<f64>),
        mass: Option<f64>,
    ) -> Result<(), WorldFileError> {
        let in_model = link_pose * self.pose(collision)?;
        let pose = model_pose * in_model;
        let geometry = child(collision, "geometry")
            .and_then(|geometry| geometry.children().find(Node::is_element))
            .ok_or_else(|| problem(self.path, collision, "<collision> without a <geometry>"))?;
        let (friction, restitution) = self.surface(collision)?;
        let shape = match geometry.tag_name().name() {
            "box" => {
                let size = child(geometry, "size")
                    .ok_or_else(|| problem(self.path, geometry, "<box> without a <size>"))?;
                ObjectShape::Box { size: self.numbers(size)? }
            }
            "sphere" => ObjectShape::Sphere { radius: self.number(geometry, "radius")? },
            "cylinder" => ObjectShape::Cylinder {
                radius: self.number(geometry, "radius")?,
                length: self.number(geometry, "length")?,
            },
            "capsule" => ObjectShape::Capsule {
                radius: self.number(geometry, "radius")?,
                length: self.number(geometry, "length")?,
            },
            "mesh" => self.mesh(geometry, mass.is_some())?,
            "plane" => {
                return self.plane(
                    (collision, geometry),
                    model,
                    &pose,
                    (friction, restitution),
                    mass.is_some(),
                );
            }
            name => return Err(self.unread(geometry, name)),
        };
        let name = unique(&self.world, model);
        self.paint(collision, &name);
        let (shape, pose) =
            if mass.is_some() { (shape.displaced(&in_model), *model_pose) } else { (shape, pose) };
        self.world.objects.push(Object { mass, friction, restitution, ..fixed(name, shape, &pose) });
        Ok(())
    }

    /// Gives an object the diffuse colour of the visual at the place of its collision in the link, else of
    /// the last one.
    fn paint(&mut self, collision: Node<'_, '_>, object: &str) {
        let of_kind = |kind| {
            collision
                .parent()
                .into_iter()
                .flat_map(|link| link.children())
                .filter(move |node| node.has_tag_name(kind))
        };
        let place = of_kind("collision").position(|other| other == collision).unwrap_or(0);
        let visual = of_kind("visual").nth(place).or_else(|| of_kind("visual").next_back());
        let diffuse =
            visual.and_then(|visual| child(visual, "material")).and_then(|looks| child(looks, "diffuse"));
        let Some(diffuse) = diffuse else { return };
        let parts: Vec<f64> = text(diffuse).split_whitespace().filter_map(|part| part.parse().ok()).collect();
        if let [red, green, blue, ..] = parts[..] {
            let colour = [red, green, blue].map(|part| part.clamp(0.0, 1.0));
            self.world.appearance.colours.insert(object.to_owned(), colour);
        }
    }

    fn mesh(&mut self, geometry: Node<'_, '_>, moves: bool) -> Result<ObjectShape, WorldFileError> {
        let uri =
            child(geometry, "uri").ok_or_else(|| problem(self.path, geometry, "<mesh> without a <uri>"))?;
        if let Some(part) = child(geometry, "submesh") {
            let text = "a part of a mesh is not read; write the part into a separate file";
            return Err(problem(self.path, part, text));
        }
        let name = text(uri);
        let name = name.trim().strip_prefix("file://").unwrap_or(name.trim());
        if name.contains("://") {
            return Err(problem(
                self.path,
                uri,
                format!("\"{name}\" is not a file; write a path relative to the SDF file"),
            ));
        }
        let scale =
            child(geometry, "scale").map(|scale| self.numbers(scale)).transpose()?.unwrap_or([1.0; 3]);
        let file = self.path.parent().unwrap_or(Path::new("")).join(name);
        if !file.is_file() {
            return Err(problem(
                self.path,
                uri,
                format!("its mesh \"{name}\" was not found beside the file"),
            ));
        }
        let (shape, reason) = mesh(&file, scale, moves);
        if let Some(reason) = reason {
            self.ignore(geometry, "concavity of a <mesh>", reason);
        }
        Ok(shape)
    }

    /// A level plane becomes the ground, a slope a large box below it. Planes of collisions have no ends, by
    /// the specification of SDF: their `size` is for drawing.
    fn plane(
        &mut self,
        (collision, geometry): (Node<'_, '_>, Node<'_, '_>),
        model: &str,
        pose: &Isometry3<f64>,
        (friction, restitution): (f64, f64),
        moves: bool,
    ) -> Result<(), WorldFileError> {
        if moves {
            return Err(problem(self.path, geometry, "a plane cannot move: make its model <static>"));
        }
        let normal = match child(geometry, "normal") {
            Some(normal) => Vector3::from(self.numbers::<3>(normal)?),
            None => Vector3::z(),
        };
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &normal);
        let Some(turn) = turn.filter(|_| normal.norm() > 1e-9) else {
            return Err(problem(self.path, geometry, "the normal of a plane must point up or aside"));
        };
        let pose = pose * turn;
        if (pose.rotation * Vector3::z()).z > 1.0 - 1e-9 {
            if self.world.ground.is_some() {
                let text =
                    "a second level plane: planes have no ends, and a world has one ground; write a <box>";
                return Err(problem(self.path, geometry, text));
            }
            self.world.ground =
                Some(Ground { height: pose.translation.z, friction, restitution, ..Ground::default() });
            self.paint(collision, "ground");
            return Ok(());
        }
        let shape = ObjectShape::Box { size: [WIDE, WIDE, THICK] };
        let pose = pose * Translation3::new(0.0, 0.0, -0.5 * THICK);
        let name = unique(&self.world, model);
        self.paint(collision, &name);
        self.world.objects.push(Object { friction, restitution, ..fixed(name, shape, &pose) });
        Ok(())
    }
}
