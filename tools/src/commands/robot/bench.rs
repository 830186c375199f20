//! `motorium robot bench`: execution times of the algorithms for a robot.

use std::hint::black_box;
use std::process::ExitCode;
use std::time::Instant;

use comfy_table::CellAlignment;
use motorium_robots::{
    Derivatives, Dynamics, FrameId, Kinematics, MimicMode, Model, Reference, SingularMassMatrix,
};
use nalgebra::{DMatrix, Vector3};
use serde::Serialize;

use super::source::RobotArgs;
use crate::out::{errln, outln};
use crate::report::table;
use crate::style;

/// Measure the execution times of the algorithms for a robot, on one thread, at random states.
///
/// Each sample is the mean over a batch of calls of about 20 us, which makes the time of reading the clock
/// negligible. p50, p99 and max are over the samples.
///
/// Example: motorium robot bench panda
#[derive(Debug, clap::Args)]
pub(super) struct Bench {
    #[command(flatten)]
    robot: RobotArgs,
    /// Number of samples of each algorithm
    #[arg(long, default_value_t = 500, value_parser = clap::value_parser!(u32).range(10..=1_000_000))]
    samples: u32,
    /// Frame of the frame Jacobian [default: an end effector or foot, or the tip of the longest chain]
    #[arg(long)]
    frame: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The times of one algorithm, per call.
#[derive(Debug, Clone, Serialize)]
struct Times {
    algorithm: &'static str,
    p50_ns: f64,
    p99_ns: f64,
    max_ns: f64,
    calls: u64,
}

impl Bench {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let robot = match self.robot.open(MimicMode::Follow) {
            Ok(robot) => robot,
            Err(code) => return Ok(code),
        };
        let model = &robot.model;
        let frame = match (&self.frame, &robot.profile) {
            (Some(name), _) => model.frame(name)?,
            (None, Some(profile)) => {
                let ends = profile.end_effectors.values().map(|end| &end.frame);
                let mut names = ends.chain(profile.feet.values().map(|foot| &foot.frame));
                names.next().map_or_else(|| tip(model), |name| Ok(model.frame(name)?))?
            }
            (None, None) => tip(model)?,
        };
        let times = measure(model, frame, self.samples as usize);
        let name = &model.frames()[frame.index()].name;
        if self.json {
            let answer = serde_json::json!({
                "robot": model.name(),
                "nv": model.nv(),
                "frame": name,
                "optimised": !cfg!(debug_assertions),
                "times": times,
            });
            outln!("{}", serde_json::to_string_pretty(&answer)?);
            return Ok(ExitCode::SUCCESS);
        }
        let base = super::facts::base(model);
        outln!("{}: nv {}, {base} base, frame {name}\n", style::strong(model.name()), model.nv());
        let mut rows = table(["algorithm", "p50 us", "p99 us", "max us", "calls"]);
        for times in &times {
            let us = |ns: f64| format!("{:.3}", ns * 1e-3);
            let calls = times.calls.to_string();
            rows.add_row([
                times.algorithm.to_string(),
                us(times.p50_ns),
                us(times.p99_ns),
                us(times.max_ns),
                calls,
            ]);
        }
        for column in rows.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        outln!("{}", rows.trim_fmt());
        if cfg!(debug_assertions) {
            errln!("{}: built without optimisation; build with --release", style::warning("warning"));
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Returns the frame moved by the most joints; Jacobians of other frames would partly be zero.
fn tip(model: &Model) -> anyhow::Result<FrameId> {
    let base = model.frames().iter().rev().find_map(|frame| model.frame(&frame.name).ok());
    model.tip().or(base).ok_or_else(|| anyhow::anyhow!("the robot has no link"))
}

/// A state at which the algorithms run.
struct State {
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    tau: Vec<f64>,
}

/// Reproducible pseudo-random numbers from -1 to 1 (Knuth's MMIX generator).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self, length: usize, bound: f64) -> Vec<f64> {
        (0..length).map(|_| bound * self.next()).collect()
    }
}

fn states(model: &Model) -> Vec<State> {
    let mut numbers = Numbers(1);
    let state = |_| {
        let step = numbers.vector(model.nv(), 2.0);
        let mut q = model.neutral();
        model.integrate(&model.neutral(), &step, &mut q);
        let offset = model.nq() - model.joint_count();
        for (index, q) in q[offset..].iter_mut().enumerate() {
            *q = q.clamp(model.lower()[index], model.upper()[index]);
        }
        let n = model.nv();
        State { q, v: numbers.vector(n, 2.0), a: numbers.vector(n, 5.0), tau: numbers.vector(n, 20.0) }
    };
    (0..64).map(state).collect()
}

fn measure(model: &Model, frame: FrameId, samples: usize) -> Vec<Times> {
    let states = states(model);
    let n = model.nv();
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let mut kinematics = Kinematics::new(model);
    let mut dynamics = Dynamics::new(model);
    let mut out = vec![0.0; n];
    let mut square = DMatrix::zeros(n, n);
    let mut six = DMatrix::zeros(6, n);
    let mut three = DMatrix::zeros(3, n);
    let mut derivatives = Derivatives::new(model);
    let mut singular = false;
    let mut all = Vec::new();
    let mut run = |algorithm, work: &mut dyn FnMut(&State)| all.push(time(algorithm, &states, samples, work));
    // A robot with a singular mass matrix has no forward dynamics: check once, without timing.
    let mut judge = |result: Result<(), SingularMassMatrix>| singular |= result.is_err();

    run("forward kinematics", &mut |s| kinematics.update(model, &s.q));
    run("  with velocities and accelerations", &mut |s| {
        kinematics.update_with_acceleration(model, &s.q, &s.v, &s.a);
    });
    run("frame Jacobian from q", &mut |s| {
        kinematics.jacobian_at(model, &s.q, frame, Reference::LocalWorldAligned, &mut six);
    });
    run("centre of mass Jacobian from q", &mut |s| {
        kinematics.update(model, &s.q);
        kinematics.com_jacobian(model, &mut three);
    });
    run("gravity", &mut |s| dynamics.gravity(model, &s.q, gravity, &mut out));
    run("bias forces", &mut |s| dynamics.bias(model, &s.q, &s.v, gravity, &mut out));
    run("inverse dynamics (RNEA)", &mut |s| dynamics.rnea(model, &s.q, &s.v, &s.a, gravity, &mut out));
    run("mass matrix (CRBA)", &mut |s| dynamics.crba(model, &s.q, &mut square));
    run("forward dynamics (ABA)", &mut |s| {
        judge(dynamics.forward(model, &s.q, &s.v, &s.tau, gravity, &mut out));
    });
    run("inverse mass matrix", &mut |s| judge(dynamics.inverse_mass(model, &s.q, &mut square)));
    run("centroidal momentum matrix", &mut |s| dynamics.centroidal_map(model, &s.q, &mut six));
    run("derivatives of RNEA", &mut |s| {
        dynamics.rnea_derivatives(model, &s.q, &s.v, &s.a, gravity, &mut derivatives);
    });
    run("derivatives of ABA", &mut |s| {
        judge(dynamics.forward_derivatives(model, &s.q, &s.v, &s.tau, gravity, &mut out, &mut derivatives));
    });
    black_box((&out, &square, &six, &three, &derivatives));
    if singular {
        let needs_inertia = ["forward dynamics (ABA)", "inverse mass matrix", "derivatives of ABA"];
        all.retain(|times| !needs_inertia.contains(&times.algorithm));
        errln!(
            "{}: the mass matrix is singular, so forward dynamics are left out; `motorium robot check` names the link",
            style::warning("warning")
        );
    }
    all
}

fn time(algorithm: &'static str, states: &[State], samples: usize, work: &mut dyn FnMut(&State)) -> Times {
    let mut next = states.iter().cycle();
    let mut batch = |calls: u64| {
        let start = Instant::now();
        for state in next.by_ref().take(calls as usize) {
            work(black_box(state));
        }
        start.elapsed().as_nanos() as f64 / calls as f64
    };
    // Warm up, and find the number of calls that takes 20 us.
    let each = (0..8).map(|_| batch(16)).fold(f64::INFINITY, f64::min).max(1.0);
    let calls = ((20_000.0 / each).ceil() as u64).clamp(1, 4096);
    let mut times: Vec<f64> = (0..samples).map(|_| batch(calls)).collect();
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share).round() as usize];
    Times { algorithm, p50_ns: at(0.5), p99_ns: at(0.99), max_ns: at(1.0), calls: calls * samples as u64 }
}
