//! Libraries of a full body and of its parts, learned from motion capture.

use motorium_library::{
    Basis, BuildError, DAMPING, LayoutError, MergeError, Metric, MotionLibrary, Movement, Recordings,
    SampledSpring, SpringError, Trajectory, Truncation, merge_independent, merge_parts, path_errors,
};
use nalgebra::DMatrix;

use super::search::Goal;

/// Number of samples of a window: 2 s at [`RATE`].
pub const WINDOW: usize = 60;
/// Samples between the starts of two successive windows.
const STRIDE: usize = 8;
/// Maximum change of an angle between samples, rad; a larger one is a discontinuity of the Euler angles.
const LEAP: f64 = 0.35;
/// Standard deviation of the Gaussian smoothing filter, samples.
const SMOOTH: f64 = 1.5;
/// Sampling rate, Hz.
pub const RATE: f64 = 30.0;

/// Names of the channels for arms and legs in the recordings. Angles are in degrees. `*` at the end of a name
/// matches any suffix.
pub const CHANNELS: [&str; 12] = [
    "lhumerus*",
    "lradius*",
    "lwrist*",
    "lhand_*",
    "rhumerus*",
    "rradius*",
    "rwrist*",
    "rhand_*",
    "lfemur*",
    "ltibia*",
    "rfemur*",
    "rtibia*",
];
const LEFT_ARM: &str = "lhumerus*,lradius*,lwrist*,lhand_*";
const RIGHT_ARM: &str = "rhumerus*,rradius*,rwrist*,rhand_*";
const LEFT_LEG: &str = "lfemur*,ltibia*";
const RIGHT_LEG: &str = "rfemur*,rtibia*";

/// Splits recordings with the channels [`CHANNELS`] (deg) into smoothed windows in rad. Returns the windows
/// of the first four fifths of each recording for training, and the windows of the last fifth for evaluation.
pub fn windows(mut clips: Recordings) -> (Recordings, Recordings) {
    let mut rest = Recordings { names: clips.names.clone(), trajectories: Vec::new() };
    for clip in &mut clips.trajectories {
        clip.positions *= std::f64::consts::PI / 180.0;
        let smooth = clip.smoothed(SMOOTH);
        let cut = clip.positions.nrows() * 4 / 5;
        let part = |from: usize, rows: usize| Trajectory {
            positions: smooth.positions.rows(from, rows).into_owned(),
            duration: (rows.max(2) - 1) as f64 / RATE,
            ..clip.clone()
        };
        let last = part(cut, clip.positions.nrows() - cut);
        let first = part(0, cut);
        rest.trajectories.push(last);
        *clip = first;
    }
    (clips.windows(WINDOW, STRIDE, LEAP), rest.windows(WINDOW, STRIDE, LEAP))
}

/// Returns the largest difference between corresponding singular values of the libraries `a` and `b`,
/// relative to the largest singular value of `b`.
pub fn difference(a: &MotionLibrary, b: &MotionLibrary) -> f64 {
    let (a, b) = (&a.parts().singular, &b.parts().singular);
    let largest = b.first().copied().unwrap_or(1.0);
    a.iter().zip(b).map(|(a, b)| (a - b).abs() / largest).fold(0.0, f64::max)
}

/// Error of [`Body::learn`].
#[derive(Debug, thiserror::Error)]
pub enum BodyError {
    /// No library can be learned from these windows.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The recordings lack arms or legs.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// The parts cannot be merged.
    #[error(transparent)]
    Merge(#[from] MergeError),
    /// The spring is unstable at the number of samples of a window.
    #[error(transparent)]
    Spring(#[from] SpringError),
}

/// Motion libraries of a full body, of its parts, and of the merged parts. All libraries use the force
/// metric.
#[derive(Clone, Debug)]
pub struct Body {
    /// Library of all degrees of freedom, built from recordings.
    pub whole: MotionLibrary,
    /// Library of both arms, extracted from `whole`.
    pub arms: MotionLibrary,
    /// Library of both legs, extracted from `whole`.
    pub legs: MotionLibrary,
    /// Library of the right arm, extracted from `whole`.
    pub right_arm: MotionLibrary,
    /// Library of the left leg, extracted from `whole`.
    pub left_leg: MotionLibrary,
    /// Library of arms and legs merged as parts of the same movements; equal to `whole`.
    pub together: MotionLibrary,
    /// Library of arms and legs merged as parts that move independently.
    pub two_parts: MotionLibrary,
    /// Library of the four limbs merged as parts that move independently.
    pub four_parts: MotionLibrary,
}

impl Body {
    /// Builds the libraries from windows with the names of [`CHANNELS`].
    ///
    /// # Errors
    /// [`BodyError`] if no library can be built from the windows, or the windows lack arms or legs.
    pub fn learn(seen: &Recordings) -> Result<Self, BodyError> {
        let spring = SampledSpring::new(WINDOW, DAMPING)?;
        let whole = MotionLibrary::build(seen, spring, Metric::Force, Truncation::All)?;
        let part = |patterns: &str| -> Result<MotionLibrary, BodyError> {
            Ok(whole.split(&whole.layout().part(&format!("part={patterns}"))?)?)
        };
        let (left_arm, right_arm) = (part(LEFT_ARM)?, part(RIGHT_ARM)?);
        let (left_leg, right_leg) = (part(LEFT_LEG)?, part(RIGHT_LEG)?);
        let arms = part(&format!("{LEFT_ARM},{RIGHT_ARM}"))?;
        let legs = part(&format!("{LEFT_LEG},{RIGHT_LEG}"))?;
        let two_parts = merge_independent(&[&arms, &legs], Truncation::All)?;
        let four_parts = merge_independent(&[&left_arm, &right_arm, &left_leg, &right_leg], Truncation::All)?;
        let together = merge_parts(&[&arms, &legs], Truncation::All)?;
        Ok(Self { whole, arms, legs, right_arm, left_leg, together, two_parts, four_parts })
    }

    /// Returns composite goals. Each goal combines the arms of one held-out window with the legs of a window
    /// from another recording.
    pub fn composites(&self, held: &Recordings) -> Vec<Goal> {
        let spring = self.whole.spring();
        let arm_names = self.arms.layout().names();
        let arms: Vec<usize> =
            (0..held.names.len()).filter(|dof| arm_names.contains(&held.names[*dof])).collect();
        let steps = spring.forces();
        let clip = |window: &Trajectory| window.id.split('@').next().unwrap_or_default().to_string();
        let count = held.trajectories.len();
        let mut goals = Vec::new();
        for (k, upper) in held.trajectories.iter().enumerate().step_by(3) {
            let lower = (1..count)
                .map(|j| &held.trajectories[(k + 7 * j) % count])
                .find(|window| clip(window) != clip(upper));
            let Some(lower) = lower else { continue };
            let (a, b) = (Movement::from_trajectory(upper, spring), Movement::from_trajectory(lower, spring));
            let mut forces = b.forces.clone();
            let mut path = lower.sampled(spring);
            for dof in &arms {
                let of_dof = dof * steps..(dof + 1) * steps;
                forces[of_dof.clone()].copy_from_slice(&a.forces[of_dof]);
                path.set_column(*dof, &upper.sampled(spring).column(*dof));
            }
            goals.push(Goal { forces, spread: Trajectory::spread(&path) });
        }
        goals
    }

    /// Returns the first `n` eigenforces of a library of all degrees of freedom. Rows are in the order of
    /// `whole`.
    pub fn eigenforces(&self, library: &MotionLibrary, n: usize) -> DMatrix<f64> {
        let basis = Basis::eigenforces(library, n);
        let steps = self.whole.spring().forces();
        let names = self.whole.layout().names().iter();
        let rows: Vec<usize> = names
            .filter_map(|name| library.layout().names().iter().position(|other| other == name))
            .collect();
        DMatrix::from_fn(self.whole.rows(), basis.size(), |i, k| {
            basis.functions()[(rows[i / steps] * steps + i % steps, k)]
        })
    }

    /// Returns the position errors of goals reproduced with the first `n` eigenforces of a library, relative
    /// to the mean spread of the goals.
    pub fn errors(&self, library: &MotionLibrary, n: usize, goals: &[Goal]) -> Vec<f64> {
        let data = DMatrix::from_fn(self.whole.rows(), goals.len(), |i, k| goals[k].forces[i]);
        let spread = goals.iter().map(|goal| goal.spread).sum::<f64>() / goals.len().max(1) as f64;
        let functions = self.eigenforces(library, n);
        let left = &data - &functions * (functions.transpose() * &data);
        let errors = path_errors(left, self.whole.layout().dofs(), self.whole.spring());
        errors.into_iter().map(|error| error / spread).collect()
    }
}

/// Builds a library of the degrees of freedom of `part` from the recordings of these degrees of freedom
/// alone.
///
/// # Errors
/// [`BuildError`] if no library can be built from the recordings.
pub fn learned_alone(seen: &Recordings, part: &MotionLibrary) -> Result<MotionLibrary, BuildError> {
    let names = part.layout().names();
    let columns: Vec<usize> =
        names.iter().filter_map(|name| seen.names.iter().position(|other| other == name)).collect();
    let alone = |window: &Trajectory| Trajectory {
        positions: window.positions.select_columns(&columns),
        ..window.clone()
    };
    let alone =
        Recordings { names: names.to_vec(), trajectories: seen.trajectories.iter().map(alone).collect() };
    MotionLibrary::build(&alone, *part.spring(), part.metric(), Truncation::All)
}
