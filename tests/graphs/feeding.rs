//! `motorium topic pub`: external values reach a topic that the bridge publishes, and no other.

use std::path::Path;

use crate::program::{complaint, json, printed};
use crate::support::{Run, machine};

#[test]
fn an_outside_value_reaches_only_the_topic_of_its_bridge() {
    let _machine = machine();
    let run = Run::start(Path::new("graphs/panda-bridge.toml"), &["--for", "60 s"]);
    let id = run.folder.id().to_string();
    let newest = || {
        let text = printed(&["topic", "echo", "panda/target", "--run", &id, "--count", "1", "--json"]);
        serde_json::from_str::<serde_json::Value>(text.trim()).expect("JSON")
    };
    let position = "position=[0.35, 0.0, 0.55] goal=6";
    let text = complaint(&["topic", "pub", "panda/target", position, "--run", &id]);
    assert!(text.contains("`orientation` is missing, and `panda/target` has no value yet"), "{text}");
    let pose = "position=[0.35, 0.0, 0.55] orientation=[1, 0, 0, 0] goal=7";
    printed(&["topic", "pub", "panda/target", pose, "--run", &id]);
    let once = newest();
    assert_eq!(once["value"]["position"], serde_json::json!([0.35, 0.0, 0.55]));
    assert_eq!((&once["value"]["goal"], &once["publisher"]), (&7.into(), &"bridge".into()));
    // without an orientation the pose keeps the one of the newest value
    printed(&["topic", "pub", "panda/target", "position=[0.36, 0.0, 0.55]", "--run", &id]);
    let once = newest();
    assert_eq!(once["value"]["orientation"], serde_json::json!([1.0, 0.0, 0.0, 0.0]));
    // fields may be given one by one, and the value may be published repeatedly
    let fields = ["position=[0.36, 0, 0.55]", "orientation=[1, 0, 0, 0]", "goal=8"];
    let repeated =
        [&["topic", "pub", "panda/target"], &fields[..], &["--run", &id, "--rate", "50", "--for", "1s"]];
    printed(&repeated.concat());
    let repeated = newest();
    assert_eq!(repeated["value"]["goal"], 8);
    let (before, after) = (once["sequence"].as_u64().unwrap(), repeated["sequence"].as_u64().unwrap());
    assert!((before + 5..=before + 60).contains(&after), "{before} and {after}");

    let refused = |topic: &str, value: &str| complaint(&["topic", "pub", topic, value, "--run", &id]);
    let text = refused("panda/joint_command", "effort=[1]");
    assert!(text.contains("published by component `controller`, and cannot be published"), "{text}");
    assert!(text.contains("only `panda/target` can be published from outside"), "{text}");
    let text = refused("panda/target", "positon=[0, 0, 0]");
    assert!(text.contains("no field `positon`; did you mean `position`?"), "{text}");
    let text = refused("panda/target", "position=[0, 0]");
    assert!(text.contains("`position` has 2 entries, expected 3"), "{text}");
    let text = refused("panda/target", "position=[0, 0, 0] orientation=[3, 0, 0, 0]");
    assert!(text.contains("`orientation` has the length 3.000, expected 1"), "{text}");
    let text = refused("panda/target", "position=[0, 0, inf]");
    assert!(text.contains("`position` is inf, expected a finite f64"), "{text}");
    let rows = json(&["topic", "list", "--run", &id, "--json"]);
    let writer = |name: &str| {
        let row = rows.as_array().unwrap().iter().find(|row| row["name"] == name).unwrap();
        row["writer"].as_str().unwrap().to_string()
    };
    assert_eq!(
        (writer("panda/target"), writer("panda/joint_command")),
        ("bridge".into(), "controller".into())
    );
}
