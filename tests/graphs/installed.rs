//! A robot of the PyPI package `example-robot-data`, from its first profile to a task. Skipped, with the
//! reason, unless `MOTORIUM_EXAMPLE_ROBOT_DATA` names the package's folder `robots`.

use std::path::{Path, PathBuf};
use std::process::Output;

use crate::program::motorium;
use crate::support::{ANY_LOSS, Ended, workspace};

/// Runs the program with the robots of the package installed, or prints why it does not.
fn with_robots(arguments: &[&str]) -> Option<Output> {
    let Some(robots) = std::env::var_os("MOTORIUM_EXAMPLE_ROBOT_DATA").map(PathBuf::from) else {
        eprintln!(
            "skipped: MOTORIUM_EXAMPLE_ROBOT_DATA is not set (the folder `robots` of example-robot-data)"
        );
        return None;
    };
    // a collection is a folder of the folder of installed robots
    let installed = robots.parent().expect("the folder is in the package");
    let mut command = motorium(arguments);
    command.env("MOTORIUM_ROBOTS", installed).current_dir(workspace());
    Some(command.output().expect("motorium starts"))
}

/// Writes TIAGo's first profile with its wheels uncommented and another frame of the hand, and the graph next
/// to it.
fn prepared(folder: &Path) -> Option<PathBuf> {
    let profile = folder.join("tiago.toml");
    let output =
        with_robots(&["robot", "profile", "tiago", "--output", profile.to_str().expect("a path of text")])?;
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(&profile).expect("readable");
    let (head, rest) = text.split_once("\n# [mobile_base]\n").expect("wheels, as a comment");
    let (table, tail) = rest.split_once("\n\n").expect("further tables");
    let table: String = table.lines().map(|line| line[1..].to_owned() + "\n").collect();
    assert_eq!(table.matches("friction = 0.0").count(), 4, "four casters\n{text}");
    let head = head.replacen("\njoints = ", "\nbase = \"floating\"\njoints = ", 1);
    let head = head.replacen("\"hand_safety_box\"", "\"hand_grasping_frame\"", 1);
    std::fs::write(&profile, format!("{head}\n[mobile_base]\n{table}\n{tail}")).expect("written");
    let graph = folder.join("tiago-deliver.toml");
    std::fs::copy(workspace().join("graphs/installed/tiago-deliver.toml"), &graph).expect("copied");
    Some(graph)
}

/// Runs the graph in lockstep; the can must end on the far table, and nobody may allocate.
fn delivers(graph: &Path) -> Ended {
    let mut arguments = vec!["run", graph.to_str().expect("a path of text"), "--json", "--clock", "lockstep"];
    arguments.extend(ANY_LOSS);
    let ended = Ended::from_output(&with_robots(&arguments).expect("it was there before"));
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let results = &ended.report().results;
    let (can, arm) = (&results["physics"]["objects"]["can"], &results["arm"]);
    let number = |value: &serde_json::Value| value.as_f64().unwrap_or_else(|| panic!("{can}"));
    assert_eq!(can["touching"][0], "far table", "{can}");
    // upright on the table, 80 cm high; it may still rock a little on its rim
    assert!((number(&can["position"][2]) - 0.9).abs() < 2e-3, "{can}");
    let off =
        [0.6, 1.92].iter().zip(0..).map(|(goal, axis): (&f64, usize)| number(&can["position"][axis]) - goal);
    assert!(off.map(|off| off * off).sum::<f64>().sqrt() < 0.05, "{can}");
    assert!(number(&can["rpy"][0]).hypot(number(&can["rpy"][1])) < 0.05, "{can}");
    assert_eq!((&arm["goals_reached"], &results["route"]["goals_reached"]), (&12.into(), &4.into()), "{arm}");
    assert_eq!((&arm["finger_goals"], &arm["finger_goals_refused"]), (&3.into(), &0.into()), "{arm}");
    for component in &ended.report().components {
        assert_eq!(component.allocations, Some(0), "{}", component.name);
    }
    ended
}

#[test]
fn tiago_delivers_a_can_twice_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let Some(graph) = prepared(folder.path()) else { return };
    let hashes = [(); 2].map(|()| delivers(&graph).report().state_hash.clone());
    assert_eq!(hashes[0], hashes[1]);
}
