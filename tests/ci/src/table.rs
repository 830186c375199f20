//! The table of all steps.
//!
//! A step that needs the whole machine starts when all steps before it have ended, and the steps after it
//! start when it has ended. In between, one step of each lane runs at a time.

use crate::step::{Machine, Step};
use crate::steps::tools::{CHROMIUM, ICEORYX2, MCAP, MUJOCO, PYARROW, SCHEMAS, STRACE};
use crate::steps::{build, graphs, measurements, packages, test_programs, tools};

const TOOLS: &str = "optional_tools";
const RELEASE: &str = "release";
const TESTS: &str = "compiled_tests";

/// All steps in their order.
pub(crate) const STEPS: [Step; 26] = [
    // -- compilation, on the busy machine
    Step {
        name: "fmt",
        about: "formatting of all crates",
        needs: &[],
        tools: &[],
        machine: Machine::Shared,
        lane: "sources",
        action: build::fmt,
    },
    Step {
        name: "deny",
        about: "licences, sources and banned crates by deny.toml",
        needs: &[],
        tools: &["cargo-deny"],
        machine: Machine::Shared,
        lane: "sources",
        action: build::deny,
    },
    Step {
        name: TOOLS,
        about: "installs strace, chromium and Python packages for some tests, if permitted",
        needs: &[],
        tools: &[],
        machine: Machine::Shared,
        lane: "tools",
        action: tools::install,
    },
    Step {
        name: RELEASE,
        about: "compiles the README's first command",
        needs: &[],
        tools: &[],
        machine: Machine::Shared,
        lane: "release",
        action: build::release,
    },
    Step {
        name: "faults",
        about: "kills, stops and hangs of processes, compared with docs/src/faults.md",
        needs: &[RELEASE],
        tools: &[],
        machine: Machine::Shared,
        lane: "release",
        action: build::faults,
    },
    Step {
        name: TESTS,
        about: "compiles and lints all crates, tests and examples",
        needs: &[],
        tools: &[],
        machine: Machine::Aside,
        lane: "tests",
        action: build::tests,
    },
    Step {
        name: "compiled_benches",
        about: "compiles and lints the benches",
        needs: &[],
        tools: &[],
        machine: Machine::Aside,
        lane: "tests",
        action: build::benches,
    },
    Step {
        name: "publishable",
        about: "every crate has the files, versions and metadata that the registry requires",
        needs: &[],
        tools: &[],
        machine: Machine::Shared,
        lane: "packages",
        action: packages::publishable,
    },
    Step {
        name: "first_command",
        about: "the README's first command in real time: cargo run --release",
        needs: &[RELEASE],
        tools: &[],
        machine: Machine::Alone,
        lane: "real time",
        action: measurements::first_command,
    },
    // -- tests, and everything that needs no real time
    Step {
        name: "real_time_tests",
        about: "test programs with tests in real time, two tests at a time",
        needs: &[TESTS, TOOLS],
        tools: &[STRACE, CHROMIUM, ICEORYX2, MCAP, SCHEMAS, PYARROW],
        machine: Machine::Shared,
        lane: "real time",
        action: test_programs::real_time,
    },
    Step {
        name: "virtual_machines",
        about: "graphs with CAN buses in two virtual machines",
        needs: &[TESTS, RELEASE],
        tools: &["apt-get"],
        machine: Machine::Aside,
        lane: "virtual machines",
        action: test_programs::virtual_machines,
    },
    Step {
        name: "doc_tests",
        about: "examples in the documentation",
        needs: &[TESTS],
        tools: &[],
        machine: Machine::Aside,
        lane: "tests",
        action: test_programs::doc,
    },
    Step {
        name: "other_tests",
        about: "all other test programs, and the tests inside the crates",
        needs: &[TESTS, TOOLS],
        tools: &[MUJOCO],
        machine: Machine::Aside,
        lane: "tests",
        action: test_programs::other,
    },
    Step {
        name: "every_graph",
        about: "checks, runs and replays every example graph in lockstep",
        needs: &[RELEASE],
        tools: &[],
        machine: Machine::Aside,
        lane: "graphs",
        action: graphs::every,
    },
    Step {
        name: "pick_and_place",
        about: "contacts are identical in two runs",
        needs: &[RELEASE],
        tools: &[],
        machine: Machine::Aside,
        lane: "graphs",
        action: graphs::pick_and_place,
    },
    Step {
        name: "episodes",
        about: "episodes are equal with one seed and different with separate seeds",
        needs: &[RELEASE],
        tools: &[],
        machine: Machine::Aside,
        lane: "graphs",
        action: graphs::episodes,
    },
    Step {
        name: "learner",
        about: "an example tries gaits",
        needs: &[TESTS],
        tools: &[],
        machine: Machine::Aside,
        lane: "graphs",
        action: graphs::learner,
    },
    Step {
        name: "on_mujoco",
        about: "the example graphs on physics.mujoco",
        needs: &[RELEASE, TOOLS],
        tools: &[MUJOCO],
        machine: Machine::Aside,
        lane: "graphs",
        action: graphs::on_mujoco,
    },
    Step {
        name: "on_rapier",
        about: "the example graphs on physics.rapier",
        needs: &[RELEASE],
        tools: &[],
        machine: Machine::Aside,
        lane: "graphs",
        action: graphs::on_rapier,
    },
    Step {
        name: "archive",
        about: "builds a release archive and tries it",
        needs: &[RELEASE, TESTS],
        tools: &[],
        machine: Machine::Aside,
        lane: "graphs",
        action: packages::archive,
    },
    Step {
        name: "made",
        about: "the crate of `motorium new` builds, passes its tests and runs",
        needs: &[RELEASE],
        tools: &[],
        machine: Machine::Aside,
        lane: "graphs",
        action: packages::made,
    },
    // -- measurements
    Step {
        name: "two_runs",
        about: "two lockstep runs are identical, and faster than real time",
        needs: &[RELEASE],
        tools: &[],
        machine: Machine::Alone,
        lane: "real time",
        action: measurements::two_runs,
    },
    Step {
        name: "offered_buses",
        about: "buses shared with other programs in real time",
        needs: &[RELEASE],
        tools: &[],
        machine: Machine::Alone,
        lane: "real time",
        action: measurements::offered_buses,
    },
    Step {
        name: "recorded",
        about: "a recording in real time without loss",
        needs: &[RELEASE],
        tools: &[],
        machine: Machine::Alone,
        lane: "real time",
        action: measurements::recorded,
    },
    Step {
        name: "latency",
        about: "hops and releases as ratios to the floors of this machine",
        needs: &[RELEASE],
        tools: &[],
        machine: Machine::Alone,
        lane: "real time",
        action: measurements::latency,
    },
    Step {
        name: "leftovers",
        about: "no shared memory is left behind",
        needs: &[],
        tools: &[],
        machine: Machine::Alone,
        lane: "real time",
        action: measurements::leftovers,
    },
];

/// Selects steps of a table by their names, together with those that they need; all if there are no names.
///
/// # Errors
/// The first unknown name.
pub(crate) fn select(steps: &[Step], names: &[String]) -> Result<Vec<Step>, String> {
    if let Some(unknown) = names.iter().find(|name| !steps.iter().any(|step| step.name == **name)) {
        return Err(unknown.clone());
    }
    let mut selected: Vec<Step> = Vec::new();
    // needed steps come first in the table
    for step in steps.iter().rev() {
        let is_named = names.is_empty() || names.iter().any(|name| name == step.name);
        if is_named || selected.iter().any(|later| later.needs.contains(&step.name)) {
            selected.push(*step);
        }
    }
    selected.reverse();
    Ok(selected)
}

/// Describes the steps, one line each.
pub(crate) fn list(steps: &[Step]) -> String {
    let line = |step: &Step| {
        let machine = match step.machine {
            Machine::Alone => "alone",
            Machine::Shared => "",
            Machine::Aside => "aside",
        };
        let mut line = format!("{:18} {machine:6} {}", step.name, step.about);
        for (label, names) in [("needs", step.needs), ("optional", step.tools)] {
            if !names.is_empty() {
                line += &format!("; {label}: {}", names.join(", "));
            }
        }
        line + "\n"
    };
    steps.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn needed_steps_come_earlier_in_the_table() {
        let mut before = BTreeSet::new();
        for step in STEPS {
            for needed in step.needs {
                assert!(
                    before.contains(needed),
                    "{} needs {needed}, which does not come before it",
                    step.name
                );
            }
            assert!(before.insert(step.name), "{} is listed twice", step.name);
        }
    }

    #[test]
    fn rows_are_described() {
        let list = list(&STEPS);
        assert_eq!(list.lines().count(), STEPS.len());
        for (line, step) in list.lines().zip(STEPS) {
            assert!(line.starts_with(step.name) && !step.about.is_empty() && !step.lane.is_empty(), "{line}");
        }
    }

    #[test]
    fn selection_includes_needed_steps() {
        let names = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(ToString::to_string).collect();
            select(&STEPS, &names).map(|steps| steps.iter().map(|step| step.name).collect::<Vec<_>>())
        };
        assert_eq!(names(&["fmt"]), Ok(vec!["fmt"]));
        assert_eq!(names(&["archive", "fmt"]), Ok(vec!["fmt", "release", "compiled_tests", "archive"]));
        assert_eq!(names(&["fmt", "tests"]), Err("tests".to_string()));
        assert_eq!(names(&[]).map(|all| all.len()), Ok(STEPS.len()));
    }
}
