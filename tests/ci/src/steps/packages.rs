//! Crates for the registry, the release archive, and the crate of a new component.

use std::fs::{self, File};
use std::path::Path;
use std::time::SystemTime;

use crate::call::Call;
use crate::context::Context;
use crate::failure::Failure;
use crate::outcome::Outcome;
use crate::proc::TICKS_PER_SECOND;

/// Every crate can be published: files, versions and metadata are complete. [`made`] does the build.
pub(crate) fn publishable(context: &Context<'_>) -> Result<Outcome, Failure> {
    let publish = context.cargo("publish --workspace --dry-run --no-verify --locked");
    let (status, printed) = context.quietly(&publish)?;
    remove(&context.shared().root.join("target/package"))?;
    if status.success() {
        return Ok(Outcome::default());
    }
    printed.lines().for_each(|line| context.say(line));
    let message = printed.lines().last().unwrap_or_default().to_string();
    Err(Failure::Ended { command: publish.to_string(), status, message })
}

/// Builds a release archive and tries it from an empty folder.
pub(crate) fn archive(context: &Context<'_>) -> Result<Outcome, Failure> {
    let root = &context.shared().root;
    let folder = context.scratch("archive");
    context.run(&context.call(root.join("tools/release/archive")).arg(&folder))?;
    let entries = fs::read_dir(&folder).map_err(Failure::file(&folder))?;
    let is_archive = |file: &std::path::PathBuf| file.to_string_lossy().ends_with(".tar.gz");
    let archive = entries.flatten().map(|entry| entry.path()).find(is_archive);
    let archive = archive.ok_or_else(|| Failure::Check(format!("no archive in {}", folder.display())))?;
    context.run(&context.call(root.join("tools/release/try")).arg(&archive))?;
    remove(&root.join("target/package"))?;
    Ok(Outcome::default())
}

/// The output of `motorium new` builds, passes its tests and runs. The program is built without the
/// launcher, the tests with it.
pub(crate) fn made(context: &Context<'_>) -> Result<Outcome, Failure> {
    let target = context.shared().root.join("target/made");
    context.run(&context.motorium("new my-controller --path").arg(&context.shared().scratch))?;
    let folder = context.scratch("my-controller");
    let cargo = |arguments: &str| -> Call {
        context.cargo(arguments).folder(&folder).env("CARGO_TARGET_DIR", &target)
    };
    remove(&target)?;
    let build = cargo("build --quiet").env("CARGO_INCREMENTAL", "1");
    let cpu_seconds = || Ok::<_, Failure>(context.run(&build)?.ticks as f64 / TICKS_PER_SECOND);
    let first = cpu_seconds()?;
    touch(&folder.join("src/main.rs"))?;
    let edit = cpu_seconds()?;
    let note =
        format!("a first component: {first:.1} CPU s for the first build, {edit:.1} CPU s for an edit");
    context.say(&note);
    context.run(&cargo("test"))?;
    let graph = folder.join("graph.toml");
    let program = format!("controller.exec={}", target.join("debug/my-controller").display());
    let run = context.motorium("run").arg(graph).args("--clock lockstep --for 2s --set").arg(program);
    context.run(&run)?;
    remove(&target)?;
    Ok(Outcome::noted(note))
}

/// Sets the time of a file, as an editor does.
fn touch(file: &Path) -> Result<(), Failure> {
    let opened = File::options().append(true).open(file);
    opened.and_then(|opened| opened.set_modified(SystemTime::now())).map_err(Failure::file(file))
}

/// Removes a folder, if it exists.
fn remove(folder: &Path) -> Result<(), Failure> {
    match folder.exists() {
        true => fs::remove_dir_all(folder).map_err(Failure::file(folder)),
        false => Ok(()),
    }
}
