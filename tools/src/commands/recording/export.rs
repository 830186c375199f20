//! `motorium export`: a recording as tables, or as a dataset for learning.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use motorium::declare::Taps;
use motorium::plan::Plan;
use motorium_bridges::foxglove::joints_of_topic;
use motorium_bridges::recording::{
    Camera, Dataset, Opened, OtherLog, Recording, Signal, TableError, usual_cameras, usual_signals,
    write_csv, write_lerobot, write_parquet,
};

use crate::out::{errln, outln};
use crate::output::refuse_existing;
use crate::style;

/// Description of a dataset of LeRobot in its folder.
const DESCRIPTION: &str = "meta/info.json";

/// Write a recording as tables, one for each topic, or as a dataset of LeRobot.
///
/// MCAP files of other programs become tables of the channels that can be decoded: JSON, ROS 2 CDR and
/// protobuf.
///
/// `--format lerobot` writes a LeRobotDataset of version 3.0: frames of state, action and pictures at a fixed
/// rate, with one episode for each episode of the recording.
///
/// Example: motorium export out/a.mcap --topic panda/joint_state --output out/a
#[derive(Debug, clap::Args)]
pub(crate) struct Export {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// `csv`, `parquet`, or `lerobot`
    #[arg(long, value_enum, default_value_t, hide_possible_values = true)]
    format: Format,
    /// A topic; `*` matches any characters; may be repeated [default: all]
    #[arg(long, value_name = "TOPIC")]
    topic: Vec<String>,
    /// The folder of the tables [default: FILE without `.mcap`]
    #[arg(long, short, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Replace existing tables, or an existing dataset
    #[arg(long)]
    overwrite: bool,
    /// LeRobot: frames per second [default: 50]
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    fps: Option<u32>,
    /// LeRobot: numbers of the state, such as `panda/joint_state.position[0..7]`; may be repeated [default:
    /// the positions read by the writer of the joint commands]
    #[arg(long, value_name = "SIGNAL")]
    state: Vec<Signal>,
    /// LeRobot: numbers of the action; may be repeated [default: the commanded positions, or efforts]
    #[arg(long, value_name = "SIGNAL")]
    action: Vec<Signal>,
    /// LeRobot: a topic of pictures with 8 bits per colour; may be repeated [default: all]
    #[arg(long, value_name = "TOPIC", conflicts_with = "no_pictures")]
    pictures: Vec<String>,
    /// LeRobot: omit pictures
    #[arg(long)]
    no_pictures: bool,
    /// LeRobot: description of the task [default: the name of the graph]
    #[arg(long, value_name = "TEXT")]
    task: Option<String>,
}

#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// Comma-separated values
    #[default]
    Csv,
    /// Parquet
    Parquet,
    /// A dataset of LeRobot, version 3.0
    Lerobot,
}

impl Export {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let opened = super::opened_any(&self.file)?;
        let folder = self.output.clone().unwrap_or_else(|| self.file.with_extension(""));
        if self.format == Format::Lerobot {
            anyhow::ensure!(
                self.topic.is_empty(),
                "a dataset is made of `--state` and `--action`, not of `--topic`"
            );
            let Opened::Run(recording) = &opened else {
                anyhow::bail!(
                    "{}: `--format lerobot` needs a recording of motorium, expected `csv` or `parquet` for other files",
                    self.file.display()
                );
            };
            return self.dataset(recording, &folder);
        }
        let of_datasets = [
            ("--fps", self.fps.is_some()),
            ("--state", !self.state.is_empty()),
            ("--action", !self.action.is_empty()),
            ("--pictures", !self.pictures.is_empty()),
            ("--no-pictures", self.no_pictures),
            ("--task", self.task.is_some()),
        ];
        if let Some((option, _)) = of_datasets.iter().find(|(_, given)| *given) {
            anyhow::bail!("`{option}` is an option of `--format lerobot`");
        }
        match &opened {
            Opened::Run(recording) => self.tables(recording, &folder),
            Opened::Other(log) => self.tables_of_other(log, &folder),
        }
    }

    /// Writes a table for each channel that can be decoded, and reports the others.
    fn tables_of_other(&self, log: &OtherLog, folder: &Path) -> anyhow::Result<ExitCode> {
        let names: Vec<String> = log.channels().iter().map(|channel| channel.topic.clone()).collect();
        let mut written = 0;
        for (index, path) in self.files(&names, folder)? {
            let channel = &log.channels()[index];
            if let Err(reason) = &channel.decoder {
                anyhow::ensure!(self.topic.is_empty(), "channel {channel}: {reason}");
                errln!("{} channel {channel} is left out: {reason}", style::warning("warning:"));
                continue;
            }
            let rows = self.table(&path, |file| match self.format {
                Format::Parquet => log.write_parquet(index, file),
                Format::Csv | Format::Lerobot => log.write_csv(index, file),
            })?;
            outln!("{}: {rows} rows", path.display());
            written += 1;
        }
        anyhow::ensure!(written > 0, "{}: no channel can be decoded", self.file.display());
        Ok(ExitCode::SUCCESS)
    }

    fn tables(&self, recording: &Recording, folder: &Path) -> anyhow::Result<ExitCode> {
        let names: Vec<String> = recording.topics().iter().map(|topic| topic.name.clone()).collect();
        for (index, path) in self.files(&names, folder)? {
            let rows = self.table(&path, |file| match self.format {
                Format::Parquet => write_parquet(recording, index, file),
                Format::Csv | Format::Lerobot => write_csv(recording, index, file),
            })?;
            outln!("{}: {rows} rows", path.display());
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Writes a table to a file and returns its number of rows.
    fn table(
        &self,
        path: &Path,
        write: impl FnOnce(&mut BufWriter<File>) -> Result<u64, TableError>,
    ) -> anyhow::Result<u64> {
        let file = File::create(path).with_context(|| format!("making {}", path.display()))?;
        let mut file = BufWriter::new(file);
        let rows = write(&mut file)?;
        file.flush().with_context(|| format!("writing {}", path.display()))?;
        Ok(rows)
    }

    /// Creates the folder and returns the files of the chosen topics, with the indices of the topics.
    fn files(&self, names: &[String], folder: &Path) -> anyhow::Result<Vec<(usize, PathBuf)>> {
        let chosen = match self.topic.as_slice() {
            [] => Taps::new(["*"], core::time::Duration::ZERO),
            names => Taps::new(names.iter().map(String::as_str), core::time::Duration::ZERO),
        };
        if let Some(unknown) = chosen.unmatched(names) {
            anyhow::bail!("the recording has no topic `{unknown}`; its topics are {}", names.join(", "));
        }
        if names.is_empty() {
            anyhow::bail!("{}: the recording has no topics to write", self.file.display());
        }
        refuse_file(folder)?;
        std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
        let extension = if self.format == Format::Parquet { "parquet" } else { "csv" };
        let chosen = names.iter().enumerate().filter(|(_, name)| chosen.includes(name));
        let file = |name: &str| format!("{}.{extension}", name.trim_start_matches('/').replace('/', "-"));
        let files: Vec<_> = chosen.map(|(index, name)| (index, folder.join(file(name)))).collect();
        files.iter().try_for_each(|(_, path)| refuse_existing(path, self.overwrite))?;
        Ok(files)
    }

    fn dataset(self, recording: &Recording, folder: &Path) -> anyhow::Result<ExitCode> {
        refuse_existing(&folder.join(DESCRIPTION), self.overwrite)?;
        let plan = recording.plan()?;
        let (mut state, mut action) = (self.state, self.action);
        if state.is_empty() || action.is_empty() {
            let usual = usual_signals(recording, &plan);
            let (usual_state, usual_action) = usual.context(
                "the recording does not have the joint commands of one controller and the joint states that it reads: \
                 name the numbers by `--state` and `--action`",
            )?;
            if state.is_empty() {
                state.push(usual_state);
            }
            if action.is_empty() {
                action.push(usual_action);
            }
        }
        let cameras = match (self.no_pictures, self.pictures.as_slice()) {
            (true, _) => Vec::new(),
            (false, []) => {
                let (cameras, depths) = usual_cameras(recording);
                for topic in depths {
                    eprintln!(
                        "note: the pictures of `{topic}` are depths in metres, and are left out: a dataset has 8 \
                         bits per colour"
                    );
                }
                cameras
            }
            (false, topics) => topics.iter().map(|topic| Camera::of_topic(topic)).collect(),
        };
        let names = [names(recording, &plan, &state), names(recording, &plan, &action)];
        let robot = plan.components.iter().find_map(|component| component.robot.as_ref());
        let dataset = Dataset {
            state,
            action,
            cameras,
            fps: self.fps.unwrap_or(50),
            task: self.task.unwrap_or_else(|| plan.name.clone()),
            robot: robot.map(|robot| robot.name.clone()),
            names,
        };
        let counts = write_lerobot(recording, &dataset, folder)?;
        let episodes = if counts.episodes == 1 { "episode" } else { "episodes" };
        outln!("{}: {} frames in {} {episodes}", folder.display(), counts.frames, counts.episodes);
        Ok(ExitCode::SUCCESS)
    }
}

/// Refuses the name of a file instead of a folder: each topic is a separate table.
fn refuse_file(folder: &Path) -> anyhow::Result<()> {
    let extension = folder.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    let is_table = ["csv", "parquet"].iter().any(|known| extension.eq_ignore_ascii_case(known));
    anyhow::ensure!(
        folder.is_dir() || !(is_table || folder.exists()),
        "`--output {}` is the name of a file, expected a folder: each topic becomes a file in this folder; \
         `--format csv` or `--format parquet` selects the format",
        folder.display()
    );
    Ok(())
}

/// Returns the names of the numbers of signals: joint names if each signal is one field of a joint topic.
fn names(recording: &Recording, plan: &Plan, signals: &[Signal]) -> Vec<String> {
    let of_joints = |signal: &Signal| {
        let topic = &recording.topics()[recording.topic(&signal.topic)?];
        let index = plan.topics.iter().position(|known| known.name == signal.topic)?;
        let field = signal.field.as_ref()?;
        let joints = topic.layout.type_name.starts_with("motorium.Joint");
        let joints = joints.then(|| joints_of_topic(plan, index)).flatten()?;
        let entries = signal.entries.clone().unwrap_or(0..joints.len());
        let chosen = joints.get(entries.start..entries.end.min(joints.len()))?;
        Some(chosen.iter().map(|joint| format!("{joint}.{field}")).collect::<Vec<_>>())
    };
    let all: Option<Vec<Vec<String>>> = signals.iter().map(of_joints).collect();
    all.unwrap_or_default().concat()
}
