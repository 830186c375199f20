//! `motorium can calibrate`: the offsets of drives, measured while the robot is held in a known pose.

use std::process::ExitCode;
use std::time::Duration;

use motorium::units::TimeSpan;
use motorium_can::{Calibrated, calibrate};
use serde_json::{Value, json};

use super::check::{Found, adapters};
use super::interface::refused;
use crate::commands::loading::GraphArgs;
use crate::out::{out, outln};
use crate::report::table;
use crate::{registry, robots};

/// Measure the offsets of the drives of a graph, while the robot is held in a pose of its profile.
///
/// No drive is enabled. The command stops if another program commands a drive. Readable drive settings are
/// compared with the drive table first. Prints the entries for the drive table, and changes no file.
///
/// Example: motorium can calibrate graphs/arm-can.toml --pose ready
#[derive(Debug, clap::Args)]
pub(super) struct Calibrate {
    #[command(flatten)]
    graph: GraphArgs,
    /// The pose in which the robot is held, from its profile or SRDF
    #[arg(long, value_name = "NAME")]
    pose: String,
    /// Name of the `can.adapter` component, for a graph with several
    #[arg(long, value_name = "COMPONENT")]
    adapter: Option<String>,
    /// Duration of the measurement
    #[arg(long = "for", value_name = "TIME", default_value = "1s", allow_hyphen_values = true)]
    time: TimeSpan,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Calibrate {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        anyhow::ensure!(self.time.ns > 0, "`--for` is 0 s, expected a positive time");
        let checked = match self.graph.load(&registry::registry()) {
            Ok(checked) => checked,
            Err(code) => return Ok(code),
        };
        let found = self.one(adapters(&checked.plan)?)?;
        anyhow::ensure!(
            found.table.is_real(),
            "the buses of `{}` are simulated over topics: give them an `interface`, in the drive table or by `interfaces`",
            found.component
        );
        let component = checked.plan.components.iter().find(|component| component.name == found.component);
        let robot = component.and_then(|component| component.robot.as_ref());
        let robot =
            robots::load(robot.ok_or_else(|| anyhow::anyhow!("`{}` has no robot", found.component))?)?;
        let pose = robots::pose(&robot, &self.pose)?;
        let open = |bus| found.table.open(bus).map_err(refused);
        let mut buses = (0..found.table.buses.len()).map(open).collect::<anyhow::Result<Vec<_>>>()?;
        let joints = robot.model.joint_names();
        let time = Duration::from(self.time);
        let offsets = calibrate(&found.table, (joints, pose.as_slice()), &mut buses, time, |_, time| {
            std::thread::sleep(time);
            motorium::os::monotonic_ns()
        })?;
        if self.json {
            let joints: Vec<Value> = offsets.iter().map(value).collect();
            let value = json!({ "component": found.component, "pose": self.pose, "joints": joints });
            outln!("{}", serde_json::to_string_pretty(&value)?);
        } else {
            out!("{}", describe(&offsets));
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Returns the named adapter, or the only one.
    fn one(&self, mut found: Vec<Found>) -> anyhow::Result<Found> {
        let names: Vec<String> = found.iter().map(|found| found.component.clone()).collect();
        if let Some(name) = &self.adapter {
            found.retain(|found| found.component == *name);
        }
        match (found.pop(), found.is_empty()) {
            (Some(found), true) => Ok(found),
            (Some(_), false) => {
                anyhow::bail!(
                    "the graph has several adapters; name one with `--adapter`: {}",
                    names.join(", ")
                )
            }
            (None, _) if names.is_empty() => {
                anyhow::bail!("the graph has no component of the kind `can.adapter`")
            }
            (None, _) => anyhow::bail!("unknown adapter, expected {}", names.join(", ")),
        }
    }
}

fn value(calibrated: &Calibrated) -> Value {
    json!({
        "joint": calibrated.joint,
        "position": calibrated.position,
        "offset": calibrated.offset,
        "offset_before": calibrated.before,
        "spread": calibrated.spread,
        "answers": calibrated.answers,
    })
}

fn describe(offsets: &[Calibrated]) -> String {
    let mut rows = table(["joint", "measured", "with the offset", "to be written", "spread", "answers"]);
    for calibrated in offsets {
        rows.add_row([
            calibrated.joint.clone(),
            format!("{:.4}", calibrated.position),
            format!("{:.4}", calibrated.before),
            format!("offset = {:.4}", calibrated.offset),
            format!("{:.4}", calibrated.spread),
            calibrated.answers.to_string(),
        ]);
    }
    format!("{}\n", rows.trim_fmt())
}
