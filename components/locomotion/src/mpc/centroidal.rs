//! The quadratic program of a horizon of centroidal motion.

use motorium_qp::{ActiveSetSettings, ActiveSetSolver, Problem, QpSolver, Sides, SolveError, Structure};
use nalgebra::{DMatrix, Matrix3, Rotation3, SVector, Vector3};

use super::horizon::{CentroidalState, HorizonStep, MpcSettings};

/// Number of rows of a state.
const STATE: usize = 12;

/// A state as a column: rotation, position, angular momentum, velocity.
type Column = SVector<f64, STATE>;

/// Model-predictive control of the centroidal motion; see the [module](super). Only construction allocates.
#[derive(Debug)]
pub struct CentroidalMpc {
    settings: MpcSettings,
    points: usize,
    /// Axes of the force variables: two tangents and the normal of the ground, as columns.
    axes: Matrix3<f64>,
    horizon: Vec<HorizonStep>,
    /// Predicted states, from the beginning to the end of the horizon.
    predicted: Vec<CentroidalState>,
    /// `true` if `predicted` is from the previous horizon.
    predicts: bool,
    problem: Problem,
    solver: ActiveSetSolver,
    /// Effect of all forces on the state, and its rows weighted by the cost: one column per force.
    effect: DMatrix<f64>,
    weighed: DMatrix<f64>,
    forces: Vec<Vector3<f64>>,
    iterations: u32,
}

impl CentroidalMpc {
    /// Creates a controller with one contact point per entry of `friction`, the points' friction
    /// coefficients.
    ///
    /// # Panics
    /// If `settings` specify a horizon without steps.
    pub fn new(settings: MpcSettings, friction: &[f64]) -> Self {
        assert!(settings.steps > 0, "a horizon without a step");
        let (steps, points) = (settings.steps, friction.len());
        let variables = 3 * points * steps;
        let mut structure = Structure::new(variables).rows(4 * points * steps, Sides::Upper);
        for point in 0..points * steps {
            structure = structure.bound(3 * point + 2, Sides::Both);
        }
        let mut problem = Problem::new(&structure);
        for slot in 0..points * steps {
            // an inner approximation of the cone
            let friction = friction[slot % points] * std::f64::consts::FRAC_1_SQRT_2;
            for (face, (axis, sign)) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)].into_iter().enumerate() {
                problem.row_matrix[(4 * slot + face, 3 * slot + axis)] = sign;
                problem.row_matrix[(4 * slot + face, 3 * slot + 2)] = -friction;
            }
        }
        Self {
            horizon: (0..steps).map(|_| HorizonStep::of_points(points)).collect(),
            predicted: vec![CentroidalState::default(); steps + 1],
            predicts: false,
            solver: ActiveSetSolver::new(structure, ActiveSetSettings::default()),
            problem,
            effect: DMatrix::zeros(STATE, variables),
            weighed: DMatrix::zeros(STATE, variables),
            forces: vec![Vector3::zeros(); points * steps],
            iterations: 0,
            axes: Matrix3::identity(),
            points,
            settings,
        }
    }

    /// Returns the settings.
    pub fn settings(&self) -> &MpcSettings {
        &self.settings
    }

    /// Returns the steps of the horizon, to be filled in before [`solve`](Self::solve).
    pub fn horizon_mut(&mut self) -> &mut [HorizonStep] {
        &mut self.horizon
    }

    /// Sets the ground axes for the following solves: two tangents and the normal, as columns. The friction
    /// cones are centred on this normal.
    pub fn set_ground_axes(&mut self, axes: &Matrix3<f64>) {
        self.axes = *axes;
    }

    /// Discards the previous horizon. The next solve gives the same result as with a new controller.
    pub fn reset(&mut self) {
        self.predicts = false;
        self.solver.reset();
    }

    /// Computes the forces of the horizon from `state`, `elapsed` seconds after the previous solve. `inertia`
    /// is the inertia of the whole robot about its centre of mass, in world axes \[kg m2\], while the
    /// reference has the heading `heading` \[rad\]. In later steps the inertia turns with the heading of the
    /// reference.
    ///
    /// # Errors
    /// [`SolveError`] from the solver. The program is never infeasible, because zero force satisfies all
    /// constraints.
    pub fn solve(
        &mut self,
        state: &CentroidalState,
        (inertia, heading): (&Matrix3<f64>, f64),
        elapsed: f64,
    ) -> Result<(), SolveError> {
        self.place_arms(state, elapsed);
        self.assemble(state, inertia, heading);
        self.solver.update(&self.problem).map_err(|_| SolveError::NotUpdated)?;
        let solution = self.solver.solve()?;
        self.iterations = solution.iterations;
        for (force, x) in self.forces.iter_mut().zip(solution.x.as_slice().as_chunks::<3>().0) {
            *force = self.axes * Vector3::from(*x);
        }
        self.predict(state, inertia, heading);
        Ok(())
    }

    /// Returns the force at contact point `point` in step `step` of the last solution, in world axes \[N\].
    pub fn force(&self, step: usize, point: usize) -> Vector3<f64> {
        self.forces[step * self.points + point]
    }

    /// Returns the predicted states of the last solution, from the beginning to the end of the horizon.
    pub fn predicted(&self) -> &[CentroidalState] {
        &self.predicted
    }

    /// Returns the number of iterations of the last solution.
    pub fn iterations(&self) -> u32 {
        self.iterations
    }

    /// Returns the quadratic program of the last solve.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// Assembles the quadratic program.
    fn assemble(&mut self, state: &CentroidalState, inertia: &Matrix3<f64>, heading: f64) {
        let variables = self.problem.gradient.len();
        self.problem.hessian.fill(0.0);
        self.problem.gradient.fill(0.0);
        self.effect.fill(0.0);
        let mut free = column(state);
        for step in 0..self.settings.steps {
            self.bound(step);
            let inverse = inverse_inertia(inertia, self.horizon[step].heading - heading);
            self.advance(step, &inverse, &mut free);
            let used = 3 * self.points * (step + 1);
            self.weigh(step, &inverse, used);
            self.add_cost(step, &inverse, &free, used);
        }
        self.regularise(variables);
    }

    /// Adds the cost of the forces.
    fn regularise(&mut self, variables: usize) {
        let (settings, slots) = (&self.settings, self.points);
        let weight_of_robot = settings.mass * settings.gravity.norm();
        let weight = (settings.weights.force / weight_of_robot.max(f64::MIN_POSITIVE)).powi(2);
        for variable in 0..variables {
            let slot = variable / 3;
            let step = &self.horizon[slot / slots];
            if step.points[slot % slots].is_none() {
                // no other term contains it, so it becomes zero
                self.problem.hessian[(variable, variable)] = 1.0;
                continue;
            }
            self.problem.hessian[(variable, variable)] += weight;
            let touching = step.points.iter().flatten().count() as f64;
            let share = (-settings.mass * settings.gravity.z / touching).max(0.0);
            self.problem.gradient[variable] -= weight * share * self.axes[(2, variable % 3)];
        }
    }

    /// Chooses the reference point of the lever arms in each step: the measured centre of mass for the first
    /// horizon, then the previous prediction.
    fn place_arms(&mut self, state: &CentroidalState, elapsed: f64) {
        let h = self.settings.step;
        for (step, horizon) in self.horizon.iter_mut().enumerate() {
            let later = (step as f64 + 0.5) * h;
            horizon.centre = match self.predicts {
                _ if step == 0 => state.position + state.velocity * (0.5 * h),
                true => {
                    let place = ((later + elapsed) / h).min(self.settings.steps as f64);
                    let before = (place as usize).min(self.settings.steps - 1);
                    let (one, other) = (&self.predicted[before], &self.predicted[before + 1]);
                    one.position + (other.position - one.position) * (place - before as f64)
                }
                false => horizon.position,
            };
        }
    }

    /// Sets the bounds of the forces of a step.
    fn bound(&mut self, step: usize) {
        for (point, place) in self.horizon[step].points.iter().enumerate() {
            let slot = step * self.points + point;
            let touches = place.is_some();
            self.problem.lower[3 * slot + 2] = if touches { 0.0 } else { f64::NEG_INFINITY };
            self.problem.upper[3 * slot + 2] = if touches { self.settings.max_force } else { f64::INFINITY };
            for face in 0..4 {
                self.problem.row_upper[4 * slot + face] = if touches { 0.0 } else { f64::INFINITY };
            }
        }
    }

    /// Advances the force-free state and the effect of the forces by one step.
    fn advance(&mut self, step: usize, inverse: &Matrix3<f64>, free: &mut Column) {
        let MpcSettings { step: h, mass, gravity, .. } = self.settings;
        let horizon = &self.horizon[step];
        drift(free, inverse, h);
        let spin = horizon.angular_velocity * h;
        for axis in 0..3 {
            free[axis] -= spin[axis];
            free[3 + axis] += 0.5 * h * h * gravity[axis];
            free[9 + axis] += h * gravity[axis];
        }
        let before = 3 * self.points * step;
        for mut column in self.effect.columns_mut(0, before).column_iter_mut() {
            let mut moved = Column::from_column_slice(column.as_slice());
            drift(&mut moved, inverse, h);
            column.copy_from(&moved);
        }
        for (point, place) in horizon.points.iter().enumerate() {
            let Some(place) = place else { continue };
            let arm = place - horizon.centre;
            for axis in 0..3 {
                let force = self.axes.column(axis).into_owned();
                let effect = column(&impulse(&arm, &force, inverse, h, mass));
                self.effect.column_mut(before + 3 * point + axis).copy_from(&effect);
            }
        }
    }

    /// Weights the rows of the effect of the first `used` forces at the end of a step.
    fn weigh(&mut self, step: usize, inverse: &Matrix3<f64>, used: usize) {
        let scale = Scale::new(&self.settings, self.horizon[step].heading, inverse);
        for place in 0..used {
            let effect = Column::from_column_slice(self.effect.column(place).as_slice());
            self.weighed.column_mut(place).copy_from(&scale.apply(&effect));
        }
    }

    /// Adds the cost of the state at the end of a step.
    fn add_cost(&mut self, step: usize, inverse: &Matrix3<f64>, free: &Column, used: usize) {
        let horizon = &self.horizon[step];
        let momentum = inverse.try_inverse().unwrap_or_else(Matrix3::zeros) * horizon.angular_velocity;
        let desired = CentroidalState {
            turn: Vector3::zeros(),
            position: horizon.position,
            angular_momentum: momentum,
            velocity: horizon.velocity,
        };
        let error = Scale::new(&self.settings, horizon.heading, inverse).apply(&(free - column(&desired)));
        let (weighed, rows) = (self.weighed.as_slice(), self.problem.hessian.nrows());
        let hessian = self.problem.hessian.as_mut_slice();
        let (columns, _) = weighed.as_chunks::<STATE>();
        for (j, right) in columns[..used].iter().enumerate() {
            for (left, entry) in columns[..=j].iter().zip(&mut hessian[j * rows..]) {
                *entry += dot(left, right);
            }
            self.problem.gradient[j] += dot(right, error.as_ref());
        }
    }

    /// Predicts the states under the forces of the solution.
    fn predict(&mut self, state: &CentroidalState, inertia: &Matrix3<f64>, heading: f64) {
        let MpcSettings { step: h, mass, gravity, .. } = self.settings;
        self.predicted[0] = *state;
        let mut at = column(state);
        for (step, horizon) in self.horizon.iter().enumerate() {
            let inverse = inverse_inertia(inertia, horizon.heading - heading);
            drift(&mut at, &inverse, h);
            let spin = horizon.angular_velocity * h;
            for axis in 0..3 {
                at[axis] -= spin[axis];
                at[3 + axis] += 0.5 * h * h * gravity[axis];
                at[9 + axis] += h * gravity[axis];
            }
            for (point, place) in horizon.points.iter().enumerate() {
                let Some(place) = place else { continue };
                let force = self.forces[step * self.points + point];
                at += column(&impulse(&(place - horizon.centre), &force, &inverse, h, mass));
            }
            self.predicted[step + 1] = CentroidalState {
                turn: at.fixed_rows::<3>(0).into_owned(),
                position: at.fixed_rows::<3>(3).into_owned(),
                angular_momentum: at.fixed_rows::<3>(6).into_owned(),
                velocity: at.fixed_rows::<3>(9).into_owned(),
            };
        }
        self.predicts = true;
    }
}

/// Weights of the rows of a state in heading axes. The angular momentum is weighted as an angular velocity.
struct Scale {
    weights: [Vector3<f64>; 4],
    inverse: Matrix3<f64>,
    sin: f64,
    cos: f64,
}

impl Scale {
    fn new(settings: &MpcSettings, heading: f64, inverse: &Matrix3<f64>) -> Self {
        let weights = &settings.weights;
        let (sin, cos) = heading.sin_cos();
        Self {
            weights: [weights.turn, weights.position, weights.angular_velocity, weights.velocity],
            inverse: *inverse,
            sin,
            cos,
        }
    }

    fn apply(&self, state: &Column) -> Column {
        let mut weighed = Column::zeros();
        for (block, weight) in self.weights.iter().enumerate() {
            let mut part = state.fixed_rows::<3>(3 * block).into_owned();
            if block == 2 {
                part = self.inverse * part;
            }
            let along = self.cos * part.x + self.sin * part.y;
            let across = self.cos * part.y - self.sin * part.x;
            let seen = Vector3::new(along, across, part.z);
            weighed.fixed_rows_mut::<3>(3 * block).copy_from(&weight.component_mul(&seen));
        }
        weighed
    }
}

fn dot(left: &[f64; STATE], right: &[f64; STATE]) -> f64 {
    left.iter().zip(right).map(|(left, right)| left * right).sum()
}

fn column(state: &CentroidalState) -> Column {
    let mut column = Column::zeros();
    column.fixed_rows_mut::<3>(0).copy_from(&state.turn);
    column.fixed_rows_mut::<3>(3).copy_from(&state.position);
    column.fixed_rows_mut::<3>(6).copy_from(&state.angular_momentum);
    column.fixed_rows_mut::<3>(9).copy_from(&state.velocity);
    column
}

/// Returns the inverse of the inertia, rotated about the vertical.
fn inverse_inertia(inertia: &Matrix3<f64>, yaw: f64) -> Matrix3<f64> {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
    let turned = turn * inertia * turn.transpose();
    turned.try_inverse().unwrap_or_else(Matrix3::zeros)
}

/// Advances a state without forces and weight by `h` seconds.
fn drift(state: &mut Column, inverse: &Matrix3<f64>, h: f64) {
    let turn = inverse * state.fixed_rows::<3>(6) * h;
    for axis in 0..3 {
        state[axis] += turn[axis];
        state[3 + axis] += h * state[9 + axis];
    }
}

/// Returns the change of a state by a force that acts for `h` seconds.
fn impulse(
    arm: &Vector3<f64>,
    force: &Vector3<f64>,
    inverse: &Matrix3<f64>,
    h: f64,
    mass: f64,
) -> CentroidalState {
    let torque = arm.cross(force);
    CentroidalState {
        turn: inverse * torque * (0.5 * h * h),
        position: force * (0.5 * h * h / mass),
        angular_momentum: torque * h,
        velocity: force * (h / mass),
    }
}
