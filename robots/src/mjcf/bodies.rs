//! The tree of bodies.

use std::collections::HashSet;
use std::path::Path;

use nalgebra::{Isometry3, Translation3, Vector3};
use roxmltree::{Document, Node, ParsingOptions};

use super::attributes::{Attributes, MAIN, named};
use super::compiler::{Compiler, FromGeoms};
use super::error::{MjcfError, MjcfProblem};
use super::geoms::Geoms;
use super::pose::pose;
use super::sections::{read_assets, read_exclusions};
use super::{MjcfRobot, equality};
use crate::load::{BaseMode, LoadOptions};
use crate::{Base, Body, Coordinate, Frame, Inertia, Model, ModelWarning, Position, Shape, Srdf};

/// Sections that no quantity here contains.
const SKIPPED: [&str; 9] =
    ["option", "size", "visual", "statistic", "custom", "sensor", "keyframe", "actuator", "tendon"];
pub(super) const POSES: [&str; 6] = ["pos", "quat", "axisangle", "xyaxes", "zaxis", "euler"];

pub(super) fn build(text: &str, file: Option<&Path>, options: &LoadOptions) -> Result<MjcfRobot, MjcfError> {
    let document =
        Document::parse_with_options(text, ParsingOptions { allow_dtd: true, ..Default::default() })
            .map_err(|error| {
                let at = error.pos();
                let message = error.to_string().replace(&format!(" at {at}"), "");
                let at = Position { line: at.row, column: at.col };
                MjcfError { file: None, at, problem: Box::new(MjcfProblem::Xml(message)) }
            })?;
    let attributes = Attributes::new(&document)?;
    let root = document.root_element();
    if !root.has_tag_name("mujoco") {
        return Err(attributes.error(root, MjcfProblem::Root(root.tag_name().name().to_owned())));
    }
    let compiler = Compiler::read(root, &attributes)?;
    let mut geoms = Geoms { attributes: &attributes, compiler: &compiler, meshes: Default::default() };
    let mut exclusions = Srdf::default();
    for section in root.children().filter(Node::is_element) {
        match section.tag_name().name() {
            "asset" => read_assets(section, &mut geoms, file)?,
            "contact" => read_exclusions(section, &attributes, &mut exclusions)?,
            "compiler" | "default" | "worldbody" | "equality" => {}
            name if SKIPPED.contains(&name) => {}
            name => return Err(attributes.error(section, MjcfProblem::Element(name.to_owned()))),
        }
    }
    let fixed = Base {
        floating: false,
        neutral: Isometry3::identity(),
        inertia: Inertia::zero(),
        shapes: Vec::new(),
        world_shapes: Vec::new(),
    };
    let world =
        Frame { name: "world".to_owned(), body: None, in_world: false, placement: Isometry3::identity() };
    let mut tree = Tree {
        geoms: &geoms,
        base: fixed,
        bodies: Vec::new(),
        frames: vec![world],
        references: Vec::new(),
        warnings: Vec::new(),
    };
    let place = Place { carrier: None, world: true, within: Isometry3::identity(), class: MAIN, top: true };
    for section in root.children().filter(|section| section.has_tag_name("worldbody")) {
        // What stands in the world weighs nothing.
        drop(tree.contents(section, &place)?);
    }
    if options.base == BaseMode::Floating && !tree.base.floating {
        let problem = "nothing floats in this file; give the body that should a <freejoint/>".to_owned();
        return Err(attributes.error(root, MjcfProblem::Other(problem)));
    }
    tree.check_names(&attributes, root)?;
    for section in root.children().filter(|section| section.has_tag_name("equality")) {
        equality::couple(section, &attributes, &mut tree.bodies, &tree.references, options.mimic)?;
    }
    tree.check_exclusions(&attributes, root, &exclusions)?;
    let name = root.attribute("model").unwrap_or("MuJoCo Model").to_owned();
    let Tree { mut base, mut bodies, frames, mut warnings, .. } = tree;
    if let Some(total) = compiler.total_mass {
        let inertias = || bodies.iter().map(|body| &body.inertia).chain([&base.inertia]);
        let scale = total / inertias().map(|inertia| inertia.mass).sum::<f64>();
        for inertia in bodies.iter_mut().map(|body| &mut body.inertia).chain([&mut base.inertia]) {
            inertia.mass *= scale;
            inertia.rotational *= scale;
        }
    }
    number_joints(&mut bodies);
    for body in &bodies {
        crate::urdf::check_inertia(&body.name, &body.inertia, &mut warnings);
    }
    crate::urdf::warn_of_massless_ends(&bodies, &mut warnings);
    Ok(MjcfRobot { model: Model::new(name, base, bodies, frames), warnings, exclusions })
}

/// Independent joints count 0, 1, 2 ... in the order of the bodies; mimics name their master by its body until here.
fn number_joints(bodies: &mut [Body]) {
    let mut next = 0;
    let columns: Vec<usize> = bodies
        .iter()
        .map(|body| {
            let independent = matches!(body.joint.coordinate, Coordinate::Independent(_));
            next += usize::from(independent);
            next - usize::from(independent)
        })
        .collect();
    for (body, &column) in bodies.iter_mut().zip(&columns) {
        match &mut body.joint.coordinate {
            Coordinate::Independent(index) => *index = column,
            Coordinate::Mimic { of, .. } => *of = columns[*of],
        }
    }
}

/// Where elements stand.
#[derive(Clone, Copy)]
struct Place<'a> {
    /// Body they belong to; `None` for the world or a floating base.
    carrier: Option<usize>,
    /// It is the world.
    world: bool,
    /// The frame of the element around them, in that body's.
    within: Isometry3<f64>,
    /// Their default class.
    class: &'a str,
    /// In the world itself, not in a body of it: where free joints are.
    top: bool,
}

pub(super) struct Tree<'b, 'a, 'i> {
    pub(super) geoms: &'b Geoms<'b, 'a, 'i>,
    base: Base,
    pub(super) bodies: Vec<Body>,
    frames: Vec<Frame>,
    /// Position of each body's joint in the pose of the file.
    pub(super) references: Vec<f64>,
    warnings: Vec<ModelWarning>,
}

impl<'b, 'a, 'i> Tree<'b, 'a, 'i> {
    pub(super) fn attributes(&self) -> &'b Attributes<'a, 'i> {
        self.geoms.attributes
    }

    /// What stands in a body, a frame or the world; gives the inertia of its geoms, in the frame of the carrier.
    fn contents(
        &mut self,
        node: Node<'a, 'i>,
        place: &Place<'a>,
    ) -> Result<Result<Inertia, MjcfError>, MjcfError> {
        let attributes = self.attributes();
        let mut whole: Result<Inertia, MjcfError> = Ok(Inertia::zero());
        for element in node.children().filter(Node::is_element) {
            match element.tag_name().name() {
                "body" => self.body(element, place)?,
                "frame" => {
                    attributes.only(element, &[&["name", "childclass"], &POSES[..]].concat())?;
                    let within = place.within * pose(attributes, self.geoms.compiler, element, MAIN)?;
                    let class = element.attribute("childclass").unwrap_or(place.class);
                    attributes.known_class(element, class)?;
                    let inside = self.contents(element, &Place { within, class, ..*place })?;
                    whole = whole.and_then(|whole| Ok(whole.merged(&inside?)));
                }
                "geom" => {
                    let geom = self.geoms.read(element, place.class, place.world)?;
                    if geom.collides {
                        let link = self.owner(node);
                        let placement = place.within * geom.placement;
                        let shape = Shape { link, placement, geometry: geom.geometry };
                        match place.carrier {
                            Some(body) => self.bodies[body].shapes.push(shape),
                            None if place.world && self.base.floating => self.base.world_shapes.push(shape),
                            None => self.base.shapes.push(shape),
                        }
                    }
                    whole = whole.and_then(|whole| Ok(whole.merged(&geom.inertia?.moved(&place.within))));
                }
                "site" => {
                    let class = attributes.class_of(element, place.class)?;
                    if let Some(name) = element.attribute("name") {
                        let placement = place.within * pose(attributes, self.geoms.compiler, element, class)?;
                        self.add_frame(name, place, placement);
                    }
                }
                // Read with their body.
                "joint" | "freejoint" | "inertial" => {
                    if !node.has_tag_name("body") {
                        return Err(attributes.error(
                            element,
                            MjcfProblem::Element(format!(
                                "{}> of <{}",
                                element.tag_name().name(),
                                node.tag_name().name()
                            )),
                        ));
                    }
                }
                "camera" | "light" => {}
                name => return Err(attributes.error(element, MjcfProblem::Element(name.to_owned()))),
            }
        }
        Ok(whole)
    }

    /// Name of the body that an element is in.
    fn owner(&self, node: Node<'a, 'i>) -> String {
        let body = node.ancestors().find(|node| node.has_tag_name("body"));
        body.map_or_else(|| "world".to_owned(), |body| body_name(body))
    }

    fn add_frame(&mut self, name: &str, place: &Place<'a>, placement: Isometry3<f64>) {
        // A site may have the name of a body.
        if !self.frames.iter().any(|frame| frame.name == name) {
            let (body, in_world) = (place.carrier, place.world && self.base.floating);
            self.frames.push(Frame { name: name.to_owned(), body, in_world, placement });
        }
    }

    fn body(&mut self, node: Node<'a, 'i>, around: &Place<'a>) -> Result<(), MjcfError> {
        let attributes = self.attributes();
        attributes.only(
            node,
            &[&["name", "childclass", "mocap", "gravcomp", "user", "sleep"], &POSES[..]].concat(),
        )?;
        for (name, reason) in [("mocap", "a body moved from outside is no part of a robot"), ("gravcomp", "")]
        {
            if let Some(value) = node.attribute(name).filter(|value| !["false", "0"].contains(value)) {
                return Err(attributes.refused(node, name, value, reason));
            }
        }
        let name = body_name(node);
        let class = node.attribute("childclass").unwrap_or(around.class);
        attributes.known_class(node, class)?;
        let mut placement = around.within * pose(attributes, self.geoms.compiler, node, MAIN)?;
        let (mut carrier, mut world) = (around.carrier, around.world);
        let joints: Vec<_> = node
            .children()
            .filter(|child| child.has_tag_name("joint") || child.has_tag_name("freejoint"))
            .collect();
        let kind = |joint: Node<'a, 'i>| -> Result<&str, MjcfError> {
            if joint.has_tag_name("freejoint") {
                return Ok("free");
            }
            let class = attributes.class_of(joint, class)?;
            Ok(attributes.get(joint, class, "type").unwrap_or("hinge"))
        };
        if let [joint] = joints[..]
            && kind(joint)? == "free"
        {
            self.float(node, joint, around, placement)?;
            (carrier, world, placement) = (None, false, Isometry3::identity());
        } else if !joints.is_empty() {
            if world && self.base.floating {
                return Err(self.two_robots(node));
            }
            world = false;
            for (index, &joint) in joints.iter().enumerate() {
                let last = index + 1 == joints.len();
                let class = attributes.class_of(joint, class)?;
                let anchor = Vector3::from(attributes.numbers::<3>(joint, class, "pos")?.unwrap_or_default());
                placement *= Translation3::from(anchor);
                let built = self.joint(joint, kind(joint)?, class, placement)?;
                let name = if last { name.clone() } else { format!("{name}/{}", built.name) };
                let (inertia, shapes) = (Inertia::zero(), Vec::new());
                self.bodies.push(Body { name, joint: built, parent: carrier, inertia, shapes });
                carrier = Some(self.bodies.len() - 1);
                placement = Isometry3::from(Translation3::from(-anchor));
            }
        }
        let in_world = world && self.base.floating;
        self.frames.push(Frame { name, body: carrier, in_world, placement });
        let inside = Place { carrier, world, within: placement, class, top: false };
        let of_geoms = self.contents(node, &inside)?;
        let inertial = node.children().find(|child| child.has_tag_name("inertial"));
        let inertia = match (self.geoms.compiler.from_geoms, inertial) {
            (FromGeoms::Never | FromGeoms::Missing, Some(inertial)) => {
                self.inertial(inertial)?.moved(&placement)
            }
            (FromGeoms::Never, None) => Inertia::zero(),
            // What stands still needs none.
            _ if world => Inertia::zero(),
            _ => of_geoms?,
        };
        let whole = match carrier {
            Some(carrier) => &mut self.bodies[carrier].inertia,
            None if world => return Ok(()),
            None => &mut self.base.inertia,
        };
        *whole = whole.merged(&inertia);
        Ok(())
    }

    fn two_robots(&self, node: Node<'_, '_>) -> MjcfError {
        let problem =
            "beside a body with a free joint nothing else may move in the world: load the robots one by one";
        self.attributes().error(node, MjcfProblem::Other(problem.to_owned()))
    }

    /// A free joint: the body becomes the base, what stands around it belongs to the world.
    fn float(
        &mut self,
        node: Node<'a, 'i>,
        joint: Node<'a, 'i>,
        around: &Place<'a>,
        placement: Isometry3<f64>,
    ) -> Result<(), MjcfError> {
        if self.base.floating || !self.bodies.is_empty() {
            return Err(self.two_robots(node));
        }
        if !around.top {
            let problem = MjcfProblem::Other("a free joint belongs to a body of the world".to_owned());
            return Err(self.attributes().error(joint, problem));
        }
        self.frames.iter_mut().for_each(|frame| frame.in_world = true);
        self.base.world_shapes = std::mem::take(&mut self.base.shapes);
        self.base.inertia = Inertia::zero();
        (self.base.floating, self.base.neutral) = (true, placement);
        Ok(())
    }

    fn check_names(&self, attributes: &Attributes<'a, 'i>, root: Node<'a, 'i>) -> Result<(), MjcfError> {
        let duplicate = |what, names: Vec<&str>| {
            let mut seen = HashSet::new();
            match names.into_iter().find(|name| !seen.insert(*name)) {
                Some(name) => {
                    let at = root.descendants().filter(|node| node.attribute("name") == Some(name)).nth(1);
                    let name = name.to_owned();
                    Err(attributes.error(at.unwrap_or(root), MjcfProblem::Duplicate { what, name }))
                }
                None => Ok(()),
            }
        };
        duplicate("body", self.frames.iter().map(|frame| &*frame.name).collect())?;
        duplicate("joint", self.bodies.iter().map(|body| &*body.joint.name).collect())
    }

    fn check_exclusions(
        &self,
        attributes: &Attributes<'a, 'i>,
        root: Node<'a, 'i>,
        exclusions: &Srdf,
    ) -> Result<(), MjcfError> {
        let known = |name: &str| self.frames.iter().any(|frame| frame.name == name);
        match exclusions.links().into_iter().find(|name| !known(name)) {
            None => Ok(()),
            Some(name) => {
                let rule = root.descendants().find(|node| {
                    node.has_tag_name("exclude")
                        && [node.attribute("body1"), node.attribute("body2")].contains(&Some(name))
                });
                let at = rule.unwrap_or(root);
                let nearest = crate::nearest::nearest(name, self.frames.iter().map(|frame| &*frame.name))
                    .map(str::to_owned);
                let (element, name) = (named(at), name.to_owned());
                Err(attributes.error(at, MjcfProblem::Unknown { element, what: "body", name, nearest }))
            }
        }
    }
}

/// Bodies without a name get one from their place in the file.
fn body_name(node: Node<'_, '_>) -> String {
    node.attribute("name").map_or_else(
        || {
            let before = node.document().descendants().take_while(|other| *other != node);
            format!("body{}", before.filter(|other| other.has_tag_name("body")).count() + 1)
        },
        str::to_owned,
    )
}
