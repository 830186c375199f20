//! The README's second command, `cargo test --workspace`, in parts.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::context::Context;
use crate::failure::Failure;
use crate::libtest::Reader;
use crate::outcome::Outcome;
use crate::steps::report::Report;
use crate::verdict;
use crate::witness::{Watch, Witness};

/// Test programs with tests that reserve the machine, or run graphs in real time.
const REAL_TIME: [&str; 8] =
    ["can", "command", "graphs", "hosted", "iceoryx2", "recording", "sensors", "view"];
/// The virtual machines: their time is virtual, so load does not matter.
const VIRTUAL: &str = "vcan";
/// Time limit of a virtual machine [s].
const VIRTUAL_SECONDS: &str = "3000";

/// Part of the tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    /// [`REAL_TIME`]: they use the machine one after the other, and mostly wait.
    RealTime,
    /// All other programs, except [`VIRTUAL`], and the tests inside the crates.
    Other,
}

/// Real-time tests, two at a time: one holds the machine, the other runs in lockstep meanwhile.
pub(crate) fn real_time(context: &Context<'_>) -> Result<Outcome, Failure> {
    let programs = programs(context, Part::RealTime)?;
    let witness = Witness::start(Watch::Gaps);
    let tested = run(context, &programs, &["--test-threads", "2"]);
    let record = witness.stop();
    let (reader, has_succeeded) = tested?;
    let mut outcome = verdict::judge(&reader.finish(), has_succeeded, Some(&record));
    outcome.notes.push(format!("{} tests in real time; {}", outcome.real_time, record.description()));
    Ok(outcome)
}

/// Examples in the documentation.
pub(crate) fn doc(context: &Context<'_>) -> Result<Outcome, Failure> {
    let (reader, has_succeeded) = run(context, &["--doc".to_string()], &[])?;
    Ok(verdict::judge(&reader.finish(), has_succeeded, None))
}

/// Tests that do not run in real time.
pub(crate) fn other(context: &Context<'_>) -> Result<Outcome, Failure> {
    let programs = programs(context, Part::Other)?;
    let (reader, has_succeeded) = run(context, &programs, &[])?;
    let programs = reader.finish();
    let mut outcome = verdict::judge(&programs, has_succeeded, None);
    for program in &programs {
        if program.tests.values().any(|test| test.real_time_from.is_some()) {
            let name = &program.name;
            let help = "help: add the program to REAL_TIME in tests/ci/src/steps/test_programs.rs";
            outcome.failures.push(format!("{name} reserves the machine, but runs at lower priority\n{help}"));
        }
    }
    Ok(outcome)
}

/// Graphs with CAN buses in two virtual machines. One emulates the optimised command, the other a build
/// with more assertions.
pub(crate) fn virtual_machines(context: &Context<'_>) -> Result<Outcome, Failure> {
    let (reader, has_succeeded) = run(context, &[format!("--test={VIRTUAL}")], &[])?;
    Ok(verdict::judge(&reader.finish(), has_succeeded, None))
}

/// Runs tests of the workspace, all of them even if one fails. Returns the read output, and `true` if cargo
/// succeeded.
fn run(context: &Context<'_>, selected: &[String], options: &[&str]) -> Result<(Reader, bool), Failure> {
    let mut call = context.linted_cargo("test --workspace --no-fail-fast")?;
    call = selected.iter().fold(call, crate::call::Call::arg);
    call = options.iter().fold(call.args("-- --show-output"), crate::call::Call::arg);
    call =
        call.env("MOTORIUM_CAN_PROGRAM", context.command_path()).env("MOTORIUM_VM_SECONDS", VIRTUAL_SECONDS);
    let mut reader = Reader::new();
    let ended = context.lines(&call, &mut |line| {
        if reader.line(&line.text, line.arrived) {
            context.say(&line.text);
        }
    })?;
    Ok((reader, ended.status.success()))
}

/// Options of `cargo test` that select a part of the test programs of the workspace.
fn programs(context: &Context<'_>, part: Part) -> Result<Vec<String>, Failure> {
    let call = context.cargo("metadata --no-deps --offline --format-version 1");
    let metadata = Report::run(context, &call)?;
    select(metadata.value("/packages")?, part)
}

fn select(packages: &Value, part: Part) -> Result<Vec<String>, Failure> {
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let targets: Vec<Value> = list(packages).iter().flat_map(|package| list(&package["targets"])).collect();
    let names = |kind: &str| -> BTreeSet<String> {
        let tested = targets.iter().filter(|target| target["test"] == true);
        let of_kind = tested.filter(|target| list(&target["kind"]).iter().any(|it| it == kind));
        of_kind.filter_map(|target| target["name"].as_str()).map(str::to_string).collect()
    };
    let programs = names("test");
    if let Some(missing) = REAL_TIME.iter().chain([&VIRTUAL]).find(|name| !programs.contains(**name)) {
        return Err(Failure::Check(format!("there is no test program `{missing}`")));
    }
    let is_real_time = |name: &String| REAL_TIME.contains(&name.as_str());
    let option = |name: String| format!("--test={name}");
    Ok(match part {
        Part::RealTime => programs.into_iter().filter(is_real_time).map(option).collect(),
        Part::Other => {
            let within = names("bin").into_iter().map(|name| format!("--bin={name}"));
            let others = programs.into_iter().filter(|name| !is_real_time(name) && name != VIRTUAL);
            ["--lib".to_string()].into_iter().chain(within).chain(others.map(option)).collect()
        }
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn parts_cover_all_programs_once() {
        let target =
            |name: &str, kind: &str, test: bool| json!({ "name": name, "kind": [kind], "test": test });
        let real_time = REAL_TIME.map(|name| target(name, "test", true));
        let mut packages = json!([
            { "targets": real_time },
            { "targets": [
                target("lib", "lib", true),
                target("tool", "bin", true),
                target("untested", "bin", false),
                target("vcan", "test", true),
                target("layers", "test", true),
                target("can", "test", true),
                target("speed", "bench", false),
            ] },
        ]);
        let other = select(&packages, Part::Other).expect("programs");
        assert_eq!(other, ["--lib", "--bin=tool", "--test=layers"]);
        let real_time = select(&packages, Part::RealTime).expect("programs");
        assert_eq!(real_time, REAL_TIME.map(|name| format!("--test={name}")));
        packages[0]["targets"][1]["name"] = json!("renamed");
        assert!(matches!(select(&packages, Part::Other), Err(Failure::Check(_))));
    }
}
