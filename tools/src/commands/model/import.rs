//! `motorium model import`: creates a policy folder from the files of a training framework.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use motorium_learners::task::robot_digest;
use motorium_models::policy::{
    Bundle, Environment, ImportError, ImportOptions, Policy, import_isaac, import_leapp, import_mjlab,
    import_weights,
};
use motorium_models::safetensors;
use motorium_robots::{LoadOptions, Loaded, load_with};

use super::yaml;
use crate::out::outln;
use crate::output::{Overwrite, write_file};

/// Options that conflict with `--descriptors`.
const NOT_WITH_DESCRIPTORS: [&str; 5] = ["rate", "history", "height_points", "height_scale", "height_offset"];
/// Options that conflict with `--table`.
const NOT_WITH_TABLE: [&str; 7] =
    ["rate", "history", "height_points", "height_scale", "height_offset", "descriptors", "env"];

/// Create a policy folder from the files of a training framework.
///
/// mjlab: an ONNX file, whose metadata contain joints, gains and observation terms; --rate sets its rate.
///
/// Isaac Lab 3: the YAML file of a LEAPP bundle, or its folder. The default pose is read from --env, the
/// env.yaml of the training run, or is a --pose of the robot.
///
/// Isaac Lab 2: an ONNX file with --descriptors, its IO_descriptors.yaml, and --env, which has the gains.
///
/// rsl_rl, Stable-Baselines3, CleanRL: weights in safetensors with --table, a policy.toml without `network`
/// and with a table `weights`.
///
/// Example: motorium model import policy.onnx --output out/go1 --robot quadruped
#[derive(Debug, clap::Args)]
pub(super) struct Import {
    /// The network: an ONNX file, a safetensors file, or a LEAPP bundle
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The folder to write
    #[arg(long, short, value_name = "FOLDER")]
    output: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
    /// The table of a safetensors file
    #[arg(long, value_name = "TABLE.toml", conflicts_with_all = NOT_WITH_TABLE)]
    table: Option<PathBuf>,
    /// The description of an ONNX file of Isaac Lab 2
    #[arg(long, value_name = "IO_descriptors.yaml", conflicts_with_all = NOT_WITH_DESCRIPTORS)]
    descriptors: Option<PathBuf>,
    /// The environment of a training run of Isaac Lab
    #[arg(long, value_name = "env.yaml")]
    env: Option<PathBuf>,
    /// The rate of the policy, Hz, if its files do not contain it [default: 50 for mjlab]
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// History steps of each observation term of mjlab [default: as in the file, or 1]
    #[arg(long, value_name = "STEPS")]
    history: Option<usize>,
    /// The points of mjlab's height scan along x and y [default: 17,11 for 187 points]
    #[arg(long, value_name = "X,Y", value_delimiter = ',')]
    height_points: Option<Vec<usize>>,
    /// The factor of mjlab's height scan [default: as in the file]
    #[arg(long, value_name = "FACTOR")]
    height_scale: Option<f64>,
    /// The offset of mjlab's height scan, m [default: 0]
    #[arg(long, value_name = "METRES")]
    height_offset: Option<f64>,
    /// The robot, to compare joints with the policy's; its name and digest are written to policy.toml
    #[arg(long, value_name = "ROBOT", add = crate::complete::robots())]
    robot: Option<String>,
    /// The default pose of a LEAPP bundle without --env: a pose of the robot
    #[arg(long, value_name = "NAME", requires = "robot", conflicts_with = "env")]
    pose: Option<String>,
}

fn name(path: &Path) -> String {
    path.display().to_string()
}

/// Returns the YAML file of a LEAPP bundle at `path`, which is the file or its folder; `None` for other
/// files.
fn bundle_file(path: &Path) -> anyhow::Result<Option<PathBuf>> {
    let is_yaml = |path: &Path| path.extension().is_some_and(|extension| extension == "yaml");
    if !path.is_dir() {
        return Ok(is_yaml(path).then(|| path.to_owned()));
    }
    let mut files = Vec::new();
    for entry in std::fs::read_dir(path).with_context(|| name(path))? {
        files.extend(Some(entry.with_context(|| name(path))?.path()).filter(|path| is_yaml(path)));
    }
    match <[PathBuf; 1]>::try_from(files) {
        Ok([file]) => Ok(Some(file)),
        Err(files) => bail!("{}: {} YAML files, expected one, as in a LEAPP bundle", name(path), files.len()),
    }
}

impl Import {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let description = self.output.join("policy.toml");
        let inputs = || [&self.file].into_iter().chain(&self.table).chain(&self.descriptors).chain(&self.env);
        self.overwrite.check(inputs(), [&description])?;
        let robot = match &self.robot {
            Some(robot) => Some(load_with(robot, Path::new(""), &LoadOptions::default())?),
            None => None,
        };
        let (mut policy, network) = self.import(robot.as_ref())?;
        if let Some(loaded) = robot {
            policy.joint_targets(loaded.model.joint_names()).with_context(|| name(&self.file))?;
            policy.robot.clone_from(&self.robot);
            policy.robot_digest = robot_digest(&loaded, &policy.action.joints);
        }
        let file = self.output.join(&policy.network);
        let text = policy.to_toml()?;
        // the network may already be in the folder
        if std::fs::read(&file).ok().as_ref() != Some(&network) {
            self.overwrite.check(inputs(), [&file])?;
            write_file(&file, network)?;
        }
        write_file(&description, text)?;
        print(&policy, &self.output);
        Ok(ExitCode::SUCCESS)
    }

    /// Returns `true` if an option for files of mjlab is given.
    fn has_mjlab_options(&self) -> bool {
        self.history.is_some()
            || self.height_points.is_some()
            || self.height_scale.is_some()
            || self.height_offset.is_some()
    }

    /// Returns the policy and the bytes of its network.
    fn import(&self, robot: Option<&Loaded>) -> anyhow::Result<(Policy, Vec<u8>)> {
        let file = || name(&self.file);
        let environment = match &self.env {
            Some(path) => Some(yaml::environment(path)?),
            None => None,
        };
        if let Some(path) = bundle_file(&self.file)? {
            if self.descriptors.is_some() || self.table.is_some() || self.has_mjlab_options() {
                bail!(
                    "{}: a LEAPP bundle, expected no `--descriptors`, `--table`, `--history` and `--height-...`",
                    file()
                );
            }
            return self.import_bundle(&path, environment.as_ref(), robot);
        }
        if self.pose.is_some() {
            bail!("{}: `--pose` is the default pose of a LEAPP bundle; help: remove it", file());
        }
        let bytes = std::fs::read(&self.file).with_context(file)?;
        if let Some(path) = &self.descriptors {
            let descriptors = yaml::descriptors(path)?;
            let imported = import_isaac(&bytes, &descriptors, environment.as_ref());
            return imported.map_err(|error| self.located(error, path));
        }
        if let Some(path) = &self.env {
            bail!(
                "{}: the description is missing; help: pass IO_descriptors.yaml with `--descriptors`",
                name(path)
            );
        }
        if let Some(table) = &self.table {
            let text = std::fs::read_to_string(table).with_context(|| name(table))?;
            let tensors = safetensors::read(&bytes).with_context(file)?;
            return import_weights(&tensors, &text).with_context(|| name(table));
        }
        if self.file.extension().is_some_and(|extension| extension == "safetensors") {
            bail!("{}: the file contains only weights; help: describe them in a file for `--table`", file());
        }
        let points = self.height_points.as_deref().map(<[usize; 2]>::try_from).transpose();
        let options = ImportOptions {
            rate: self.rate.unwrap_or(50.0),
            history: self.history,
            robot: None,
            height_points: points.context("--height-points: expected two numbers")?,
            height_scale: self.height_scale,
            height_offset: self.height_offset,
        };
        import_mjlab(&bytes, options).with_context(file)
    }

    fn import_bundle(
        &self,
        path: &Path,
        environment: Option<&Environment>,
        robot: Option<&Loaded>,
    ) -> anyhow::Result<(Policy, Vec<u8>)> {
        let bundle = yaml::bundle(path)?;
        let at = || name(path);
        let read = |file: &str| {
            let path = path.with_file_name(file);
            std::fs::read(&path).with_context(|| name(&path))
        };
        let bytes = read(&bundle.model().with_context(at)?.path)?;
        let initial = match &bundle.initial_values {
            Some(file) => {
                Some(safetensors::read(&read(file)?).with_context(|| name(&path.with_file_name(file)))?)
            }
            None => None,
        };
        let default_pose = self.default_pose((&bundle, path), environment, robot)?;
        import_leapp(&bytes, &bundle, initial.as_ref(), &default_pose, environment, self.rate)
            .map_err(|error| self.located(error, path))
    }

    /// Adds the name of the file to an error: `--env`, or the description at `path`.
    fn located(&self, error: ImportError, path: &Path) -> anyhow::Error {
        let file = match (&error, &self.env) {
            (ImportError::Environment(_), Some(environment)) => name(environment),
            _ => name(path),
        };
        anyhow::Error::new(error).context(file)
    }

    /// Returns the default position of each joint of a bundle [rad or m].
    fn default_pose(
        &self,
        (bundle, path): (&Bundle, &Path),
        environment: Option<&Environment>,
        robot: Option<&Loaded>,
    ) -> anyhow::Result<Vec<f64>> {
        let joints = bundle.joints().map_err(|error| self.located(error, path))?;
        match (environment, robot, &self.pose) {
            (Some(environment), ..) => {
                environment.default_pose(joints).map_err(|error| self.located(error, path))
            }
            (None, Some(robot), Some(pose)) => {
                let (names, pose) = (robot.model.joint_names(), crate::robots::pose(robot, pose)?);
                let position = |joint: &String| {
                    let index = names.iter().position(|name| name == joint);
                    index
                        .map(|index| pose[index])
                        .with_context(|| format!("the robot has no joint \"{joint}\""))
                };
                joints.iter().map(position).collect()
            }
            _ => bail!(
                "{}: no default pose, expected `--env env.yaml`, which has it, or `--robot ROBOT --pose NAME`; \
                 help: env.yaml is in `params` of the training run",
                name(path)
            ),
        }
    }
}

fn print(policy: &Policy, folder: &Path) {
    let terms: Vec<&str> = policy.observations.iter().map(|term| term.term.name()).collect();
    outln!(
        "{} joints at {} Hz: {}",
        policy.action.joints.len(),
        policy.rate,
        policy.action.joints.join(", ")
    );
    outln!("observation: {}", terms.join(", "));
    outln!("wrote {}; `motorium model check` compares it with a robot", folder.display());
}
