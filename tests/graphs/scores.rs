//! Scores of recordings: of tasks that leave some freedom, and of unreached targets.

use std::path::Path;

use crate::recording::{motorium, recorded, text};

/// Returns the score of a recording as JSON and as text.
fn scored(file: &Path) -> (serde_json::Value, String) {
    let run = |options: &[&str]| {
        let output = motorium(&[&["score", text(file)], options].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).expect("text")
    };
    (serde_json::from_str(&run(&["--json"])).expect("JSON"), run(&[]))
}

#[test]
fn a_free_orientation_is_neither_missed_nor_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = recorded(folder.path(), "humanoid-reach.toml", &["--for", "3 s", "--no-expect"]);
    let (score, said) = scored(&file);
    let poses = score["poses"].as_array().expect("poses");
    let frames: Vec<_> = poses.iter().filter_map(|pose| pose["frame"].as_str()).collect();
    assert_eq!(frames, ["left_palm", "right_palm"], "where it looks is no goal: {said}");
    for pose in poses {
        assert_eq!((&pose["orientation_is_free"], &pose["position_is_free"]), (&true.into(), &false.into()));
        assert_eq!(pose["goals_missed"], 0, "{pose}");
        assert!(pose["goals_reached"].as_u64() > Some(0), "{pose}");
    }
    assert!(said.contains("orientation is left free by `controller`") && !said.contains("mrad"), "{said}");
}

#[test]
fn gaze_target_is_not_a_goal() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = recorded(folder.path(), "camera-servo.toml", &["--for", "500 ms", "--no-expect"]);
    let (score, said) = scored(&file);
    assert_eq!(score["poses"], serde_json::json!([]), "{said}");
    assert!(score["joints"].as_array().is_some_and(|joints| !joints.is_empty()), "{said}");
}
