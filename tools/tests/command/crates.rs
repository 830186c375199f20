//! The crates of the command: their number, licences and sources.
//!
//! `cargo deny check licenses bans sources` checks more, where it is installed; this test needs only cargo.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde::Deserialize;

/// Maximum number of crates that `cargo build --release` compiles for the command, including procedural
/// macros and the project's own. A change that raises it adds its reason here:
///
/// * `shlex` and `is_executable`: shells complete runs, topics and parameters;
/// * the channels and queues of crossbeam (three crates in place of one), shared by the launcher, the
///   printers and programs that drive several sessions;
/// * a crate of the project: the drives on CAN buses;
/// * `mcap` and `foxglove` without compression and server (27 crates): recordings that every viewer and
///   reader of robotics opens;
/// * `socketcan` (seven crates): drives on the kernel's buses;
/// * `can-dbc` (14 crates: a grammar for `pest`, and the encodings of old files): databases of CAN messages;
/// * `miniz_oxide` (two crates; the crate `png` would add four more): pictures as terrain;
/// * `serde_path_to_error`: names the key of an unreadable configuration. All configurations are read in this
///   way; separate ways were nearly a third of the code of `motorium-sensors`;
/// * a crate of the project: the algebra shared by models and the motion library;
/// * `ruzstd` and `lz4_flex`: compressed chunks of recordings by other programs;
/// * `serde-saphyr` (four crates: a parser, its ring buffer and its decoder of encodings): the YAML files
///   that Isaac Lab and LEAPP write next to a trained policy;
/// * five crates of the project: the QP solvers, a leaf below the controllers; the controllers of moving
///   bases; the setpoint of a joint, a leaf below everything that commands one; worlds, which robots do not
///   need; pictures, which other programs can draw as well.
///
/// `toml` and `signal-hook` are in the tree once, shared with iceoryx2 and the screen.
///
/// Crates saved by removing each subtree alone: iceoryx2 32, `mcap` and `foxglove` 26, `ratatui` 25,
/// serde, its formats and schemas 18, the crates of the project 23, `parry3d` and `rapier3d` 15, clap 14,
/// `can-dbc` 14, `clarabel` 14, `urdf-rs` 9, `nalgebra` 7, `socketcan` 7, `indicatif` 4, `serde-saphyr` 4,
/// `prometheus-client` 3. Without the screen of `top`, databases of CAN messages, cones, URDF, the kernel's
/// buses and metrics, 74 crates fewer, there are still 212.
const CEILING: usize = 291;

/// Crates that `cargo build --release -p motorium-view` may compile, counted in the same way. The viewer is a
/// separate program because of them: Foxglove's server runs on tokio. Actuator networks of robots add `pulp`
/// and three more, `motorium-pictures` encodes its PNG files.
const VIEWER: usize = 221;

/// Standard output of cargo with these arguments, run in the workspace without the network.
fn cargo(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO"))
        .args(arguments)
        .args(["--locked", "--offline"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("cargo starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo {}: {errors}", arguments.join(" "));
    String::from_utf8(output.stdout).expect("text")
}

/// Names and versions of the crates that one of the project depends on, including itself.
fn behind(package: &str) -> BTreeSet<String> {
    let tree = cargo(&["tree", "-p", package, "-e", "normal", "--prefix", "none", "--format", "{p}"]);
    // Procedural macros and repeated crates have a remark after the version.
    let crates: BTreeSet<String> = tree
        .lines()
        .map(|line| line.splitn(3, ' ').take(2).collect::<Vec<_>>().join(" "))
        .filter(|line| !line.is_empty())
        .collect();
    assert!(crates.len() > 100, "the tree is not read: {tree}");
    crates
}

#[test]
fn command_stays_below_its_crate_ceiling() {
    let crates = behind("motorium-tools");
    assert!(
        crates.len() <= CEILING,
        "{} crates are compiled for the command, expected at most {CEILING}",
        crates.len()
    );
}

#[test]
fn viewer_stays_below_its_crate_ceiling() {
    let (viewer, command) = (behind("motorium-view"), behind("motorium-tools"));
    assert!(
        viewer.len() <= VIEWER,
        "{} crates are compiled for the viewer, expected at most {VIEWER}",
        viewer.len()
    );
    for name in ["tokio", "tungstenite", "motorium-view"] {
        let has = |crates: &BTreeSet<String>| crates.iter().any(|it| it.starts_with(&format!("{name} ")));
        assert!(has(&viewer) && !has(&command), "{name}");
    }
}

/// The part of `deny.toml` about licences that is read here.
#[derive(Deserialize)]
struct Deny {
    licenses: Licences,
}

#[derive(Deserialize)]
struct Licences {
    allow: BTreeSet<String>,
}

/// Returns `true` if the allowed licences satisfy an SPDX expression. `AND` binds closer than `OR`, which old
/// manifests write as `/`.
fn is_met(expression: &str, allowed: &BTreeSet<String>) -> bool {
    /// Splits at a word outside of all parentheses.
    fn parts<'a>(expression: &'a str, word: &str) -> Vec<&'a str> {
        let (mut parts, mut start, mut depth) = (Vec::new(), 0, 0);
        for (at, character) in expression.char_indices() {
            match character {
                '(' => depth += 1,
                ')' => depth -= 1,
                _ if depth == 0 && at >= start && expression[at..].starts_with(word) => {
                    parts.push(&expression[start..at]);
                    start = at + word.len();
                }
                _ => {}
            }
        }
        parts.push(&expression[start..]);
        parts
    }
    let expression = expression.trim();
    let choices: Vec<&str> =
        parts(expression, " OR ").into_iter().flat_map(|choice| parts(choice, "/")).collect();
    if choices.len() > 1 {
        return choices.iter().any(|choice| is_met(choice, allowed));
    }
    let all = parts(expression, " AND ");
    if all.len() > 1 {
        return all.iter().all(|part| is_met(part, allowed));
    }
    match expression.strip_prefix('(').and_then(|rest| rest.strip_suffix(')')) {
        Some(inner) => is_met(inner, allowed),
        None => allowed.contains(expression),
    }
}

#[test]
fn crate_licences_are_allowed_and_needed() {
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../deny.toml")).expect("a file");
    let allowed = toml::from_str::<Deny>(&text).expect("TOML").licenses.allow;
    // Like cargo deny by default: tests may use crates that are not shipped.
    let listed =
        cargo(&["tree", "--workspace", "-e", "normal,build", "--prefix", "none", "--format", "{l}|{p}"]);
    let mut seen = String::new();
    for (licence, package) in listed.lines().filter_map(|line| line.split_once('|')) {
        assert!(is_met(licence, &allowed), "{package}: `{licence}`");
        seen += licence;
    }
    for licence in &allowed {
        assert!(seen.contains(licence.as_str()), "{licence} is allowed, and no crate has it");
    }
}

#[test]
fn licence_expressions_are_read_as_in_spdx() {
    let allowed = BTreeSet::from(["MIT", "Apache-2.0 WITH LLVM-exception"].map(str::to_string));
    for met in
        ["MIT", "MIT OR GPL-3.0", "GPL-3.0/MIT", "(GPL-3.0 OR MIT) AND MIT", "Apache-2.0 WITH LLVM-exception"]
    {
        assert!(is_met(met, &allowed), "{met}");
    }
    for unmet in ["GPL-3.0", "MIT AND GPL-3.0", "(GPL-3.0 OR Apache-2.0) AND MIT", "none", ""] {
        assert!(!is_met(unmet, &allowed), "{unmet}");
    }
}

/// The part of `Cargo.lock` that is read here.
#[derive(Deserialize)]
struct Lock {
    package: Vec<Locked>,
}

#[derive(Deserialize)]
struct Locked {
    name: String,
    version: String,
    source: Option<String>,
}

#[test]
fn crates_come_from_the_registry_with_one_iceoryx2() {
    let text =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../Cargo.lock")).expect("a file");
    let mut versions: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for package in toml::from_str::<Lock>(&text).expect("TOML").package {
        match package.source {
            Some(source) => {
                let registry = "registry+https://github.com/rust-lang/crates.io-index";
                assert_eq!(source, registry, "{}", package.name);
            }
            None => assert!(package.name.starts_with("motorium"), "{} has no source", package.name),
        }
        versions.entry(package.name).or_default().insert(package.version);
    }
    // The layout of shared memory changes with every minor release of it.
    let iceoryx2: Vec<_> = versions.iter().filter(|(name, _)| name.starts_with("iceoryx2")).collect();
    assert!(iceoryx2.len() > 5 && iceoryx2.iter().all(|(_, versions)| versions.len() == 1), "{iceoryx2:?}");
}
