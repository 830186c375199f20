//! Comparison of four task stacks: a posture task, a Cartesian task, both on one level, and the Cartesian
//! task on a higher level.

use motorium_robots::{FrameId, Kinematics, Model, Twist};
use nalgebra::{Isometry3, Vector3};

use crate::{
    DifferentialIk, IkError, RobotState, SetpointIntegrator,
    limits::{PositionLimit, VelocityLimit},
    tasks::{CartesianTask, PostureSettings, PostureTask, VelocityTask},
};

/// Combination of a Cartesian task and a posture task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TaskStack {
    /// The posture alone.
    Postural,
    /// The Cartesian task alone.
    Cartesian,
    /// Both tasks on one level, with weights 1 and 0.5.
    Soft,
    /// The Cartesian task on a level above the posture task.
    Hard,
}

impl TaskStack {
    /// All stacks, in the order of declaration.
    pub const ALL: [Self; 4] = [Self::Postural, Self::Cartesian, Self::Soft, Self::Hard];

    /// Returns the name of the stack for figures.
    pub fn name(self) -> &'static str {
        match self {
            Self::Postural => "postural",
            Self::Cartesian => "Cartesian",
            Self::Soft => "soft, 1 and 0.5",
            Self::Hard => "hard",
        }
    }
}

/// The errors of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StackSample {
    /// Time \[s\].
    pub time: f64,
    /// Distance of the frame from its target \[m\].
    pub position: f64,
    /// Norm of the difference between the joint positions and the posture \[rad\].
    pub posture: f64,
}

/// A target that moves on a circle around a frame's position in the y-z plane, starting and ending at rest.
fn circle(start: &Isometry3<f64>, radius: f64, period: f64, time: f64) -> (Isometry3<f64>, Twist) {
    let rate = std::f64::consts::TAU / period;
    // accelerates over the first second
    let (phase, speed) = if time < 1.0 { (0.5 * time * time, time) } else { (time - 0.5, 1.0) };
    let (sin, cos) = (rate * phase).sin_cos();
    let offset = Vector3::new(0.0, radius * sin, radius * (1.0 - cos));
    let velocity = Vector3::new(0.0, cos, sin) * (radius * rate * speed);
    let target = Isometry3::from_parts((start.translation.vector + offset).into(), start.rotation);
    (target, Twist { linear: velocity, angular: Vector3::zeros() })
}

/// Runs a fixed-base robot at 1 kHz for `seconds` from the posture `home`. `frame` follows a target on a
/// circle of 10 cm; the joints follow their velocities exactly.
///
/// ```
/// use motorium_control::{TaskStack, run_stack};
///
/// let iiwa = motorium_robots::load("iiwa14", std::path::Path::new("."))?;
/// let home = iiwa.profile.as_ref().expect("it has a profile").home(&iiwa.model)?;
/// let hand = iiwa.end_effector(None)?;
/// let worst = |stack| -> Result<f64, Box<dyn std::error::Error>> {
///     let samples = run_stack(&iiwa.model, home.as_slice(), hand, stack, 2.0)?;
///     Ok(samples.iter().fold(0.0, |worst, sample| sample.position.max(worst)))
/// };
/// assert!(worst(TaskStack::Hard)? < 1e-4, "the posture does not disturb the hand");
/// assert!(worst(TaskStack::Soft)? > 1e-2, "here it does");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`IkError`] if a tick has no solution.
pub fn run_stack(
    model: &Model,
    home: &[f64],
    frame: FrameId,
    stack: TaskStack,
    seconds: f64,
) -> Result<Vec<StackSample>, IkError> {
    let dt = 1e-3;
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, home);
    let start = kinematics.pose(model, frame);
    let mut hand = CartesianTask::new(model, frame);
    let mut posture = PostureTask::new(model, home).with(PostureSettings { gain: 5.0, weight: 0.5 });
    let mut ik = DifferentialIk::new(model);
    if stack == TaskStack::Hard {
        ik = ik.levels(&[hand.rows(), posture.rows()]);
    }
    let mut setpoint = SetpointIntegrator::new(model, home);
    let ticks = (seconds / dt).round() as usize;
    let mut samples = Vec::with_capacity(ticks);
    for tick in 0..ticks {
        let time = tick as f64 * dt;
        let (target, velocity) = circle(&start, 0.1, 4.0, time);
        hand.set_moving_target(target, velocity, Twist::zero());
        kinematics.update(model, setpoint.position());
        let state = RobotState { model, kinematics: &kinematics, q: setpoint.position() };
        ik.begin();
        if stack == TaskStack::Postural {
            hand.update(&state);
        } else {
            ik.add_task(&state, 0, &mut hand);
        }
        match stack {
            TaskStack::Cartesian => posture.update(&state),
            TaskStack::Hard => ik.add_task(&state, 1, &mut posture),
            TaskStack::Postural | TaskStack::Soft => ik.add_task(&state, 0, &mut posture),
        }
        ik.add_limit(&state, &PositionLimit::default(), dt);
        ik.add_limit(&state, &VelocityLimit::default(), dt);
        samples.push(StackSample {
            time,
            position: hand.position_error(),
            posture: posture.error().iter().map(|error| error * error).sum::<f64>().sqrt(),
        });
        setpoint.integrate(ik.solve()?, dt);
    }
    Ok(samples)
}
