//! Policies: their file, and the order of joints.

use super::{Policy, PolicyError};

const TEXT: &str = r#"
network = "policy.onnx"
rate = 50.0
observations = [
    { term = "base_angular_velocity", scale = 0.25 },
    { term = "joint_positions", history = 3 },
    { term = "height_scan", rays = 9 },
]
[action]
joints = ["a", "b", "c", "d"]
scale = [0.5, 1.0, 1.5, 2.0]
offset = 0.1
default_pose = [0.0, 0.2, 0.4, 0.6]
clip = [-1.0, 1.0]
"#;

#[test]
fn permuted_robots_get_the_same_motion() {
    let policy = Policy::parse(TEXT).expect("a policy");
    let action = [0.3, -0.8, 5.0, -0.1];
    let expected = [("a", 0.25), ("b", -0.5), ("c", 2.0), ("d", 0.5)];
    let mut names = ["a", "x", "b", "c", "y", "d"];
    let mut seed = 1_u32;
    for _ in 0..1000 {
        for k in (1..names.len()).rev() {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            names.swap(k, (seed >> 8) as usize % (k + 1));
        }
        let mut q = [7.0; 6];
        policy.joint_targets(&names).expect("all joints").apply(&action, &mut q);
        for (name, q) in names.iter().zip(q) {
            let target = expected.iter().find(|(joint, _)| joint == name).map_or(7.0, |(_, target)| *target);
            assert!((q - target).abs() < 1e-12, "{name}: {q} {target}");
        }
    }
}

#[test]
fn a_missing_joint_is_named() {
    let policy = Policy::parse(TEXT).expect("a policy");
    let error = policy.joint_targets(&["a", "c", "d"]).expect_err("no b");
    assert!(error.to_string().starts_with("the robot has no joint \"b\"; its joints are a, c, d"), "{error}");
}

#[test]
fn mistakes_are_named_with_their_place() {
    for (from, to, message) in [
        ("rate = 50.0", "rate = 0.0", "`rate`: found 0, expected a rate above 0 Hz"),
        ("rate = 50.0", "rates = 50.0", "line 3, column 1: unknown field `rates`"),
        ("0.2, 0.4", "0.2", "`action.default_pose`: found 3 numbers, expected 4"),
        ("\"b\", \"c\"", "\"b\", \"b\"", "`action.joints`: found \"b\" twice"),
        ("1.5, 2.0", "1.5", "`action.scale`: found 3 numbers, expected 1 or 4"),
        ("history = 3", "history = 0", "`observations[1].history`: found 0, expected 1 to 64"),
        (", rays = 9", "", "`observations[2].rays`: missing"),
        ("[-1.0, 1.0]", "[1.0, -1.0]", "`action.clip`"),
        ("offset = 0.1", "offset = nan", "`action.offset`: found NaN, expected finite numbers"),
        ("joint_positions", "joint_places", "line 6, column 14: unknown variant `joint_places`"),
    ] {
        assert!(TEXT.contains(from), "{from}");
        let error = Policy::parse(&TEXT.replace(from, to)).expect_err(to);
        assert!(error.to_string().starts_with(message), "{error}");
        assert!(!matches!(error, PolicyError::Joints { .. }));
    }
}
