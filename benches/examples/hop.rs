//! The library without the command: floors, hops, chains and the command gate in turns, `cargo run --release
//! --example hop -- hop.polling.across.512 floor.cache-line chain.4`.

use std::process::ExitCode;

use motorium::declare::{ConfigError, RobotReference};
use motorium::program::{Program, run_worker};
use motorium::worker::{Registry, RobotSource};
use motorium_benches::Role;
use motorium_benches::host::Loader;
use motorium_benches::latency::{Bench, Case, catalogue, targets};
use motorium_benches::timer::Places;

fn no_robots(_: &RobotReference) -> Result<Vec<String>, ConfigError> {
    Err(ConfigError::new("this program knows no robots"))
}

fn registry() -> Registry {
    Registry::new(RobotSource { check: no_robots }, motorium_benches::kinds())
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    // The second process of a measurement is this program again.
    if let Some(role) = Role::from_arguments(&arguments) {
        return role.run();
    }
    // So are the processes of a graph.
    match Program::from_arguments(&arguments) {
        Some(Program::Worker { folder, component }) => {
            return run_worker(&folder, &component, |plan| match &plan.program {
                motorium::plan::Program::Builtin { kind } => registry().find(kind).copied(),
                _ => None,
            });
        }
        Some(Program::Guard(folder)) => return motorium::launcher::guard::main(&folder),
        Some(Program::Cleaner(folder)) => return motorium::program::clean(&folder),
        Some(Program::Describe | Program::Kinds) | None => {}
    }
    let registry = registry();
    let bench = Bench {
        program: std::env::current_exe().expect("a running program has a file"),
        registry: &registry,
        places: Places::detect(),
        fifo: 80,
        samples: 20_000,
        paced: 5_000,
        seconds: 1,
        fast_seconds: 1,
        panda_seconds: 1,
        loader: Loader::detect(),
    };
    let wanted = |case: &Case| arguments[1..].contains(&case.name);
    let cases: Vec<Case> = catalogue().into_iter().filter(wanted).collect();
    let mut measured = Vec::new();
    for (case, seen) in cases.iter().zip(bench.measure_in_turns(&cases)) {
        match seen {
            Ok(seen) => {
                println!(
                    "{:26} p50 {:6} p99 {:6} ns, turns {:?}",
                    seen.name, seen.ns.p50, seen.ns.p99, seen.slices_p50
                );
                measured.push(seen);
            }
            Err(error) => println!("{:26} {error}", case.name),
        }
    }
    for target in targets(&measured).iter().filter(|target| target.measured.is_some()) {
        println!("{}: {:.3}, at most {}", target.what, target.measured.unwrap_or(f64::NAN), target.at_most);
    }
    ExitCode::SUCCESS
}
