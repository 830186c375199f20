//! The frame controlled by tasks by default.

use std::path::Path;

use motorium_robots::{EndEffectorError, LoadError, Loaded, RobotSource, load};

fn robot(name: &str) -> Loaded {
    load(name, Path::new(".")).unwrap()
}

#[test]
fn only_end_effector_is_the_default_frame() {
    let panda = robot("panda");
    assert_eq!(panda.end_effector(None).unwrap(), panda.model.frame("panda_hand_tcp").unwrap());
    assert_eq!(panda.end_effector(Some("panda_link4")).unwrap(), panda.model.frame("panda_link4").unwrap());
    // Without the profile its end effectors are unknown, but a frame can still be named.
    assert!(panda.model.end_effector(None, Some("panda_link4")).is_ok());
}

#[test]
fn missing_or_ambiguous_tip_is_an_error_with_an_example() {
    let panda = robot("panda");
    let error = panda.model.end_effector(None, None).unwrap_err();
    assert_eq!(error.to_string(), "robot `panda` has no known end effector, and no `frame` is specified");
    assert_eq!(error.example(), Some("panda_hand_tcp"));

    let mut two = robot("panda");
    let ends = &mut two.profile.as_mut().unwrap().end_effectors;
    let second = ends.values().next().unwrap().clone();
    ends.insert("second".to_owned(), second);
    let error = two.end_effector(None).unwrap_err();
    assert_eq!(error.to_string(), "robot `panda` has several end effectors, and no `frame` is specified");
    assert_eq!(error.example(), Some("panda_hand_tcp"));

    let error = panda.end_effector(Some("panda_hand_tpc")).unwrap_err();
    assert!(matches!(error, EndEffectorError::UnknownFrame(_)), "{error}");
    assert_eq!(error.example(), Some("panda_hand_tcp"));
}

#[test]
fn immovable_frame_is_rejected_and_the_tip_suggested() {
    let panda = robot("panda");
    let error = panda.end_effector(Some("panda_link0")).unwrap_err();
    assert_eq!(
        error.to_string(),
        "`panda_link0` of robot `panda` is fixed to the world, so no joint moves it"
    );
    assert_eq!(error.example(), Some("panda_hand_tcp"));
    let quadruped = robot("quadruped");
    let base = &quadruped.model.frames()[0].name;
    assert!(quadruped.end_effector(Some(base)).is_ok(), "a floating base moves");
}

#[test]
fn tip_is_the_end_of_the_longest_chain() {
    for (name, tip) in
        [("ur5e", "tool0"), ("panda", "panda_hand_tcp"), ("iiwa14", "iiwa_link_ee"), ("double-pendulum", "")]
    {
        let model = robot(name).model;
        let found = model.tip().expect("the robot has joints");
        assert!(model.moves(found), "{name}");
        assert!(
            tip.is_empty() || model.frames()[found.index()].name == tip,
            "{name}: {:?}",
            model.frames()[found.index()]
        );
    }
}

#[test]
fn robot_that_fails_to_load_is_named_with_the_cause() {
    let error =
        RobotSource { name: "left", text: "pnada", base: Path::new("/nowhere"), ..RobotSource::default() }
            .load()
            .unwrap_err();
    assert!(matches!(*error.source, LoadError::NotFound { .. }));
    assert!(
        error.to_string().starts_with("robot `left`: robot \"pnada\" is neither in the catalogue"),
        "{error}"
    );
    assert!(error.to_string().ends_with("(did you mean \"panda\"?)"), "{error}");
}
