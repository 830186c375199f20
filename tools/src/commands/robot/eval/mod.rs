//! `motorium robot eval`: evaluates the kinematics and dynamics of a robot at given states.

mod answer;
mod difference;
mod layout;
mod states;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use comfy_table::CellAlignment;
use motorium_robots::{JointKind, Kinematics, Loaded, MimicMode, Model, pinocchio_joint_order};
use serde_json::{Value, json};

use super::facts::short;
use super::pose::PoseArgs;
use super::source::{ProfiledArgs, RobotArgs};
use crate::out::{errln, outln};
use crate::report::table;
use crate::{exit, style};
use layout::Layout;
use states::States;

/// Compute kinematics and dynamics of a robot at given states: frame poses, Jacobians, mass matrix, bias and
/// gravity forces, inverse and forward dynamics, centre of mass, centroidal momentum, energies.
///
/// The states are JSON: `cases`, each with `q` (or `joint_positions` by name), `v`, `a`, `tau`, in
/// Pinocchio's layout, or in the order `joints` lists. Two kinds of joints differ from Pinocchio: `v`, `a`
/// and `tau` of a planar joint are along the axes of its plane, and `q` of a floating base is its pose in the
/// world even if its joint has an origin. With --json, all results are printed, one case per state. Otherwise
/// results in the states are compared with ours.
///
/// Without states, prints the poses of the frames in the world, at the home pose or another one.
///
/// Example: motorium robot eval panda --frame panda_hand --pose ready
#[derive(Debug, clap::Args)]
pub(super) struct Eval {
    #[command(flatten)]
    robot: ProfiledArgs,
    /// The states; `-` is standard input [default: print poses of frames in one pose]
    #[arg(long, value_name = "FILE", conflicts_with = "PoseArgs")]
    states: Option<PathBuf>,
    #[command(flatten)]
    pose: PoseArgs,
    /// Frame to print: its pose, and with states also Jacobians, velocities and accelerations; may be
    /// repeated [default: `jacobian_frames` of the states, or all frames]
    #[arg(long, value_name = "LINK")]
    frame: Vec<String>,
    /// Maximum relative difference that counts as agreement
    #[arg(long, default_value_t = 1e-8, conflicts_with = "json")]
    tolerance: f64,
    /// Print the answer as JSON
    #[arg(long)]
    json: bool,
}

impl Eval {
    pub(super) fn run(mut self) -> anyhow::Result<ExitCode> {
        let Some(states) = &self.states else { return self.poses() };
        let text = if states.as_os_str() == "-" {
            std::io::read_to_string(std::io::stdin()).context("reading standard input")?
        } else {
            crate::input::text(states)?
        };
        let document: Value =
            serde_json::from_str(&text).with_context(|| format!("{} is not JSON", states.display()))?;
        if document["floating_base"] == true && !self.robot.robot.fixed_base {
            self.robot.robot.floating_base = true;
        }
        let robot = match self.robot.open(mode(&self.robot.robot, &document)?) {
            Ok(robot) => robot,
            Err(code) => return Ok(code),
        };
        let states = self.states(&robot, &document).with_context(|| states.display().to_string())?;
        let answer = answer::answer(&robot.model, &states)?;
        if self.json {
            outln!("{}", serde_json::to_string(&answer)?);
            return Ok(ExitCode::SUCCESS);
        }
        Ok(self.print(&document, &answer))
    }

    /// Prints the poses of the frames in the selected pose.
    fn poses(&self) -> anyhow::Result<ExitCode> {
        let robot = match self.robot.open(MimicMode::Follow) {
            Ok(robot) => robot,
            Err(code) => return Ok(code),
        };
        let model = &robot.model;
        let mut kinematics = Kinematics::new(model);
        kinematics.update(model, &self.pose.configuration(&robot)?);
        let names: Vec<&str> = match self.frame.as_slice() {
            [] => model.frames().iter().map(|frame| frame.name.as_str()).collect(),
            named => named.iter().map(String::as_str).collect(),
        };
        let mut frames = Vec::new();
        for name in names {
            let pose = kinematics.pose(model, model.frame(name)?);
            let (roll, pitch, yaw) = pose.rotation.euler_angles();
            frames.push((name, pose.translation.vector, [roll, pitch, yaw]));
        }
        if self.json {
            let poses = frames.iter().map(
                |(name, position, rpy)| json!({ "frame": name, "position": position.as_slice(), "rpy": rpy }),
            );
            outln!("{}", json!({ "robot": model.name(), "frames": poses.collect::<Vec<_>>() }));
            return Ok(ExitCode::SUCCESS);
        }
        let mut rows = table(["frame", "x m", "y m", "z m", "roll rad", "pitch rad", "yaw rad"]);
        for (name, position, rpy) in frames {
            let numbers = position.iter().chain(&rpy).map(|number| format!("{number:.4}"));
            rows.add_row(core::iter::once(name.to_string()).chain(numbers));
        }
        for column in rows.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        outln!("{}", rows.trim_fmt());
        Ok(ExitCode::SUCCESS)
    }

    fn states(&self, robot: &Loaded, document: &Value) -> anyhow::Result<States> {
        let urdf = super::urdf_text::text(robot)?;
        let order = pinocchio_joint_order(&urdf);
        let layout = Layout::from_document(&robot.model, document, &order)
            .context("reading `joints` of the states")?;
        states::read(&robot.model, layout, document, &self.frame)
    }

    /// Compares the results in the input with ours; without any, prints the pose of the robot.
    fn print(&self, document: &Value, answer: &Value) -> ExitCode {
        let differences = difference::differences(document, answer);
        if differences.is_empty() {
            let mut rows = table(["case", "centre of mass m", "kinetic J", "potential J", "largest |rnea|"]);
            for (index, case) in answer["cases"].as_array().into_iter().flatten().enumerate() {
                let numbers = |key: &str| -> Vec<f64> {
                    case[key].as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
                };
                let com: Vec<String> = numbers("com").into_iter().map(short).collect();
                let scalar = |key: &str| short(case[key].as_f64().unwrap_or(f64::NAN));
                let largest = numbers("rnea").into_iter().fold(0.0, |most: f64, x| most.max(x.abs()));
                rows.add_row([
                    index.to_string(),
                    com.join(" "),
                    scalar("kinetic_energy"),
                    scalar("potential_energy"),
                    short(largest),
                ]);
            }
            for column in rows.column_iter_mut().skip(2) {
                column.set_cell_alignment(CellAlignment::Right);
            }
            outln!("{}\n--json prints everything", rows.trim_fmt());
            return ExitCode::SUCCESS;
        }
        let mut rows = table(["quantity", "cases", "largest relative difference"]);
        for (quantity, (count, worst)) in &differences {
            rows.add_row([quantity.clone(), count.to_string(), format!("{worst:.1e}")]);
        }
        for column in rows.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        outln!("{}", rows.trim_fmt());
        let apart: Vec<&str> = differences
            .iter()
            .filter(|(_, (_, worst))| worst.is_nan() || *worst > self.tolerance)
            .map(|(name, _)| &**name)
            .collect();
        if apart.is_empty() {
            outln!("{} all within {:e}", style::good("ok:"), self.tolerance);
            return ExitCode::SUCCESS;
        }
        errln!("{}: {} differ by more than {:e}", style::error("error"), apart.join(", "), self.tolerance);
        exit::FAILED
    }
}

/// Returns the mode of mimic joints: independent if the input lists or contains them as such.
fn mode(robot: &RobotArgs, document: &Value) -> anyhow::Result<MimicMode> {
    let Ok(independent) = robot.load(MimicMode::Independent) else { return Ok(MimicMode::Follow) };
    let Ok(follow) = robot.load(MimicMode::Follow) else { return Ok(MimicMode::Follow) };
    let extra = independent.model.nv() - follow.model.nv();
    if extra == 0 {
        return Ok(MimicMode::Follow);
    }
    let mimics = |name: &str| {
        follow.model.joint_index(name).is_none() && independent.model.joint_index(name).is_some()
    };
    let listed = document["joints"].as_array().map(|joints| {
        joints.iter().filter_map(|joint| joint.as_str().or_else(|| joint["name"].as_str())).any(mimics)
    });
    let first = states::cases(document)?.first().cloned().unwrap_or(json!({}));
    // A continuous joint may have one entry of q, or two.
    let lengths = |model: &Model| {
        let continuous = |index: &usize| model.joint(*index).kind == JointKind::Continuous;
        let count = (0..model.joint_count()).filter(continuous).count();
        [model.nq(), model.nq() + count]
    };
    let held = || match (&first["v"], &first["q"]) {
        (Value::Array(v), _) => v.len() == independent.model.nv(),
        (_, Value::Array(q)) => {
            lengths(&independent.model).contains(&q.len()) || !lengths(&follow.model).contains(&q.len())
        }
        _ => true,
    };
    Ok(if listed.unwrap_or_else(held) { MimicMode::Independent } else { MimicMode::Follow })
}
