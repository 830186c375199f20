//! Standing posture of a legged robot: feet on level ground, centre of mass above them.

use std::fmt;

use nalgebra::{DMatrix, DVector, Isometry3, Point3, UnitQuaternion, Vector2, Vector3};

use super::home::neutral;
use super::limbs::Limb;
use crate::model::configuration::with_joints;
use crate::{
    Attachment, CollisionModel, CollisionOptions, ConvexShape, Dynamics, FrameId, JointKind, Kinematics,
    Loaded, MeshMode, Model, Reference, convex_corners,
};

/// Prefixes of SRDF state names in which a legged robot stands, the best first.
const STANDING: [&str; 6] = ["standing", "half_sitting", "homing", "default", "home", "neutral"];
/// Heights of the hip to try, as fractions of the length of a straight leg: for balls, then for soles.
const HEIGHTS: [[f64; 4]; 2] = [[0.8, 0.7, 0.9, 0.6], [0.95, 0.9, 0.85, 0.75]];
/// Initial deflections of hip, knee and ankle in a search, rad.
const BENT: [f64; 3] = [-0.5, 1.0, -0.5];
/// Fraction of a joint's range kept free at either end.
const MARGIN: f64 = 0.03;
/// Minimum distance of the centre of mass from the edge of the support, m.
const LEAST_MARGIN: f64 = 0.01;
/// Height above the lowest point up to which points belong to the sole, m.
const SOLE_DEPTH: f64 = 0.006;
/// Shortest side of a sole, m; a smaller patch counts as a point.
const SHORTEST_SIDE: f64 = 0.03;
/// Largest angle between an axis of a sole's frame and the vertical, rad.
const LEVEL: f64 = 0.05;
/// Largest difference in height between feet and largest error of their position, m.
const UNEVEN: f64 = 2e-3;

/// The part of a foot that touches the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Contact {
    /// A ball about the origin of the foot's frame; with radius 0, a point.
    Ball {
        /// Radius, m.
        radius: f64,
    },
    /// A flat sole.
    Sole {
        /// Sides along x and y of the foot's frame, m.
        sides: [f64; 2],
        /// Height of the frame's origin above the ground, m.
        height: f64,
    },
}

/// A foot of a standing robot.
#[derive(Clone, Debug)]
pub(super) struct StandingFoot {
    pub(super) limb: Limb,
    pub(super) contact: Contact,
}

/// A standing robot.
#[derive(Clone, Debug)]
pub(super) struct Stance {
    pub(super) joints: DVector<f64>,
    /// Pose of the base, with the ground at z = 0.
    pub(super) base: Isometry3<f64>,
    pub(super) feet: Vec<StandingFoot>,
    /// Effort of each joint that holds the robot, N m or N.
    pub(super) effort: Vec<f64>,
    /// Name of the SRDF state it is based on.
    pub(super) state: Option<String>,
}

/// Reason why no standing posture exists.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Falls {
    /// A foot has no collision shape.
    NoShape(String),
    /// The support has no area.
    Points,
    /// No frame of a foot is parallel to its sole.
    Tilted(String),
    /// No configuration was found.
    Unbalanced,
    /// A drive cannot hold the weight.
    Weak { joint: String, needs: f64, has: f64 },
}

impl fmt::Display for Falls {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoShape(link) => write!(f, "foot {link} has no collision shape"),
            Self::Points => write!(f, "its feet are two points, on which no posture balances"),
            Self::Tilted(link) => write!(f, "no frame of foot {link} is level with its sole"),
            Self::Unbalanced => write!(f, "no posture was found with its weight above its feet"),
            Self::Weak { joint, needs, has } => {
                write!(f, "{joint} would need {needs:.1} N m to carry it and has {has:.1}")
            }
        }
    }
}

/// Finds a posture in which the robot stands on `feet`: near a state of its SRDF, otherwise with bent legs.
pub(super) fn stand(robot: &Loaded, feet: &[Limb]) -> Result<Stance, Falls> {
    let model = &robot.model;
    let zero = DVector::from_fn(model.joint_count(), |index, _| straight(model, index));
    let mut search = Search::new(model, feet, &zero)?;
    let mut failure = Falls::Unbalanced;
    for name in STANDING {
        for posture in
            robot.postures.iter().filter(|posture| posture.name.to_ascii_lowercase().starts_with(name))
        {
            let reference = clamped(model, &posture.joints);
            let targets = search.level_targets(&reference);
            match search.stand(&reference, targets, false) {
                Ok(stance) => return Ok(Stance { state: Some(posture.name.clone()), ..stance }),
                Err(falls) => failure = falls,
            }
        }
    }
    let soles = search.feet.iter().any(|foot| foot.sole);
    for share in HEIGHTS[usize::from(soles)] {
        for sign in if soles { [1.0, -1.0, 0.0] } else { [-1.0, 1.0, 0.0] } {
            let reference = search.bent(&zero, sign);
            let targets = search.targets_below_hips(&zero, share);
            match search.stand(&reference, targets, true) {
                Ok(stance) => return Ok(stance),
                // a weak drive is a more helpful reason than a failed search
                Err(falls) if matches!(failure, Falls::Unbalanced | Falls::Points) => failure = falls,
                Err(_) => {}
            }
        }
    }
    Err(failure)
}

/// Returns the position of a joint of a straight leg, or of an arm at its side: zero, or the nearest position
/// inside its range.
fn straight(model: &Model, index: usize) -> f64 {
    0.0_f64.min(model.upper()[index]).max(model.lower()[index])
}

fn clamped(model: &Model, joints: &DVector<f64>) -> DVector<f64> {
    DVector::from_fn(joints.len(), |index, _| clamp(model, index, joints[index]))
}

fn clamp(model: &Model, index: usize, position: f64) -> f64 {
    let (lower, upper) = (model.lower()[index], model.upper()[index]);
    let margin = if (upper - lower).is_finite() { MARGIN * (upper - lower) } else { 0.0 };
    position.min(upper - margin).max(lower + margin)
}

/// A point of a foot's collision shapes, in the frame of its body: a ball with this radius.
pub(super) type Corner = (Point3<f64>, f64);

struct Foot {
    limb: Limb,
    corners: Vec<Corner>,
    sole: bool,
    /// Orientation of the frame when the robot is straight, with its vertical axis exactly vertical.
    level: UnitQuaternion<f64>,
}

struct Search<'a> {
    model: &'a Model,
    kinematics: Kinematics,
    feet: Vec<Foot>,
    /// Joints of the legs.
    legs: Vec<usize>,
}

impl<'a> Search<'a> {
    fn new(model: &'a Model, feet: &[Limb], zero: &DVector<f64>) -> Result<Self, Falls> {
        let options = CollisionOptions {
            meshes: MeshMode::Outermost,
            leave_out_defects: true,
            ..CollisionOptions::default()
        };
        let name = |limb: &Limb| model.frames()[limb.frame.index()].name.clone();
        let first = || feet.first().map(name).unwrap_or_default();
        let solids = CollisionModel::new(model, &options).map_err(|_| Falls::NoShape(first()))?;
        let mut kinematics = Kinematics::new(model);
        kinematics.update(model, &with_joints(model, zero.as_slice()));
        let feet = feet.iter().map(|limb| {
            let corners =
                limb.body(model).map(|body| corners(&solids, Attachment::Body(body))).unwrap_or_default();
            if corners.is_empty() {
                return Err(Falls::NoShape(name(limb)));
            }
            let mut foot =
                Foot { limb: limb.clone(), corners, sole: false, level: UnitQuaternion::identity() };
            foot.find_sole(model, &kinematics)?;
            Ok(foot)
        });
        let feet = feet.collect::<Result<Vec<_>, _>>()?;
        let mut legs: Vec<usize> = feet
            .iter()
            .flat_map(|foot| &foot.limb.joints)
            .filter_map(|joint| model.joint_index(joint))
            .collect();
        legs.sort_unstable();
        legs.dedup();
        Ok(Self { model, kinematics, feet, legs })
    }

    fn update(&mut self, joints: &DVector<f64>) {
        self.kinematics.update(self.model, &with_joints(self.model, joints.as_slice()));
    }

    fn position(&self, frame: FrameId) -> Vector3<f64> {
        self.kinematics.pose(self.model, frame).translation.vector
    }

    /// Bends the legs at hip, knee and ankle; the knees point forwards for a positive sign.
    fn bent(&mut self, zero: &DVector<f64>, sign: f64) -> DVector<f64> {
        self.update(zero);
        let mut bent = zero.clone();
        for index in 0..bent.len() {
            if !self.legs.contains(&index) {
                bent[index] = neutral(self.model, index);
            }
        }
        for foot in &self.feet {
            let joints = foot.limb.joints.iter().filter_map(|joint| self.model.joint_index(joint));
            let pitch = joints.filter_map(|index| {
                let joint = self.model.joint(index);
                let body = self.kinematics.body_pose(self.model.joint_body(index));
                let across = (body.rotation * joint.axis.into_inner()).y;
                (joint.kind != JointKind::Prismatic && across.abs() > 0.7).then_some((index, across.signum()))
            });
            for ((index, side), bend) in pitch.zip(BENT) {
                bent[index] = clamp(self.model, index, zero[index] + sign * side * bend);
            }
        }
        bent
    }

    /// Returns the positions of the feet in a posture, at their mean height.
    fn level_targets(&mut self, joints: &DVector<f64>) -> Vec<Vector3<f64>> {
        self.update(joints);
        let lowest: Vec<f64> =
            self.feet.iter().map(|foot| foot.lowest(self.model, &self.kinematics)).collect();
        let mean = lowest.iter().sum::<f64>() / lowest.len() as f64;
        let feet = self.feet.iter().zip(&lowest);
        feet.map(|(foot, lowest)| self.position(foot.limb.frame) + Vector3::z() * (mean - lowest)).collect()
    }

    /// Returns the positions of the feet of straight legs, raised to this fraction of the distance from the
    /// hip. A foot without a sole is placed below the joint that swings the leg.
    fn targets_below_hips(&mut self, zero: &DVector<f64>, share: f64) -> Vec<Vector3<f64>> {
        self.update(zero);
        let mut targets: Vec<Vector3<f64>> = Vec::new();
        for foot in &self.feet {
            let joints: Vec<usize> =
                foot.limb.joints.iter().filter_map(|joint| self.model.joint_index(joint)).collect();
            let origin = |index: usize| {
                self.kinematics.body_pose(self.model.joint_body(joints[index])).translation.vector
            };
            let mut target = self.position(foot.limb.frame);
            if !foot.sole {
                target.x = origin(joints.len().saturating_sub(2)).x;
            }
            let hip = origin(joints.len().saturating_sub(if foot.sole { 4 } else { 2 })).z;
            target.z = hip - share * (hip - target.z);
            targets.push(target);
        }
        let mean = targets.iter().map(|target| target.z).sum::<f64>() / targets.len() as f64;
        targets.iter_mut().for_each(|target| target.z = mean);
        targets
    }

    /// Solves for a posture with the feet at the targets. Moves the targets below the centre of mass and
    /// levels them.
    fn stand(
        &mut self,
        reference: &DVector<f64>,
        mut targets: Vec<Vector3<f64>>,
        centre: bool,
    ) -> Result<Stance, Falls> {
        let mut joints = reference.clone();
        for _ in 0..8 {
            let error = self.solve(&mut joints, reference, &targets);
            if error > UNEVEN {
                return Err(Falls::Unbalanced);
            }
            let lowest: Vec<f64> =
                self.feet.iter().map(|foot| foot.lowest(self.model, &self.kinematics)).collect();
            let mean = lowest.iter().sum::<f64>() / lowest.len() as f64;
            let uneven = lowest.iter().map(|lowest| (lowest - mean).abs()).fold(0.0, f64::max);
            let support = self.support();
            let centre_of_mass = self.centre_of_mass();
            let middle = middle(&support);
            let away = centre_of_mass.xy() - middle;
            let room = margin(&support, &middle).ok_or(Falls::Points)?;
            let left = margin(&support, &centre_of_mass.xy()).unwrap_or(0.0);
            if room < LEAST_MARGIN {
                return Err(Falls::Points);
            }
            let centred = if centre { away.norm() < 0.1 * room } else { left > 0.4 * room };
            if centred && uneven < 0.5 * UNEVEN {
                return self.stance(joints, mean);
            }
            for (target, lowest) in targets.iter_mut().zip(&lowest) {
                target.z += mean - lowest;
                if !centred {
                    target.x += away.x;
                    target.y += away.y;
                }
            }
        }
        Err(Falls::Unbalanced)
    }

    fn stance(&mut self, joints: DVector<f64>, ground: f64) -> Result<Stance, Falls> {
        let effort = self.effort(&joints);
        for (index, effort) in effort.iter().enumerate() {
            let limit = self.model.effort_limit()[index];
            if effort.abs() > limit && limit > 0.0 {
                let joint = self.model.joint_names()[index].clone();
                return Err(Falls::Weak { joint, needs: effort.abs(), has: limit });
            }
        }
        let mut base = self.model.base().neutral;
        if !self.model.base().floating {
            base = Isometry3::identity();
        }
        base.translation.z -= ground;
        let feet = self.feet.iter().map(|foot| StandingFoot {
            limb: foot.limb.clone(),
            contact: foot.contact(self.model, &self.kinematics),
        });
        let feet = feet.collect();
        Ok(Stance { joints, base, feet, effort, state: None })
    }

    /// Runs damped least squares on the leg joints; returns the largest error, m or rad.
    fn solve(
        &mut self,
        joints: &mut DVector<f64>,
        reference: &DVector<f64>,
        targets: &[Vector3<f64>],
    ) -> f64 {
        let (model, legs) = (self.model, self.legs.clone());
        let first = model.nv() - model.joint_count();
        let rows: usize = self.feet.iter().map(|foot| if foot.sole { 6 } else { 3 }).sum();
        let mut whole = DMatrix::zeros(6, model.nv());
        let mut worst = f64::INFINITY;
        for iteration in 0..120 {
            self.update(joints);
            let mut jacobian = DMatrix::zeros(rows, legs.len());
            let mut error = DVector::zeros(rows);
            let mut row = 0;
            for (foot, target) in self.feet.iter().zip(targets) {
                let pose = self.kinematics.pose(model, foot.limb.frame);
                self.kinematics.jacobian(model, foot.limb.frame, Reference::LocalWorldAligned, &mut whole);
                let turn = (foot.level * pose.rotation.inverse()).scaled_axis();
                let parts = [target - pose.translation.vector, turn];
                for (part, error_part) in parts.iter().enumerate().take(if foot.sole { 2 } else { 1 }) {
                    for axis in 0..3 {
                        error[row] = error_part[axis];
                        for (column, leg) in legs.iter().enumerate() {
                            jacobian[(row, column)] = whole[(3 * part + axis, first + leg)];
                        }
                        row += 1;
                    }
                }
            }
            worst = error.amax();
            if worst < 0.1 * UNEVEN && iteration > 0 {
                break;
            }
            let pull = if iteration < 60 { 1e-4 } else { 1e-9 };
            let away =
                DVector::from_fn(legs.len(), |column, _| reference[legs[column]] - joints[legs[column]]);
            let mut normal = jacobian.transpose() * &jacobian;
            for diagonal in 0..legs.len() {
                normal[(diagonal, diagonal)] += pull + 1e-6 + 1e-2 * worst.min(1.0).powi(2);
            }
            let Some(factor) = normal.cholesky() else { break };
            let mut step = factor.solve(&(jacobian.transpose() * error + away * pull));
            let longest = step.amax();
            if longest > 0.3 {
                step *= 0.3 / longest;
            }
            for (column, leg) in legs.iter().enumerate() {
                joints[*leg] = clamp(model, *leg, joints[*leg] + step[column]);
            }
        }
        self.update(joints);
        worst
    }

    /// Returns the corners of the support, in the world.
    fn support(&self) -> Vec<Vector2<f64>> {
        let touching = |foot: &Foot| foot.touching(self.model, &self.kinematics);
        let mut points: Vec<Vector2<f64>> =
            self.feet.iter().flat_map(touching).map(|point| point.coords.xy()).collect();
        let mut corners = Vec::new();
        convex_corners(&mut points, |point| *point, &mut corners);
        corners
    }

    /// Returns the centre of mass of all links, including a fixed base.
    fn centre_of_mass(&self) -> Vector3<f64> {
        let (mut mass, mut moment) = (0.0, Vector3::zeros());
        for (id, frame) in self.model.frame_ids().zip(self.model.frames()) {
            let pose = self.kinematics.pose(self.model, id);
            mass += frame.inertia.mass;
            moment += frame.inertia.mass * (pose * Point3::from(frame.inertia.com)).coords;
        }
        moment / mass
    }

    /// Returns the efforts that hold the robot with minimum-norm vertical forces at its contacts.
    fn effort(&mut self, joints: &DVector<f64>) -> Vec<f64> {
        self.update(joints);
        let model = self.model;
        let (nv, first) = (model.nv(), model.nv() - model.joint_count());
        let q = with_joints(model, joints.as_slice());
        let mut tau = vec![0.0; nv];
        Dynamics::new(model).gravity(model, &q, Vector3::new(0.0, 0.0, -9.81), &mut tau);
        let points: Vec<(FrameId, Point3<f64>)> = self
            .feet
            .iter()
            .flat_map(|foot| {
                let points = foot.touching(model, &self.kinematics);
                points.into_iter().map(|point| (foot.limb.frame, point))
            })
            .collect();
        let com = self.centre_of_mass();
        let weight = 9.81 * model.total_mass();
        let row = |row: usize, point: &Vector3<f64>| [1.0, point.x, point.y][row];
        let balance = DMatrix::from_fn(3, points.len(), |i, j| row(i, &points[j].1.coords));
        let load = DVector::from_fn(3, |i, _| weight * row(i, &com));
        let Ok(forces) = balance.svd(true, true).solve(&load, 1e-9) else { return tau[first..].to_vec() };
        let mut jacobian = DMatrix::zeros(6, nv);
        for ((frame, point), force) in points.iter().zip(forces.iter()) {
            self.kinematics.jacobian(model, *frame, Reference::LocalWorldAligned, &mut jacobian);
            let arm = point.coords - self.position(*frame);
            for (column, tau) in tau.iter_mut().enumerate() {
                let turn = Vector3::new(jacobian[(3, column)], jacobian[(4, column)], jacobian[(5, column)]);
                *tau -= force * (jacobian[(2, column)] + turn.cross(&arm).z);
            }
        }
        tau[first..].to_vec()
    }
}

impl Foot {
    /// Returns the corners in the world with their radius.
    fn placed(&self, model: &Model, kinematics: &Kinematics) -> Vec<Corner> {
        let body = self.limb.body(model).map_or_else(Isometry3::identity, |body| kinematics.body_pose(body));
        self.corners.iter().map(|(point, radius)| (body * point, *radius)).collect()
    }

    /// Returns the height of the foot's lowest point.
    fn lowest(&self, model: &Model, kinematics: &Kinematics) -> f64 {
        let heights = self.placed(model, kinematics).into_iter().map(|(point, radius)| point.z - radius);
        heights.fold(f64::INFINITY, f64::min)
    }

    /// Returns the points within the depth of a sole above the lowest one.
    fn patch(&self, model: &Model, kinematics: &Kinematics) -> Vec<Point3<f64>> {
        let lowest = self.lowest(model, kinematics);
        let corners = self.placed(model, kinematics).into_iter();
        let low = corners.filter(|(point, radius)| point.z - radius <= lowest + SOLE_DEPTH);
        low.map(|(point, radius)| point - Vector3::z() * radius).collect()
    }

    /// Decides whether the foot is flat, and chooses a frame that is level with its sole.
    fn find_sole(&mut self, model: &Model, kinematics: &Kinematics) -> Result<(), Falls> {
        let patch = self.patch(model, kinematics);
        let side = |axis: usize| {
            let of =
                |fold: fn(f64, f64) -> f64, start| patch.iter().map(|point| point[axis]).fold(start, fold);
            of(f64::max, f64::NEG_INFINITY) - of(f64::min, f64::INFINITY)
        };
        if side(0) < SHORTEST_SIDE || side(1) < SHORTEST_SIDE {
            return Ok(());
        }
        let body = self.limb.body(model);
        let frames: Vec<FrameId> =
            model.frame_ids().filter(|id| model.frames()[id.index()].body == body).collect();
        let inside = |frame: FrameId| {
            let pose = kinematics.pose(model, frame);
            let level = (pose.rotation * Vector3::z()).angle(&Vector3::z()) < LEVEL;
            let [x, y] = symmetric_sides(&pose, &patch);
            level && x > SHORTEST_SIDE && y > 0.5 * SHORTEST_SIDE
        };
        let frame = Some(self.limb.frame).filter(|frame| inside(*frame));
        let Some(frame) = frame.or_else(|| frames.into_iter().find(|frame| inside(*frame))) else {
            return Err(Falls::Tilted(model.frames()[self.limb.frame.index()].name.clone()));
        };
        self.limb.frame = frame;
        let rotation = kinematics.pose(model, frame).rotation;
        let (_, _, yaw) = rotation.euler_angles();
        (self.sole, self.level) = (true, UnitQuaternion::from_euler_angles(0.0, 0.0, yaw));
        Ok(())
    }

    fn contact(&self, model: &Model, kinematics: &Kinematics) -> Contact {
        let pose = kinematics.pose(model, self.limb.frame);
        let height = pose.translation.z - self.lowest(model, kinematics);
        if self.sole {
            let sides = symmetric_sides(&pose, &self.patch(model, kinematics));
            return Contact::Sole { sides, height };
        }
        Contact::Ball { radius: if height > 1e-3 { height } else { 0.0 } }
    }

    /// Returns the points at which the foot touches the ground.
    fn touching(&self, model: &Model, kinematics: &Kinematics) -> Vec<Point3<f64>> {
        let pose = kinematics.pose(model, self.limb.frame);
        match self.contact(model, kinematics) {
            Contact::Ball { radius } => vec![Point3::from(pose.translation.vector - Vector3::z() * radius)],
            Contact::Sole { sides: [x, y], height } => [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)]
                .map(|(along, across)| pose * Point3::new(along * x / 2.0, across * y / 2.0, -height))
                .to_vec(),
        }
    }
}

/// Returns the sides of the largest rectangle about the frame's origin, along its x and y, that a patch
/// spans.
fn symmetric_sides(pose: &Isometry3<f64>, patch: &[Point3<f64>]) -> [f64; 2] {
    [0, 1].map(|axis| {
        let along = patch.iter().map(|point| pose.inverse_transform_point(point)[axis]);
        let (least, most) =
            along.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), x| (least.min(x), most.max(x)));
        (2.0 * most.min(-least)).max(0.0)
    })
}

/// Returns the corners of the shapes of a body.
fn corners(solids: &CollisionModel, attachment: Attachment) -> Vec<Corner> {
    let own = (0..solids.solid_count()).filter(|&solid| solids.attachment(solid) == attachment);
    own.flat_map(|solid| solid_corners(solids, solid)).collect()
}

/// Returns the corners of a solid in the frame to which it is attached.
pub(super) fn solid_corners(solids: &CollisionModel, solid: usize) -> Vec<Corner> {
    let placement = solids.placement(solid);
    let points: Vec<Corner> = match solids.convex_shape(solid) {
        ConvexShape::Sphere { radius } => vec![(Point3::origin(), radius)],
        ConvexShape::Box { half } => (0..8)
            .map(|corner| {
                let sign = |bit: usize| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
                (Point3::new(sign(0) * half.x, sign(1) * half.y, sign(2) * half.z), 0.0)
            })
            .collect(),
        ConvexShape::Cylinder { radius, half_length } => (0..32)
            .map(|corner| {
                let (sin, cos) = (f64::from(corner / 2) * core::f64::consts::TAU / 16.0).sin_cos();
                let end = if corner % 2 == 0 { half_length } else { -half_length };
                (Point3::new(radius * cos, radius * sin, end), 0.0)
            })
            .collect(),
        ConvexShape::Capsule { radius, half_length } => {
            [half_length, -half_length].map(|end| (Point3::new(0.0, 0.0, end), radius)).to_vec()
        }
        ConvexShape::Hull { points } => points.into_iter().map(|point| (point.into(), 0.0)).collect(),
        ConvexShape::HalfSpace => Vec::new(),
    };
    points.into_iter().map(|(point, radius)| (placement * point, radius)).collect()
}

fn middle(corners: &[Vector2<f64>]) -> Vector2<f64> {
    corners.iter().sum::<Vector2<f64>>() / corners.len() as f64
}

/// Returns the distance of a point inside a polygon from its nearest edge, negative outside; `None` without
/// an area.
fn margin(corners: &[Vector2<f64>], point: &Vector2<f64>) -> Option<f64> {
    let edges = corners.iter().zip(corners.iter().cycle().skip(1));
    let distance =
        |(from, to): (&Vector2<f64>, &Vector2<f64>)| (to - from).perp(&(point - from)) / (to - from).norm();
    (corners.len() > 2).then(|| edges.map(distance).fold(f64::INFINITY, f64::min))
}
