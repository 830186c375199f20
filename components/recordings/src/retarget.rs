//! Retargeting: finds joint positions at which a robot's limbs point in the same directions as the limbs of a
//! human.
//!
//! Each sample is a damped least-squares problem on the directions of the limbs, within the position limits.
//! The solution starts from the joint positions of the previous sample and stays close to them:
//! `min over q of sum_l |u_l(q) - d_l|^2 + w |q - q_before|^2`, with the unit directions `u_l` of limb `l` of
//! the robot and `d_l` of the human. The first sample starts from the home pose and from configurations
//! spread over the limits.

use motorium_robots::{FrameId, Kinematics, Model, Reference};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::{Recording, RecordingError};

/// A limb of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotLimb {
    /// Name of the corresponding human limb. The direction of the limb is in the channels `NAME_x`, `NAME_y`
    /// and `NAME_z`.
    pub name: String,
    /// Frame at the start of the limb.
    pub from: FrameId,
    /// Frame at the end of the limb.
    pub to: FrameId,
}

/// Options of [`retarget`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RetargetOptions {
    /// Number of iterations per sample. Default: 60.
    pub iterations: usize,
    /// Number of initial guesses for the first sample. Default: 32.
    pub seeds: usize,
    /// Weight of the joint motion since the previous sample, relative to the squared direction error,
    /// 1/rad^2. Default: 1e-3.
    pub posture: f64,
    /// Smallest step of a joint between two samples that is reported as a [change of branch](BranchChange),
    /// rad or m. Default: 0.5.
    pub branch: f64,
}

impl Default for RetargetOptions {
    fn default() -> Self {
        Self { iterations: 60, seeds: 32, posture: 1e-3, branch: 0.5 }
    }
}

/// A change of branch: a step of a joint that the motion of the limbs does not explain.
#[derive(Clone, Debug, PartialEq)]
pub struct BranchChange {
    /// Index of the sample, counted from 0.
    pub sample: usize,
    /// Name of the joint.
    pub joint: String,
    /// Size of the step, rad or m.
    pub step: f64,
}

/// The joint positions found by [`retarget`], and measures of the quality of these positions.
#[derive(Clone, Debug, PartialEq)]
pub struct Retargeted {
    /// Positions of the joints that move the limbs, rad or m; one channel per joint.
    pub positions: Recording,
    /// Median angle between each robot limb and its human limb, rad, in the order of the limbs.
    pub medians: Vec<f64>,
    /// Changes of branch.
    pub branches: Vec<BranchChange>,
}

/// A robot with its limbs, and reusable memory.
struct Problem<'a> {
    model: &'a Model,
    limbs: &'a [RobotLimb],
    kinematics: Kinematics,
    start: DMatrix<f64>,
    end: DMatrix<f64>,
    jacobian: DMatrix<f64>,
    residual: DVector<f64>,
    /// Joints that move the limbs.
    joints: Vec<usize>,
}

impl<'a> Problem<'a> {
    fn new(model: &'a Model, limbs: &'a [RobotLimb], q: &[f64]) -> Self {
        let rows = 3 * limbs.len();
        let mut made = Self {
            model,
            limbs,
            kinematics: Kinematics::new(model),
            start: DMatrix::zeros(6, model.nv()),
            end: DMatrix::zeros(6, model.nv()),
            jacobian: DMatrix::zeros(rows, model.joint_count()),
            residual: DVector::zeros(rows),
            joints: vec![],
        };
        // a joint whose axis is along a limb in one configuration is not in another
        let mut moves = vec![false; model.joint_count()];
        for seed in 0..4 {
            let spread = spread(model, q, seed);
            made.linearise(&spread, &vec![Vector3::zeros(); limbs.len()]);
            for (joint, moves) in moves.iter_mut().enumerate() {
                *moves |= made.jacobian.column(joint).amax() > 1e-6;
            }
        }
        made.joints = (0..model.joint_count()).filter(|joint| moves[*joint]).collect();
        made
    }

    /// Writes residuals and Jacobian; returns the sum of squares.
    fn linearise(&mut self, q: &[f64], targets: &[Vector3<f64>]) -> f64 {
        self.kinematics.update(self.model, q);
        let base = self.model.nv() - self.model.joint_count();
        for (index, (limb, target)) in self.limbs.iter().zip(targets).enumerate() {
            let [from, to] = [limb.from, limb.to].map(|frame| self.kinematics.pose(self.model, frame));
            let along = to.translation.vector - from.translation.vector;
            let length = along.norm().max(1e-9);
            let direction = along / length;
            self.residual.fixed_rows_mut::<3>(3 * index).copy_from(&(target - direction));
            self.kinematics.jacobian(self.model, limb.from, Reference::LocalWorldAligned, &mut self.start);
            self.kinematics.jacobian(self.model, limb.to, Reference::LocalWorldAligned, &mut self.end);
            let turn = (Matrix3::identity() - direction * direction.transpose()) / length;
            for joint in 0..self.model.joint_count() {
                let column = self.end.fixed_view::<3, 1>(0, base + joint)
                    - self.start.fixed_view::<3, 1>(0, base + joint);
                self.jacobian.fixed_view_mut::<3, 1>(3 * index, joint).copy_from(&(turn * column));
            }
        }
        self.residual.norm_squared()
    }

    /// Runs Levenberg-Marquardt from `q`, close to `before`; returns the objective.
    fn solve(
        &mut self,
        q: &mut [f64],
        before: &[f64],
        targets: &[Vector3<f64>],
        options: &RetargetOptions,
    ) -> f64 {
        let offset = q.len() - self.model.joint_count();
        let n = self.joints.len();
        let apart = |q: &[f64]| -> f64 { q.iter().zip(before).map(|(a, b)| (a - b) * (a - b)).sum() };
        let mut damping = 1e-3;
        let mut value = self.linearise(q, targets) + options.posture * apart(q);
        for _ in 0..options.iterations {
            let mut gram = DMatrix::zeros(n, n);
            let mut slope = DVector::zeros(n);
            for (a, i) in self.joints.iter().enumerate() {
                let column = self.jacobian.column(*i);
                slope[a] =
                    column.dot(&self.residual) - options.posture * (q[offset + i] - before[offset + i]);
                for (b, j) in self.joints.iter().enumerate() {
                    gram[(a, b)] = column.dot(&self.jacobian.column(*j));
                }
                gram[(a, a)] += options.posture + damping;
            }
            let Some(factor) = gram.cholesky() else { break };
            factor.solve_mut(&mut slope);
            let mut trial = q.to_vec();
            for (step, joint) in slope.iter().zip(&self.joints) {
                let (low, high) = (self.model.lower()[*joint], self.model.upper()[*joint]);
                let entry = &mut trial[offset + joint];
                *entry = (*entry + step.clamp(-0.5, 0.5)).max(low).min(high);
            }
            let after = self.linearise(&trial, targets) + options.posture * apart(&trial);
            if after < value {
                let gain = value - after;
                q.copy_from_slice(&trial);
                value = after;
                damping = (0.3 * damping).max(1e-9);
                if gain < 1e-12 {
                    break;
                }
            } else {
                damping *= 4.0;
                self.linearise(q, targets);
                if damping > 1e6 {
                    break;
                }
            }
        }
        value
    }
}

/// Returns initial guess `seed`: the given configuration first, then configurations spread over the limits.
fn spread(model: &Model, q: &[f64], seed: usize) -> Vec<f64> {
    let mut made = q.to_vec();
    let offset = q.len() - model.joint_count();
    for (joint, entry) in made[offset..].iter_mut().enumerate() {
        let (lower, upper) = (model.lower()[joint], model.upper()[joint]);
        if seed > 0 {
            let low = if lower.is_finite() { lower } else { -std::f64::consts::PI };
            let high = if upper.is_finite() { upper } else { std::f64::consts::PI };
            // multiples of powers of the inverse plastic number fill a box evenly
            let share = (seed as f64 * 0.754_877_666_246_692_8_f64.powi(joint as i32 + 1)).fract();
            *entry = low + share * (high - low);
        }
        *entry = entry.max(lower).min(upper);
    }
    made
}

/// Returns `true` for a joint step that the limb motion does not explain; `turned` is the largest change of a
/// limb direction (chord of unit vectors).
fn changes_branch(step: f64, turned: f64, least: f64) -> bool {
    step.abs() > least.max(3.0 * turned)
}

/// Finds joint positions at which a robot's limbs point in the recorded directions.
///
/// `directions` has the channels `LIMB_x`, `LIMB_y` and `LIMB_z` of each limb, in the world frame of the
/// robot. `home` is the home configuration of the robot (`nq` numbers). The base and joints that do not move
/// a limb stay at `home`.
///
/// # Errors
/// A channel is missing, or `home` has the wrong length.
pub fn retarget(
    directions: &Recording,
    model: &Model,
    limbs: &[RobotLimb],
    home: &[f64],
    options: &RetargetOptions,
) -> Result<Retargeted, RecordingError> {
    if home.len() != model.nq() {
        return Err(RecordingError::OutOfRange {
            name: "length of the home configuration",
            value: home.len() as f64,
            expected: "as many numbers as the model's configuration",
        });
    }
    let mut columns = vec![];
    for limb in limbs {
        for axis in ["x", "y", "z"] {
            let name = format!("{}_{axis}", limb.name);
            let found = directions.names().iter().position(|known| *known == name);
            columns.push(found.ok_or_else(|| RecordingError::NoChannel {
                path: directions.id().to_string(),
                name,
                known: directions.names().join(", "),
            })?);
        }
    }
    let mut problem = Problem::new(model, limbs, home);
    let joints = problem.joints.clone();
    let offset = home.len() - model.joint_count();
    let rows = directions.samples();
    let mut values = DMatrix::zeros(rows, joints.len());
    let mut angles = vec![vec![]; limbs.len()];
    let mut branches = vec![];
    let mut q = home.to_vec();
    let mut before: Vec<Vector3<f64>> = vec![];
    for row in 0..rows {
        let targets: Vec<Vector3<f64>> = columns
            .chunks_exact(3)
            .map(|columns| Vector3::from_fn(|axis, _| directions.values()[(row, columns[axis])]))
            .collect();
        let last = q.clone();
        if row == 0 {
            let mut least = f64::INFINITY;
            for seed in 0..options.seeds.max(1) {
                let mut trial = spread(model, home, seed);
                let value = problem.solve(&mut trial, home, &targets, options);
                if value < least {
                    (least, q) = (value, trial);
                }
            }
        } else {
            problem.solve(&mut q, &last, &targets, options);
        }
        problem.linearise(&q, &targets);
        for (index, angles) in angles.iter_mut().enumerate() {
            // the chord between two unit vectors
            let chord = problem.residual.fixed_rows::<3>(3 * index).norm();
            angles.push(2.0 * (0.5 * chord).min(1.0).asin());
        }
        let turned = before.iter().zip(&targets).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        for (place, joint) in joints.iter().enumerate() {
            values[(row, place)] = q[offset + joint];
            let step = q[offset + joint] - last[offset + joint];
            if row > 0 && changes_branch(step, turned, options.branch) {
                branches.push(BranchChange { sample: row, joint: model.joint_names()[*joint].clone(), step });
            }
        }
        before = targets;
    }
    let medians = angles.into_iter().map(|mut angles| {
        angles.sort_by(f64::total_cmp);
        angles[angles.len() / 2]
    });
    let names = joints.iter().map(|joint| model.joint_names()[*joint].clone()).collect();
    let positions = Recording::new(names, directions.times().to_vec(), values)?;
    Ok(Retargeted { positions, medians: medians.collect(), branches })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns directions of the Panda's arm in configurations of a smooth movement.
    fn example() -> (motorium_robots::Loaded, Vec<RobotLimb>, Recording, Vec<f64>) {
        let loaded = motorium_robots::load("panda", std::path::Path::new(".")).expect("the Panda");
        let frame = |name: &str| loaded.model.frame(name).expect("a frame");
        let limbs = vec![
            RobotLimb { name: "upper".into(), from: frame("panda_link2"), to: frame("panda_link4") },
            RobotLimb { name: "fore".into(), from: frame("panda_link4"), to: frame("panda_link6") },
        ];
        let profile = loaded.profile.as_ref().expect("a profile");
        let home = profile.home(&loaded.model).expect("a home").as_slice().to_vec();
        let mut kinematics = Kinematics::new(&loaded.model);
        let mut rows = vec![];
        for i in 0..40 {
            let mut q = home.clone();
            q[0] += 0.4 * (0.1 * f64::from(i)).sin();
            q[1] += 0.3 * (0.08 * f64::from(i)).sin();
            q[3] += 0.3 * (0.13 * f64::from(i)).sin();
            kinematics.update(&loaded.model, &q);
            for limb in &limbs {
                let [from, to] = [limb.from, limb.to].map(|frame| kinematics.pose(&loaded.model, frame));
                rows.extend((to.translation.vector - from.translation.vector).normalize().iter().copied());
            }
        }
        let names =
            ["upper", "fore"].iter().flat_map(|limb| ["x", "y", "z"].map(|axis| format!("{limb}_{axis}")));
        let times = (0..40).map(|i| 0.03 * f64::from(i)).collect();
        let directions = Recording::new(names.collect(), times, DMatrix::from_row_slice(40, 6, &rows));
        (loaded, limbs, directions.expect("a recording"), home)
    }

    #[test]
    fn robot_limbs_match_the_human_directions() {
        let (loaded, limbs, directions, home) = example();
        let options = RetargetOptions::default();
        let found = retarget(&directions, &loaded.model, &limbs, &home, &options).expect("positions");
        assert!(found.medians.iter().all(|angle| *angle < 5e-3), "{:?}", found.medians);
        assert_eq!(found.branches, []);
        assert_eq!(found.positions.names().first().map(String::as_str), Some("panda_joint1"));
        assert!(!found.positions.names().contains(&"panda_joint7".to_string()), "it moves no limb");
    }

    #[test]
    fn step_without_limb_motion_is_a_change_of_branch() {
        assert!(changes_branch(0.6, 0.1, 0.5) && changes_branch(-0.6, 0.1, 0.5));
        assert!(!changes_branch(0.4, 0.0, 0.5), "a small step");
        assert!(!changes_branch(0.6, 0.3, 0.5), "a fast limb");
    }

    #[test]
    fn missing_channel_is_named() {
        let (loaded, limbs, _, home) = example();
        let times = vec![0.0, 1.0];
        let short = Recording::new(vec!["upper_x".into()], times, DMatrix::zeros(2, 1)).expect("a recording");
        let error = retarget(&short, &loaded.model, &limbs, &home, &RetargetOptions::default());
        let error = error.expect_err("a channel").to_string();
        assert!(error.contains("found no channel `upper_y`"), "{error}");
    }
}
