//! `motorium primitive replay`: the movement of a primitive, as demonstrated or adapted.

use std::fmt::Write as _;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use motorium_primitives::file::{Primitive, PrimitiveFile};
use motorium_primitives::rollout::{Override, Trajectory, ViaPoint, roll_out};

use super::numbers::{Numbers, numbers, per_dimension};
use super::plot;
use crate::out::errln;
use crate::output::{self, Overwrite, check_format, write_file};
use crate::style;
use crate::values::positive;

/// Distance from the mean, in standard deviations, beyond which a via point is an extrapolation.
const FAR: f64 = 6.0;

/// Run a primitive: as demonstrated, or with another start, goal, duration or via points.
///
/// Prints the movement as CSV unless it is written to a file.
///
/// Example: motorium primitive replay reach.json --goal 0.5,0.2,0.4 --duration 3 --plot there.svg
#[derive(Debug, clap::Args)]
#[command(allow_negative_numbers = true)]
pub(super) struct Replay {
    /// The primitive, as `motorium primitive fit` wrote it
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Start position, one number for each dimension
    #[arg(long, value_name = "X,..", value_parser = numbers, allow_hyphen_values = true)]
    start: Option<Numbers>,
    /// Goal position, or the centre of a rhythm
    #[arg(long, value_name = "X,..", value_parser = numbers, allow_hyphen_values = true)]
    goal: Option<Numbers>,
    /// Velocity at the goal, for a primitive of the variant final-velocity
    #[arg(long, value_name = "V,..", value_parser = numbers, allow_hyphen_values = true)]
    final_velocity: Option<Numbers>,
    /// Duration, or the period of a rhythm, s
    #[arg(long, value_name = "S", value_parser = positive)]
    duration: Option<f64>,
    /// Via point of a probabilistic primitive: phase:X,.. or phase:X,..:deviation; may be repeated
    #[arg(long, value_name = "P:X,..", value_parser = via, allow_hyphen_values = true)]
    via: Vec<ViaPoint>,
    /// Number of periods of a rhythm [default: 2]
    #[arg(long, value_name = "N", value_parser = positive)]
    periods: Option<f64>,
    /// Amplitude of a rhythm; 1 is the demonstration's
    #[arg(long, value_name = "R", value_parser = positive)]
    amplitude: Option<f64>,
    /// Samples per second
    #[arg(long, value_name = "HZ", default_value_t = 100.0, value_parser = positive)]
    rate: f64,
    /// Write the movement to a file: .csv, .json or .jsonl
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Draw the movement
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print the movement as JSON
    #[arg(long)]
    json: bool,
}

fn via(text: &str) -> Result<ViaPoint, String> {
    let mut parts = text.split(':');
    let (Some(phase), Some(place)) = (parts.next(), parts.next()) else {
        return Err("expected a phase, a colon and a position, such as 0.5:0.1,-2".to_string());
    };
    let Ok(phase) = phase.parse::<f64>() else {
        return Err(format!("invalid phase `{phase}`, expected a number from 0 to 1"));
    };
    if !(0.0..=1.0).contains(&phase) {
        return Err(format!("a phase of {phase}, expected a number from 0 to 1"));
    }
    let deviation = parts.next().map_or(Ok(1e-4), positive)?;
    Ok(ViaPoint { phase, position: numbers(place)?.0, deviation })
}

impl Replay {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        self.overwrite.check([&self.file], self.output.iter().chain(&self.plot))?;
        self.plot.iter().try_for_each(|plot| check_format(plot, &["svg"]))?;
        let known = ["csv", "json", "jsonl", "ndjson"];
        let format = self.output.as_deref().map(|output| output::format(output, &known)).transpose()?;
        let file = PrimitiveFile::read(&self.file)?;
        let given = |option: &str, numbers: &Option<Numbers>| {
            numbers.as_ref().map(|numbers| per_dimension(option, &numbers.0, &file.names)).transpose()
        };
        let overrides = Override {
            start: given("--start", &self.start)?,
            goal: given("--goal", &self.goal)?,
            final_velocity: given("--final-velocity", &self.final_velocity)?,
            duration: self.duration,
            via: self.via.clone(),
            periods: self.periods,
            amplitude: self.amplitude,
        };
        let trajectory = roll_out(&file, &overrides, 1.0 / self.rate)?;
        self.warn_of_far_via_points(&file);
        if let Some(path) = &self.plot {
            let shown = std::slice::from_ref(&trajectory);
            let panels: Vec<_> =
                file.names.iter().enumerate().map(|(d, name)| plot::dimension(name, shown, d)).collect();
            plot::write(path, &panels)?;
        }
        if let Some(path) = &self.output {
            let text = match format {
                Some("csv") => csv(&trajectory),
                Some("json") => serde_json::to_string(&trajectory)? + "\n",
                _ => json_lines(&trajectory),
            };
            write_file(path, text)?;
        }
        if self.json {
            print(&(serde_json::to_string(&trajectory)? + "\n"))?;
        } else if self.output.is_none() && self.plot.is_none() {
            print(&csv(&trajectory))?;
        } else {
            let wrote = |what: &str, path: &Option<PathBuf>| {
                path.as_deref().map_or_else(String::new, |path: &Path| format!("{what} {}\n", path.display()))
            };
            print(&format!("{}{}", wrote("wrote", &self.output), wrote("drew", &self.plot)))?;
        }
        Ok(ExitCode::SUCCESS)
    }

    fn warn_of_far_via_points(&self, file: &PrimitiveFile) {
        let Primitive::Probabilistic(movement) = &file.primitive else { return };
        for ViaPoint { phase, position, .. } in &self.via {
            let far = movement.deviations_from_mean(*phase, position);
            for ((name, place), far) in file.names.iter().zip(position).zip(far).filter(|(_, far)| *far > FAR)
            {
                errln!(
                    "{} at phase {phase}, {place} is {far:.0} standard deviations from the demonstrated `{name}`: the \
                     movement is extrapolated",
                    style::warning("warning:")
                );
            }
        }
    }
}

/// Prints to standard output; a closed pipe is not an error.
fn print(text: &str) -> anyhow::Result<()> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}

fn csv(trajectory: &Trajectory) -> String {
    let mut text = String::from("time_s");
    for name in &trajectory.names {
        let _ = write!(text, ",{name}");
    }
    for name in &trajectory.names {
        let _ = write!(text, ",{name}_velocity");
    }
    text.push('\n');
    for (k, time) in trajectory.time.iter().enumerate() {
        let _ = write!(text, "{time}");
        for value in trajectory.position[k].iter().chain(&trajectory.velocity[k]) {
            let _ = write!(text, ",{value}");
        }
        text.push('\n');
    }
    text
}

fn json_lines(trajectory: &Trajectory) -> String {
    let mut text = String::new();
    for (k, time) in trajectory.time.iter().enumerate() {
        let value =
            serde_json::json!({ "position": trajectory.position[k], "velocity": trajectory.velocity[k] });
        let _ = writeln!(text, "{}", serde_json::json!({ "time_s": time, "value": value }));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn via_points_are_parsed() {
        let expected = ViaPoint { phase: 0.5, position: vec![0.1, -2.0], deviation: 1e-4 };
        assert_eq!(via("0.5:0.1,-2"), Ok(expected.clone()));
        assert_eq!(via("0.5:0.1,-2:0.01"), Ok(ViaPoint { deviation: 0.01, ..expected }));
        assert_eq!(via("1.5:1").unwrap_err(), "a phase of 1.5, expected a number from 0 to 1");
        assert!(via("0.5").unwrap_err().contains("a colon"));
        assert!(via("0.5:a").unwrap_err().contains("`a` is not a number"));
    }
}
