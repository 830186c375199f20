//! The checks of the project, as `.ci/run` starts them: the commands of the README, and everything else
//! that must hold before a change is merged.
//!
//! [`table`] lists the steps, [`schedule`] runs them in parallel, and [`summary`] prints the closing lines.
//! A real-time check that fails while the host kept this machine from running is reported as inconclusive,
//! with the [`evidence`]. Nothing is tried again.

mod call;
mod clock;
mod context;
mod evidence;
mod failure;
mod libtest;
mod measure;
mod outcome;
mod proc;
mod schedule;
mod step;
mod steps;
mod summary;
mod table;
mod verdict;
mod witness;

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use context::{Context, Shared};

const HELP: &str = "Runs the checks of the project.

Usage: bash .ci/run [--only STEP]...
       bash .ci/run --list

Options:
  --only STEP  Runs this step and the steps it needs
  --list       Lists the steps: name, `alone` or `aside` (at lower priority), and what each needs
  --help       Prints this help

Exit code: 0 if all steps passed, 1 if one failed, 2 on a usage error. A real-time check that failed while the
host took at least 20 ms in one piece, or 5 % of the processor time, is inconclusive; at most 1 % may be.
";

/// What the arguments request.
#[derive(Debug, PartialEq, Eq)]
enum Request {
    Help,
    List,
    Run { only: Vec<String> },
}

fn parse(arguments: impl IntoIterator<Item = String>) -> Result<Request, String> {
    let mut arguments = arguments.into_iter();
    let mut only = Vec::new();
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--help" | "-h" => return Ok(Request::Help),
            "--list" => return Ok(Request::List),
            "--only" => only.push(arguments.next().ok_or("`--only` has no value, expected a step")?),
            _ => return Err(format!("unknown argument `{argument}`, expected `--only STEP` or `--list`")),
        }
    }
    Ok(Request::Run { only })
}

fn print(line: &str) {
    eprintln!("{line}");
}

fn main() -> ExitCode {
    let request = parse(std::env::args().skip(1)).and_then(|request| match request {
        Request::Run { only } => {
            let unknown =
                |step| format!("unknown step `{step}`\nhelp: `bash .ci/run --list` lists the steps");
            Ok(Some(table::select(&table::STEPS, &only).map_err(unknown)?))
        }
        Request::Help => {
            print!("{HELP}");
            Ok(None)
        }
        Request::List => {
            print!("{}", table::list(&table::STEPS));
            Ok(None)
        }
    });
    match request {
        Ok(Some(steps)) => run(&steps),
        Ok(None) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn run(steps: &[step::Step]) -> ExitCode {
    let began = Instant::now();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let shared = root.canonicalize().map_err(failure::Failure::file(&root));
    let shared = match shared.and_then(|root| Shared::new(root, print)) {
        Ok(shared) => shared,
        Err(error) => {
            eprintln!("error: {error}");
            return ExitCode::FAILURE;
        }
    };
    let finished = schedule::run(steps, &shared);
    let summary = summary::summarise(&finished, began.elapsed().as_secs_f64());
    print("");
    let context = Context::new(&shared, String::new(), false);
    // the size is information only
    let _ = context.run(&context.call("du").args("-sh target"));
    summary.lines.iter().for_each(|line| print(line));
    ExitCode::from(u8::from(!summary.has_passed))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_select_steps() {
        let parse = |arguments: &str| parse(arguments.split_whitespace().map(str::to_string));
        assert_eq!(parse(""), Ok(Request::Run { only: vec![] }));
        let only = vec!["fmt".to_string(), "deny".to_string()];
        assert_eq!(parse("--only fmt --only deny"), Ok(Request::Run { only }));
        assert_eq!((parse("--list"), parse("--only a --help")), (Ok(Request::List), Ok(Request::Help)));
        assert!(parse("--only").is_err() && parse("fmt").is_err());
    }

    #[test]
    fn help_states_the_bounds_of_inconclusive_checks() {
        let gap = format!("{:.0} ms in one piece", 1e3 * evidence::MIN_GAP_S);
        let share = format!("{:.0} % of the processor time", 100.0 * evidence::MIN_STEAL_SHARE);
        assert!(HELP.contains(&gap) && HELP.contains(&share), "{gap}, {share}");
    }
}
