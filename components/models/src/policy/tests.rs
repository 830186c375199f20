//! Tests of policies: their file, joint order, and networks.

use super::{
    Assembly, NetworkMismatch, Numbers, Observation, Policy, PolicyError, PolicyNetwork, RobotDigest, Term,
};
use crate::inference::Unary;
use crate::onnx::{GruLayer, Model, write_gru, write_mlp};

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
    let message = "the robot has no joint \"b\"; its joints are a, c, d".to_owned();
    assert_eq!(error, PolicyError::Joints { message });
}

#[test]
fn mistakes_are_reported_with_their_position() {
    let error = |from: &str, to: &str| {
        assert!(TEXT.contains(from), "{from}");
        Policy::parse(&TEXT.replace(from, to)).expect_err(to)
    };
    for (from, to, expected) in [
        ("rate = 50.0", "rate = 0.0", "rate"),
        ("0.2, 0.4", "0.2", "action.default_pose"),
        ("\"b\", \"c\"", "\"b\", \"b\"", "action.joints"),
        ("1.5, 2.0", "1.5", "action.scale"),
        ("history = 3", "history = 0", "observations[1].history"),
        (", rays = 9", "", "observations[2].rays"),
        ("[-1.0, 1.0]", "[1.0, -1.0]", "action.clip"),
        ("offset = 0.1", "offset = nan", "action.offset"),
    ] {
        match error(from, to) {
            PolicyError::Value { key, .. } => assert_eq!(key, expected),
            other => panic!("{to}: {other:?}"),
        }
    }
    for (from, to, place) in
        [("rate = 50.0", "rates = 50.0", (3, 1)), ("joint_positions", "joint_places", (6, 14))]
    {
        match error(from, to) {
            PolicyError::Parse { line, column, .. } => assert_eq!((line, column), place),
            other => panic!("{to}: {other:?}"),
        }
    }
}

#[test]
fn mistakes_in_images_are_named() {
    let image = "{ term = \"depth_image\", camera = \"front\", pixels = [4, 3], range = [0.1, 2.0] }";
    let text = TEXT.replace("{ term = \"height_scan\", rays = 9 }", image);
    assert_eq!(Policy::parse(&text).expect("a policy").inputs(), Ok(27));
    let twice = format!("{image}, {image}");
    for (from, to, expected) in [
        (", camera = \"front\"", "", "observations[2].camera"),
        ("\"front\"", "\"Front eye\"", "observations[2].camera"),
        (image, &twice, "observations[3].camera"),
        (", pixels = [4, 3]", "", "observations[2].pixels"),
        ("[4, 3]", "[4, 1025]", "observations[2].pixels"),
        (", range = [0.1, 2.0]", "", "observations[2].range"),
        ("[0.1, 2.0]", "[2.0, 0.1]", "observations[2].range"),
        ("[0.1, 2.0]", "[-0.1, 2.0]", "observations[2].range"),
        ("[0.1, 2.0]", "[0.1, inf]", "observations[2].range"),
        ("depth_image", "grey_image", "observations[2].range"),
        ("history = 3", "camera = \"front\"", "observations[1].camera"),
        ("history = 3", "pixels = [4, 3]", "observations[1].pixels"),
        ("history = 3", "range = [0.1, 2.0]", "observations[1].range"),
    ] {
        assert!(text.contains(from), "{from}");
        match Policy::parse(&text.replacen(from, to, 1)).expect_err(to) {
            PolicyError::Value { key, .. } => assert_eq!(key, expected, "{to}"),
            other => panic!("{to}: {other:?}"),
        }
    }
}

const ROVER: &str = r#"
network = "policy.onnx"
rate = 25.0
observations = [{ term = "command" }, { term = "last_action" }]
[action]
kind = "base_twist"
twist = { turn = [-1.5, 0.5], forward = [-0.1, 0.3] }
"#;

#[test]
fn base_twists_have_an_output_for_each_range() {
    let policy = Policy::parse(ROVER).expect("a policy");
    assert_eq!((policy.outputs(), policy.inputs()), (2, Ok(5)));
    assert_eq!(policy.action.bounds(), Some([-1.0, 1.0]));
    assert_eq!(policy.joint_targets(&["wheel"]).map(|targets| targets.targets().len()), Ok(0));
    let text = policy.to_toml().expect("a file");
    assert_eq!(Policy::parse(&text), Ok(policy), "{text}");
}

#[test]
fn mistakes_in_base_twists_are_named() {
    let key = |text: String| match Policy::parse(&text) {
        Err(PolicyError::Value { key, .. }) => key,
        other => panic!("{other:?}"),
    };
    for (from, to, expected) in [
        ("turn = [-1.5, 0.5]", "turn = [0.5, -1.5]", "action.twist.turn"),
        ("turn = [-1.5, 0.5], forward = [-0.1, 0.3]", "", "action.twist"),
        ("twist =", "clip = [-1.0, 1.0]\ntwist =", "action.clip"),
        ("twist =", "joints = [\"wheel\"]\ntwist =", "action.joints"),
        ("twist =", "scale = 2.0\ntwist =", "action.scale"),
        ("kind = \"base_twist\"", "joints = [\"wheel\"]\ndefault_pose = [0.0]", "action.twist"),
        ("twist = { turn = [-1.5, 0.5], forward = [-0.1, 0.3] }", "", "action.twist"),
        ("\"command\"", "\"joint_velocities\"", "observations[0].term"),
    ] {
        assert!(ROVER.contains(from), "{from}");
        assert_eq!(key(ROVER.replace(from, to)), expected, "{to}");
    }
    assert_eq!(key(ROVER.replace("kind = \"base_twist\"", "").replace("twist", "# twist")), "action.joints");
}

#[test]
fn digests_of_robots_are_hexadecimal() {
    let digest = |joints: &str| {
        Policy::parse(&format!("{TEXT}\n[robot_digest]\njoints = {joints}\ndynamics = \"00000000000000ff\""))
    };
    let policy = digest("\"0123456789abcdef\"").expect("a policy");
    let expected = RobotDigest { joints: 0x0123_4567_89ab_cdef, dynamics: 255 };
    assert_eq!(policy.robot_digest, Some(expected));
    let text = policy.to_toml().expect("a file");
    assert!(text.contains("00000000000000ff"), "{text}");
    assert_eq!(Policy::parse(&text), Ok(policy));
    for joints in ["\"0123456789abcde\"", "\"+123456789abcdef\"", "7"] {
        assert!(matches!(digest(joints), Err(PolicyError::Parse { .. })), "{joints}");
    }
}

fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
}

fn shuffle<T>(values: &mut [T], state: &mut u64) {
    for k in (1..values.len()).rev() {
        values.swap(k, ((random(state) + 1.0) * 0.5 * (k + 1) as f64) as usize % (k + 1));
    }
}

/// Targets of a robot's joints after one observation.
fn motion(policy: &Policy, network: &mut PolicyNetwork, names: &[&str], q: &[f64]) -> Vec<f64> {
    let targets = policy.joint_targets(names).expect("all joints");
    let relative: Vec<f64> = targets
        .targets()
        .iter()
        .zip(&policy.action.default_pose)
        .map(|(target, default)| q[target.joint] - default)
        .collect();
    let mut assembly = Assembly::new(policy);
    assembly.push(0, &relative);
    assembly.write(network.observation_mut());
    let action: Vec<f64> = network.run().iter().map(|output| f64::from(*output)).collect();
    let mut joints = q.to_vec();
    targets.apply(&action, &mut joints);
    joints
}

#[test]
fn permuted_policies_give_the_same_motion_or_an_error() {
    let names = ["a", "b", "c", "d", "e", "f"];
    let count = names.len();
    let mut state = 5;
    let mut numbers = |count: usize| (0..count).map(|_| random(&mut state)).collect::<Vec<f64>>();
    let (weights, bias, scale, pose, q) =
        (numbers(count * count), numbers(count), numbers(count), numbers(count), numbers(count));
    let policy = |order: &[usize]| {
        let pick = |values: &[f64]| order.iter().map(|index| values[*index]).collect::<Vec<f64>>();
        let mut policy = Policy::parse(TEXT).expect("a policy");
        policy.observations = vec![Observation::new(Term::JointPositions)];
        policy.action.joints = order.iter().map(|index| names[*index].to_owned()).collect();
        policy.action.scale = Numbers::Each(pick(&scale));
        policy.action.default_pose = pick(&pose);
        let rows = order.iter().flat_map(|row| {
            let weights = &weights;
            order.iter().map(move |column| weights[row * count + column] as f32)
        });
        let layer = (rows.collect(), pick(&bias).iter().map(|bias| *bias as f32).collect());
        let bytes = write_mlp(count, &[layer], Unary::Relu, &[]);
        let program = Model::read(&bytes).and_then(|model| model.program(1)).expect("a network");
        let network = PolicyNetwork::new(&policy, program).expect("it fits");
        (policy, network)
    };
    let mut order: Vec<usize> = (0..count).collect();
    let (straight, mut network) = policy(&order);
    let expected = motion(&straight, &mut network, &names, &q);
    let mut state = 9;
    for round in 0..1000 {
        shuffle(&mut order, &mut state);
        let (mut permuted, mut network) = policy(&order);
        let found = motion(&permuted, &mut network, &names, &q);
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-5, "{order:?}: {found} {expected}");
        }
        permuted.action.joints[round % count] = "g".to_owned();
        assert!(matches!(permuted.joint_targets(&names), Err(PolicyError::Joints { .. })));
    }
}

#[test]
fn recurrent_states_carry_over_and_reset() {
    let gru = GruLayer {
        inputs: 3,
        hidden: 4,
        input_weights: (0..36).map(|k| (k as f32 * 0.37).sin()).collect(),
        state_weights: (0..48).map(|k| (k as f32 * 0.71).cos()).collect(),
        bias: vec![0.1; 24],
    };
    let bytes = write_gru(&gru, &[(vec![0.5; 16], vec![0.0; 4])], Unary::Tanh, &[]);
    let program = Model::read(&bytes).and_then(|model| model.program(1)).expect("a network");
    let mut policy = Policy::parse(TEXT).expect("a policy");
    policy.observations = vec![Observation::new(Term::Command)];
    let mut network = PolicyNetwork::new(&policy, program.clone()).expect("it fits");
    let run = |network: &mut PolicyNetwork| {
        network.observation_mut().copy_from_slice(&[0.3, -0.2, 0.9]);
        network.run().to_vec()
    };
    let (first, second) = (run(&mut network), run(&mut network));
    assert_ne!(first, second, "the state counts");
    network.reset();
    assert_eq!((run(&mut network), run(&mut network)), (first.clone(), second));
    policy.initial_states = vec![vec![0.0, 0.5, -0.5, 1.0]];
    let text = policy.to_toml().expect("text");
    assert_eq!(Policy::parse(&text).as_ref(), Ok(&policy), "{text}");
    let mut network = PolicyNetwork::new(&policy, program.clone()).expect("it fits");
    let other = run(&mut network);
    assert_ne!(other, first, "the initial state counts");
    network.reset();
    assert_eq!(run(&mut network), other);
    policy.initial_states = vec![vec![0.0; 3]];
    let error = PolicyNetwork::new(&policy, program.clone()).expect_err("three numbers");
    assert_eq!(error, NetworkMismatch::InitialStates { found: vec![3], expected: vec![4] });
    policy.observations = vec![Observation::new(Term::Phase)];
    let error = PolicyNetwork::new(&policy, program).expect_err("another width");
    assert_eq!(error, NetworkMismatch::Inputs { found: vec![1, 3], expected: 2 });
}

const WALK: &str = r#"
network = "policy.onnx"
rate = 10.0
observations = [{ term = "joint_positions" }, { term = "last_action" }]
[action]
joints = ["left", "right"]
default_pose = [0.0, 0.0]
clip = [-2.0, 2.0]
[pattern]
gait = "walk"
frequency = [1.0, 3.0]
amplitude = [0.0, 1.5]
legs = [[{ joint = "left", amplitude = 0.1 }], [{ joint = "right", amplitude = 0.1, phase = 1.0 }]]
"#;

#[test]
fn patterns_add_two_outputs() {
    let policy = Policy::parse(WALK).expect("a policy");
    assert_eq!((policy.outputs(), policy.inputs()), (4, Ok(6)));
    let pattern = policy.pattern.as_ref().expect("a pattern");
    assert_eq!(pattern.parameters([-2.0, 2.0], [-2.0, 2.0]), [1.0, 1.5]);
    assert_eq!(pattern.parameters([0.0, 0.0], [-2.0, 2.0]), [2.0, 0.75]);
    assert_eq!(Policy::parse(&policy.to_toml().expect("a file")), Ok(policy));
}

#[test]
fn mistakes_in_patterns_are_named() {
    for (from, to, expected) in [
        ("clip = [-2.0, 2.0]", "", "action.clip"),
        ("clip =", "kind = \"effort\"\nclip =", "action.kind"),
        ("frequency = [1.0, 3.0]", "frequency = [3.0, 1.0]", "pattern.frequency"),
        ("amplitude = [0.0, 1.5]", "amplitude = [0.0, 2.5]", "pattern.amplitude"),
        ("gait =", "coupling = -1.0\ngait =", "pattern.coupling"),
        ("{ joint = \"right\"", "{ joint = \"left\"", "pattern.legs"),
        ("{ joint = \"right\"", "{ joint = \"hip\"", "pattern.legs"),
    ] {
        assert!(WALK.contains(from), "{from}");
        match Policy::parse(&WALK.replace(from, to)) {
            Err(PolicyError::Value { key, .. }) => assert_eq!(key, expected),
            other => panic!("{to}: {other:?}"),
        }
    }
}
