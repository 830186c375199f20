//! Inverse kinematics: finds a configuration in which a frame has a target pose.
//!
//! Damped least squares on the configuration manifold (Wampler 1986; damping proportional to the error, in
//! the spirit of Sugihara 2011). The search stays within the joint limits and starts from several initial
//! guesses. Redundant joints are pulled towards the initial posture.

use nalgebra::{DMatrix, DVector, Isometry3, Vector3, Vector6};

use crate::{FrameId, Kinematics, Model, Reference};

/// Primes, whose square roots are linearly independent over the rationals.
const PRIMES: [f64; 16] =
    [2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0, 23.0, 29.0, 31.0, 37.0, 41.0, 43.0, 47.0, 53.0];

/// Options of the search for a configuration in which a frame has a target pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IkOptions {
    /// Maximum distance between the frame and the target at which the target counts as reached \[m\].
    pub position_tolerance: f64,
    /// Maximum angle between the frame and the target at which the target counts as reached \[rad\]; infinite
    /// if only the position matters.
    pub rotation_tolerance: f64,
    /// Maximum number of iterations from each initial guess.
    pub iterations: usize,
    /// Number of initial guesses. The first guess is the given configuration; all further guesses are spread
    /// over the ranges of the joints.
    pub seeds: usize,
    /// Gain per iteration with which redundant joints are pulled towards the initial posture, from 0 (no
    /// pull) to 1.
    pub posture: f64,
}

impl Default for IkOptions {
    /// Tolerances of 0.1 um and 1 urad, 100 iterations from each of 32 initial guesses, and a pull of a tenth
    /// of the distance to the posture per iteration.
    fn default() -> Self {
        Self { position_tolerance: 1e-7, rotation_tolerance: 1e-6, iterations: 100, seeds: 32, posture: 0.1 }
    }
}

/// Result of a successful search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IkSolution {
    /// Remaining distance from the target \[m\].
    pub position_error: f64,
    /// Remaining angle from the target \[rad\].
    pub rotation_error: f64,
    /// Index of the successful initial guess, counted from 0.
    pub seed: usize,
    /// Number of iterations from the successful guess.
    pub iterations: usize,
}

/// State of a search that is performed in several calls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum IkProgress {
    /// The search has not finished.
    Searching,
    /// The search succeeded: `q` reaches the target.
    Found(IkSolution),
    /// No initial guess led to the target. `q` is the best configuration found.
    NotFound {
        /// Distance between the frame and the target in the best configuration \[m\].
        position_error: f64,
        /// Angle between the frame and the target in the best configuration \[rad\].
        rotation_error: f64,
    },
}

/// Error of a failed search. `q` is the best configuration found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "no configuration found that moves \"{frame}\" to the target within tolerance, from {seeds} starting points; the best is \
     {position_error:.1e} m and {rotation_error:.1e} rad away{}",
    explanation(.at_limits, *.singular)
)]
pub struct IkFailure {
    /// Name of the frame.
    pub frame: String,
    /// Number of initial guesses tried.
    pub seeds: usize,
    /// Distance between the frame and the target in the best configuration \[m\].
    pub position_error: f64,
    /// Angle between the frame and the target in the best configuration \[rad\].
    pub rotation_error: f64,
    /// Names of the joints at a limit.
    pub at_limits: Vec<String>,
    /// `true` if the configuration is singular, with the arm stretched or folded, so that no joint motion
    /// reduces the error further.
    pub singular: bool,
}

fn explanation(at_limits: &[String], singular: bool) -> String {
    match (at_limits, singular) {
        ([], false) => " and still improving; increase the number of iterations".to_owned(),
        ([], true) => ", in a singular configuration; the target is probably out of reach".to_owned(),
        (joints, _) => format!(", with {} at a limit", joints.join(", ")),
    }
}

/// Workspace for the inverse kinematics of one [`Model`] with a fixed or floating base. Only
/// [`new`](Self::new) and the creation of an error allocate.
#[derive(Clone, Debug)]
pub struct InverseKinematics {
    kinematics: Kinematics,
    jacobian: DMatrix<f64>,
    outcome: DMatrix<f64>,
    step: DVector<f64>,
    pull: DVector<f64>,
    wanted: DVector<f64>,
    trial: DVector<f64>,
    next: DVector<f64>,
    best: DVector<f64>,
    progress: Search,
}

/// Progress of a search.
#[derive(Clone, Copy, Debug, Default)]
struct Search {
    /// Index of the initial guess.
    seed: usize,
    /// Number of iterations from that guess.
    iterations: usize,
    /// Smallest error so far; `None` before the first iteration.
    least: Option<f64>,
}

impl InverseKinematics {
    /// Creates a workspace for `model`.
    pub fn new(model: &Model) -> Self {
        let (nq, nv) = (model.nq(), model.nv());
        Self {
            kinematics: Kinematics::new(model),
            jacobian: DMatrix::zeros(6, nv),
            outcome: DMatrix::zeros(6, nv),
            step: DVector::zeros(nv),
            pull: DVector::zeros(nv),
            wanted: DVector::zeros(nv),
            trial: DVector::zeros(nq),
            next: DVector::zeros(nq),
            best: DVector::zeros(nq),
            progress: Search::default(),
        }
    }

    /// Finds a configuration `q` in which `frame` has the pose `target` in the world, starting from the given
    /// `q`. Redundant joints are pulled towards the given `q`. All joints stay within their limits.
    ///
    /// # Errors
    ///
    /// [`IkFailure`] if no initial guess leads to the target. In this case `q` is the best configuration
    /// found.
    pub fn solve(
        &mut self,
        model: &Model,
        frame: FrameId,
        target: &Isometry3<f64>,
        options: &IkOptions,
        q: &mut [f64],
    ) -> Result<IkSolution, IkFailure> {
        self.restart();
        loop {
            match self.search(model, frame, target, options, q, usize::MAX) {
                IkProgress::Searching => {}
                IkProgress::Found(solution) => return Ok(solution),
                IkProgress::NotFound { .. } => return Err(self.failure(model, frame, target, options)),
            }
        }
    }

    /// Starts a new search, which [`search`](Self::search) continues.
    pub fn restart(&mut self) {
        self.progress = Search::default();
    }

    /// Continues a search for at most `steps` iterations, for control loops that must not wait for a
    /// solution. Repeated calls produce the same result as [`solve`](Self::solve). All arguments except
    /// `steps` must stay unchanged between calls. Does not allocate.
    ///
    /// ```
    /// # use motorium_robots::{IkOptions, IkProgress, InverseKinematics, Kinematics, load};
    /// let panda = load("panda", std::path::Path::new(".")).unwrap();
    /// let (model, tool) = (&panda.model, panda.end_effector(None).unwrap());
    /// let mut q = panda.profile.as_ref().unwrap().home(model).unwrap();
    /// let mut kinematics = Kinematics::new(model);
    /// kinematics.update(model, q.as_slice());
    /// let mut target = kinematics.pose(model, tool);
    /// target.translation.x += 0.1;
    /// let mut search = InverseKinematics::new(model);
    /// search.restart();
    /// // two iterations a step
    /// let found = std::iter::from_fn(|| {
    ///     Some(search.search(model, tool, &target, &IkOptions::default(), q.as_mut_slice(), 2))
    /// });
    /// let found = found.take(100).find(|progress| *progress != IkProgress::Searching);
    /// assert!(matches!(found, Some(IkProgress::Found(_))));
    /// ```
    pub fn search(
        &mut self,
        model: &Model,
        frame: FrameId,
        target: &Isometry3<f64>,
        options: &IkOptions,
        q: &mut [f64],
        steps: usize,
    ) -> IkProgress {
        assert_eq!(q.len(), model.nq(), "length of q");
        for _ in 0..steps {
            let Search { seed, iterations, least } = self.progress;
            if iterations == 0 {
                self.start(model, q, seed);
            }
            let error = self.error(model, frame, target, options);
            let (position_error, rotation_error) = sizes(&error);
            if error.norm() < least.unwrap_or(f64::INFINITY) {
                self.progress.least = Some(error.norm());
                self.best.copy_from(&self.trial);
            }
            let turned = rotation_error <= options.rotation_tolerance;
            if position_error <= options.position_tolerance && turned {
                q.copy_from_slice(self.trial.as_slice());
                return IkProgress::Found(IkSolution { position_error, rotation_error, seed, iterations });
            }
            if iterations < options.iterations {
                // From the given start, the first half of the iterations includes the pull towards the
                // posture. The rest does not, so that the target is reached. Other guesses search for other
                // solutions.
                let posture = (seed == 0 && 2 * iterations < options.iterations).then_some(&*q);
                self.advance(model, frame, &error, posture, options);
                self.progress.iterations += 1;
            } else if seed + 1 < options.seeds {
                (self.progress.seed, self.progress.iterations) = (seed + 1, 0);
            } else {
                self.trial.copy_from(&self.best);
                let error = self.error(model, frame, target, options);
                let (position_error, rotation_error) = sizes(&error);
                q.copy_from_slice(self.best.as_slice());
                return IkProgress::NotFound { position_error, rotation_error };
            }
        }
        IkProgress::Searching
    }

    /// Returns initial guess `seed`: the given configuration first, then points of a low-discrepancy sequence
    /// over the limits.
    fn start(&mut self, model: &Model, q: &[f64], seed: usize) {
        self.trial.copy_from_slice(q);
        let offset = model.nq() - model.joint_count();
        for index in 0..model.joint_count() {
            let (lower, upper) = (model.lower()[index], model.upper()[index]);
            let entry = &mut self.trial[offset + index];
            if seed > 0 {
                let low = if lower.is_finite() { lower } else { *entry - std::f64::consts::PI };
                let high = if upper.is_finite() { upper } else { *entry + std::f64::consts::PI };
                // multiples of independent irrationals, one per joint (Weyl 1916)
                let share = (seed as f64 * PRIMES[index % PRIMES.len()].sqrt() + index as f64 * 0.37).fract();
                *entry = low + share * (high - low);
            }
            *entry = entry.clamp(lower, upper);
        }
    }

    /// Returns the error at `trial`: the remaining motion of the frame, in world axes. The angular part is
    /// zero if irrelevant.
    fn error(
        &mut self,
        model: &Model,
        frame: FrameId,
        target: &Isometry3<f64>,
        options: &IkOptions,
    ) -> Vector6<f64> {
        self.kinematics.place_carriers(model, self.trial.as_slice(), frame);
        let pose = self.kinematics.pose(model, frame);
        let linear = target.translation.vector - pose.translation.vector;
        let angular = if options.rotation_tolerance.is_finite() {
            (target.rotation * pose.rotation.inverse()).scaled_axis()
        } else {
            Vector3::zeros()
        };
        Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
    }

    /// Performs one damped step; joints stop at the ends of their range.
    fn advance(
        &mut self,
        model: &Model,
        frame: FrameId,
        error: &Vector6<f64>,
        posture: Option<&[f64]>,
        options: &IkOptions,
    ) {
        self.kinematics.jacobian(model, frame, Reference::LocalWorldAligned, &mut self.jacobian);
        if !options.rotation_tolerance.is_finite() {
            self.jacobian.rows_mut(3, 3).fill(0.0);
        }
        let offset = model.nv() - model.joint_count();
        // A joint at its limit that the error pushes outwards is excluded.
        self.wanted.gemv_tr(1.0, &self.jacobian, error, 0.0);
        for index in 0..model.joint_count() {
            let at = model.joints_of_q(self.trial.as_slice())[index];
            let push = self.wanted[offset + index];
            if at <= model.lower()[index] && push < 0.0 || at >= model.upper()[index] && push > 0.0 {
                self.jacobian.column_mut(offset + index).fill(0.0);
            }
        }
        self.pull.fill(0.0);
        if let Some(posture) = posture {
            model.difference(self.trial.as_slice(), posture, self.pull.as_mut_slice());
            self.pull *= options.posture;
        }
        // step = pull + J' (J J' + damping)^-1 (error - J pull). Damping proportional to the error settles at
        // unreachable targets and converges quadratically otherwise.
        let damping = 0.5 * error.norm() + 1e-12;
        let mut gram = nalgebra::Matrix6::zeros();
        for i in 0..6 {
            for j in 0..6 {
                gram[(i, j)] = self.jacobian.row(i).dot(&self.jacobian.row(j));
            }
            gram[(i, i)] += damping;
        }
        let mut missing = *error;
        missing.gemv(-1.0, &self.jacobian, &self.pull, 1.0);
        let Some(factor) = gram.cholesky() else { return };
        factor.solve_mut(&mut missing);
        self.step.copy_from(&self.pull);
        self.step.gemv_tr(1.0, &self.jacobian, &missing, 1.0);
        let longest = self.step.amax();
        if longest > 0.5 {
            self.step *= 0.5 / longest;
        }
        model.integrate(self.trial.as_slice(), self.step.as_slice(), self.next.as_mut_slice());
        let offset = model.nq() - model.joint_count();
        for index in 0..model.joint_count() {
            let entry = &mut self.next[offset + index];
            *entry = entry.clamp(model.lower()[index], model.upper()[index]);
        }
        self.trial.copy_from(&self.next);
    }

    fn failure(
        &mut self,
        model: &Model,
        frame: FrameId,
        target: &Isometry3<f64>,
        options: &IkOptions,
    ) -> IkFailure {
        self.trial.copy_from(&self.best);
        let error = self.error(model, frame, target, options);
        let (position_error, rotation_error) = sizes(&error);
        self.kinematics.jacobian(model, frame, Reference::LocalWorldAligned, &mut self.outcome);
        let slope = self.outcome.tr_mul(&error).norm();
        let joints = model.joints_of_q(self.trial.as_slice());
        let at_limits = (0..model.joint_count())
            .filter(|&index| joints[index] <= model.lower()[index] || joints[index] >= model.upper()[index])
            .map(|index| model.joint_names()[index].clone())
            .collect();
        IkFailure {
            frame: model.frames()[frame.index()].name.clone(),
            seeds: options.seeds.max(1),
            position_error,
            rotation_error,
            at_limits,
            singular: slope < 1e-2 * error.norm() * self.outcome.norm(),
        }
    }
}

/// Returns distance and angle.
fn sizes(error: &Vector6<f64>) -> (f64, f64) {
    (error.fixed_rows::<3>(0).norm(), error.fixed_rows::<3>(3).norm())
}
