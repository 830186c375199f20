//! `motorium plot`: numbers of a recording over time.

use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::process::ExitCode;

use motorium_bridges::quantities::{entries, quantity};
use motorium_bridges::recording::{Curve, Opened, Recording, Signal, curves};
use motorium_pictures::chart::{Chart, Series};

use crate::braille::braille;
use crate::out::{errln, out};
use crate::output::{format, refuse_existing, write_file};
use crate::values::finite;

/// Maximum number of points of a curve in a picture: more than the picture has columns.
const POINTS: usize = 2000;

/// The formats of a file: pictures, and a table.
const FORMATS: [&str; 3] = ["svg", "png", "csv"];

/// Draw numbers of a recording over time: in the terminal, or as a picture.
///
/// A signal is TOPIC.FIELD, TOPIC.FIELD[I] or TOPIC.FIELD[A..B]. MCAP files of other programs are also drawn
/// (JSON, ROS 2 CDR, protobuf): /odom.pose.pose.position, /tf.transforms[0].transform.
///
/// Example: motorium plot out/a.mcap panda/joint_state.position[0..7] --output out/a.svg
#[derive(Debug, clap::Args)]
pub(crate) struct Plot {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// The numbers to draw, such as `panda/joint_state.position[0..7]`
    #[arg(value_name = "SIGNAL", required = true)]
    signals: Vec<Signal>,
    /// Write a picture (.svg or .png), or the numbers (.csv)
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long, requires = "output")]
    overwrite: bool,
    /// Start of the drawn interval, s since the start of the recording
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = finite)]
    from: f64,
    /// End of the drawn interval, s [default: the recording's]
    #[arg(long, value_name = "S", value_parser = finite)]
    to: Option<f64>,
}

impl Plot {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        if let Some(output) = &self.output {
            format(output, &FORMATS)?;
            refuse_existing(output, self.overwrite)?;
        }
        let opened = super::opened_any(&self.file)?;
        let end = self.to.unwrap_or(f64::INFINITY);
        let (recording, mut curves) = match &opened {
            Opened::Run(recording) => (Some(&**recording), curves(recording, &self.signals)?),
            Opened::Other(log) => (None, log.curves(&self.signals)?),
        };
        let last = curves.iter().filter_map(|curve| curve.points.last()).map(|(time, _)| *time);
        let last = last.fold(0.0, f64::max);
        for curve in &mut curves {
            curve.points.retain(|(time, _)| (self.from..=end).contains(time));
        }
        curves.retain(|curve| !curve.points.is_empty());
        let until = self.to.map_or_else(|| "the end".to_string(), |to| format!("{to} s"));
        anyhow::ensure!(
            !curves.is_empty(),
            "no sample of these signals lies from {} s to {until}; the last one is at {last:.3} s",
            self.from
        );
        let series = curves.iter().map(|curve| Series {
            name: label(recording, curve, &self.signals),
            points: curve.thinned(POINTS).into_iter().map(|(time, value)| [time, value, 0.0]).collect(),
        });
        let titles: Vec<String> = self.signals.iter().map(title).collect();
        let chart = Chart {
            title: titles.join(", "),
            x: "time, s".to_string(),
            y: values(recording, &self.signals),
            log_x: false,
            log_y: false,
            series: series.collect(),
        };
        let Some(output) = &self.output else {
            out!("{}", braille(&chart, size(), std::io::stdout().is_terminal()));
            return Ok(ExitCode::SUCCESS);
        };
        let content = match format(output, &FORMATS)? {
            "svg" => chart.svg().into_bytes(),
            "png" => chart.png(),
            _ => chart.csv().into_bytes(),
        };
        write_file(output, content)?;
        errln!("{}: {} curves", output.display(), curves.len());
        Ok(ExitCode::SUCCESS)
    }
}

/// Returns the name of the values, with their unit if it is known: if all signals are one field of one
/// quantity.
fn values(recording: Option<&Recording>, signals: &[Signal]) -> String {
    let Some(field) = signals[0].field.as_deref() else { return String::new() };
    let unit = |signal: &Signal| {
        let recording = recording?;
        let topic = &recording.topics()[recording.topic(&signal.topic)?];
        quantity(&topic.layout.type_name, signal.field.as_deref()?).map(|quantity| quantity.unit)
    };
    let first = unit(&signals[0]);
    if signals.iter().any(|signal| signal.field.as_deref() != Some(field) || unit(signal) != first) {
        return String::new();
    }
    match first {
        Some(unit) if !unit.is_empty() => format!("{field}, {unit}"),
        _ => field.to_string(),
    }
}

fn title(signal: &Signal) -> String {
    match &signal.field {
        Some(field) => format!("{}.{field}", signal.topic),
        None => signal.topic.clone(),
    }
}

/// Returns the name of a curve: its joint or axis, after its field if several fields are drawn.
fn label(recording: Option<&Recording>, curve: &Curve, signals: &[Signal]) -> String {
    let (topic, field) = curve.name.split_once('.').unwrap_or((&curve.name, ""));
    let field = field.split('[').next().unwrap_or_default();
    let name = curve.label.clone().or_else(|| {
        let (entry, plan) = (curve.entry?, recording?.plan().ok()?);
        let index = plan.topics.iter().position(|known| known.name == topic)?;
        entries(&plan, index, field).into_iter().nth(entry)
    });
    let last = |name: &str| name.rsplit_once('/').map_or(name, |(_, name)| name).to_string();
    match (name, signals) {
        (Some(name), [Signal { field: Some(_), .. }]) => name,
        (Some(name), _) => format!("{}.{field} {name}", last(topic)),
        (None, _) => last(&curve.name),
    }
}

/// Returns the columns and rows of the terminal, limited to a readable size.
fn size() -> (u16, u16) {
    let (columns, rows) = ratatui::crossterm::terminal::size().unwrap_or((100, 30));
    (columns.clamp(40, 160), rows.saturating_sub(2).clamp(12, 40))
}
