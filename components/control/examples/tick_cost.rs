//! Measures the time of one control tick of a Panda: `cargo run --release -p motorium-control --example
//! tick_cost`.
//!
//! The hand follows a target that steps between poses. Some poses are out of reach, so that bounds become
//! active.

use std::time::Instant;

use motorium_control::{
    DifferentialIk, FeedForward, RobotState, SetpointIntegrator,
    limits::{PositionLimit, VelocityLimit},
    tasks::{CartesianTask, PostureTask},
};
use motorium_qp::{ActiveSetSettings, ActiveSetSolver, QpSolver};
use motorium_robots::{Kinematics, load};
use nalgebra::{Isometry3, Vector3};

const TICKS: usize = 20_000;
const DT: f64 = 0.001;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let panda = load("panda", std::path::Path::new("."))?;
    let (model, profile) = (&panda.model, panda.profile.as_ref().ok_or("a catalogue robot has a profile")?);
    let home = profile.home(model)?;
    let hand = model.frame(&profile.end_effector("hand")?.frame)?;

    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, home.as_slice());
    let centre = kinematics.pose(model, hand);
    let mut task = CartesianTask::new(model, hand);
    let mut posture = PostureTask::new(model, home.as_slice());
    let (position, velocity) = (PositionLimit::default(), VelocityLimit::default());
    let mut ik = DifferentialIk::new(model);
    let mut solver = ActiveSetSolver::new(DifferentialIk::structure(model), ActiveSetSettings::default());
    let mut setpoint = SetpointIntegrator::new(model, home.as_slice());
    let mut feed_forward = FeedForward::new(model, Some(Vector3::new(0.0, 0.0, -9.81)));

    let names = ["kinematics", "assemble", "qp update", "qp solve", "integrate, efforts", "whole tick"];
    let mut times: [Vec<f64>; 6] = std::array::from_fn(|_| Vec::with_capacity(TICKS));
    let mut iterations = Vec::with_capacity(TICKS);
    for tick in 0..TICKS {
        let offsets = [[0.1, 0.2, 0.1], [-0.1, -0.3, 0.2], [0.6, 0.0, 0.5], [0.0, 0.3, -0.3]];
        let offset = Vector3::from(offsets[tick / 1000 % offsets.len()]);
        task.set_target(Isometry3::from_parts((centre.translation.vector + offset).into(), centre.rotation));

        let mut marks = [Instant::now(); 6];
        kinematics.update(model, setpoint.position());
        marks[1] = Instant::now();
        let state = RobotState { model, kinematics: &kinematics, q: setpoint.position() };
        ik.assemble(&state, &mut [&mut task, &mut posture], &[&position, &velocity], DT);
        marks[2] = Instant::now();
        solver.update(ik.problem())?;
        marks[3] = Instant::now();
        let solution = solver.solve()?;
        marks[4] = Instant::now();
        setpoint.integrate(solution.x.as_slice(), DT);
        std::hint::black_box(feed_forward.effort(model, setpoint.position(), &[], &setpoint));
        marks[5] = Instant::now();

        iterations.push(f64::from(solution.iterations));
        for (part, pair) in marks.windows(2).enumerate() {
            times[part].push((pair[1] - pair[0]).as_nanos() as f64 / 1e3);
        }
        times[5].push((marks[5] - marks[0]).as_nanos() as f64 / 1e3);
    }

    println!("{:20} {:>9} {:>9} {:>9} {:>9}  us", "", "min", "median", "p99", "max");
    for (name, times) in names.iter().zip(&mut times) {
        print_row(name, times);
    }
    print_row("iterations", &mut iterations);
    Ok(())
}

fn print_row(name: &str, values: &mut [f64]) {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[((values.len() - 1) as f64 * share) as usize];
    println!("{name:20} {:9.2} {:9.2} {:9.2} {:9.2}", at(0.0), at(0.5), at(0.99), at(1.0));
}
