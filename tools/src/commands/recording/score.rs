//! `motorium score`: scores a recorded run.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_bridges::recording::{JointScore, JointsScore, PoseScore, Score as Scored, Tolerance, score};

use crate::out::{out, outln};
use crate::report::decimal;

/// Score a recording: goals, path errors, tracking errors, limits, smoothness.
///
/// Frames are computed from the recorded joint states and compared with the recorded targets, independently
/// of the components.
///
/// Example: motorium score out/a.mcap
#[derive(Debug, clap::Args)]
pub(crate) struct Score {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// Distance from a goal within which it counts as reached, in m [default: the graph's, or 5 mm]
    #[arg(long, value_name = "M", value_parser = tolerance)]
    position_tolerance: Option<f64>,
    /// Angle from a goal within which it counts as reached, in rad [default: the graph's, or 0.02]
    #[arg(long, value_name = "RAD", value_parser = tolerance)]
    orientation_tolerance: Option<f64>,
    /// Print the score as JSON on standard output
    #[arg(long)]
    json: bool,
}

fn tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(tolerance) if tolerance >= 0.0 => Ok(tolerance),
        _ => Err("expected a number of at least 0".to_string()),
    }
}

impl Score {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let recording = super::opened(&self.file)?;
        let plan = recording.plan()?;
        let tolerance =
            Tolerance { position: self.position_tolerance, orientation: self.orientation_tolerance };
        let scored = score(&recording, &plan, tolerance)?;
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&scored)?);
        } else {
            out!("{}", text(&scored));
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn text(score: &Scored) -> String {
    let mut text = format!("{}: {:.3} s\n", score.graph, score.duration_s);
    if score.poses.is_empty() && score.joints.is_empty() {
        text += "nothing to score: the recording has neither pose targets nor joint states of a robot\n";
    }
    score.poses.iter().for_each(|pose| text += &poses(pose));
    score.joints.iter().for_each(|state| text += &joints(state));
    text
}

fn poses(pose: &PoseScore) -> String {
    let PoseScore { frame, target, reader, state, goals_reached, goals_missed, .. } = pose;
    let mut text = format!("\n{frame} of {state} after {target}, as `{reader}` reads them\n");
    text += &format!("  goals      {goals_reached} reached, {goals_missed} missed");
    if let (Some(position), Some(orientation)) = (pose.position_error_m, pose.orientation_error_rad) {
        text += &format!("; at the worst {}", pose.errors(position, orientation));
    }
    text += &format!(
        "\n  path       rms {}; at most {}\n",
        pose.errors(pose.path_position_rms_m, pose.path_orientation_rms_rad),
        pose.errors(pose.path_position_max_m, pose.path_orientation_max_rad)
    );
    for (is_free, what) in [(pose.position_is_free, "position"), (pose.orientation_is_free, "orientation")] {
        if is_free {
            text += &format!("  {what} is left free by `{reader}`\n");
        }
    }
    if let Some(smoothness) = pose.smoothness {
        text += &format!("  smoothness {smoothness:.2} (spectral arc length; one bell has -1.4)\n");
    }
    for goal in pose.goals.iter().filter(|goal| !goal.reached) {
        text += &format!(
            "  missed     goal {} at {:.3} s: {} away\n",
            goal.goal,
            goal.at_rest_s,
            pose.errors(goal.position_error_m, goal.orientation_error_rad)
        );
    }
    text
}

fn joints(score: &JointsScore) -> String {
    let after = score.command.as_ref().map(|command| format!(" after {command}")).unwrap_or_default();
    let width = score.joints.iter().map(|joint| joint.name.len()).max().unwrap_or(0).max(5);
    let mut text = format!(
        "\n{}{after}, rad or m\n  {:width$}  {:>10}  {:>10}  {:>10}  {:>9}  {:>9}  {:>6}\n",
        score.state, "joint", "error rms", "error max", "margin", "velocity", "effort", "beyond"
    );
    let number = |value: Option<f64>| value.map_or("-".to_string(), decimal);
    let share = |value: Option<f64>| value.map_or("-".to_string(), |value| format!("{:.1} %", 100.0 * value));
    for joint in &score.joints {
        let JointScore { name, tracking_rms, tracking_max, position_margin, beyond_limits, .. } = joint;
        text += &format!(
            "  {name:width$}  {:>10}  {:>10}  {:>10}  {:>9}  {:>9}  {beyond_limits:>6}\n",
            number(*tracking_rms),
            number(*tracking_max),
            number(*position_margin),
            share(joint.velocity_share),
            share(joint.effort_share)
        );
    }
    text
}
