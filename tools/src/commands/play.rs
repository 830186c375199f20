//! `motorium play`: a simulated robot follows a recorded joint movement exactly.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{bail, ensure};
use motorium::nearest::list;
use motorium_recordings::Recording;
use motorium_robots::{Coordinate, JointKind, LoadOptions, Loaded, Model, PackagePath, load_with};

use super::recording::Temporary;
use super::run::{Clock, Generated, Run};
use super::samples::SampleArgs;
use crate::out::errln;
use crate::style;

/// Largest difference of a follower from its leader's position that is not reported \[rad or m\].
const FOLLOWER_TOLERANCE: f64 = 1e-3;
/// Time for which the run continues after the end of the movement, s.
const REST: f64 = 0.5;

/// Move a simulated robot exactly along a recorded movement of its joints.
///
/// Reads CSV, JSON lines and MCAP files of motorium and other programs (JSON, ROS 2 CDR, protobuf). Columns
/// are assigned to joints by name; joints without a column hold their home position. Columns of mimic joints
/// are compared with their leaders'. Positions are in rad or m.
///
/// Example: motorium play demo.csv --robot panda --record out/demo.mcap
#[derive(Debug, clap::Args)]
pub(crate) struct Play {
    /// The recording
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// A catalogue or installed robot, a URDF or MJCF file, or a folder with one
    #[arg(long, value_name = "ROBOT", add = crate::complete::robots())]
    robot: String,
    /// Search `package://` files in this folder first; may be repeated
    #[arg(long, value_name = "FOLDER")]
    package_path: Vec<PathBuf>,
    #[command(flatten)]
    samples: SampleArgs,
    /// Speed factor
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    speed: f64,
    /// The clock, `realtime` or `lockstep` [default: lockstep]
    #[arg(long, value_enum, hide_possible_values = true)]
    clock: Option<Clock>,
    /// Record every sample into an MCAP file
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// With `--record`: replace the file if it exists
    #[arg(long, requires = "record")]
    overwrite: bool,
    /// Print the report as JSON on standard output
    #[arg(long)]
    json: bool,
}

impl Play {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        ensure!(
            self.speed > 0.0 && self.speed.is_finite(),
            "`--speed {}`: expected a number above 0",
            self.speed
        );
        let recording = self.samples.read(&self.file)?;
        let packages = PackagePath { folders: self.package_path.clone(), prefixes: Vec::new() };
        let options = LoadOptions { packages, ..LoadOptions::default() };
        let loaded = load_with(&self.robot, Path::new(""), &options)?;
        let model = &loaded.model;
        ensure!(
            model.nq() == model.joint_count(),
            "robot `{}` has a floating base, which joint positions do not move; expected a robot on a fixed base",
            self.robot
        );
        let recording = self.without_followers(recording, model)?;
        let joints = self.joints(&recording, model)?;
        let start = self.start(&recording, &joints, &loaded)?;
        self.check_limits(&recording, &joints, model)?;
        let table = Temporary::write("csv", &table(&recording, &joints, model))?;
        let duration = recording.duration() / self.speed;
        let graph = Temporary::write("toml", &self.graph(table.path(), &start, duration)?)?;
        Run::generated(Generated {
            graph: graph.path().to_path_buf(),
            clock: Some(self.clock.unwrap_or(Clock::Lockstep)),
            record: self.record.clone(),
            overwrite: self.overwrite,
            json: self.json,
        })
        .run()
    }

    /// Removes the columns of mimic joints after comparing them with the columns of their leaders.
    fn without_followers(&self, recording: Recording, model: &Model) -> anyhow::Result<Recording> {
        let follower = |name: &String| {
            let mut joints = model.bodies().iter().map(|body| &body.joint);
            joints.find(|joint| joint.name == *name && matches!(joint.coordinate, Coordinate::Mimic { .. }))
        };
        let (names, times, values) = (recording.names(), recording.times(), recording.values());
        let mut kept = Vec::new();
        for (column, name) in names.iter().enumerate() {
            let Some(joint) = follower(name) else {
                kept.push(column);
                continue;
            };
            let leader = &model.joint_names()[joint.coordinate.index()];
            let warn = |found: String| {
                errln!(
                    "{} {}: {found}; its column is ignored",
                    style::warning("warning:"),
                    self.file.display()
                );
            };
            let Some(of_leader) = names.iter().position(|other| other == leader) else {
                warn(format!("`{name}` follows `{leader}`, which has no column"));
                continue;
            };
            let expected = |sample: usize| {
                joint.coordinate.multiplier() * values[(sample, of_leader)] + joint.coordinate.offset()
            };
            let difference = |sample: usize| (values[(sample, column)] - expected(sample)).abs();
            let farthest = (0..times.len()).max_by(|a, b| difference(*a).total_cmp(&difference(*b)));
            if let Some(sample) = farthest.filter(|sample| difference(*sample) > FOLLOWER_TOLERANCE) {
                warn(format!(
                    "`{name}` follows `{leader}`, but is at {} at {:.3} s, expected {:.4}, a difference of {:.4}",
                    values[(sample, column)],
                    times[sample] - times[0],
                    expected(sample),
                    difference(sample)
                ));
            }
        }
        ensure!(
            !kept.is_empty(),
            "{}: all columns are of joints that follow others, expected columns of their leaders",
            self.file.display()
        );
        if kept.len() == names.len() {
            return Ok(recording);
        }
        let names = kept.iter().map(|column| names[*column].clone()).collect();
        Ok(Recording::new(names, times.to_vec(), values.select_columns(&kept))?)
    }

    /// Assigns a joint to each column: by name, or in order if no column is named after a joint.
    fn joints(&self, recording: &Recording, model: &Model) -> anyhow::Result<Vec<usize>> {
        let (file, known) = (self.file.display(), list(model.joint_names().iter().map(String::as_str)));
        let found: Vec<Option<usize>> =
            recording.names().iter().map(|name| model.joint_index(name)).collect();
        let count = found.len();
        if found.iter().all(Option::is_none) && count == model.joint_count() {
            errln!(
                "{} no column is named after a joint: the columns are assigned to the joints in order, {known}",
                style::warning("note:")
            );
            return Ok((0..count).collect());
        }
        let columns = recording.names().iter().zip(&found);
        let unknown: Vec<&str> =
            columns.filter(|(_, joint)| joint.is_none()).map(|(name, _)| name.as_str()).collect();
        if !unknown.is_empty() {
            bail!(
                "{file}: robot `{}` has no joints {}; its joints are {known}; select columns by `--channel`",
                self.robot,
                list(unknown.iter().copied())
            );
        }
        let joints: Vec<usize> = found.into_iter().flatten().collect();
        let held = (0..model.joint_count()).filter(|joint| !joints.contains(joint));
        let held: Vec<&str> = held.map(|joint| model.joint_names()[joint].as_str()).collect();
        if !held.is_empty() {
            let held = list(held.iter().copied());
            errln!("{} {file} has no columns {held}: they hold their home position", style::warning("note:"));
        }
        Ok(joints)
    }

    /// Returns the initial positions of all joints: the first sample, or home for joints without a column.
    fn start(&self, recording: &Recording, joints: &[usize], loaded: &Loaded) -> anyhow::Result<Vec<f64>> {
        let model = &loaded.model;
        let mut start = match &loaded.profile {
            Some(profile) => profile.home(model)?.as_slice().to_vec(),
            None => model.neutral(),
        };
        for (column, joint) in joints.iter().enumerate() {
            start[*joint] = recording.values()[(0, column)];
        }
        Ok(start)
    }

    /// Refuses positions outside of the joint ranges, and speeds beyond the limits.
    fn check_limits(&self, recording: &Recording, joints: &[usize], model: &Model) -> anyhow::Result<()> {
        let (times, values) = (recording.times(), recording.values());
        for (column, joint) in joints.iter().enumerate() {
            let name = &model.joint_names()[*joint];
            let (lower, upper) = (model.lower()[*joint], model.upper()[*joint]);
            for (sample, time) in times.iter().enumerate() {
                let value = values[(sample, column)];
                ensure!(
                    (lower..=upper).contains(&value),
                    "{}: joint `{name}` is at {value} at {:.3} s, expected {lower} to {upper}{}",
                    self.file.display(),
                    time - times[0],
                    millimetres(recording, (column, *joint), model)
                        .or_else(|| degrees(recording, joints, model))
                        .unwrap_or_default()
                );
            }
            let limit = model.velocity_limit()[*joint];
            let speeds = (1..times.len()).map(|sample| {
                let step = values[(sample, column)] - values[(sample - 1, column)];
                (step / (times[sample] - times[sample - 1])).abs() * self.speed
            });
            let fastest = speeds.fold(0.0, f64::max);
            ensure!(
                fastest <= limit,
                "{}: joint `{name}` moves at {fastest:.3} rad/s or m/s, expected at most {limit}; slow down by `--speed {:.2}`",
                self.file.display(),
                (self.speed * limit / fastest * 100.0).floor() / 100.0
            );
        }
        Ok(())
    }

    /// Builds the graph: the simulated robot, and a policy that follows the table.
    fn graph(&self, table: &Path, start: &[f64], duration: f64) -> anyhow::Result<String> {
        let text = |path: &Path| toml::Value::from(path.to_string_lossy().into_owned());
        let robot = Path::new(&self.robot);
        let robot = if robot.exists() { std::path::absolute(robot)? } else { robot.to_path_buf() };
        let mut of_robot = toml::Table::from_iter([
            ("urdf".to_string(), text(&robot)),
            ("start".to_string(), start.to_vec().into()),
        ]);
        if !self.package_path.is_empty() {
            let folders = self.package_path.iter().map(|folder| Ok(text(&std::path::absolute(folder)?)));
            let folders: Vec<toml::Value> = folders.collect::<anyhow::Result<_>>()?;
            of_robot.insert("package_path".to_string(), folders.into());
        }
        let length = |seconds: f64| format!("{} ns", (seconds * 1e9).round());
        Ok(format!(
            "name = \"play\"\nduration = \"{}\"\n\n[robot.robot]\n{of_robot}\n\
             [component.physics]\nkind = \"physics.articulated\"\nrobot = \"robot\"\nrate = \"1 kHz\"\n\
             subscribe = {{ joint_command = \"robot/joint_command\" }}\n\
             publish = {{ joint_state = \"robot/joint_state\" }}\n\n\
             [component.policy]\nkind = \"policy.promp\"\nrobot = \"robot\"\ntrigger = \"robot/joint_state\"\n\
             subscribe = {{ joint_state = \"robot/joint_state\" }}\n\
             publish = {{ joint_command = \"robot/joint_command\" }}\n\n\
             [component.policy.config]\nprimitives = [{}]\nduration = \"{}\"\njoint_command = {{ ease = \"1 ms\" }}\n",
            length(duration + REST),
            text(table),
            length(duration)
        ))
    }
}

/// Returns advice if the positions of a sliding joint are within its limits in millimetres.
fn millimetres(recording: &Recording, (column, joint): (usize, usize), model: &Model) -> Option<String> {
    let limits = model.lower()[joint]..=model.upper()[joint];
    let slides = model.joint(joint).kind == JointKind::Prismatic;
    let is_within = |value: &f64| limits.contains(&(1e-3 * value));
    let are_meant = slides && recording.values().column(column).iter().all(is_within);
    are_meant
        .then(|| "; the column seems to be in mm, and positions of joints that slide are in m".to_owned())
}

/// Returns advice if the positions of all joints that turn are within their limits in degrees, and one of
/// them is out of reach in radians.
fn degrees(recording: &Recording, joints: &[usize], model: &Model) -> Option<String> {
    let values = recording.values();
    let mut advice = None;
    for (column, joint) in joints.iter().enumerate() {
        if model.joint(*joint).kind == JointKind::Prismatic {
            continue;
        }
        let farthest = values.column(column).iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        let limits = model.lower()[*joint]..=model.upper()[*joint];
        let is_within = |value: &f64| limits.contains(&value.to_radians());
        if !values.column(column).iter().all(is_within) {
            return None;
        }
        advice = advice.or_else(|| model.degrees_advice(*joint, farthest));
    }
    advice.map(|advice| format!("; the table seems to be in degrees, and {advice}"))
}

/// Converts the recording to a table with joint names. Numbers are preserved bit for bit.
fn table(recording: &Recording, joints: &[usize], model: &Model) -> String {
    let names: Vec<&str> = joints.iter().map(|joint| model.joint_names()[*joint].as_str()).collect();
    let mut text = format!("time_s,{}\n", names.join(","));
    let first = recording.times()[0];
    for (time, row) in recording.times().iter().zip(recording.values().row_iter()) {
        let _ = write!(text, "{}", time - first);
        row.iter().for_each(|value| {
            let _ = write!(text, ",{value}");
        });
        text.push('\n');
    }
    text
}
