//! `motorium qp`: quadratic programs in files.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use motorium_qp::recorded::{self, Record, Replay, Stream};
use motorium_qp::{
    ActiveSetSettings, ActiveSetSolver, ClarabelSettings, ClarabelSolver, QpSolver, Structure,
};
use motorium_recordings::read_bounded;

use crate::input::decoded;
use crate::out::outln;
use crate::report::decimal;

/// Maximum file size, bytes.
const LONGEST: u64 = 256 << 20;

/// Solve quadratic programs of controllers, recorded in files.
///
/// Example: motorium qp solve problems.json
#[derive(Debug, clap::Args)]
pub(crate) struct Qp {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Solve(Solve),
}

impl Qp {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::Solve(command) => command.run(),
        }
    }
}

/// Solve recorded problems in order, as a controller does, and print accuracy, iterations and times.
///
/// The exit code is 1 if a problem was not solved.
///
/// Example: motorium qp solve problems.json --solver clarabel --json
#[derive(Debug, clap::Args)]
struct Solve {
    /// A problem, or a list of consecutive problems, as JSON; a change of size causes a cold start
    file: PathBuf,
    /// The solver
    #[arg(long, value_enum, default_value_t = SolverName::ActiveSet)]
    solver: SolverName,
    /// Number of rounds over all problems; if there are several, the first is not timed
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    rounds: u32,
    /// Also print the status and the solution of each problem
    #[arg(long)]
    each: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum SolverName {
    /// The built-in dense dual active-set method, warm-started with the active set of the previous problem
    ActiveSet,
    /// The same, cold-started for each problem
    ActiveSetCold,
    /// Clarabel, an interior-point method
    Clarabel,
}

impl SolverName {
    fn build(self, structure: &Structure) -> Box<dyn QpSolver> {
        let structure = structure.clone();
        let active_set = |warm_start| ActiveSetSettings { warm_start, ..ActiveSetSettings::default() };
        match self {
            Self::ActiveSet => Box::new(ActiveSetSolver::new(structure, active_set(true))),
            Self::ActiveSetCold => Box::new(ActiveSetSolver::new(structure, active_set(false))),
            Self::Clarabel => Box::new(ClarabelSolver::new(structure, ClarabelSettings::default())),
        }
    }
}

impl Solve {
    fn run(self) -> anyhow::Result<ExitCode> {
        let streams = read(&self.file).with_context(|| self.file.display().to_string())?;
        let build = |structure: &Structure| self.solver.build(structure);
        let mut replay = recorded::replay_streams(&streams, build, self.rounds as usize);
        let code = if replay.solved == replay.problems { ExitCode::SUCCESS } else { ExitCode::FAILURE };
        if self.json {
            replay.each = replay.each.filter(|_| self.each);
            outln!("{}", serde_json::to_string_pretty(&replay)?);
            return Ok(code);
        }
        print(&replay, self.each);
        Ok(code)
    }
}

fn read(path: &Path) -> anyhow::Result<Vec<Stream>> {
    let bytes = read_bounded(path, LONGEST)?;
    let text = decoded(bytes).context("the file is not UTF-8")?;
    Ok(recorded::read_streams(&text)?)
}

fn print(replay: &Replay, each: bool) {
    outln!("{} of {} problems solved", replay.solved, replay.problems);
    outln!("largest violation of a constraint   {}", decimal(replay.worst_violation));
    outln!("largest distance from the reference {}", decimal(replay.worst_distance));
    let row = |name: &str, Record { p50, p99, max }: Record, digits: usize| {
        outln!("{name:12} p50 {p50:.digits$}, p99 {p99:.digits$}, max {max:.digits$}");
    };
    row("iterations", replay.iterations, 0);
    row("time, us", replay.time_us, 1);
    for (index, problem) in replay.each.iter().flatten().enumerate() {
        match &problem.error {
            Some(error) => outln!("problem {index}: {error}"),
            None if each => outln!("problem {index}: {:?}", problem.x),
            None => {}
        }
    }
}
