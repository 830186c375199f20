//! The crates behind the command: how many there are, their licences and their sources.
//!
//! `cargo deny check licenses bans sources` checks more, where it is installed; this needs nothing but cargo
//! itself.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde::Deserialize;

/// Crates that `cargo build --release` may compile for the command, procedural macros and the project's own
/// included. A change that needs more says so here, and why it is worth it. The last were `shlex` and
/// `is_executable`, with which shells complete runs, topics and parameters; the channels and queues of
/// crossbeam (three crates in place of one), which the launcher, the printers and programs that drive several
/// sessions share; a crate of the project, the drives on CAN buses, a wing of their own; `mcap` and
/// `foxglove` without compression and server (27 crates): recordings that every viewer and reader of robotics
/// opens; `socketcan`, with which drives reach the kernel's buses (seven crates); and `can-dbc`, which reads
/// the databases of their messages (14 crates: a grammar for `pest`, and the encodings of old files); and
/// `miniz_oxide`, which unpacks pictures that are terrain (two crates; the crate `png` brings four more); and
/// `serde_path_to_error`, which names the key of a configuration that cannot be read: all are read in one way
/// since, where other ways were nearly a third of the code of `motorium-sensors`; and a crate of the project,
/// the algebra that models and the motion library share; and `ruzstd` and `lz4_flex`, which unpack the chunks
/// of recordings by other programs; and `serde-saphyr`, which reads the YAML files that Isaac Lab and LEAPP
/// write next to a trained policy (four crates: a parser, its ring buffer and its decoder of encodings); and
/// four crates of the project: the QP solvers, a leaf below the controllers, the controllers of moving bases,
/// the setpoint of a joint, a leaf below everything that commands one, and worlds, which robots do not need.
/// `toml` and `signal-hook` are in the tree once, shared with iceoryx2 and the screen.
///
/// What goes with each subtree, where all others stay: iceoryx2 32, `mcap` and `foxglove` 26, `ratatui` 25,
/// serde, its formats and schemas 18, the crates of the project 22, `parry3d` and `rapier3d` 15, clap 14,
/// `can-dbc` 14, `clarabel` 14, `urdf-rs` 9, `nalgebra` 7, `socketcan` 7, `indicatif` 4, `serde-saphyr` 4,
/// `prometheus-client` 3. Without the screen of `top`, databases of CAN messages, cones, URDF, the kernel's
/// buses and metrics, 74 crates fewer, there are still 212.
const CEILING: usize = 290;

/// Crates that `cargo build --release -p motorium-view` may compile, counted in the same way. It is a program
/// of its own for their sake: Foxglove's server runs on tokio. Robots have networks as actuators, which bring
/// `pulp` and three more.
const VIEWER: usize = 220;

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

/// Names and versions of the crates behind one of the project, itself included.
fn behind(package: &str) -> BTreeSet<String> {
    let tree = cargo(&["tree", "-p", package, "-e", "normal", "--prefix", "none", "--format", "{p}"]);
    // A procedural macro and a crate that was listed before have a remark behind their version.
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
        "{} crates stand behind the command, at most {CEILING} may",
        crates.len()
    );
}

#[test]
fn viewer_stays_below_its_crate_ceiling() {
    let (viewer, command) = (behind("motorium-view"), behind("motorium-tools"));
    assert!(viewer.len() <= VIEWER, "{} crates stand behind the viewer, at most {VIEWER} may", viewer.len());
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

/// True if an SPDX expression can be met with the licences allowed. `AND` binds closer than `OR`, which old
/// manifests write as `/`.
fn is_met(expression: &str, allowed: &BTreeSet<String>) -> bool {
    /// The parts between a word that stands outside all parentheses.
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
    // As cargo deny does by default: tests may use what is not shipped.
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

/// `Cargo.lock`, as far as it is read here.
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
