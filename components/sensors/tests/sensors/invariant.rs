//! The contact-aided invariant filter, compared with closed forms, finite differences and its own statistics.

use motorium_robots::lie::so3;
use motorium_sensors::estimation::{
    ContactKinematics, FilterNoise, FilterState, InvariantFilter, StartDeviations,
};
use motorium_sensors::noise::Noise;
use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

const NO_NOISE: FilterNoise = FilterNoise {
    gyroscope: 0.0,
    accelerometer: 0.0,
    gyroscope_bias_walk: 0.0,
    accelerometer_bias_walk: 0.0,
    slip: 0.0,
    foot: 0.0,
};

fn some_state() -> FilterState {
    FilterState {
        rotation: UnitQuaternion::from_euler_angles(0.3, -0.2, 1.1),
        velocity: Vector3::new(0.4, -0.3, 0.1),
        position: Vector3::new(2.0, -1.0, 0.5),
        gyroscope_bias: Vector3::new(0.01, -0.02, 0.03),
        accelerometer_bias: Vector3::new(-0.1, 0.05, 0.2),
    }
}

fn deviations() -> StartDeviations {
    StartDeviations {
        tilt: 0.02,
        yaw: 0.01,
        velocity: 0.05,
        position: 0.03,
        gyroscope_bias: 0.004,
        accelerometer_bias: 0.05,
    }
}

/// Returns the invariant error of an estimate and the errors of its biases.
fn error(estimate: &FilterState, truth: &FilterState) -> SVector<f64, 15> {
    let turn = estimate.rotation * truth.rotation.inverse();
    let phi = so3::log(&turn);
    let back = so3::left_jacobian_inverse(&phi);
    let parts = [
        phi,
        back * (estimate.velocity - turn * truth.velocity),
        back * (estimate.position - turn * truth.position),
        estimate.gyroscope_bias - truth.gyroscope_bias,
        estimate.accelerometer_bias - truth.accelerometer_bias,
    ];
    SVector::from_fn(|row, _| parts[row / 3][row % 3])
}

/// Returns the state with this error relative to `truth`.
fn perturbed(truth: &FilterState, xi: &SVector<f64, 15>) -> FilterState {
    let part = |index: usize| xi.fixed_rows::<3>(3 * index).into_owned();
    let (turn, left) = (so3::exp(&part(0)), so3::left_jacobian(&part(0)));
    FilterState {
        rotation: turn * truth.rotation,
        velocity: turn * truth.velocity + left * part(1),
        position: turn * truth.position + left * part(2),
        gyroscope_bias: truth.gyroscope_bias + part(3),
        accelerometer_bias: truth.accelerometer_bias + part(4),
    }
}

fn propagated(start: &FilterState, omega: &Vector3<f64>, force: &Vector3<f64>, dt: f64) -> FilterState {
    let mut filter = InvariantFilter::new(0, NO_NOISE, GRAVITY);
    filter.start(start, &deviations());
    filter.propagate(omega, force, dt);
    *filter.state()
}

#[test]
fn constant_readings_are_integrated_exactly() {
    let (omega, force) = (Vector3::new(2.0, -3.0, 1.0), Vector3::new(1.0, 4.0, 9.0));
    let once = propagated(&some_state(), &omega, &force, 0.1);
    let mut many = some_state();
    for _ in 0..2000 {
        many = propagated(&many, &omega, &force, 5e-5);
    }
    assert!(once.rotation.angle_to(&many.rotation) < 1e-12);
    assert!((once.velocity - many.velocity).norm() < 1e-11);
    assert!((once.position - many.position).norm() < 1e-11);
}

#[test]
fn thrown_body_follows_its_parabola() {
    let start = FilterState { velocity: Vector3::new(1.0, 0.0, 3.0), ..FilterState::default() };
    let end = propagated(&start, &Vector3::new(5.0, 1.0, -2.0), &Vector3::zeros(), 0.5);
    assert!((end.velocity - Vector3::new(1.0, 0.0, 3.0 - 9.81 * 0.5)).norm() < 1e-14);
    assert!((end.position - Vector3::new(0.5, 0.0, 1.5 - 0.5 * 9.81 * 0.25)).norm() < 1e-14);
}

/// Columns of the error dynamics, by central differences of the propagation itself.
#[test]
fn covariance_propagation_matches_finite_differences() {
    let (omega, force, dt) = (Vector3::new(0.3, -0.5, 0.8), Vector3::new(0.5, -1.0, 9.5), 1e-3);
    let start = some_state();
    let truth = propagated(&start, &omega, &force, dt);
    let mut slope = SMatrix::<f64, 15, 15>::zeros();
    for column in 0..15 {
        let side = |sign: f64| {
            let mut xi = SVector::<f64, 15>::zeros();
            xi[column] = sign * 1e-5;
            error(&propagated(&perturbed(&start, &xi), &omega, &force, dt), &truth)
        };
        slope.set_column(column, &((side(1.0) - side(-1.0)) / 2e-5));
    }
    let mut filter = InvariantFilter::new(0, NO_NOISE, GRAVITY);
    filter.start(&start, &deviations());
    let before = filter.invariant_covariance();
    filter.propagate(&omega, &force, dt);
    let found = filter.invariant_covariance();
    let expected = slope * before * slope.transpose();
    // The discretisation freezes the rotation over a step; the remaining difference is of order omega dt
    // times the bias terms.
    let scale = |row: usize, column: usize| (expected[(row, row)] * expected[(column, column)]).sqrt();
    for row in 0..15 {
        for column in 0..15 {
            let wrong = (found[(row, column)] - expected[(row, column)]).abs() / scale(row, column);
            assert!(wrong < 2e-6, "{row} {column}: {wrong}");
        }
    }
}

/// A body swaying over two feet that step in turn, and its sensor readings.
struct Walk {
    noise: Noise,
    truth: FilterState,
    feet: [Vector3<f64>; 2],
    time: f64,
    dt: f64,
}

const WALKING: FilterNoise = FilterNoise {
    gyroscope: 2e-3,
    accelerometer: 2e-2,
    gyroscope_bias_walk: 1e-3,
    accelerometer_bias_walk: 1e-2,
    slip: 5e-3,
    foot: 2e-3,
};

impl Walk {
    fn normal(&mut self, deviation: f64) -> Vector3<f64> {
        let mut values = [0.0; 3];
        self.noise.add(&[deviation; 3], &mut values);
        values.into()
    }

    /// Runs `steps` steps from a start with the filter's deviations. Calls `each` with the filter and the
    /// truth.
    fn run(seed: u64, steps: u32, mut each: impl FnMut(&InvariantFilter, &FilterState)) {
        let start = some_state();
        let mut walk = Self {
            noise: Noise::new(seed, 0),
            truth: start,
            feet: [Vector3::zeros(); 2],
            time: 0.0,
            dt: 5e-3,
        };
        let mut filter = InvariantFilter::new(2, WALKING, GRAVITY);
        filter.start(&start, &deviations());
        // a truth sampled around the start
        let d = deviations();
        let tilt = walk.normal(d.tilt);
        let yaw = walk.normal(d.yaw).z;
        let turn = Vector3::new(tilt.x, tilt.y, yaw);
        walk.truth.rotation = so3::exp(&-turn) * start.rotation;
        let [velocity, position, gyroscope, accelerometer] =
            [d.velocity, d.position, d.gyroscope_bias, d.accelerometer_bias]
                .map(|deviation| walk.normal(deviation));
        walk.truth.velocity += velocity;
        walk.truth.position += position;
        walk.truth.gyroscope_bias += gyroscope;
        walk.truth.accelerometer_bias += accelerometer;
        for step in 0..steps {
            walk.step(step, &mut filter);
            each(&filter, &walk.truth);
        }
    }

    fn step(&mut self, step: u32, filter: &mut InvariantFilter) {
        let (dt, t) = (self.dt, self.time);
        self.time += dt;
        let omega = Vector3::new(0.6 * (3.0 * t).sin(), 0.5 * (2.0 * t).cos(), 0.4 * (1.0 * t).sin());
        let force = Vector3::new((4.0 * t).cos(), 0.8 * (5.0 * t).sin(), 9.81 + 2.0 * (7.0 * t).sin());
        let root = dt.sqrt();
        let readings = (
            omega + self.truth.gyroscope_bias + self.normal(WALKING.gyroscope / root),
            force + self.truth.accelerometer_bias + self.normal(WALKING.accelerometer / root),
        );
        let unbiased = FilterState {
            gyroscope_bias: Vector3::zeros(),
            accelerometer_bias: Vector3::zeros(),
            ..self.truth
        };
        let next = propagated(&unbiased, &omega, &force, dt);
        self.truth.rotation = next.rotation;
        (self.truth.velocity, self.truth.position) = (next.velocity, next.position);
        let walks = (
            self.normal(WALKING.gyroscope_bias_walk * root),
            self.normal(WALKING.accelerometer_bias_walk * root),
        );
        self.truth.gyroscope_bias += walks.0;
        self.truth.accelerometer_bias += walks.1;
        filter.propagate(&readings.0, &readings.1, dt);
        for foot in 0..2_u32 {
            // each foot is in the air for a third of its stride, alternately
            let phase = (step + 30 * foot) % 60;
            let index = foot as usize;
            if phase < 20 {
                filter.lift(index);
                let beside = Vector3::new(0.1, if foot == 0 { 0.2 } else { -0.2 }, -0.4);
                self.feet[index] = self.truth.position + beside;
                continue;
            }
            if phase > 20 {
                let slip = self.normal(WALKING.slip * root);
                self.feet[index] += slip;
            }
            let exact =
                self.truth.rotation.inverse_transform_vector(&(self.feet[index] - self.truth.position));
            let covariance = Matrix3::from_diagonal(&Vector3::new(1e-6, 4e-6, 9e-6));
            let encoders = Vector3::new(1e-3, 2e-3, 3e-3).component_mul(&self.normal(1.0));
            let position = exact + encoders + self.normal(WALKING.foot);
            filter.correct(index, &ContactKinematics { position, covariance }).unwrap();
        }
    }
}

/// For a consistent covariance, the normalised squared invariant error has its dimension as mean. Bounds are
/// five standard deviations of the mean over the runs; samples within a run are dependent and count once.
#[test]
fn errors_are_consistent_with_the_covariance() {
    let runs = 60_u32;
    let (mut whole, mut pose) = (0.0, 0.0);
    for seed in 0..u64::from(runs) {
        let (mut samples, mut of_run, mut of_pose) = (0.0, 0.0, 0.0);
        Walk::run(seed, 600, |filter, truth| {
            let xi = error(filter.state(), truth);
            let covariance = filter.invariant_covariance();
            of_run += xi.dot(&covariance.cholesky().unwrap().solve(&xi));
            let part = covariance.fixed_view::<9, 9>(0, 0).into_owned();
            let xi = xi.fixed_rows::<9>(0).into_owned();
            of_pose += xi.dot(&part.cholesky().unwrap().solve(&xi));
            samples += 1.0;
        });
        whole += of_run / samples;
        pose += of_pose / samples;
    }
    let (whole, pose) = (whole / f64::from(runs), pose / f64::from(runs));
    let bound = |dimension: f64| 5.0 * (2.0 * dimension / f64::from(runs)).sqrt();
    assert!((whole - 15.0).abs() < bound(15.0), "{whole}");
    assert!((pose - 9.0).abs() < bound(9.0), "{pose}");
}

#[test]
fn innovations_are_consistent() {
    let (mut sum, mut count) = (0.0, 0.0);
    for seed in 100..120 {
        let mut filter = InvariantFilter::new(1, WALKING, GRAVITY);
        filter.start(&FilterState::default(), &StartDeviations::default());
        let mut walk = Walk {
            noise: Noise::new(seed, 1),
            truth: FilterState::default(),
            feet: [Vector3::new(0.1, 0.0, -0.5); 2],
            time: 0.0,
            dt: 2e-3,
        };
        for step in 0..300 {
            let omega = walk.normal(WALKING.gyroscope / walk.dt.sqrt());
            let force = Vector3::new(0.0, 0.0, 9.81) + walk.normal(WALKING.accelerometer / walk.dt.sqrt());
            filter.propagate(&omega, &force, walk.dt);
            let slip = walk.normal(WALKING.slip * walk.dt.sqrt());
            walk.feet[0] += if step > 0 { slip } else { Vector3::zeros() };
            let position = walk.feet[0] + walk.normal(WALKING.foot);
            let contact = ContactKinematics { position, covariance: Matrix3::zeros() };
            let nis = filter.correct(0, &contact).unwrap();
            if step > 50 {
                (sum, count) = (sum + nis, count + 1.0);
            }
        }
    }
    let mean: f64 = sum / count;
    assert!((mean - 3.0).abs() < 5.0 * (6.0 / count).sqrt(), "{mean} over {count}");
}

/// Position and yaw are the paper's unobservable directions. The others settle.
#[test]
fn contacts_do_not_observe_position_or_yaw() {
    // At rest: a velocity known in world axes would reveal the heading.
    let start = FilterState { position: Vector3::zeros(), velocity: Vector3::zeros(), ..some_state() };
    let mut filter = InvariantFilter::new(2, FilterNoise { foot: 1e-3, ..NO_NOISE }, GRAVITY);
    filter.start(&start, &deviations());
    let before = filter.invariant_covariance();
    let mut yaws = vec![before[(2, 2)]];
    for step in 0..2000_u32 {
        let t = 1e-3 * f64::from(step);
        let omega = Vector3::new((3.0 * t).sin(), (2.0 * t).cos(), 0.5);
        filter.propagate(&omega, &Vector3::new(t.sin(), 0.3, 9.8), 1e-3);
        for foot in 0..2_usize {
            let position = Vector3::new(0.1 + 0.2 * foot as f64, 0.1 * t, -0.4);
            let contact = ContactKinematics { position, covariance: Matrix3::identity() * 1e-8 };
            filter.correct(foot, &contact).unwrap();
        }
        yaws.push(filter.invariant_covariance()[(2, 2)]);
    }
    // No information about the initial yaw is gained; only the uncertainty added by the bias may shrink
    // again.
    assert!(yaws.iter().all(|yaw| *yaw >= yaws[0] * (1.0 - 1e-9)), "{:?}", &yaws[..5]);
    let after = filter.invariant_covariance();
    for axis in 0..3 {
        assert!(after[(6 + axis, 6 + axis)] >= before[(6 + axis, 6 + axis)] * (1.0 - 1e-9));
        assert!(after[(3 + axis, 3 + axis)] < 0.2 * before[(3 + axis, 3 + axis)], "velocity is observed");
    }
    assert!(after[(0, 0)] < 0.2 * before[(0, 0)] && after[(1, 1)] < 0.2 * before[(1, 1)], "tilt is observed");
}

/// The error dynamics do not depend on the estimate, so neither do the gains while biases are known.
#[test]
fn covariance_without_biases_is_state_independent() {
    let known = StartDeviations { gyroscope_bias: 0.0, accelerometer_bias: 0.0, ..deviations() };
    let run = |start: &FilterState| {
        let mut filter = InvariantFilter::new(1, FilterNoise { foot: 1e-3, ..NO_NOISE }, GRAVITY);
        filter.start(start, &known);
        for _ in 0..100 {
            filter.propagate(&Vector3::new(0.1, 0.2, 0.3), &Vector3::new(0.1, 0.2, 9.9), 1e-3);
            let position = Vector3::new(0.1, 0.2, -0.5);
            filter.correct(0, &ContactKinematics { position, covariance: Matrix3::zeros() }).unwrap();
        }
        filter.invariant_covariance()
    };
    let level =
        FilterState { rotation: UnitQuaternion::identity(), position: Vector3::zeros(), ..some_state() };
    let one = FilterState { velocity: Vector3::zeros(), ..level };
    let tilted = FilterState { rotation: UnitQuaternion::from_euler_angles(0.8, 0.4, 2.0), ..one };
    assert!((run(&one) - run(&tilted)).amax() < 1e-15);
}

#[test]
fn rolling_foot_keeps_the_errors_unchanged() {
    let mut filter = InvariantFilter::new(1, NO_NOISE, GRAVITY);
    filter.start(&some_state(), &deviations());
    let position = Vector3::new(0.1, 0.2, -0.5);
    let contact = ContactKinematics { position, covariance: Matrix3::identity() * 1e-8 };
    filter.correct(0, &contact).unwrap();
    let (before, place) = (filter.invariant_covariance(), filter.foot(0).unwrap());
    let distance = Vector3::new(0.01, 0.0, 0.002);
    filter.roll(0, &distance);
    assert_eq!(filter.invariant_covariance(), before);
    assert!((filter.foot(0).unwrap() - place - some_state().rotation * distance).norm() < 1e-15);
    let moved = ContactKinematics { position: position + distance, ..contact };
    assert!(filter.correct(0, &moved).unwrap() < 1e-20, "the foot is at its expected position");
    filter.lift(0);
    assert_eq!((filter.contacts(), filter.foot(0)), (0, None));
}
