//! Driven wheels of a robot: pairs of coaxial round bodies at its lowest point.

use std::fmt::Write as _;

use nalgebra::{Isometry3, Point3, Vector3};

use super::stance::{Corner, corners};
use super::text::{quoted, strings};
use crate::model::configuration::with_joints;
use crate::{
    Attachment, BasePose, CollisionModel, CollisionOptions, FrameId, JointKind, Kinematics, MeshMode, Model,
};

/// Smallest range of a joint that turns a wheel, rad.
const TURNS: f64 = 4.0 * core::f64::consts::PI;
/// Smallest component of a wheel's axis to the left.
const ACROSS: f64 = 0.99;
/// Largest difference between the height and the length of a wheel, as a fraction of its radius.
const ROUND: f64 = 0.05;
/// Largest difference between the dimensions of two wheels of a pair, m.
const ALIKE: f64 = 1e-3;
/// Maximum depth of another part below the wheels, m.
const BELOW: f64 = 5e-3;

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
        let lowest = (0..model.bodies().len())
            .map(|body| (Attachment::Body(body), kinematics.body_pose(body)))
            .chain([(Attachment::Base, base), (Attachment::World, Isometry3::identity())])
            .flat_map(|(attachment, pose)| placed(&solids, attachment, pose))
            .map(|(point, radius)| point.z - radius)
            .fold(f64::INFINITY, f64::min);
        let name = |wheel: &Wheel| model.joint_names()[wheel.joint].clone();
        (pairs.iter().all(alike) && lowest > ground - BELOW).then(|| Self {
            joints: pairs.iter().flatten().map(name).collect(),
            radius: first.radius,
            track: 2.0 * first.centre.y,
            height: base.translation.z - ground,
        })
    }

    /// Writes the table of the profile: as a comment if the base is fixed.
    pub(super) fn text(&self, model: &Model) -> String {
        let mut table =
            format!("[mobile_base]\ndrive = \"differential\"\nframe = {}\n", quoted(&model.frames()[0].name));
        table += &strings("wheels", &self.joints);
        let metres = |value: f64| (value * 1e6).round() / 1e6;
        let _ = writeln!(table, "wheel_radius = {:?}", metres(self.radius));
        let _ = writeln!(table, "track = {:?}", metres(self.track));
        let base = Isometry3::translation(0.0, 0.0, metres(self.height));
        let BasePose { position, rpy } = BasePose::from_isometry(&base);
        let _ = writeln!(table, "\n[base_poses]\nhome = {{ position = {position:?}, rpy = {rpy:?} }}");
        if model.base().floating {
            return format!("\n# Wheels of equal size on one axle.\n{table}");
        }
        let lines = table.lines().map(|line| format!("# {line}").trim_end().to_owned() + "\n");
        "\n# Wheels of equal size on one axle. To drive them with control.wheels, uncomment these lines, and add\n# base = \"floating\" above `joints`.\n"
            .to_owned()
            + &lines.collect::<String>()
    }
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
    for (point, radius) in placed(solids, Attachment::Body(body), pose) {
        least = least.inf(&point.coords.add_scalar(-radius));
        most = most.sup(&point.coords.add_scalar(radius));
    }
    let half = 0.5 * (most - least);
    let is_round = half.z.is_finite() && (half.x - half.z).abs() < ROUND * half.z;
    (across.abs() > ACROSS && is_round).then(|| Wheel { joint, centre: 0.5 * (most + least), radius: half.z })
}

/// Returns the corners of the solids of a part, placed at `pose`.
fn placed(
    solids: &CollisionModel,
    attachment: Attachment,
    pose: Isometry3<f64>,
) -> impl Iterator<Item = Corner> + use<> {
    corners(solids, attachment)
        .into_iter()
        .map(move |(point, radius): (Point3<f64>, f64)| (pose * point, radius))
}
