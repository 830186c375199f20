//! Formatting, licences and compilation.

use crate::context::{Context, program};
use crate::failure::Failure;
use crate::outcome::Outcome;

pub(crate) fn fmt(context: &Context<'_>) -> Result<Outcome, Failure> {
    context.run(&context.cargo("fmt --all --check"))?;
    Ok(Outcome::default())
}

/// `cargo test` checks licences and duplicates, too (`tools/tests/command/crates.rs`). This step checks all
/// of `deny.toml`. Compiling the tool would dominate the run.
pub(crate) fn deny(context: &Context<'_>) -> Result<Outcome, Failure> {
    if program("cargo-deny").is_none() {
        let note = "not run: cargo deny is not installed (cargo install cargo-deny --locked)";
        return Ok(Outcome::noted(note.to_string()));
    }
    context.run(&context.cargo("deny check licenses bans sources"))?;
    Ok(Outcome::default())
}

/// The compilation of the README's first command.
pub(crate) fn release(context: &Context<'_>) -> Result<Outcome, Failure> {
    context.run(&context.cargo("build --release"))?;
    Ok(Outcome::default())
}

/// Kills, stops and hangs of every process of running graphs, on the busy machine. The book has the
/// consequence of each.
pub(crate) fn faults(context: &Context<'_>) -> Result<Outcome, Failure> {
    let bench = context.motorium("bench kill --count 500 --matrix");
    let matrix = context.output(&bench)?;
    let page = context.source("docs/src/faults.md")?;
    let mut rows = matrix.lines().peekable();
    if rows.peek().is_none() {
        return Err(Failure::Output { command: bench.to_string(), expected: "rows".to_string() });
    }
    let missing = rows.filter(|row| !page.lines().any(|line| line == *row));
    let failures = missing.map(|row| format!("docs/src/faults.md has no row: {row}")).collect();
    Ok(Outcome { failures, ..Outcome::default() })
}

/// The compilation of the README's second command, with the lints.
pub(crate) fn tests(context: &Context<'_>) -> Result<Outcome, Failure> {
    context.run(&context.linted_cargo("test --workspace --no-run")?)?;
    Ok(Outcome::default())
}

/// Benches for their lints, separate from [`tests`]: together with benches, examples are compiled as tests,
/// and the step `learner` runs an example.
pub(crate) fn benches(context: &Context<'_>) -> Result<Outcome, Failure> {
    context.run(&context.linted_cargo("test --workspace --benches --no-run")?)?;
    Ok(Outcome::default())
}
