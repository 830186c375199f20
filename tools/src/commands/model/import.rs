//! `motorium model import`: a policy folder from the files of a training framework.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use motorium_models::policy::{ImportOptions, Policy, import_mjlab, import_weights};
use motorium_models::safetensors;
use motorium_robots::{LoadOptions, load_with};

use crate::out::outln;

/// Make a policy folder from an ONNX file of mjlab, or from weights in safetensors and a table written by
/// hand.
///
/// The metadata of mjlab has joints, gains and observation terms; its rate is given by --rate. Weights of
/// rsl_rl, Stable-Baselines3 and CleanRL need --table: a policy.toml without `network`, and with a table
/// `weights`.
///
/// Example: motorium model import policy.onnx --output out/go1 --robot quadruped
#[derive(Debug, clap::Args)]
pub(super) struct Import {
    /// The network: an ONNX file with metadata, or a safetensors file
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The folder to write; it has no policy.toml yet
    #[arg(long, short, value_name = "FOLDER")]
    output: PathBuf,
    /// The table of a safetensors file
    #[arg(long, value_name = "TABLE.toml", conflicts_with_all = ["rate", "history"])]
    table: Option<PathBuf>,
    /// The rate of a policy of mjlab, Hz [default: 50]
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// The steps of history of each observation term of mjlab [default: 1]
    #[arg(long, value_name = "STEPS")]
    history: Option<usize>,
    /// The robot: its joints are compared with the policy's, and it is named in policy.toml
    #[arg(long, value_name = "ROBOT", add = crate::complete::robots())]
    robot: Option<String>,
}

impl Import {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let name = |path: &Path| path.display().to_string();
        let description = self.output.join("policy.toml");
        if description.exists() {
            bail!("{} exists; help: choose another folder, or remove it", name(&description));
        }
        let bytes = std::fs::read(&self.file).with_context(|| name(&self.file))?;
        let (mut policy, network) = match &self.table {
            Some(table) => {
                let text = std::fs::read_to_string(table).with_context(|| name(table))?;
                let tensors = safetensors::read(&bytes).with_context(|| name(&self.file))?;
                import_weights(&tensors, &text).with_context(|| name(table))?
            }
            None if self.file.extension().is_some_and(|extension| extension == "safetensors") => {
                bail!("{}: weights alone; help: describe them in a file for `--table`", name(&self.file));
            }
            None => {
                let (rate, history) = (self.rate.unwrap_or(50.0), self.history.unwrap_or(1));
                let options = ImportOptions { rate, history, robot: None };
                (import_mjlab(&bytes, options).with_context(|| name(&self.file))?, bytes)
            }
        };
        if let Some(robot) = &self.robot {
            let loaded = load_with(robot, Path::new(""), &LoadOptions::default())?;
            policy.joint_targets(loaded.model.joint_names()).with_context(|| name(&self.file))?;
            policy.robot = Some(robot.clone());
        }
        std::fs::create_dir_all(&self.output).with_context(|| name(&self.output))?;
        let file = self.output.join(&policy.network);
        std::fs::write(&file, network).with_context(|| name(&file))?;
        std::fs::write(&description, policy.to_toml()?).with_context(|| name(&description))?;
        print(&policy, &self.output);
        Ok(ExitCode::SUCCESS)
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
