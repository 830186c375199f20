//! State, propagation and correction of the filter.

use motorium_robots::lie::so3;
use nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector3};

use super::blocks::Blocks;
use super::noise::{FilterNoise, StartDeviations};
use crate::estimation::SingularInnovation;

/// Blocks of the covariance: rotation, velocity, position, the two biases, then the feet.
const ROTATION: usize = 0;
const VELOCITY: usize = 1;
const POSITION: usize = 2;
const GYROSCOPE: usize = 3;
const ACCELEROMETER: usize = 4;
const FEET: usize = 5;

/// Measured position of a foot on the ground, from forward kinematics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactKinematics {
    /// Position of the foot relative to the sensor's origin, in sensor axes \[m\].
    pub position: Vector3<f64>,
    /// Covariance of the position error in sensor axes \[m2\]: `J cov(q) J'`.
    pub covariance: Matrix3<f64>,
}

/// State of the filter without the positions of the feet: pose, velocity and biases of the inertial
/// measurement unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterState {
    /// Orientation of the sensor in the world.
    pub rotation: UnitQuaternion<f64>,
    /// Velocity of the sensor's origin in world axes \[m/s\].
    pub velocity: Vector3<f64>,
    /// Position of the sensor's origin in the world \[m\].
    pub position: Vector3<f64>,
    /// Gyroscope bias in sensor axes \[rad/s\].
    pub gyroscope_bias: Vector3<f64>,
    /// Accelerometer bias in sensor axes \[m/s2\].
    pub accelerometer_bias: Vector3<f64>,
}

impl Default for FilterState {
    fn default() -> Self {
        Self {
            rotation: UnitQuaternion::identity(),
            velocity: Vector3::zeros(),
            position: Vector3::zeros(),
            gyroscope_bias: Vector3::zeros(),
            accelerometer_bias: Vector3::zeros(),
        }
    }
}

/// Contact-aided invariant extended Kalman filter: estimates pose and velocity of a legged robot's base from
/// an inertial measurement unit, joint encoders and the contacts of its feet.
///
/// The state `X = (R, v, p, d_1 .. d_K)` in `SE_(K+2)(3)` holds orientation, velocity and position of the
/// sensor in the world and the positions of the feet on the ground. The state also contains the biases of
/// gyroscope and accelerometer. Between readings `omega`, `f`
///
/// ```text
/// dR/dt = R (omega - b_g - w_g)^      dv/dt = R (f - b_a - w_a) + g      dp/dt = v      dd/dt = R w_d
/// ```
///
/// integrated exactly for readings that are constant over a step. The error is right-invariant,
/// `X_est X^-1 = exp(xi)`, in world axes. The linear dynamics of the error do not depend on the state, except
/// for the biases. A foot on the ground measures `R' (d - p)`, the forward kinematics `h` of its joints; the
/// innovation `R h - (d - p)` is linear in `xi` with a constant matrix. The linearisation therefore adds no
/// spurious information: position and yaw, which contacts cannot observe, stay uncertain.
///
/// A foot is added at `p + R h` at touchdown and removed at lift-off. For rolling round feet,
/// [`roll`](Self::roll) moves the contact without changing the error.
///
/// Hartley, Ghaffari, Eustice and Grizzle, *Contact-aided invariant extended Kalman filtering for robot state
/// estimation*, IJRR 39(4), 2020. Nothing allocates after [`new`](Self::new).
///
/// ```
/// use motorium_sensors::estimation::{ContactKinematics, FilterNoise, FilterState, InvariantFilter, StartDeviations};
/// use nalgebra::{Matrix3, Vector3};
///
/// let mut filter = InvariantFilter::new(1, FilterNoise::default(), Vector3::new(0.0, 0.0, -9.81));
/// filter.start(&FilterState::default(), &StartDeviations::default());
/// let foot = ContactKinematics { position: Vector3::new(0.1, 0.0, -0.3), covariance: Matrix3::identity() * 1e-8 };
/// for _ in 0..20_000 {
///     // At rest, with an accelerometer that is off by 0.02 m/s2.
///     filter.propagate(&Vector3::zeros(), &Vector3::new(0.0, 0.0, 9.83), 1e-3);
///     filter.correct(0, &foot)?;
/// }
/// let state = filter.state();
/// assert!(state.velocity.norm() < 1e-3 && (state.accelerometer_bias.z - 0.02).abs() < 0.01);
/// # Ok::<(), motorium_sensors::estimation::SingularInnovation>(())
/// ```
#[derive(Clone, Debug)]
pub struct InvariantFilter {
    noise: FilterNoise,
    gravity: Vector3<f64>,
    state: FilterState,
    /// Positions of the feet on the ground, in the world \[m\]; `None` in the air.
    feet: Vec<Option<Vector3<f64>>>,
    covariance: Blocks,
    gain: Vec<Matrix3<f64>>,
}

impl InvariantFilter {
    /// Creates a filter for up to `feet` feet under the gravitational acceleration `gravity` \[m/s2\] in the
    /// world.
    pub fn new(feet: usize, noise: FilterNoise, gravity: Vector3<f64>) -> Self {
        let blocks = FEET + feet;
        let mut filter = Self {
            noise,
            gravity,
            state: FilterState::default(),
            feet: vec![None; feet],
            covariance: Blocks::new(blocks),
            gain: vec![Matrix3::zeros(); blocks],
        };
        filter.start(&FilterState::default(), &StartDeviations::default());
        filter
    }

    /// Restarts from a state with the given standard deviations. All feet are then in the air.
    pub fn start(&mut self, state: &FilterState, deviations: &StartDeviations) {
        self.state = *state;
        self.feet.fill(None);
        self.covariance.clear();
        let StartDeviations { tilt, yaw, velocity, position, gyroscope_bias, accelerometer_bias } =
            *deviations;
        let up = -self.gravity.try_normalize(0.0).unwrap_or(-Vector3::z());
        let about = up * up.transpose();
        *self.covariance.get_mut(ROTATION, ROTATION) =
            about * yaw.powi(2) + (Matrix3::identity() - about) * tilt.powi(2);
        for (block, deviation) in [
            (VELOCITY, velocity),
            (POSITION, position),
            (GYROSCOPE, gyroscope_bias),
            (ACCELEROMETER, accelerometer_bias),
        ] {
            *self.covariance.get_mut(block, block) = Matrix3::identity() * deviation.powi(2);
        }
        // The deviations describe velocity and position themselves, so xi_v = dv + [v] xi_R; likewise for the
        // position.
        for (block, value) in [(VELOCITY, state.velocity), (POSITION, state.position)] {
            self.covariance.add_multiple(block, ROTATION, &value.cross_matrix());
        }
    }

    /// Propagates the state by `dt` \[s\]. The arguments are the mean angular velocity \[rad/s\] and the mean
    /// specific force \[m/s2\] over that time, in sensor axes.
    pub fn propagate(&mut self, angular_velocity: &Vector3<f64>, specific_force: &Vector3<f64>, dt: f64) {
        let before = self.state;
        self.propagate_covariance(dt);
        let turn = (angular_velocity - before.gyroscope_bias) * dt;
        let force = specific_force - before.accelerometer_bias;
        let once = so3::left_jacobian(&turn) * force;
        let twice = second_integral(&turn) * force;
        let state = &mut self.state;
        state.position += before.velocity * dt + (before.rotation * twice + self.gravity * 0.5) * (dt * dt);
        state.velocity += (before.rotation * once + self.gravity) * dt;
        let rotation = before.rotation * so3::exp(&turn);
        state.rotation = UnitQuaternion::new_normalize(rotation.into_inner());
    }

    /// Computes `P = F (P + A Q A' dt) F'` with `F = exp(L dt)`, the error dynamics `L` and the adjoint `A`
    /// of the state.
    fn propagate_covariance(&mut self, dt: f64) {
        let Self { noise, gravity, state, feet, covariance, .. } = self;
        let rotation = state.rotation.to_rotation_matrix().into_inner();
        let (v, p) = (state.velocity.cross_matrix(), state.position.cross_matrix());
        // Gyroscope noise affects every quantity that rotates about the origin of the world.
        let add = |covariance: &mut Blocks, a: usize, b: usize, part: Matrix3<f64>| {
            *covariance.get_mut(a, b) += part;
            if a != b {
                *covariance.get_mut(b, a) += part.transpose();
            }
        };
        let turning = noise.gyroscope.powi(2) * dt;
        let arm = |block: usize, feet: &[Option<Vector3<f64>>]| match block {
            ROTATION => Some(Matrix3::identity()),
            VELOCITY => Some(v),
            POSITION => Some(p),
            GYROSCOPE | ACCELEROMETER => None,
            foot => feet[foot - FEET].map(|place| place.cross_matrix()),
        };
        for a in 0..covariance.count() {
            let Some(one) = arm(a, feet) else { continue };
            for b in a..covariance.count() {
                let Some(other) = arm(b, feet) else { continue };
                add(covariance, a, b, one * other.transpose() * turning);
            }
        }
        let own = |deviation: f64| Matrix3::identity() * (deviation.powi(2) * dt);
        add(covariance, VELOCITY, VELOCITY, own(noise.accelerometer));
        add(covariance, GYROSCOPE, GYROSCOPE, own(noise.gyroscope_bias_walk));
        add(covariance, ACCELEROMETER, ACCELEROMETER, own(noise.accelerometer_bias_walk));
        for foot in (0..feet.len()).filter(|foot| feet[*foot].is_some()) {
            add(covariance, FEET + foot, FEET + foot, own(noise.slip));
        }
        // Apply F row by row, starting with the row that no other row reads and ending with the row that all
        // read.
        let g = gravity.cross_matrix();
        let (half, sixth) = (0.5 * dt * dt, dt * dt * dt / 6.0);
        let identity = Matrix3::identity();
        let to_position = -(p * dt + v * half + g * sixth) * rotation;
        covariance.add_multiple(POSITION, GYROSCOPE, &to_position);
        covariance.add_multiple(POSITION, ACCELEROMETER, &(-rotation * half));
        covariance.add_multiple(POSITION, ROTATION, &(g * half));
        covariance.add_multiple(POSITION, VELOCITY, &(identity * dt));
        for (foot, place) in feet.iter().enumerate() {
            if let Some(place) = place {
                covariance.add_multiple(FEET + foot, GYROSCOPE, &(-place.cross_matrix() * rotation * dt));
            }
        }
        covariance.add_multiple(VELOCITY, GYROSCOPE, &(-(v * dt + g * half) * rotation));
        covariance.add_multiple(VELOCITY, ACCELEROMETER, &(-rotation * dt));
        covariance.add_multiple(VELOCITY, ROTATION, &(g * dt));
        covariance.add_multiple(ROTATION, GYROSCOPE, &(-rotation * dt));
        covariance.symmetrize();
    }

    /// Corrects the state with a foot on the ground. At touchdown the foot is only added to the state.
    /// Returns the normalised innovation squared, whose mean is 3 for a consistent filter, or 0 for an added
    /// foot.
    ///
    /// # Errors
    /// [`SingularInnovation`] if the covariance of the innovation is not positive definite. The filter is
    /// then unchanged.
    ///
    /// # Panics
    /// If `foot` is not the index of a foot.
    pub fn correct(&mut self, foot: usize, contact: &ContactKinematics) -> Result<f64, SingularInnovation> {
        let block = FEET + foot;
        let rotation = self.state.rotation.to_rotation_matrix().into_inner();
        let own = Matrix3::identity() * self.noise.foot.powi(2);
        let noise = rotation * (contact.covariance + own) * rotation.transpose();
        let reach = rotation * contact.position;
        let Some(place) = self.feet[foot] else {
            self.feet[foot] = Some(self.state.position + reach);
            self.covariance.copy_block(POSITION, block);
            *self.covariance.get_mut(block, block) += noise;
            return Ok(0.0);
        };
        let innovation = reach - (place - self.state.position);
        let covariance = &mut self.covariance;
        let at = |row: usize, column: usize| *covariance.get(row, column);
        let spread =
            at(POSITION, POSITION) - at(POSITION, block) - at(block, POSITION) + at(block, block) + noise;
        let factor = spread.cholesky().ok_or(SingularInnovation)?;
        for (row, gain) in self.gain.iter_mut().enumerate() {
            let cross = at(row, block) - at(row, POSITION);
            *gain = factor.solve(&cross.transpose()).transpose();
        }
        let count = covariance.count();
        // (1 - K H) P (1 - K H)' + K N K', with K H x = K (x_foot - x_position)
        for column in 0..count {
            let difference = covariance.get(block, column) - covariance.get(POSITION, column);
            for row in 0..count {
                *covariance.get_mut(row, column) -= self.gain[row] * difference;
            }
        }
        for row in 0..count {
            let difference = covariance.get(row, block) - covariance.get(row, POSITION);
            for column in 0..count {
                *covariance.get_mut(row, column) -= difference * self.gain[column].transpose();
            }
        }
        for row in 0..count {
            for column in 0..count {
                *covariance.get_mut(row, column) += self.gain[row] * noise * self.gain[column].transpose();
            }
        }
        covariance.symmetrize();
        self.apply(&innovation);
        Ok(innovation.dot(&factor.solve(&innovation)))
    }

    /// Computes `X = exp(K z) X` and adds the corrections of the biases.
    fn apply(&mut self, innovation: &Vector3<f64>) {
        let step = |block: usize| self.gain[block] * innovation;
        let turn = step(ROTATION);
        let (rotation, left) = (so3::exp(&turn), so3::left_jacobian(&turn));
        let moved = |value: &Vector3<f64>, block: usize| rotation * value + left * step(block);
        let state = FilterState {
            rotation: UnitQuaternion::new_normalize((rotation * self.state.rotation).into_inner()),
            velocity: moved(&self.state.velocity, VELOCITY),
            position: moved(&self.state.position, POSITION),
            gyroscope_bias: self.state.gyroscope_bias + step(GYROSCOPE),
            accelerometer_bias: self.state.accelerometer_bias + step(ACCELEROMETER),
        };
        for foot in 0..self.feet.len() {
            if let Some(place) = self.feet[foot] {
                self.feet[foot] = Some(moved(&place, FEET + foot));
            }
        }
        self.state = state;
    }

    /// Moves the contact of a foot on the ground by a displacement in sensor axes \[m\], for round feet that
    /// roll. No effect on a foot in the air.
    pub fn roll(&mut self, foot: usize, distance: &Vector3<f64>) {
        if let Some(place) = &mut self.feet[foot] {
            *place += self.state.rotation * distance;
        }
    }

    /// Removes a foot from the state at lift-off.
    pub fn lift(&mut self, foot: usize) {
        if self.feet[foot].take().is_some() {
            self.covariance.clear_block(FEET + foot);
        }
    }

    /// Returns the estimated state.
    pub fn state(&self) -> &FilterState {
        &self.state
    }

    /// Returns the estimated position in the world \[m\] of a foot on the ground; `None` for a foot in the
    /// air.
    pub fn foot(&self, foot: usize) -> Option<Vector3<f64>> {
        self.feet[foot]
    }

    /// Returns the number of feet on the ground.
    pub fn contacts(&self) -> usize {
        self.feet.iter().flatten().count()
    }

    /// Returns the covariance of the right-invariant error: rotation, velocity and position (`xi` of
    /// `exp(xi)`, world axes), then the gyroscope and accelerometer biases.
    pub fn invariant_covariance(&self) -> SMatrix<f64, 15, 15> {
        SMatrix::from_fn(|row, column| self.covariance.get(row / 3, column / 3)[(row % 3, column % 3)])
    }

    /// Returns the covariance of the errors of rotation (a rotation vector in world axes), velocity and
    /// position, in this order. This covariance follows from the invariant covariance by `v_est - v = xi_v -
    /// [v] xi_R`, and likewise for the position.
    pub fn covariance(&self) -> SMatrix<f64, 9, 9> {
        let invariant = self.invariant_covariance().fixed_view::<9, 9>(0, 0).into_owned();
        let mut map = SMatrix::<f64, 9, 9>::identity();
        map.fixed_view_mut::<3, 3>(3, 0).copy_from(&-self.state.velocity.cross_matrix());
        map.fixed_view_mut::<3, 3>(6, 0).copy_from(&-self.state.position.cross_matrix());
        map * invariant * map.transpose()
    }
}

/// Computes `sum [phi]^k / (k + 2)!`: the rotation `exp(phi)` integrated twice over a step.
fn second_integral(phi: &Vector3<f64>) -> Matrix3<f64> {
    let (angle, cross) = (phi.norm(), phi.cross_matrix());
    let square = angle * angle;
    let (a, b) = if angle < 0.05 {
        (
            1.0 / 6.0 - square / 120.0 + square * square / 5040.0,
            1.0 / 24.0 - square / 720.0 + square * square / 40_320.0,
        )
    } else {
        let half = 0.5 * angle;
        (
            (angle - angle.sin()) / (square * angle),
            (half * half * 2.0 - 2.0 * half.sin().powi(2)) / (square * square),
        )
    };
    Matrix3::identity() * 0.5 + cross * a + cross * cross * b
}
