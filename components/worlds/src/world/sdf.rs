//! Worlds from SDF (SDFormat 1.4 to 1.11). Static models and moving models of one link are supported, with
//! primitives, planes and meshes.

mod bodies;
mod reader;
mod schema;
mod shapes;
mod surface;
mod values;

use std::cell::RefCell;
use std::path::Path;

use motorium_robots::{ModelWarning, Position};
use nalgebra::Isometry3;
use roxmltree::{Document, Node};

use self::reader::Reader;
use self::schema::{Treatment, advice, treatment};
use self::values::{child, elements, is_foreign, is_true, named, text};
use super::WorldFileError;
use super::reading::{Read, fixed, position, problem, unique};
use super::{Object, World};
use crate::FrictionCombine;

/// Gravitational acceleration of an SDF world without `<gravity>` \[m/s2\].
const GRAVITY: [f64; 3] = [0.0, 0.0, -9.8];
/// Last minor version of SDF in which `<gravity>` is in `<physics>`.
const LAST_WITH_GRAVITY_IN_PHYSICS: u32 = 5;
/// Maximum number of element levels around a model.
const DEEPEST: usize = 64;

/// Reads the first `<world>` of an SDF document, or its `<model>`s if there is no `<world>`.
pub(super) fn read(path: &Path, document: &Document<'_>) -> Result<Read, WorldFileError> {
    let root = document.root_element();
    let mut reader =
        Reader { path, world: World::default(), warnings: RefCell::default(), first_bounce: None };
    let minor = reader.minor_version(root)?;
    reader.warn_of_foreign(root);
    reader.refuse_repeated(root)?;
    let world = child(root, "world");
    let mut states_gravity = false;
    if let Some(world) = world {
        reader.world.gravity = GRAVITY;
        for node in elements(root).filter(|node| *node != world) {
            reader.beside_the_world(node)?;
        }
    }
    let around = world.unwrap_or(root);
    let is_default = |node: &Node<'_, '_>| node.attribute("default").is_some_and(is_true);
    let physics = named(around, "physics").find(is_default).or(child(around, "physics"));
    for node in elements(around) {
        match node.tag_name().name() {
            "gravity" => (reader.world.gravity, states_gravity) = (reader.numbers(node)?, true),
            "wind" => {
                if let Some(velocity) = child(node, "linear_velocity") {
                    reader.world.wind = reader.numbers(velocity)?;
                }
            }
            "model" => reader.model(node, &Isometry3::identity(), false, "world")?,
            "physics" => {
                let Some(gravity) = child(node, "gravity") else { continue };
                if minor > LAST_WITH_GRAVITY_IN_PHYSICS {
                    let text =
                        "<gravity> in <physics> is not supported from SDF 1.6 on; move it into the <world>";
                    return Err(problem(path, gravity, text));
                }
                if !states_gravity && Some(node) == physics {
                    (reader.world.gravity, states_gravity) = (reader.numbers(gravity)?, true);
                }
            }
            _ => reader.leave_out("world", node)?,
        }
    }
    reader.warn_of_bounces();
    let Reader { world: mut read, warnings, .. } = reader;
    read.combine_frictions(FrictionCombine::Min);
    Ok(Read {
        world: read,
        states_gravity: states_gravity || world.is_some(),
        warnings: warnings.into_inner(),
    })
}

impl Reader<'_> {
    /// Returns the minor version, the number after `1.`; rejects unsupported versions. A file without a
    /// version counts as the newest.
    fn minor_version(&self, root: Node<'_, '_>) -> Result<u32, WorldFileError> {
        let Some(version) = root.attribute("version") else { return Ok(u32::MAX) };
        let minor = version.strip_prefix("1.").and_then(|minor| minor.parse::<u32>().ok());
        if let Some(minor) = minor.filter(|minor| *minor >= 4) {
            return Ok(minor);
        }
        let text = format!(
            "SDF version \"{version}\" is not supported, expected 1.4 or later; convert the file with `gz sdf -p`"
        );
        Err(problem(self.path, root, text))
    }

    /// Warns about elements in the namespaces of other programs.
    fn warn_of_foreign(&mut self, root: Node<'_, '_>) {
        let own_parent = |node: &Node<'_, '_>| node.parent().is_none_or(|parent| !is_foreign(&parent));
        let foreign =
            root.descendants().filter(|node| node.is_element() && is_foreign(node)).filter(own_parent);
        for node in foreign {
            let what = format!("<{}> of another program", node.tag_name().name());
            self.ignore(node, &what, "it is not an element of SDF");
        }
    }

    /// Rejects a second value of an element, and a second model or link with the same name.
    fn refuse_repeated(&self, root: Node<'_, '_>) -> Result<(), WorldFileError> {
        for node in elements(root) {
            let name = node.tag_name().name();
            if schema::ANY.contains(&name) {
                continue;
            }
            if schema::ONCE.contains(&name) && named(root, name).next() != Some(node) {
                let text = format!("a second <{name}> in <{}>; keep one", root.tag_name().name());
                return Err(problem(self.path, node, text));
            }
            let same = |other: &Node<'_, '_>| other.attribute("name") == node.attribute("name");
            if let ("model" | "link", Some(taken)) = (name, node.attribute("name"))
                && named(root, name).find(same) != Some(node)
            {
                let text = format!("a second <{name}> is named \"{taken}\"; give it another name");
                return Err(problem(self.path, node, text));
            }
            self.refuse_repeated(node)?;
        }
        Ok(())
    }

    /// Handles an element next to the `<world>`; rejects models and further worlds.
    fn beside_the_world(&mut self, node: Node<'_, '_>) -> Result<(), WorldFileError> {
        match node.tag_name().name() {
            "world" => {
                Err(problem(self.path, node, "a second <world>, but one file describes one world; remove it"))
            }
            "model" => {
                let text = "<model> next to <world> is not supported; move it into the <world>";
                Err(problem(self.path, node, text))
            }
            _ => self.leave_out("world", node),
        }
    }

    /// Returns the error for an element that a world cannot contain.
    fn unsupported(&self, node: Node<'_, '_>) -> WorldFileError {
        let name = node.tag_name().name();
        let around = node.parent().map_or("sdf", |parent| parent.tag_name().name());
        let text = format!("<{name}> in <{around}> is not supported; {}", advice(name));
        problem(self.path, node, text)
    }

    /// Reads a model in the frame `around`; the file may refer to this frame as `scope`. `fixed` is `true`
    /// inside a static model.
    fn model(
        &mut self,
        model: Node<'_, '_>,
        around: &Isometry3<f64>,
        fixed: bool,
        scope: &str,
    ) -> Result<(), WorldFileError> {
        if model.ancestors().nth(DEEPEST).is_some() {
            return Err(problem(self.path, model, "models nested this deeply are not supported"));
        }
        let pose = around * self.pose(model, Some(scope))?;
        if let Some(frame) = model.attribute("placement_frame").filter(|frame| !frame.is_empty()) {
            let text =
                format!("placement_frame=\"{frame}\" is not supported; write the pose of the model itself");
            return Err(problem(self.path, model, text));
        }
        let is_static = child(model, "static").map_or(Ok(false), |node| self.boolean(node))? || fixed;
        let name = model.attribute("name").unwrap_or("model");
        for node in elements(model) {
            match node.tag_name().name() {
                "pose" | "static" | "link" => {}
                "joint" if is_static => {}
                "model" if is_static => self.model(node, &pose, true, "__model__")?,
                "joint" => {
                    let text = format!(
                        "model \"{name}\" has a joint: it is a robot, but a world contains only fixed models and free bodies"
                    );
                    return Err(problem(self.path, node, text));
                }
                _ => self.leave_out("model", node)?,
            }
        }
        if let Some(second) = named(model, "link").nth(1).filter(|_| !is_static) {
            let text = "a second <link> in a moving <model> is not supported; make it a separate model, or \
                        move its <collision> into the first link";
            return Err(problem(self.path, second, text));
        }
        for link in named(model, "link") {
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
        let within = self.pose(link, Some("__model__"))?;
        for node in elements(link) {
            match node.tag_name().name() {
                "pose" | "inertial" | "collision" => {}
                "gravity" | "kinematic" => self.check_motion(node, moves)?,
                _ => self.leave_out("link", node)?,
            }
        }
        if moves {
            return self.free_link(link, model, (pose, &within));
        }
        for collision in named(link, "collision") {
            let pose = pose * within * self.pose(collision, link.attribute("name"))?;
            self.fixed_collision(collision, model, &pose)?;
        }
        Ok(())
    }

    /// Adds a collision of a static model.
    fn fixed_collision(
        &mut self,
        collision: Node<'_, '_>,
        model: &str,
        pose: &Isometry3<f64>,
    ) -> Result<(), WorldFileError> {
        let geometry = self.geometry(collision)?;
        let (friction, restitution) = self.surface(collision)?;
        if geometry.tag_name().name() == "plane" {
            return self.plane((collision, geometry), model, pose, (friction, restitution));
        }
        let shape = self.shape(geometry, false)?;
        let name = unique(&self.world, model);
        self.paint(collision, &name);
        self.world.objects.push(Object { friction, restitution, ..fixed(name, shape, pose) });
        Ok(())
    }

    /// Rejects a moving link that is kinematic or without gravity.
    fn check_motion(&self, node: Node<'_, '_>, moves: bool) -> Result<(), WorldFileError> {
        let name = node.tag_name().name();
        if moves && self.boolean(node)? != (name == "gravity") {
            let message = format!(
                "<{name}> is \"{}\": moving objects are free and subject to gravity; make its model <static>",
                text(node).trim()
            );
            return Err(problem(self.path, node, message));
        }
        Ok(())
    }

    /// Accepts, warns about or rejects an unread element.
    fn leave_out(&mut self, section: &'static str, node: Node<'_, '_>) -> Result<(), WorldFileError> {
        let name = node.tag_name().name();
        if schema::has_no_effect(node) {
            return Ok(());
        }
        match treatment(section, name) {
            Some(Treatment::NoEffect) => Ok(()),
            Some(Treatment::Ignored(reason)) => {
                self.ignore(node, &format!("<{name}> of <{section}>"), reason);
                Ok(())
            }
            Some(Treatment::Refused(reason)) => {
                Err(problem(self.path, node, format!("<{name}> of <{section}> is not supported: {reason}")))
            }
            None => Err(self.unsupported(node)),
        }
    }

    /// Warns about an ignored element, once per file.
    fn ignore(&mut self, node: Node<'_, '_>, element: &str, because: &'static str) {
        self.ignore_at(position(node), element, because);
    }

    fn ignore_at(&mut self, at: Position, element: &str, because: &'static str) {
        for warning in self.warnings.get_mut() {
            if let ModelWarning::Ignored { what, count, .. } = warning
                && what == element
            {
                *count += 1;
                return;
            }
        }
        let what = element.to_owned();
        self.warnings.get_mut().push(ModelWarning::Ignored { what, at, count: 1, reason: because });
    }

    /// Warns if surfaces differ in their restitution, because simulators combine restitutions by different
    /// rules.
    fn warn_of_bounces(&mut self) {
        let objects = self.world.objects.iter().map(|object| object.restitution);
        let mut all = self.world.ground.iter().map(|ground| ground.restitution).chain(objects);
        let first = all.next();
        if let Some(at) = self.first_bounce
            && all.any(|other| Some(other) != first)
        {
            let reason = "a contact uses the mean of both surfaces' restitutions";
            self.ignore_at(at, "Gazebo's rule for different <restitution_coefficient>s", reason);
        }
    }
}
