//! Prints a table of the robots that stand or hold their home pose and then reach a second pose with their
//! unedited first profile.
//!
//! For each URDF and MJCF file in the folders, `motorium robot profile` writes a profile and a graph, and
//! `motorium run` runs the graph in lockstep: the robot holds its home pose for 5 s, then reaches a pose of
//! its tool, joints or base.
//!
//! ```console
//! $ pip download --no-deps example-robot-data && unzip -d robots example_robot_data-*.whl
//! $ cargo run --release --example first_profiles -- robots
//! ```

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Output, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::Context as _;
use clap::Parser as _;
use serde_json::Value;

/// Print a table of the robots that stand or hold their pose, then reach another, with their first profile.
#[derive(Debug, clap::Parser)]
struct Arguments {
    /// Folders with robots: URDF files, and MJCF files named `robot.xml`
    #[arg(required = true)]
    folders: Vec<PathBuf>,
    /// Program that writes and runs the graphs [default: `motorium` next to the folder of this example]
    #[arg(long)]
    motorium: Option<PathBuf>,
    /// Number of robots to test in parallel
    #[arg(long, default_value_t = 2)]
    jobs: usize,
    /// Minimum number of robots that must pass
    #[arg(long, default_value_t = 0)]
    at_least: usize,
}

/// The outcome of one robot.
struct Outcome {
    name: String,
    stands: bool,
    /// The reason of a failure.
    failure: Option<String>,
}

fn main() -> anyhow::Result<ExitCode> {
    let arguments = Arguments::parse();
    let program = match arguments.motorium {
        Some(program) => program,
        None => {
            let own = std::env::current_exe()?;
            let folder = own.parent().and_then(Path::parent).context("the example is in a folder")?;
            folder.join(format!("motorium{}", std::env::consts::EXE_SUFFIX))
        }
    };
    anyhow::ensure!(program.is_file(), "{} not found; build it, or give --motorium", program.display());
    let mut files = Vec::new();
    for folder in &arguments.folders {
        find(folder, &mut files).with_context(|| format!("reading {}", folder.display()))?;
    }
    files.sort();
    anyhow::ensure!(!files.is_empty(), "no robot in these folders");
    let scratch = std::env::temp_dir().join(format!("first-profiles-{}", std::process::id()));
    std::fs::create_dir_all(&scratch)?;
    let (next, outcomes) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..arguments.jobs.max(1) {
            scope.spawn(|| {
                while let Some(file) = files.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let index = files.iter().position(|other| other == file).unwrap_or_default();
                    let outcome = trial(&program, file, &scratch.join(index.to_string()));
                    outcomes.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).push((index, outcome));
                }
            });
        }
    });
    let mut outcomes = outcomes.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    outcomes.sort_by_key(|(index, _)| *index);
    let _ = std::fs::remove_dir_all(&scratch);
    let width = outcomes.iter().map(|(_, outcome)| outcome.name.len()).max().unwrap_or(0);
    for (_, Outcome { name, stands, failure }) in &outcomes {
        let base = if *stands { "stands" } else { "holds" };
        match failure {
            None => println!("{name:width$}  {base:6}  reaches"),
            Some(reason) => println!("{name:width$}  fails   {reason}"),
        }
    }
    let passed = outcomes.iter().filter(|(_, outcome)| outcome.failure.is_none()).count();
    println!("\n{passed} of {} pass", outcomes.len());
    Ok(if passed >= arguments.at_least { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Collects the robot files in a folder and its subfolders.
fn find(folder: &Path, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            find(&path, found)?;
        } else if path.extension().is_some_and(|extension| extension == "urdf")
            || path.file_name().is_some_and(|name| name == "robot.xml")
        {
            found.push(path);
        }
    }
    Ok(())
}

/// Writes a robot's profile and graph, and runs the graph.
fn trial(program: &Path, file: &Path, scratch: &Path) -> Outcome {
    let stem = if file.file_stem().is_some_and(|stem| stem == "robot") { file.parent() } else { None };
    let name = stem.unwrap_or(file).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let (profile, graph) = (scratch.with_extension("toml"), scratch.with_extension("graph.toml"));
    let run = |arguments: &[&str]| -> Result<Output, String> {
        let mut command = Command::new(program);
        let output = command.args(arguments).stdin(Stdio::null()).output();
        output.map_err(|error| error.to_string())
    };
    let text = |path: &Path| path.to_string_lossy().into_owned();
    let written =
        run(&["robot", "profile", &text(file), "--output", &text(&profile), "--graph", &text(&graph)]);
    let drafted = std::fs::read_to_string(&profile).unwrap_or_default();
    let stands = drafted.contains("\n[feet.");
    let failure = match written {
        Ok(output) if output.status.success() => {
            match run(&["run", &text(&graph), "--hosting", "inline", "--json"]) {
                Ok(output) if output.status.success() => None,
                Ok(output) => Some(reason(&output)),
                Err(error) => Some(error),
            }
        }
        Ok(output) => Some(reason(&output)),
        Err(error) => Some(error),
    };
    Outcome { name, stands, failure }
}

/// Returns the reason why a command failed: its first error, and the joint or frame that missed its goal.
fn reason(output: &Output) -> String {
    let errors = String::from_utf8_lossy(&output.stderr);
    let error =
        errors.lines().find_map(|line| line.split_once("error: ")).map_or("failed", |(_, error)| error);
    let report: Option<Value> = serde_json::from_slice(&output.stdout).ok();
    let missed = report.and_then(|report| {
        let policy = &report["results"]["policy"];
        let (joint, error) = (policy["joint_of_the_error"].as_str()?, policy["joint_error"].as_f64()?);
        Some(format!("; {joint} is {error:.3} away"))
    });
    format!("{error}{}", missed.unwrap_or_default())
}
