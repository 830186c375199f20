//! `motorium animate`: a recording as a moving picture.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use motorium::units::TimeSpan;
use motorium_bridges::recording::film;
use motorium_pictures::animation;
use motorium_pictures::robot::{OBLIQUE, Pictures, View};

use crate::commands::robot::size;
use crate::out::errln;
use crate::output::{format, refuse_existing, write_file};

/// Maximum number of dots of all pictures, in millions: all are in memory, because they share a palette.
const MOST: f64 = 200.0;

/// Write a moving picture of a recording: the robots and their world, as an animated PNG file (.png).
///
/// The camera shows the whole motion of robots with a fixed base, and follows robots with a floating base.
/// Equal recordings give equal files.
///
/// Example: motorium animate out/a.mcap --to 4s --output out/a.png
#[derive(Debug, clap::Args)]
pub(crate) struct Animate {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// The picture [default: FILE with `.png` in place of `.mcap`]
    #[arg(long, short, value_name = "FILE.png")]
    output: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long)]
    overwrite: bool,
    /// Width and height of the picture [default: 640x480]
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "640x480", hide_default_value = true, value_parser = size)]
    size: (f64, f64),
    /// Start of the animated interval, since the start of the recording
    #[arg(long, value_name = "TIME", default_value = "0 s")]
    from: TimeSpan,
    /// End of the animated interval [default: the end of the recording]
    #[arg(long, value_name = "TIME")]
    to: Option<TimeSpan>,
    /// Recorded time per playing time
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    speed: f64,
    /// Pictures per second, 1 to 50
    #[arg(long, value_name = "RATE", default_value_t = 12.5)]
    fps: f64,
    /// View: front, back, left, right, top, or AZIMUTH,ELEVATION in degrees
    #[arg(long, default_value = OBLIQUE, allow_hyphen_values = true)]
    view: View,
}

impl Animate {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        anyhow::ensure!(
            self.speed.is_finite() && self.speed > 0.0,
            "`--speed` is {}, expected above 0",
            self.speed
        );
        anyhow::ensure!((1.0..=50.0).contains(&self.fps), "`--fps` is {}, expected 1 to 50", self.fps);
        let output = self.output.unwrap_or_else(|| self.file.with_extension("png"));
        format(&output, &["png"]).context("moving pictures are animated PNG files")?;
        refuse_existing(&output, self.overwrite)?;
        let recording = super::opened(&self.file)?;
        let plan = recording.plan()?;
        let (begin_ns, end_ns) = recording.times().with_context(|| {
            format!("{} has no samples; record the topics of a robot", self.file.display())
        })?;
        let end_ns = (end_ns - begin_ns).min(self.to.map_or(u64::MAX, |to| to.ns));
        anyhow::ensure!(
            self.from.ns < end_ns,
            "`--from` is {}, expected a time before the end of the picture at {}",
            self.from,
            TimeSpan { ns: end_ns }
        );
        let delay_ms = (1e3 / self.fps).round();
        let step_ns = 1e6 * delay_ms * self.speed;
        let count = ((end_ns - self.from.ns) as f64 / step_ns) as usize + 1;
        let (width, height) = self.size;
        let millions = 1e-6 * width * height * count as f64;
        anyhow::ensure!(
            millions <= MOST,
            "{count} pictures of {width}x{height} have {millions:.0} million dots, expected at most {MOST}; choose a \
             shorter time by `--from` and `--to`, a higher `--speed`, a lower `--fps` or a smaller `--size`"
        );
        let times: Vec<u64> =
            (0..count).map(|index| self.from.ns + (index as f64 * step_ns) as u64).collect();
        let film = film(&recording, &plan, &times)?;
        anyhow::ensure!(
            !film.robots.is_empty(),
            "{} has no joint states of a robot, which a picture needs; record them",
            self.file.display()
        );
        let pictures = Pictures::new(&film, self.view, self.size)?;
        let [width, height] = pictures.dots();
        let painted: Vec<Vec<u8>> = (0..count).map(|index| pictures.paint(index)).collect();
        let file = animation::encode(width, height, delay_ms as u16, &painted);
        write_file(&output, &file)?;
        errln!("{}: {count} pictures, {} kB", output.display(), file.len().div_ceil(1000));
        Ok(ExitCode::SUCCESS)
    }
}
