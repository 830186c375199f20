//! The body tree.

use std::collections::{BTreeMap, HashSet};

use nalgebra::{Isometry3, Translation3, Vector3};
use roxmltree::Node;

use super::attributes::{Attributes, Element, MAIN, named};
use super::compiler::FromGeoms;
use super::error::{MjcfError, MjcfProblem};
use super::geoms::Geoms;
use super::masks::Masks;
use super::pose::{between, pose};
use super::schema::{BODY, FRAME, FREEJOINT, JOINT, SITE};
use crate::{Base, Body, Colour, Frame, Inertia, Shape, Srdf};

/// Maximum nesting depth of bodies and frames. The limit exists because the reader is recursive, and may use
/// at most half of a thread's stack.
pub const DEEPEST: usize = 150;

/// The context of an element.
#[derive(Clone, Copy)]
pub(crate) struct Place<'a> {
    /// Carrying body; `None` for the world or a floating base.
    pub(crate) carrier: Option<usize>,
    /// The element belongs to the world.
    pub(crate) world: bool,
    /// Frame of the surrounding element in that body.
    pub(crate) within: Isometry3<f64>,
    /// The default class.
    pub(crate) class: &'a str,
    /// The element is in the world itself, not in one of its bodies.
    pub(crate) top: bool,
    /// Frame index of the surrounding body; 0 for the world.
    pub(crate) frame: usize,
}

/// A joint whose spring and damping follow from a time constant and a damping ratio.
pub(crate) struct SpringDamper<'a, 'i> {
    /// The body it moves.
    pub(crate) body: usize,
    /// \[s\]
    pub(crate) time_constant: f64,
    pub(crate) ratio: f64,
    pub(crate) node: Node<'a, 'i>,
}

pub(crate) struct Tree<'b, 'a, 'i> {
    pub(crate) geoms: &'b Geoms<'b, 'a, 'i>,
    pub(crate) base: Base,
    pub(crate) bodies: Vec<Body>,
    pub(crate) frames: Vec<Frame>,
    /// Position of each body's joint in the pose of the file.
    pub(crate) references: Vec<f64>,
    pub(crate) spring_dampers: Vec<SpringDamper<'a, 'i>>,
    pub(crate) masks: Masks,
    /// Colours of the shapes of each link, in their order.
    pub(crate) colours: BTreeMap<String, Vec<Option<Colour>>>,
    /// Mass of immovable bodies, required by `settotalmass` \[kg\].
    pub(crate) static_mass: f64,
    /// Sites, which become frames if no body has their name.
    sites: Vec<(Node<'a, 'i>, Frame)>,
}

impl<'b, 'a, 'i> Tree<'b, 'a, 'i> {
    pub(crate) fn new(geoms: &'b Geoms<'b, 'a, 'i>) -> Self {
        let base = Base {
            floating: false,
            neutral: Isometry3::identity(),
            inertia: Inertia::zero(),
            shapes: Vec::new(),
            world_shapes: Vec::new(),
        };
        let world = Frame {
            name: "world".to_owned(),
            body: None,
            in_world: false,
            placement: Isometry3::identity(),
            parent: None,
            inertia: Inertia::zero(),
        };
        Self {
            geoms,
            base,
            bodies: Vec::new(),
            frames: vec![world],
            references: Vec::new(),
            spring_dampers: Vec::new(),
            masks: Masks::default(),
            colours: BTreeMap::new(),
            static_mass: 0.0,
            sites: Vec::new(),
        }
    }

    pub(crate) fn attributes(&self) -> &'b Attributes<'a, 'i> {
        self.geoms.attributes
    }

    /// Reads the contents of a body, a frame or the world; returns the inertia of its geoms in the carrier's
    /// frame.
    pub(crate) fn contents(
        &mut self,
        node: Node<'a, 'i>,
        place: &Place<'a>,
    ) -> Result<Result<Inertia, MjcfError>, MjcfError> {
        let attributes = self.attributes();
        if node.ancestors().nth(DEEPEST).is_some() {
            let problem = format!("more than {DEEPEST} nested bodies and frames are not supported");
            return Err(attributes.error(node, MjcfProblem::Other(problem)));
        }
        let mut whole: Result<Inertia, MjcfError> = Ok(Inertia::zero());
        for element in node.children().filter(Node::is_element) {
            match element.tag_name().name() {
                "body" => self.body(element, place)?,
                "frame" => {
                    let frame = attributes.element(element, MAIN, &FRAME)?;
                    let within = place.within * pose(&frame, self.geoms.compiler)?;
                    let class = element.attribute("childclass").unwrap_or(place.class);
                    attributes.known_class(element, class)?;
                    let inside = self.contents(element, &Place { within, class, ..*place })?;
                    whole = whole.and_then(|whole| Ok(whole.merged(&inside?)));
                }
                "geom" => {
                    let geom = self.geoms.read(element, place.class, place.world)?;
                    if geom.kept {
                        let link = self.owner(node);
                        self.masks.add(&link, geom.masks);
                        self.colours.entry(link.clone()).or_default().push(geom.colour);
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
                    let site = attributes.element(element, place.class, &SITE)?;
                    let placement = match between(&site)? {
                        Some((placement, _)) => placement,
                        None => pose(&site, self.geoms.compiler)?,
                    };
                    if let Some(name) = element.attribute("name") {
                        let (body, in_world) = (place.carrier, place.world && self.base.floating);
                        let frame = Frame {
                            name: name.to_owned(),
                            body,
                            in_world,
                            placement: place.within * placement,
                            parent: Some(place.frame),
                            inertia: Inertia::zero(),
                        };
                        self.sites.push((element, frame));
                    }
                }
                // read together with their body
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

    /// Returns the name of the body that contains an element.
    fn owner(&self, node: Node<'a, 'i>) -> String {
        let body = node.ancestors().find(|node| node.has_tag_name("body"));
        body.map_or_else(|| "world".to_owned(), |body| body_name(body))
    }

    fn body(&mut self, node: Node<'a, 'i>, around: &Place<'a>) -> Result<(), MjcfError> {
        let attributes = self.attributes();
        let body = attributes.element(node, MAIN, &BODY)?;
        let name = body_name(node);
        let class = node.attribute("childclass").unwrap_or(around.class);
        attributes.known_class(node, class)?;
        let mut placement = around.within * pose(&body, self.geoms.compiler)?;
        let (mut carrier, mut world) = (around.carrier, around.world);
        let joints: Vec<_> = node
            .children()
            .filter(|child| child.has_tag_name("joint") || child.has_tag_name("freejoint"))
            .collect();
        let joints: Vec<_> = joints
            .into_iter()
            .map(|joint| match joint.has_tag_name("freejoint") {
                true => attributes.element(joint, MAIN, &FREEJOINT),
                false => attributes.element(joint, class, &JOINT),
            })
            .collect::<Result<_, _>>()?;
        if let [joint] = &joints[..]
            && (joint.node.has_tag_name("freejoint") || joint.get("type") == Some("free"))
        {
            self.float(node, joint, around, placement)?;
            (carrier, world, placement) = (None, false, Isometry3::identity());
        } else if !joints.is_empty() {
            if world && self.base.floating {
                return Err(self.two_robots(node));
            }
            world = false;
            for (index, joint) in joints.iter().enumerate() {
                let last = index + 1 == joints.len();
                let anchor = Vector3::from(joint.numbers::<3>("pos")?.unwrap_or_default());
                placement *= Translation3::from(anchor);
                let built = self.joint(joint, placement)?;
                let name = if last { name.clone() } else { format!("{name}/{}", built.name) };
                let (inertia, shapes) = (Inertia::zero(), Vec::new());
                self.bodies.push(Body { name, joint: built, parent: carrier, inertia, shapes });
                carrier = Some(self.bodies.len() - 1);
                placement = Isometry3::from(Translation3::from(-anchor));
            }
        }
        let in_world = world && self.base.floating;
        let (frame, parent, none) = (self.frames.len(), Some(around.frame), Inertia::zero());
        self.frames.push(Frame { name, body: carrier, in_world, placement, parent, inertia: none });
        let inside = Place { carrier, world, within: placement, class, top: false, frame };
        let of_geoms = self.contents(node, &inside)?;
        let mut inertials = node.children().filter(|child| child.has_tag_name("inertial"));
        let stated = inertials.next().map(|inertial| self.inertial(inertial)).transpose()?;
        if let Some(second) = inertials.next() {
            let problem = "a body has one <inertial>".to_owned();
            return Err(attributes.error(second, MjcfProblem::Other(problem)));
        }
        let stated = stated.map(|inertia| inertia.moved(&placement));
        let inertia = match (self.geoms.compiler.from_geoms, stated) {
            (FromGeoms::Never | FromGeoms::Missing, Some(inertia)) => inertia,
            (FromGeoms::Never, None) => Inertia::zero(),
            // Static bodies need none.
            _ if world && self.geoms.compiler.total_mass.is_none() => Inertia::zero(),
            (FromGeoms::Always, Some(inertia)) => {
                let of_geoms = of_geoms?;
                if of_geoms.mass > 0.0 { of_geoms } else { inertia }
            }
            _ => of_geoms?,
        };
        self.frames[frame].inertia = inertia.moved(&placement.inverse());
        let whole = match carrier {
            Some(carrier) => &mut self.bodies[carrier].inertia,
            None if world => {
                self.static_mass += inertia.mass;
                return Ok(());
            }
            None => &mut self.base.inertia,
        };
        *whole = whole.merged(&inertia);
        Ok(())
    }

    fn two_robots(&self, node: Node<'_, '_>) -> MjcfError {
        let problem = "next to a body with a free joint, no other body may move in the world: load the robots separately";
        self.attributes().error(node, MjcfProblem::Other(problem.to_owned()))
    }

    /// Makes the body of a free joint the base; surrounding elements belong to the world.
    fn float(
        &mut self,
        node: Node<'a, 'i>,
        joint: &Element<'_, 'a, 'i>,
        around: &Place<'a>,
        placement: Isometry3<f64>,
    ) -> Result<(), MjcfError> {
        self.check_free(node, joint)?;
        if self.base.floating || !self.bodies.is_empty() {
            return Err(self.two_robots(node));
        }
        if !around.top {
            return Err(joint.fault("only a body of the world can have a free joint"));
        }
        let sites = self.sites.iter_mut().map(|(_, frame)| frame);
        self.frames.iter_mut().chain(sites).for_each(|frame| frame.in_world = true);
        self.base.world_shapes = std::mem::take(&mut self.base.shapes);
        self.base.inertia = Inertia::zero();
        (self.base.floating, self.base.neutral) = (true, placement);
        Ok(())
    }

    /// Duplicate names of bodies, joints or sites are errors; a site with the name of a body is skipped.
    pub(crate) fn check_names(
        &mut self,
        attributes: &Attributes<'a, 'i>,
        root: Node<'a, 'i>,
    ) -> Result<(), MjcfError> {
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
        duplicate("site", self.sites.iter().map(|(_, frame)| &*frame.name).collect())?;
        duplicate("joint", self.bodies.iter().map(|body| &*body.joint.name).collect())?;
        let bodies = self.frames.len();
        for (node, frame) in self.sites.drain(..) {
            if self.frames[..bodies].iter().any(|body| body.name == frame.name) {
                attributes.ignored(node, format!("site \"{}\"", frame.name), "a body has this name");
            } else {
                self.frames.push(frame);
            }
        }
        Ok(())
    }

    pub(crate) fn check_exclusions(
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

/// Returns the name of a body. The name of an unnamed body is derived from its index in the file.
pub fn body_name(node: Node<'_, '_>) -> String {
    node.attribute("name").map_or_else(
        || {
            let before = node.document().descendants().take_while(|other| *other != node);
            format!("body{}", before.filter(|other| other.has_tag_name("body")).count() + 1)
        },
        str::to_owned,
    )
}
