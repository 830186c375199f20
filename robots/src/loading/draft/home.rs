//! Draft of a home posture: inside the limits, with a tool that can move in all directions.

use nalgebra::{DVector, Vector3};

use crate::loading::end_effector::tip_joints;
use crate::model::configuration::with_joints;
use crate::{
    CollisionModel, CollisionOptions, Collisions, Dynamics, FrameId, JointKind, Kinematics, Model, TaskRows,
};

/// Fraction of a joint's range kept free at either end.
const MARGIN: f64 = 0.1;
/// Deflections to try, rad.
const TRIED: [f64; 4] = [
    core::f64::consts::FRAC_PI_4,
    -core::f64::consts::FRAC_PI_4,
    core::f64::consts::FRAC_PI_2,
    -core::f64::consts::FRAC_PI_2,
];
/// Minimum improvement that justifies bending one more joint.
const WORTH: f64 = 1.2;
/// Manipulability below which a posture counts as singular, within rounding.
const SINGULAR: f64 = 1e-9;
/// Maximum number of bent joints.
const MOST_BENT: usize = 4;
/// Distance below which links count as touching by design if no joint is bent, m.
const TOUCHING: f64 = 0.01;
/// Fraction of a drive's effort that the weight may use.
const LOAD: f64 = 0.7;
/// Positions of a joint to try against an overload, as fractions of its range.
const PARTS: [f64; 9] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];
/// Maximum number of joints moved against overloads.
const MOST_RELIEVED: usize = 12;

/// Drafts a home posture: all joints at zero, or at the middle of their range if zero is near its end or
/// outside. The joints of an arm are bent far enough to avoid singular postures. Also returns `true` if that
/// succeeded. A posture that the drives cannot hold against gravity is changed until they can.
pub(super) fn draft_home(model: &Model) -> (DVector<f64>, bool) {
    let (mut home, moves_freely) = bent_home(model);
    if !model.base().floating {
        relieve(model, &mut home);
    }
    (home, moves_freely)
}

/// Moves joints, one at a time, to the positions at which the weight overloads the drives least.
fn relieve(model: &Model, home: &mut DVector<f64>) {
    let mut dynamics = Dynamics::new(model);
    let mut effort = vec![0.0; model.nv()];
    let mut overload = |joints: &DVector<f64>| {
        let q = with_joints(model, joints.as_slice());
        dynamics.gravity(model, &q, Vector3::new(0.0, 0.0, -9.81), &mut effort);
        let limits = model.effort_limit().iter().zip(&effort).filter(|(limit, _)| **limit > 0.0);
        limits.map(|(limit, effort)| (effort.abs() / (LOAD * limit) - 1.0).max(0.0)).sum::<f64>()
    };
    let mut least = overload(home);
    for _ in 0..MOST_RELIEVED {
        if least <= 0.0 {
            return;
        }
        let mut best = None;
        for index in 0..model.joint_count() {
            let (lower, upper) = (model.lower()[index], model.upper()[index]);
            if !(upper - lower).is_finite() {
                continue;
            }
            for part in PARTS {
                let mut tried = home.clone();
                tried[index] = ((lower + part * (upper - lower)) * 1e3).round() / 1e3;
                let found = overload(&tried);
                if found < 0.99 * least {
                    (least, best) = (found, Some(tried));
                }
            }
        }
        let Some(better) = best else { return };
        *home = better;
    }
}

/// Returns the posture bent out of singularities.
fn bent_home(model: &Model) -> (DVector<f64>, bool) {
    let mut home = DVector::from_fn(model.joint_count(), |index, _| neutral(model, index));
    let Some(tip) = model.tip().filter(|_| !model.base().floating) else { return (home, false) };
    let (joints, _) = tip_joints(model, tip);
    let turning: Vec<usize> = joints
        .iter()
        .filter_map(|name| model.joint_index(name))
        .filter(|&index| model.joint(index).kind != JointKind::Prismatic)
        .collect();
    let rows = match joints.len() {
        0..3 => return (home, false),
        3..6 => TaskRows::POSITION,
        _ => TaskRows::POSE,
    };
    let mut check = Check::new(model, tip, rows);
    let mut best = check.measure(model, &home);
    let mut bent = 0;
    while bent < MOST_BENT {
        let bends: Vec<(usize, f64)> = turning
            .iter()
            .filter(|&&index| home[index] == neutral(model, index))
            .flat_map(|&index| TRIED.map(|angle| (index, neutral(model, index) + angle)))
            .filter(|&(index, position)| inside(model, index, position))
            .collect();
        let singles = bends.iter().map(std::slice::from_ref);
        let mut found = best_of(&mut check, model, &home, best, singles);
        if found.is_none() && best <= SINGULAR {
            // Elbow and wrist are straight simultaneously: no single joint leaves such a posture.
            let pairs: Vec<[(usize, f64); 2]> = bends
                .iter()
                .enumerate()
                .flat_map(|(k, one)| bends[k + 1..].iter().map(|other| [*one, *other]))
                .filter(|[one, other]| one.0 != other.0)
                .collect();
            found = best_of(&mut check, model, &home, best, pairs.iter().map(<[_; 2]>::as_slice));
        }
        let Some((measure, chosen)) = found else { break };
        best = measure;
        bent += chosen.len();
        chosen.into_iter().for_each(|(index, position)| home[index] = position);
    }
    (home, best > SINGULAR)
}

/// Returns the best bends and their measure, if worthwhile.
fn best_of<'a>(
    check: &mut Check,
    model: &Model,
    home: &DVector<f64>,
    best: f64,
    all: impl Iterator<Item = &'a [(usize, f64)]>,
) -> Option<(f64, Vec<(usize, f64)>)> {
    let mut better: Option<(f64, Vec<(usize, f64)>)> = None;
    for bends in all {
        let mut tried = home.clone();
        bends.iter().for_each(|&(index, position)| tried[index] = position);
        let measure = check.measure(model, &tried);
        let least = better.as_ref().map_or(WORTH * best + SINGULAR, |(measure, _)| 1.001 * measure);
        if measure > least {
            better = Some((measure, bends.to_vec()));
        }
    }
    better
}

/// Returns zero, or the middle of the range if zero is near its end or outside.
pub(super) fn neutral(model: &Model, index: usize) -> f64 {
    let (lower, upper) = (model.lower()[index], model.upper()[index]);
    match (lower.is_finite(), upper.is_finite()) {
        (true, true) if inside(model, index, 0.0) => 0.0,
        (true, true) => (0.5 * (lower + upper) * 1e3).round() / 1e3,
        (true, false) => lower.max(0.0),
        (false, true) => upper.min(0.0),
        (false, false) => 0.0,
    }
}

/// Returns `true` for a position inside the range and not near its end.
fn inside(model: &Model, index: usize, position: f64) -> bool {
    let (lower, upper) = (model.lower()[index], model.upper()[index]);
    let margin = if (upper - lower).is_finite() { MARGIN * (upper - lower) } else { 0.0 };
    position >= lower + margin && position <= upper - margin
}

/// Evaluation of a posture.
struct Check {
    tip: FrameId,
    rows: TaskRows,
    kinematics: Kinematics,
    /// `None` if the robot's shapes are unusable.
    collisions: Option<(CollisionModel, Collisions)>,
}

impl Check {
    fn new(model: &Model, tip: FrameId, rows: TaskRows) -> Self {
        let mut kinematics = Kinematics::new(model);
        let collisions = CollisionModel::new(model, &CollisionOptions::default()).ok().map(|mut solids| {
            let neutral: Vec<f64> = (0..model.joint_count()).map(|index| neutral(model, index)).collect();
            kinematics.update(model, &with_joints(model, &neutral));
            let mut state = Collisions::new(&solids);
            state.update(&solids, &kinematics);
            let touching: Vec<[usize; 2]> =
                state.within(&solids, TOUCHING).iter().map(|near| solids.pairs()[near.pair]).collect();
            solids.retain_pairs(|pair| !touching.contains(pair));
            let state = Collisions::new(&solids);
            (solids, state)
        });
        Self { tip, rows, kinematics, collisions }
    }

    /// Returns the manipulability of the tip; `None` if the robot is in self-collision or reaches below its
    /// base.
    fn measure(&mut self, model: &Model, joints: &DVector<f64>) -> f64 {
        self.kinematics.update(model, &with_joints(model, joints.as_slice()));
        if let Some((model, state)) = &mut self.collisions {
            state.update(model, &self.kinematics);
            if state.colliding(model, TOUCHING).is_some() {
                return 0.0;
            }
        }
        let measure = self.kinematics.manipulability(model, self.tip, self.rows);
        if self.kinematics.pose(model, self.tip).translation.z < 0.0 { 0.1 * measure } else { measure }
    }
}
