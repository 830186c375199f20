//! Optional tools, without which some tests are skipped.

use std::os::unix::fs::MetadataExt;

use crate::context::{Context, program};
use crate::failure::Failure;
use crate::outcome::Outcome;
use crate::steps::graphs::has_mujoco;

/// Counts system calls.
pub(crate) const STRACE: &str = "strace";
/// Opens the page of the viewer.
pub(crate) const CHROMIUM: &str = "chromium";
/// Used by the Python programs of the book.
pub(crate) const ICEORYX2: &str = "iceoryx2";
/// Reads recordings.
pub(crate) const MCAP: &str = "mcap-protobuf-support";
/// Reads the messages in recordings.
pub(crate) const SCHEMAS: &str = "foxglove-schemas-protobuf";
/// Reads tables and data sets.
pub(crate) const PYARROW: &str = "pyarrow";
/// Contains the engine of `physics.mujoco`.
pub(crate) const MUJOCO: &str = "mujoco";

/// Names of Chromium, as in `tools/view/src/browser.rs`.
const BROWSERS: [&str; 5] =
    ["chromium", "chromium-browser", "google-chrome-stable", "google-chrome", "chrome"];

/// Installs the tools if permitted, and reports the missing ones. Never fails.
pub(crate) fn install(context: &Context<'_>) -> Result<Outcome, Failure> {
    let mut missing = Vec::new();
    // the steps with tests count the skipped ones; this names the cause
    let mut note = |tool: &str, reason: String| {
        missing.push(format!("{tool} is missing, the tests that need it are not run: {reason}"));
    };
    packages(context, &mut note)?;
    wheels(context, &mut note)?;
    Ok(Outcome { notes: missing, ..Outcome::default() })
}

/// Programs from the package manager of the system.
fn packages(context: &Context<'_>, missing: &mut dyn FnMut(&str, String)) -> Result<(), Failure> {
    let is_installed = |tool: &str| match tool {
        CHROMIUM => BROWSERS.iter().any(|name| program(name).is_some()),
        _ => program(tool).is_some(),
    };
    let absent: Vec<&str> = [STRACE, CHROMIUM].into_iter().filter(|tool| !is_installed(tool)).collect();
    if absent.is_empty() {
        return Ok(());
    }
    let is_root = std::fs::metadata("/proc/self").is_ok_and(|process| process.uid() == 0);
    let permitted = is_root && program("apt-get").is_some();
    if permitted {
        context.quietly(&context.call("apt-get").args("update"))?;
    }
    for tool in absent {
        if !permitted {
            missing(tool, "only root can install it by apt-get".to_string());
            continue;
        }
        let install = context.call("apt-get").args("install -y --no-install-recommends").arg(tool);
        let (_, printed) = context.quietly(&install)?;
        if !is_installed(tool) {
            missing(tool, format!("apt-get: {}", last_line(&printed)));
        }
    }
    Ok(())
}

/// Python packages, in an environment below `target`.
fn wheels(context: &Context<'_>, missing: &mut dyn FnMut(&str, String)) -> Result<(), Failure> {
    let python = context.shared().root.join("target/python/bin/python3");
    let venv = context.call("python3").args("-m venv target/python");
    let (is_made, printed) = match context.quietly(&venv) {
        Ok((status, printed)) => (status.success(), printed),
        Err(failure) => (false, failure.to_string()),
    };
    let packages = [
        (ICEORYX2, "iceoryx2==0.10.*"),
        (MCAP, MCAP),
        (SCHEMAS, SCHEMAS),
        (PYARROW, PYARROW),
        (MUJOCO, "mujoco==3.17.0"),
    ];
    // without the first there is probably no network
    let mut reason = (!is_made).then(|| format!("python3 -m venv: {}", last_line(&printed)));
    for (name, wheel) in packages {
        if let Some(reason) = &reason {
            missing(name, reason.clone());
            continue;
        }
        let pip =
            context.call(&python).args("-m pip install --quiet --disable-pip-version-check --no-cache-dir");
        let pip = if name == MUJOCO { pip.arg("--no-deps") } else { pip };
        let (status, printed) = context.quietly(&pip.arg(wheel))?;
        if !status.success() {
            let why = format!("pip: {}", last_line(&printed));
            missing(name, why.clone());
            if name == ICEORYX2 {
                reason = Some(why);
            }
        } else if name == MUJOCO && !has_mujoco(&context.shared().root) {
            missing(name, "its wheel has no library for this machine".to_string());
        }
    }
    let imports = context.call(&python).arg("-c").arg("import iceoryx2");
    if python.exists() && context.quietly(&imports)?.0.success() {
        context.shared().set_python(Some(python));
    }
    Ok(())
}

/// The last line with content, which usually names the error.
fn last_line(printed: &str) -> &str {
    printed.lines().map(str::trim).rfind(|line| !line.is_empty()).unwrap_or("no output")
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn names_of_chromium_match_the_viewer() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tools/view/src/browser.rs");
        let source = std::fs::read_to_string(path).expect("the viewer's browser");
        assert!(source.contains(&format!("{BROWSERS:?}")), "{BROWSERS:?}");
    }

    #[test]
    fn last_line_with_content_is_the_reason() {
        assert_eq!(last_line("a\nERROR: no network\n\n"), "ERROR: no network");
        assert_eq!(last_line("\n"), "no output");
    }
}
