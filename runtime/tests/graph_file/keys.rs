//! No key is ignored: a change of any key changes the plan.

use std::collections::BTreeSet;

use motorium::graph::schema;
use serde_json::Value as Json;

use super::{good, kinds, load, load_with};

/// For every key of the graph file, a value that differs from the value in `everything.toml`, with further
/// settings that it requires.
const OTHER_VALUES: &[(&str, &[&str])] = &[
    ("Graph.name", &["name=other"]),
    ("Graph.clock", &["clock=realtime"]),
    ("Graph.duration", &["duration=1 s"]),
    ("Graph.seed", &["seed=43"]),
    ("Cores.realtime", &["cores.realtime=[3]"]),
    ("Cores.shared", &["cores.shared=[1, 0]"]),
    ("Realtime.spin", &["realtime.spin=50 us"]),
    ("Realtime.spin_share", &["realtime.spin_share=0.3"]),
    ("Realtime.idle_exit", &["realtime.idle_exit=5 us"]),
    ("Realtime.hang_after", &["realtime.hang_after=900 ms"]),
    ("Realtime.lost_steps", &["realtime.lost_steps=0.2"]),
    ("Realtime.on_denied", &["realtime.on_denied=warn"]),
    ("Robot.urdf", &["robot.panda.urdf=ur5"]),
    ("Robot.mjcf", &["robot.panda={ mjcf = \"ur5\" }"]),
    ("Robot.joints", &["robot.panda.joints=[\"panda_joint1\"]"]),
    ("Robot.fixed", &["robot.panda.fixed={ panda_joint1 = 0.5 }"]),
    ("Robot.profile", &["robot.panda.profile=mine.toml"]),
    ("Robot.package_path", &["robot.panda.package_path=[\"packages\"]"]),
    ("Robot.base", &["robot.panda.base={ position = [1.0, 0.0, 0.0] }"]),
    ("Robot.frame", &["robot.panda.frame=hand"]),
    ("Robot.start", &["robot.panda.start=0.5"]),
    ("Robot.gains", &["robot.panda.gains={ kp = 10.0, kd = 1.0 }"]),
    ("Gains.kp", &["robot.panda.gains.kp=[20.0, 10.0]"]),
    ("Gains.kd", &["robot.panda.gains.kd=2"]),
    ("Base.position", &["robot.panda.base.position=[0.0, 0.0, 0.5]"]),
    ("Base.rpy", &["robot.panda.base.rpy=[0.0, 0.0, 1.5]"]),
    ("Topic.history", &["topic.target.history=9"]),
    ("Component.kind", &["phases.kind=log.recorder", "phases.subscribe={ episodes = \"episodes\" }"]),
    ("Component.robot", &["robot.second.urdf=panda", "controller.robot=second"]),
    ("Component.rate", &["policy.rate=61 Hz"]),
    (
        "Component.trigger",
        &[
            "controller.trigger=target",
            "latency=[]",
            "component.controller={ kind = \"control.qp\", robot = \"panda\", trigger = \"target\", subscribe = { target = \"target\", joint_state = \"joint_state\" }, publish = { joint_command = \"joint_command\" } }",
            "physics.spin=auto",
        ],
    ),
    ("Component.phase", &["physics.phase=10 us"]),
    ("Component.budget", &["physics.budget=201 us"]),
    ("Component.schedule", &["policy.schedule=fifo"]),
    ("Component.priority", &["physics.priority=89"]),
    ("Component.spin", &["physics.spin=auto"]),
    ("Component.core", &["policy.core=0"]),
    ("Component.subscribe", &["phases.subscribe={ phase = \"episodes\", target = \"target\" }"]),
    (
        "Component.publish",
        &[
            "policy.publish={ target = \"target\", episodes = \"renamed\" }",
            "recorder.subscribe.episodes=renamed",
            "recorder.trigger=renamed",
            "phases.subscribe.phase=renamed",
            "phases.trigger=renamed",
        ],
    ),
    ("Component.params", &["controller.params.gain=9"]),
    ("Component.config", &["physics.config.substeps=5"]),
    ("Component.on_overrun", &["physics.on_overrun=rephase"]),
    ("Component.hang_after", &["physics.hang_after=900 ms"]),
    ("Component.cpu_limit", &["physics.cpu_limit=30 ms"]),
    ("Component.lost_steps", &["physics.lost_steps=0.3"]),
    ("Component.overruns_tolerated", &["physics.overruns_tolerated=4"]),
    ("Component.on_error", &["physics.on_error=fail"]),
    ("Component.on_failure", &["policy.on_failure=safe_stop"]),
    ("Component.restart", &["physics.restart={}"]),
    ("Component.stop_within", &["physics.stop_within=5 s"]),
    ("Restart.when", &["physics.restart.when=failure"]),
    ("Restart.at_most", &["physics.restart.at_most=4"]),
    ("Restart.window", &["physics.restart.window=2 s"]),
    ("Restart.within", &["physics.restart.within=2 s"]),
    ("Latency.from", &["latency.0.from=target"]),
    ("Latency.to", &["latency.0.to=joint_command", "latency.0.from=target"]),
    ("Latency.max", &["latency.0.max=4 ms"]),
    ("Latency.on_miss", &["latency.0.on_miss=warn"]),
    ("Safety.stale_after", &["safety.stale_after=9 ms"]),
    ("Safety.safe_state", &["safety.safe_state=damp"]),
    ("Safety.settle", &["safety.settle=2 s"]),
    ("Safety.source_stale_after", &["safety.source_stale_after=90 ms"]),
    ("Safety.limits", &["safety.limits=refuse"]),
    ("Safety.resume", &["safety.resume=latch"]),
    ("Safety.stop_together", &["safety.stop_together=true"]),
    ("Graph.expect", &["expect.physics.steps=> 5"]),
];

/// Keys whose subkeys are in the list, and keys with separate tests: `exec`, `emergency_stop`, `world`,
/// `activate` (there are no events in lockstep), `robots`, the keys of episodes (the kinds of this test
/// cannot be reset), and the keys that combine files.
const TABLES: [&str; 23] = [
    "Component.activate",
    "Activate.on",
    "Activate.min_interval",
    "Graph.world",
    "Component.robots",
    "Graph.episodes",
    "Episodes.count",
    "Episodes.vary_seed",
    "Component.ends_episode",
    "Component.begins_episodes",
    "Component.safety",
    "Graph.extends",
    "Graph.remove",
    "Safety.emergency_stop",
    "Safety.emergency_stop_max_age",
    "Graph.cores",
    "Graph.realtime",
    "Graph.robot",
    "Graph.component",
    "Graph.topic",
    "Graph.latency",
    "Graph.safety",
    "Component.exec",
];

#[test]
fn every_key_changes_the_plan() {
    let before = load(&good("everything")).expect("a good graph").plan;
    for (key, set) in OTHER_VALUES {
        let after = load_with(&good("everything"), set)
            .unwrap_or_else(|error| panic!("{key}: {}", error.render(false)));
        assert_ne!(before, after.plan, "{key} is ignored");
    }
}

#[test]
fn list_of_keys_is_complete() {
    let document = schema(&kinds::registry()).to_value();
    let mut keys = BTreeSet::new();
    let mut take = |table: &str, described: &Json| {
        let properties = described["properties"].as_object().expect("a table");
        keys.extend(properties.keys().map(|key| format!("{table}.{key}")));
    };
    take("Graph", &document);
    for table in [
        "Episodes",
        "Cores",
        "Realtime",
        "Robot",
        "Base",
        "Gains",
        "Component",
        "Activate",
        "Topic",
        "Restart",
        "Latency",
        "Safety",
    ] {
        take(table, &document["definitions"][table]);
    }
    let listed = OTHER_VALUES.iter().map(|(key, _)| *key).chain(TABLES).map(str::to_string).collect();
    assert_eq!(keys, listed);
}
