//! Measured graphs as texts of graph files.

use std::fmt::Write as _;
use std::path::Path;

use super::LatentFiles;

/// The arm moved by the README's first command.
const PANDA: &str = include_str!("panda-reach.toml");
/// Three arms that mimic a human.
const MIMIC: &str = include_str!("mimic.toml");

fn head(name: &str, rate_hz: u32, seconds: u32, core: usize) -> String {
    format!(
        "name = \"{name}\"\nduration = \"{seconds} s\"\n[cores]\nrealtime = [{core}]\n[component.head]\n\
         kind = \"bench.relay\"\nrate = \"{rate_hz} Hz\"\n"
    )
}

fn relay(text: &mut String, name: &str, from: &str, to: Option<&str>) {
    let publish = to.map(|to| format!("publish = {{ out = \"{to}\" }}\n")).unwrap_or_default();
    let _ = write!(
        text,
        "[component.{name}]\nkind = \"bench.relay\"\ntrigger = \"{from}\"\n\
         subscribe = {{ in = \"{from}\" }}\n{publish}"
    );
}

/// Returns the graph file of one component that is released at `rate_hz` and publishes on a topic without
/// readers.
pub fn release(rate_hz: u32, seconds: u32, core: usize) -> String {
    head("bench-release", rate_hz, seconds, core) + "publish = { out = \"bench/0\" }\n"
}

/// Returns the graph file of a chain of `processes` processes at 1 kHz on one core. The last component is
/// `tail`.
pub fn chain(processes: usize, seconds: u32, core: usize) -> String {
    let mut text = head("bench-chain", 1_000, seconds, core);
    text.push_str("publish = { out = \"bench/0\" }\n");
    for i in 1..processes {
        let (from, to) = (format!("bench/{}", i - 1), format!("bench/{i}"));
        match i + 1 == processes {
            true => relay(&mut text, "tail", &from, None),
            false => relay(&mut text, &format!("relay-{i}"), &from, Some(&to)),
        }
    }
    text
}

/// Returns the graph file of the caterpillar at 1 kHz: a source, a chain of 8 relays, and a sink for each
/// relay. Its 17 processes run on one core. The last sink is `tail`.
pub fn caterpillar(seconds: u32, core: usize) -> String {
    let mut text = head("bench-caterpillar", 1_000, seconds, core);
    text.push_str("publish = { out = \"bench/0\" }\n");
    for i in 1..=8 {
        let (from, to) = (format!("bench/{}", i - 1), format!("bench/{i}"));
        relay(&mut text, &format!("relay-{i}"), &from, Some(&to));
        let sink = if i == 8 { "tail".to_string() } else { format!("sink-{i}") };
        relay(&mut text, &sink, &to, None);
    }
    text
}

/// Returns the graph file of one process at 1 kHz that triggers `readers` processes, which are named `tail-1`
/// to `tail-N`. All processes run on one core.
pub fn fan_out(readers: usize, seconds: u32, core: usize) -> String {
    let mut text = head("bench-fan-out", 1_000, seconds, core);
    text.push_str("publish = { out = \"bench/0\" }\n");
    for i in 1..=readers {
        relay(&mut text, &format!("tail-{i}"), "bench/0", None);
    }
    text
}

/// Returns the graph file of a component that commands 7 joints at 1 kHz, and an actuator that the commands
/// trigger, on one core. The actuator uses the command gate if `gated` is true.
pub fn gate(gated: bool, seconds: u32, core: usize) -> String {
    format!(
        "name = \"bench-gate\"\nduration = \"{seconds} s\"\n[cores]\nrealtime = [{core}]\n[component.commander]\n\
         kind = \"bench.commander\"\nrate = \"1 kHz\"\npublish = {{ command = \"bench/command\" }}\n\
         [component.actuator]\nkind = \"bench.actuator\"\ntrigger = \"bench/command\"\n\
         subscribe = {{ command = \"bench/command\" }}\nconfig = {{ gated = {gated} }}\n"
    )
}

/// Returns the graph file of a component that starts episodes of 50 steps at 1 kHz.
pub fn episodes(seconds: u32, core: usize) -> String {
    format!(
        "name = \"bench-episodes\"\nduration = \"{seconds} s\"\n[cores]\nrealtime = [{core}]\n\
         [component.counter]\nkind = \"bench.episodes\"\nrate = \"1 kHz\"\nbegins_episodes = true\n"
    )
}

/// Returns the graph file of a source that publishes at 10 kHz on a raw port, and a sink triggered by each
/// message, on one core. The messages are single values, or slices if `slices` is `true`.
pub fn raw_ports(slices: bool, seconds: u32, core: usize) -> String {
    format!(
        "name = \"bench-raw\"\nduration = \"{seconds} s\"\n[cores]\nrealtime = [{core}]\n[component.source]\n\
         kind = \"bench.raw_source\"\nrate = \"10 kHz\"\npublish = {{ values = \"bench/values\" }}\n\
         config = {{ slices = {slices} }}\n[component.sink]\nkind = \"bench.raw_sink\"\n\
         trigger = \"bench/values\"\nsubscribe = {{ values = \"bench/values\" }}\n\
         config = {{ slices = {slices} }}\n"
    )
}

/// Returns the graph file of the Panda loop at 1 kHz: physics, encoder, policy and controller.
pub fn panda(seconds: u32) -> String {
    PANDA.replace("duration = \"10 s\"", &format!("duration = \"{seconds} s\""))
}

/// Returns the graph file of a Panda held by the policy in `folder`: physics at 1 kHz, encoder, policy, joint
/// targets. The policy runs at 50 Hz outside the trigger chain. If `in_loop` is true, it is part of the chain
/// and runs at each joint state.
pub fn policy(folder: &Path, in_loop: bool, seconds: u32) -> String {
    let (pace, trigger) = match in_loop {
        true => ("trigger   = \"panda/joint_state\"", "panda/action"),
        false => ("rate      = \"50 Hz\"", "panda/joint_state"),
    };
    let folder = folder.display().to_string();
    let chain = PANDA.split("[component.policy]").next().unwrap_or_default();
    let safety = PANDA.split("[safety]").nth(1).unwrap_or_default();
    format!(
        r#"{chain}[component.policy]
kind      = "policy.network"
robot     = "panda"
{pace}
budget    = "200 us"
subscribe = {{ joint_state = "panda/joint_state" }}
publish   = {{ action = "panda/action" }}
config    = {{ policy = {folder:?} }}

[component.targets]
kind      = "policy.joint_targets"
robot     = "panda"
trigger   = "{trigger}"
budget    = "50 us"
subscribe = {{ joint_state = "panda/joint_state", action = "panda/action" }}
publish   = {{ joint_command = "panda/joint_command" }}
config    = {{ policy = {folder:?}, gravity_compensation = true }}

[[latency]]
from = "panda/true_joint_state"
to   = "panda/joint_command"
max  = "600 us"

[safety]{safety}"#
    )
    .replace("duration = \"10 s\"", &format!("duration = \"{seconds} s\""))
}

/// Returns the graph file of [`policy`] at 50 Hz with one more component, `floor`, which each joint state
/// triggers and which does nothing.
pub fn joint_reader(folder: &Path, seconds: u32) -> String {
    let floor = r#"[component.floor]
kind      = "bench.joint_reader"
trigger   = "panda/joint_state"
subscribe = { joint_state = "panda/joint_state" }

[component.targets]"#;
    policy(folder, false, seconds).replace("[component.targets]", floor)
}

/// Returns the graph file of three arms in one physics process, which mimic a human with the model and the
/// movement in `folder`.
pub fn latent(folder: &Path, seconds: u32) -> String {
    let graph = MIMIC.split("[expect]").next().unwrap_or_default();
    let safety = MIMIC.split("[safety]").nth(1).unwrap_or_default();
    let mut text = format!("{graph}[safety]{safety}");
    for (file, name) in [("mimic/arms.latent", LatentFiles::MODEL), ("mimic/take.csv", LatentFiles::MOTION)] {
        let path = folder.join(name).display().to_string();
        text = text.replace(&format!("{file:?}"), &format!("{path:?}"));
    }
    text.replace("rate = 30.0", "rate = 30.0, repeat = \"forever\"")
        .replace("duration = \"8 s\"", &format!("duration = \"{seconds} s\""))
}

#[cfg(test)]
mod tests {
    use motorium::declare::{ConfigError, RobotReference};
    use motorium::graph::{self, Machine};
    use motorium::worker::{Registry, RobotSource};

    use super::*;

    fn no_robots(_: &RobotReference) -> Result<Vec<String>, ConfigError> {
        Err(ConfigError::new("none here"))
    }

    #[test]
    fn measured_graphs_can_run() {
        let registry = Registry::new(RobotSource { check: no_robots }, crate::kinds());
        let machine = Machine::detect();
        let core = motorium::os::machine::online_cores()[0];
        let graphs = [release(4_000, 1, core), chain(2, 1, core), chain(8, 1, core), caterpillar(1, core)];
        let more = [fan_out(1, 1, core), fan_out(8, 1, core), gate(true, 1, core), gate(false, 1, core)];
        let newer = [episodes(1, core), raw_ports(true, 1, core), raw_ports(false, 1, core)];
        for text in graphs.into_iter().chain(more).chain(newer) {
            let checked = graph::check(Path::new("bench.toml"), text.clone(), &[], &registry, &machine);
            checked.unwrap_or_else(|error| panic!("{text}\n{}", error.render(false)));
        }
    }

    #[test]
    fn chain_has_the_requested_length_and_ends_in_a_tail() {
        for processes in [2, 4, 8] {
            let text = chain(processes, 1, 0);
            assert_eq!(text.matches("[component.").count(), processes);
            assert_eq!(text.matches("[component.tail]").count(), 1);
            assert_eq!(text.matches("trigger").count(), processes - 1);
        }
    }

    #[test]
    fn caterpillar_has_17_processes_and_a_sink_per_relay() {
        let text = caterpillar(1, 0);
        assert_eq!(text.matches("[component.").count(), 17);
        for i in 1..=8 {
            assert_eq!(text.matches(&format!("trigger = \"bench/{i}\"")).count(), if i == 8 { 1 } else { 2 });
        }
    }

    #[test]
    fn policies_keep_the_chain_of_the_panda() {
        for (in_loop, pace) in [(true, "trigger   = \"panda/joint_state\""), (false, "rate      = \"50 Hz\"")]
        {
            let text = policy(Path::new("/tmp/policy"), in_loop, 3);
            assert_eq!(text.matches("[component.").count(), 4);
            assert!(text.contains("duration = \"3 s\"") && text.contains(pace), "{text}");
            assert!(text.contains("policy = \"/tmp/policy\"") && text.contains("stale_after"));
        }
    }

    #[test]
    fn joint_reader_is_added_to_the_policy() {
        let text = joint_reader(Path::new("/tmp/policy"), 3);
        assert_eq!(text.matches("[component.").count(), 5);
        let without: toml::Table = policy(Path::new("/tmp/policy"), false, 3).parse().unwrap();
        let mut with: toml::Table = text.parse().unwrap();
        let floor = with["component"].as_table_mut().unwrap().remove("floor").unwrap();
        assert_eq!((floor["trigger"].as_str(), with), (Some("panda/joint_state"), without));
    }

    #[test]
    fn arms_mimic_with_the_files_of_a_folder() {
        let text = latent(Path::new("/tmp/latent"), 3);
        let graph: toml::Table = text.parse().unwrap();
        let mimic = &graph["component"]["mimic"];
        assert_eq!(mimic["robots"].as_array().map(Vec::len), Some(3));
        assert_eq!(mimic["config"]["model"].as_str(), Some("/tmp/latent/arms.latent"));
        assert_eq!(mimic["config"]["motion"].as_str(), Some("/tmp/latent/take.csv"));
        assert_eq!(mimic["config"]["repeat"].as_str(), Some("forever"));
        assert_eq!(graph["duration"].as_str(), Some("3 s"));
        assert!(!graph.contains_key("expect") && graph.contains_key("safety"), "{text}");
    }

    #[test]
    fn panda_loop_runs_for_the_requested_time() {
        assert!(panda(3).contains("duration = \"3 s\""));
        assert!(panda(3).contains("[[latency]]"));
    }
}
