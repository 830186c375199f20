//! Conversion of a file into a model; sections are read in the order of their dependencies.

use std::path::Path;

use nalgebra::{DMatrix, Isometry3};
use roxmltree::Node;

use super::attributes::{Attributes, MAIN};
use super::bodies::{Place, SpringDamper, Tree};
use super::compiler::Compiler;
use super::document::parse_document;
use super::drives::{self, Drives};
use super::error::{MjcfError, MjcfProblem};
use super::geoms::Geoms;
use super::robot::MjcfRobot;
use super::sections::{check_options, read_assets, read_exclusions};
use super::{actuators, equality, keyframes};
use crate::formats::options::{BaseMode, LoadOptions};
use crate::{Base, Body, Coordinate, Dynamics, Frame, LinkColours, Model, Srdf};

/// Sections without effect on a model.
const SKIPPED: [&str; 5] = ["size", "visual", "statistic", "custom", "sensor"];

pub(crate) fn build(text: &str, file: Option<&Path>, options: &LoadOptions) -> Result<MjcfRobot, MjcfError> {
    let document = parse_document(text)?;
    let attributes = Attributes::new(&document)?;
    let root = document.root_element();
    if !root.has_tag_name("mujoco") {
        return Err(attributes.error(root, MjcfProblem::Root(root.tag_name().name().to_owned())));
    }
    let compiler = Compiler::read(root, &attributes)?;
    let mut geoms = Geoms::new(&attributes, &compiler, options.shapes);
    let mut exclusions = Srdf::default();
    for section in root.children().filter(Node::is_element) {
        match section.tag_name().name() {
            "asset" => read_assets(section, &mut geoms, file)?,
            "contact" => read_exclusions(section, &attributes, &mut exclusions)?,
            "option" => check_options(section, &attributes)?,
            "tendon" => actuators::check_tendons(section, &attributes)?,
            "compiler" | "default" | "worldbody" | "equality" | "actuator" | "keyframe" => {}
            name if SKIPPED.contains(&name) => {}
            name => return Err(attributes.error(section, MjcfProblem::Element(name.to_owned()))),
        }
    }
    let sections = |name: &'static str| root.children().filter(move |section| section.has_tag_name(name));
    let mut tree = Tree::new(&geoms);
    let within = Isometry3::identity();
    let place = Place { carrier: None, world: true, within, class: MAIN, top: true, frame: 0 };
    for section in sections("worldbody") {
        // Geoms of the world have no mass.
        drop(tree.contents(section, &place)?);
    }
    if options.base == BaseMode::Floating && !tree.base.floating {
        let problem = "no body of this file floats; add a <freejoint/> to the base".to_owned();
        return Err(attributes.error(root, MjcfProblem::Other(problem)));
    }
    tree.check_names(&attributes, root)?;
    if let Some(total) = compiler.total_mass {
        tree.scale_to(total);
    }
    let mut drives = Drives::default();
    for section in sections("actuator") {
        actuators::read_actuators(section, &attributes, &mut tree.bodies, &mut drives)?;
    }
    tree.check_exclusions(&attributes, root, &exclusions)?;
    tree.masks.exclude(&attributes, root, &mut exclusions);
    let name = root.attribute("model").unwrap_or("MuJoCo Model").to_owned();
    let Tree { base, mut bodies, frames, references, spring_dampers, colours, .. } = tree;
    damp(&name, &base, &mut bodies, &references, &spring_dampers)
        .map_err(|node| attributes.refused(node, "springdamper", "", "the mass matrix is singular"))?;
    for section in sections("equality") {
        equality::couple(section, &attributes, &mut bodies, &references, options.mimic)?;
    }
    number_joints(&mut bodies);
    let mut keyframes = Vec::new();
    for section in sections("keyframe") {
        keyframes::read_keyframes(section, &attributes, (&base, &bodies), &mut keyframes)?;
    }
    let mut warnings = attributes.warnings();
    for body in &bodies {
        crate::formats::urdf::check_inertia(&body.name, &body.inertia, &mut warnings);
    }
    crate::formats::urdf::warn_of_massless_ends(&bodies, &mut warnings);
    let shapes = base.shapes.iter().chain(bodies.iter().flat_map(|body| &body.shapes));
    geoms.warn_of_missing_meshes(shapes, &mut warnings);
    let model = Model::new(name, base, bodies, frames);
    crate::formats::urdf::warn_of_model(&model, &mut warnings);
    let profile = drives::profile(&model, &references, keyframes, &drives);
    Ok(MjcfRobot { model, warnings, exclusions, profile, colours: LinkColours::of_shapes(colours) })
}

/// Sets the damping of joints with a `springdamper` from the time constant, and their stiffness from the
/// damping ratio. The inertia at each joint is evaluated in the pose of the file, with all joints free. Fails
/// with the joint's element if the mass matrix is singular.
fn damp<'a, 'i>(
    name: &str,
    base: &Base,
    bodies: &mut [Body],
    references: &[f64],
    spring_dampers: &[SpringDamper<'a, 'i>],
) -> Result<(), Node<'a, 'i>> {
    let Some(first) = spring_dampers.first() else { return Ok(()) };
    let mut independent = bodies.to_vec();
    number_joints(&mut independent);
    let frames: Vec<Frame> = Vec::new();
    let model = Model::new(name.to_owned(), base.clone(), independent, frames);
    let mut q = model.neutral();
    let own = q.len() - references.len();
    q[own..].copy_from_slice(references);
    let mut inverse = DMatrix::zeros(model.nv(), model.nv());
    Dynamics::new(&model).inverse_mass(&model, &q, &mut inverse).map_err(|_| first.node)?;
    let own = model.nv() - references.len();
    for spring in spring_dampers {
        let inertia = 1.0 / inverse[(own + spring.body, own + spring.body)];
        let (dynamics, rate) = (&mut bodies[spring.body].joint.dynamics, 1.0 / spring.time_constant);
        dynamics.damping = 2.0 * inertia * rate;
        dynamics.stiffness = inertia * (rate / spring.ratio).powi(2);
    }
    Ok(())
}

/// Numbers the independent joints 0, 1, 2 ... in the order of the bodies. Mimics refer to their master by its
/// body until here.
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

impl Tree<'_, '_, '_> {
    /// Scales all inertias such that the bodies, including static ones, have the total mass `total`.
    fn scale_to(&mut self, total: f64) {
        let inertias = || self.bodies.iter().map(|body| &body.inertia).chain([&self.base.inertia]);
        let scale = total / (self.static_mass + inertias().map(|inertia| inertia.mass).sum::<f64>());
        let links = self.frames.iter_mut().map(|frame| &mut frame.inertia);
        let whole = self.bodies.iter_mut().map(|body| &mut body.inertia).chain([&mut self.base.inertia]);
        for inertia in whole.chain(links) {
            *inertia = inertia.times(scale);
        }
    }
}
