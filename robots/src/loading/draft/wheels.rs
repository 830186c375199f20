//! Driven wheels of a robot, pairs of coaxial round bodies at its lowest point, and the casters beside them.

use std::fmt::Write as _;

use nalgebra::{Isometry3, Point3, Vector3};

use super::stance::{Corner, solid_corners};
use super::text::{base_pose, key, micrometres, quoted, strings};
use crate::loading::end_effector::tip_joints;
use crate::model::configuration::with_joints;
use crate::{Attachment, CollisionModel, CollisionOptions, FrameId, JointKind, Kinematics, MeshMode, Model};

/// Smallest range of a joint that turns a wheel, rad.
const TURNS: f64 = 4.0 * core::f64::consts::PI;
/// Smallest component of a wheel's axis to the left.
const ACROSS: f64 = 0.99;
/// Largest difference between the height and the length of a wheel, as a fraction of its radius.
const ROUND: f64 = 0.05;
/// Largest difference between the dimensions of two wheels of a pair, m.
const ALIKE: f64 = 1e-3;
/// Largest height of the lowest point of a caster above or below the wheels', m.
const LEVEL: f64 = 5e-3;
/// Maximum number of joints between the base and a caster: its swivel and its wheel.
const CASTER_JOINTS: usize = 2;

/// The wheels of a differential drive.
pub(super) struct Wheels {
    /// Joints, left before right.
    joints: Vec<String>,
    /// Radius, m.
    radius: f64,
    /// Distance between left and right, m.
    track: f64,
    /// Height of the base's origin above the ground, m.
    height: f64,
    casters: Vec<Caster>,
}

/// A link that touches the ground beside the wheels.
struct Caster {
    link: String,
    /// Joints that move it, starting at the base.
    joints: Vec<String>,
    /// Height of the link's origin above the ground, m.
    height: f64,
}

/// A wheel at its place below the base, m.
#[derive(Clone, Copy)]
struct Wheel {
    joint: usize,
    centre: Vector3<f64>,
    radius: f64,
}

impl Wheels {
    /// Finds the wheels of `model`. Returns `None` without a pair of equal wheels on one axle, if pairs
    /// differ, or if another part is below them.
    pub(super) fn find(model: &Model) -> Option<Self> {
        let options = CollisionOptions {
            meshes: MeshMode::Outermost,
            leave_out_defects: true,
            ..CollisionOptions::default()
        };
        let solids = CollisionModel::new(model, &options).ok()?;
        let mut kinematics = Kinematics::new(model);
        kinematics.update(model, &with_joints(model, &vec![0.0; model.joint_count()]));
        let base = kinematics.pose(model, FrameId(0));
        let wheels = (0..model.joint_count()).filter_map(|joint| wheel(model, &solids, &kinematics, joint));
        let wheels: Vec<Wheel> = wheels.collect();
        let pairs: Vec<[Wheel; 2]> = wheels
            .iter()
            .filter(|left| left.centre.y > 0.0)
            .filter_map(|left| {
                let right = wheels.iter().find(|right| {
                    let mirrored = left.centre.component_mul(&Vector3::new(1.0, -1.0, 1.0));
                    (right.centre - mirrored).amax() < ALIKE && (right.radius - left.radius).abs() < ALIKE
                })?;
                Some([*left, *right])
            })
            .collect();
        let [first, _] = *pairs.first()?;
        let alike = |[left, _]: &[Wheel; 2]| {
            (left.centre.y - first.centre.y).abs() < ALIKE && (left.radius - first.radius).abs() < ALIKE
        };
        let ground = first.centre.z - first.radius;
        let driven: Vec<usize> = pairs.iter().flatten().map(|wheel| model.joint_body(wheel.joint)).collect();
        let others = lowest_points(model, &solids, &kinematics, &driven);
        let is_above = others.iter().all(|(_, lowest)| *lowest > ground - LEVEL);
        let name = |wheel: &Wheel| model.joint_names()[wheel.joint].clone();
        (pairs.iter().all(alike) && is_above).then(|| Self {
            joints: pairs.iter().flatten().map(name).collect(),
            radius: first.radius,
            track: 2.0 * first.centre.y,
            height: base.translation.z - ground,
            casters: others
                .iter()
                .filter(|(_, lowest)| *lowest < ground + LEVEL)
                .filter_map(|(link, _)| Caster::new(model, &kinematics, link, ground))
                .collect(),
        })
    }

    /// Returns each wheel's joint with the inertia of the wheel's share of the robot's mass about the axle,
    /// kg m^2.
    pub(super) fn carried(&self, model: &Model) -> impl Iterator<Item = (usize, f64)> {
        let inertia = model.total_mass() * self.radius.powi(2) / self.joints.len() as f64;
        self.joints.iter().filter_map(|joint| model.joint_index(joint)).map(move |joint| (joint, inertia))
    }

    /// Writes the tables of the profile: as a comment if the base is fixed.
    pub(super) fn text(&self, model: &Model) -> String {
        let mut table =
            format!("[mobile_base]\ndrive = \"differential\"\nframe = {}\n", quoted(&model.frames()[0].name));
        table += &strings("wheels", &self.joints);
        let _ = writeln!(table, "wheel_radius = {:?}", micrometres(self.radius));
        let _ = writeln!(table, "track = {:?}", micrometres(self.track));
        table += "\n[base_poses]\n";
        table += &base_pose("home", &Isometry3::translation(0.0, 0.0, self.height));
        for (index, caster) in self.casters.iter().enumerate() {
            table.push('\n');
            if index == 0 {
                table += "# Other links that reach the ground: casters, which roll in every direction and so have no friction.\n";
            }
            table += &caster.text();
        }
        if model.base().floating {
            return format!("\n# Wheels of equal size on one axle.\n{table}");
        }
        let lines = table.lines().map(|line| format!("# {line}").trim_end().to_owned() + "\n");
        "\n# Wheels of equal size on one axle. To drive them with control.wheels, uncomment these lines, and add\n# base = \"floating\" above `joints`.\n"
            .to_owned()
            + &lines.collect::<String>()
    }
}

impl Caster {
    /// Returns `None` for a link beyond more joints than a caster has.
    fn new(model: &Model, kinematics: &Kinematics, link: &str, ground: f64) -> Option<Self> {
        let frame = model.frame(link).ok()?;
        let (joints, _) = tip_joints(model, frame);
        let height = kinematics.pose(model, frame).translation.z - ground;
        (joints.len() <= CASTER_JOINTS).then(|| Self { link: link.to_owned(), joints, height })
    }

    fn text(&self) -> String {
        let mut text = format!("[feet.{}]\nframe = {}\n", key(&self.link), quoted(&self.link));
        if !self.joints.is_empty() {
            text += &strings("joints", &self.joints);
        }
        if self.height > LEVEL {
            let _ = writeln!(text, "radius = {:?}", micrometres(self.height));
        }
        text += "friction = 0.0\n";
        text
    }
}

/// Returns the links that have shapes, without the links of the bodies `except`, and the height of the lowest
/// point of each in the world, m.
fn lowest_points(
    model: &Model,
    solids: &CollisionModel,
    kinematics: &Kinematics,
    except: &[usize],
) -> Vec<(String, f64)> {
    let mut found: Vec<(String, f64)> = Vec::new();
    for solid in 0..solids.solid_count() {
        let pose = match solids.attachment(solid) {
            Attachment::World => Isometry3::identity(),
            Attachment::Base => kinematics.pose(model, FrameId(0)),
            Attachment::Body(body) if except.contains(&body) => continue,
            Attachment::Body(body) => kinematics.body_pose(body),
        };
        let heights = placed(solids, solid, pose).map(|(point, radius)| point.z - radius);
        let lowest = heights.fold(f64::INFINITY, f64::min);
        match found.iter_mut().find(|(link, _)| link == solids.link(solid)) {
            Some((_, height)) => *height = height.min(lowest),
            None => found.push((solids.link(solid).to_owned(), lowest)),
        }
    }
    found
}

/// Returns the wheel that a joint turns, if its body is round, turns endlessly about a lateral axis, and
/// carries nothing.
fn wheel(model: &Model, solids: &CollisionModel, kinematics: &Kinematics, joint: usize) -> Option<Wheel> {
    let (body, turned) = (model.joint_body(joint), model.joint(joint));
    let carries = model.bodies().iter().any(|other| other.parent == Some(body));
    let turns = model.upper()[joint] - model.lower()[joint] > TURNS;
    if turned.kind == JointKind::Prismatic || carries || !turns || model.bodies()[body].parent.is_some() {
        return None;
    }
    let pose = kinematics.body_pose(body);
    let across = (pose.rotation * turned.axis.into_inner()).y;
    let [mut least, mut most] = [f64::INFINITY, f64::NEG_INFINITY].map(Vector3::repeat);
    let own = (0..solids.solid_count()).filter(|&solid| solids.attachment(solid) == Attachment::Body(body));
    for (point, radius) in own.flat_map(|solid| placed(solids, solid, pose)) {
        least = least.inf(&point.coords.add_scalar(-radius));
        most = most.sup(&point.coords.add_scalar(radius));
    }
    let half = 0.5 * (most - least);
    let is_round = half.z.is_finite() && (half.x - half.z).abs() < ROUND * half.z;
    (across.abs() > ACROSS && is_round).then(|| Wheel { joint, centre: 0.5 * (most + least), radius: half.z })
}

/// Returns the corners of a solid whose frame is at `pose`.
fn placed(
    solids: &CollisionModel,
    solid: usize,
    pose: Isometry3<f64>,
) -> impl Iterator<Item = Corner> + use<> {
    let corners = solid_corners(solids, solid).into_iter();
    corners.map(move |(point, radius): (Point3<f64>, f64)| (pose * point, radius))
}
