//! Runs of example graphs in lockstep, on all engines. None of these runs depends on real time.

use std::fs;
use std::path::Path;

use crate::context::Context;
use crate::failure::Failure;
use crate::outcome::Outcome;
use crate::steps::report::Report;

/// Needs a CAN interface: only checked.
const CAN_INTERFACE: &str = "arm-can";
/// Shares buses with other programs, so it cannot run in lockstep: see `offered_buses`.
const REAL_TIME: &str = "panda-can-socket";
/// Graphs whose expectations hold only at the end of the whole run: see [`pick_and_place`].
const WHOLE: [&str; 5] = ["pick-and-place", "pick-nut", "conveyor", "fetch-cube", "deliver-cube"];

/// Graphs that run twice on MuJoCo, some with contacts.
const TWICE_ON_MUJOCO: [&str; 8] = [
    "panda-reach",
    "pick-and-place",
    "pick-nut",
    "fetch-cube",
    "deliver-cube",
    "ping-pong",
    "camera-servo",
    "panda-wrist",
];
/// Sets another engine itself.
const SETS_RAPIER: &str = "panda-reach-rapier";

/// Graphs that rapier refuses, with the reason; a name that ends in `*` is a prefix.
const REFUSED_BY_RAPIER: [(&str, &str); 12] = [
    ("camera-servo", "simulates no terrain"),
    ("conveyor", "simulates no"),
    ("deliver-cube", "has a floating base"),
    ("drive-square", "has a floating base"),
    ("hover", "has a floating base"),
    ("humanoid-*", "has a floating base"),
    ("lidar-drive", "has a floating base"),
    ("quadruped-*", "has a floating base"),
    ("rough-terrain", "has a floating base"),
    ("rover-policy", "has a floating base"),
    ("two-quadrupeds", "has a floating base"),
    ("warehouse", "has a floating base"),
];

/// Names of the example graphs, sorted.
fn names(context: &Context<'_>) -> Result<Vec<String>, Failure> {
    let folder = context.shared().root.join("graphs");
    let entries = fs::read_dir(&folder).map_err(Failure::file(&folder))?;
    let files = entries.flatten().map(|entry| entry.path());
    let graphs = files.filter(|file| file.extension().is_some_and(|extension| extension == "toml"));
    let mut names: Vec<String> =
        graphs.filter_map(|file| Some(file.file_stem()?.to_str()?.to_string())).collect();
    names.sort();
    match names.is_empty() {
        true => Err(Failure::Check(format!("no graphs in {}", folder.display()))),
        false => Ok(names),
    }
}

/// Runs a check on each graph. A failure does not stop the others.
fn each(context: &Context<'_>, graphs: &[String], check: impl Fn(&str) -> Result<(), Failure>) -> Outcome {
    let mut outcome = Outcome::default();
    for graph in graphs {
        if let Err(failure) = check(graph) {
            context.say(&format!("FAILED {graph}: {failure}"));
            outcome.failures.push(format!("{graph}: {failure}"));
        }
    }
    outcome
}

/// Fails if two runs have different state hashes.
fn compare(context: &Context<'_>, one: &Report, two: &Report, more: &str) -> Result<(), Failure> {
    let (one, two) = (one.state_hash()?, two.state_hash()?);
    context.say(&format!("state hashes {one} and {two}, {more}"));
    match one == two {
        true => Ok(()),
        false => Err(Failure::Check(format!("two runs differ: state hashes {one} and {two}"))),
    }
}

/// Fails if a graph is not refused for this reason.
fn refused(context: &Context<'_>, graph: &str, overlay: &str, reason: &str) -> Result<(), Failure> {
    let check = context.motorium(&format!("check graphs/{graph}.toml --with {overlay}"));
    let (status, printed) = context.quietly(&check)?;
    if !status.success() && printed.contains(reason) {
        return Ok(());
    }
    printed.lines().for_each(|line| context.say(line));
    Err(Failure::Check(format!("not refused with {overlay}, expected `{reason}`")))
}

/// Checks every example graph, runs it in lockstep and replays its recording.
pub(crate) fn every(context: &Context<'_>) -> Result<Outcome, Failure> {
    let recording = context.scratch("every-graph.mcap").display().to_string();
    Ok(each(context, &names(context)?, |graph| {
        context.run(&context.motorium(&format!("check graphs/{graph}.toml")))?;
        if graph == CAN_INTERFACE || graph == REAL_TIME || WHOLE.contains(&graph) {
            return Ok(());
        }
        let run = context.motorium(&format!("run graphs/{graph}.toml --clock lockstep --for 2s --overwrite"));
        context.run(&run.arg("--record").arg(&recording))?;
        context.run(&context.motorium("replay").arg(&recording).arg("--verify"))?;
        Ok(())
    }))
}

/// Contacts decide the cube's final position, in a bin or on a table: identical in two runs.
pub(crate) fn pick_and_place(context: &Context<'_>) -> Result<Outcome, Failure> {
    let recording = context.scratch("pick.mcap").display().to_string();
    Ok(each(context, &WHOLE.map(String::from), |graph| {
        let run = || {
            let run =
                context.motorium(&format!("run graphs/{graph}.toml --clock lockstep --json --overwrite"));
            Report::run(context, &run.arg("--record").arg(&recording))
        };
        let [one, two] = [run()?, run()?];
        context.run(&context.motorium("replay").arg(&recording).arg("--verify"))?;
        let cube = one.value("/results/physics/objects/cube/position")?;
        compare(context, &one, &two, &format!("cube at {cube}"))
    }))
}

/// Episodes: equal with one seed, different with separate seeds.
pub(crate) fn episodes(context: &Context<'_>) -> Result<Outcome, Failure> {
    let run = |options: &str| {
        let graph = "run graphs/quadruped-trot.toml --clock lockstep --for 1s --episodes 5 --json";
        Report::run(context, &context.motorium(&format!("{graph} {options}")))
    };
    let (same, varied) = (run("--hosting inline")?, run("--vary-seed")?);
    let (same, varied) = (same.episode_hashes()?, varied.episode_hashes()?);
    let text = format!("one seed {same:?}, own seeds {varied:?}");
    context.say(&text);
    match are_episodes_right(&same, &varied) {
        true => Ok(Outcome::default()),
        false => Err(Failure::Check(text)),
    }
}

/// Five equal hashes with one seed, and five different ones, of which the first has the same seed.
fn are_episodes_right(same: &[&str], varied: &[&str]) -> bool {
    let distinct = |hashes: &[&str]| hashes.iter().collect::<std::collections::BTreeSet<_>>().len();
    same.len() == 5
        && varied.len() == 5
        && distinct(same) == 1
        && distinct(varied) == 5
        && same[0] == varied[0]
}

/// A learner that tries gaits. The build of `cargo test`: for an example alone cargo would choose other
/// features and recompile half of the tree.
pub(crate) fn learner(context: &Context<'_>) -> Result<Outcome, Failure> {
    let program = context.shared().root.join("target/debug/examples/tune_trot");
    context.run(&context.call(program).args("--episodes 20 --seconds 1"))?;
    Ok(Outcome::default())
}

/// Graphs simulated by MuJoCo with an overlay, if its wheel is installed. Two runs have the same hash, also
/// with contacts.
pub(crate) fn on_mujoco(context: &Context<'_>) -> Result<Outcome, Failure> {
    let overlay = "graphs/overlays/mujoco.toml";
    let names = names(context)?;
    if !has_mujoco(&context.shared().root) {
        let note = format!("{} graphs not run: no wheel of mujoco 3.17.0", names.len());
        return Ok(Outcome::noted(note));
    }
    Ok(each(context, &names, |graph| {
        let run = format!("run graphs/{graph}.toml --with {overlay} --clock lockstep");
        if TWICE_ON_MUJOCO.contains(&graph) {
            let run = context.motorium(&run).arg("--json");
            let [one, two] = [Report::run(context, &run)?, Report::run(context, &run)?];
            let factors = [one.number("/realtime_factor")?, two.number("/realtime_factor")?];
            return compare(context, &one, &two, &format!("real-time factors {factors:?}"));
        }
        match graph {
            CAN_INTERFACE | REAL_TIME | SETS_RAPIER => Ok(()),
            "conveyor" => refused(context, graph, overlay, "simulates no conveyor"),
            _ => context.run(&context.motorium(&run).args("--for 2s")).map(|_| ()),
        }
    }))
}

/// Returns `true` if MuJoCo's engine is installed.
pub(crate) fn has_mujoco(root: &Path) -> bool {
    let Ok(folders) = fs::read_dir(root.join("target/python/lib")) else { return false };
    let library = |folder: fs::DirEntry| folder.path().join("site-packages/mujoco/libmujoco.so.3.17.0");
    folders.flatten().map(library).any(|file| file.exists())
}

/// Graphs simulated by rapier with an overlay. Unsupported graphs are refused, each with its reason.
pub(crate) fn on_rapier(context: &Context<'_>) -> Result<Outcome, Failure> {
    let overlay = "graphs/overlays/rapier.toml";
    Ok(each(context, &names(context)?, |graph| {
        if graph == CAN_INTERFACE || graph == REAL_TIME {
            return Ok(());
        }
        if let Some(reason) = reason_of_rapier(graph) {
            return refused(context, graph, overlay, reason);
        }
        let run = context.motorium(&format!("run graphs/{graph}.toml --with {overlay} --clock lockstep"));
        let run = if WHOLE.contains(&graph) { run } else { run.args("--for 2s") };
        context.run(&run).map(|_| ())
    }))
}

fn reason_of_rapier(graph: &str) -> Option<&'static str> {
    let matches = |pattern: &str| match pattern.strip_suffix('*') {
        Some(prefix) => graph.starts_with(prefix),
        None => graph == pattern,
    };
    REFUSED_BY_RAPIER.iter().find(|(pattern, _)| matches(pattern)).map(|(_, reason)| *reason)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn named_graphs_exist() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let exists = |graph: &str| root.join(format!("graphs/{graph}.toml")).exists();
        let refused = REFUSED_BY_RAPIER.iter().map(|(pattern, _)| *pattern);
        let all = [CAN_INTERFACE, REAL_TIME, SETS_RAPIER].into_iter().chain(WHOLE).chain(TWICE_ON_MUJOCO);
        for graph in all.chain(refused.filter(|pattern| !pattern.ends_with('*'))) {
            assert!(exists(graph), "{graph}");
        }
    }

    #[test]
    fn patterns_select_refused_graphs() {
        assert_eq!(reason_of_rapier("humanoid-walk"), Some("has a floating base"));
        assert_eq!(reason_of_rapier("camera-servo"), Some("simulates no terrain"));
        assert_eq!(reason_of_rapier("hover-2"), None);
        assert_eq!(reason_of_rapier("panda-reach"), None);
    }

    #[test]
    fn episodes_differ_only_with_separate_seeds() {
        let (same, varied) = (["a"; 5], ["a", "b", "c", "d", "e"]);
        assert!(are_episodes_right(&same, &varied));
        assert!(!are_episodes_right(&varied, &varied));
        assert!(!are_episodes_right(&same, &same));
        assert!(!are_episodes_right(&["b"; 5], &["a", "c", "d", "e", "f"]), "first episode");
        assert!(!are_episodes_right(&same[..4], &varied));
    }
}
