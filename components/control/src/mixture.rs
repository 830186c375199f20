//! Mixtures of solutions, for tasks that fade.

/// A weighted sum of solutions. If the weights are nonnegative and sum to 1, the weighted sum satisfies every
/// convex limit that all solutions satisfy. Friction, unilateral contacts and torque limits are convex.
///
/// The only task on a level has the same effect with a small weight as with a large one, so reducing its
/// weight cannot fade it out. A mixture of the solutions with and without the task fades the task out.
///
/// ```
/// use motorium_control::{DifferentialIk, Mixture, RobotState};
/// use motorium_control::tasks::{CartesianTask, PostureTask, VelocityTask};
/// use motorium_robots::{Kinematics, load};
/// use nalgebra::DVector;
///
/// let panda = load("panda", std::path::Path::new("."))?;
/// let (model, home) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
/// let mut kinematics = Kinematics::new(model);
/// kinematics.update(model, home.as_slice());
/// let mut hand = CartesianTask::new(model, model.frame("panda_hand_tcp")?);
/// hand.set_target(kinematics.pose(model, hand.frame()));
/// let mut posture = PostureTask::new(model, &vec![0.1; model.nv()]);
/// let mut ik = DifferentialIk::new(model).levels(&[hand.rows(), posture.rows()]);
/// let state = RobotState { model, kinematics: &kinematics, q: home.as_slice() };
///
/// let (mut mixture, mut solutions) = (Mixture::new(ik.unknowns().len()), Vec::new());
/// for (with_hand, share) in [(false, 0.75), (true, 0.25)] {
///     ik.begin();
///     if with_hand {
///         ik.add_task(&state, 0, &mut hand);
///     }
///     ik.add_task(&state, 1, &mut posture);
///     solutions.push(DVector::from_column_slice(ik.solve()?) * share);
///     mixture.add(share, ik.unknowns());
/// }
/// ik.set_unknowns(mixture.unknowns());
/// let mixed = DVector::from_column_slice(ik.velocity());
/// assert!((mixed - (&solutions[0] + &solutions[1])).norm() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Mixture {
    unknowns: Vec<f64>,
}

impl Mixture {
    /// Creates an empty mixture of solutions with this number of unknowns.
    pub fn new(unknowns: usize) -> Self {
        Self { unknowns: vec![0.0; unknowns] }
    }

    /// Removes all solutions.
    pub fn clear(&mut self) {
        self.unknowns.fill(0.0);
    }

    /// Adds a solution, given by its unknowns, with the weight `share`.
    pub fn add(&mut self, share: f64, solution: &[f64]) {
        for (mixed, unknown) in self.unknowns.iter_mut().zip(solution) {
            *mixed += share * unknown;
        }
    }

    /// Returns the unknowns of the mixture: the weighted sum of the unknowns of all solutions.
    pub fn unknowns(&self) -> &[f64] {
        &self.unknowns
    }
}
