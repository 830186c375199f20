//! `motorium model` on small networks.

use motorium_models::inference::Unary;
use motorium_models::onnx;
use motorium_models::safetensors::{self, Tensor, Tensors};

use crate::program::{complaint, json, printed, run};

#[test]
fn network_computes_outputs_for_json_inputs() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str, content: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, content).expect("the folder takes files");
        path.to_str().expect("a plain path").to_owned()
    };
    let layers = [(vec![1.0, 0.0, 0.0, -1.0], vec![0.0, 0.5]), (vec![1.0, 2.0], vec![0.25])];
    let network = file("policy.onnx", &onnx::write_mlp(2, &layers, Unary::Relu, &[]));
    let report = |inputs: &str| {
        let inputs = file("in.json", inputs.as_bytes());
        json(&["model", "eval", &network, "--inputs", &inputs, "--json"])
    };
    assert_eq!(report(r#"{"obs": [[3.0, 0.25]]}"#)["outputs"], serde_json::json!([[3.75]]));
    assert_eq!(report(r#"{"obs": [3.0, 0.25]}"#)["outputs"], serde_json::json!([[3.75]]));
    let both = report(r#"{"inputs": [[[3.0, 0.25], [0.0, 0.0]]]}"#);
    assert_eq!(both["outputs"], serde_json::json!([[3.75, 1.25]]));
    assert_eq!((&both["names"][0], &both["shapes"][0]), (&"actions".into(), &serde_json::json!([2, 1])));
    for (inputs, message) in [
        (r#"{"obs": [[1.0]]}"#, "input \"obs\": shape [1, 1], expected [rows, 2]"),
        (r#"{"observation": [[1.0, 2.0]]}"#, "input \"observation\" is unknown, expected obs"),
        (r#"{"obs": [[1.0, 2.0], [3.0]]}"#, "a list of 1 numbers beside lists of 2"),
        (r#"{"obs": [[1.0, "x"]]}"#, "found `\"x\"`"),
    ] {
        let inputs = file("in.json", inputs.as_bytes());
        let output = run(&["model", "eval", &network, "--inputs", &inputs]);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(1) && errors.contains(message), "{errors}");
    }
}

#[test]
fn a_policy_is_checked_against_a_robot() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().to_str().expect("a plain path");
    let write = |name: &str, content: &[u8]| {
        std::fs::write(folder.path().join(name), content).expect("the folder takes files");
    };
    let text = r#"
network = "policy.onnx"
rate = 50.0
robot = "ur5e"
observations = [{ term = "joint_positions", history = 2 }, { term = "command" }]
[action]
joints = ["elbow_joint", "shoulder_pan_joint"]
scale = [0.25, 0.5]
default_pose = [1.0, 0.0]
"#;
    write("policy.toml", text.as_bytes());
    let network = |inputs: usize| {
        let layers = [(vec![0.1; 2 * inputs], vec![0.0, 0.5])];
        write("policy.onnx", &onnx::write_mlp(inputs, &layers, Unary::Tanh, &[]));
    };
    network(7);
    let report = json(&["model", "check", path, "--json"]);
    assert_eq!(report["inputs"], 7);
    assert_eq!(report["terms"][1]["first"], 4);
    assert_eq!(report["terms"][1]["message"], "motorium.TwistTarget");
    assert_eq!(report["joints"][0]["name"], "elbow_joint");
    assert_eq!(
        (&report["joints"][0]["robot_index"], &report["joints"][1]["robot_index"]),
        (&2.into(), &0.into())
    );
    let error = |arguments: &[&str]| {
        let mut all = vec!["model", "check", path];
        all.extend(arguments);
        let output = run(&all);
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let found = error(&["--robot", "panda"]);
    assert!(found.contains("the robot has no joint \"elbow_joint\", \"shoulder_pan_joint\""), "{found}");
    let point = "{ term = \"point_position\", points = [\"ball\"] }";
    write("policy.toml", text.replace("{ term = \"command\" }", point).as_bytes());
    let found = error(&[]);
    assert!(found.contains("point \"ball\" is not a link of the robot"), "{found}");
    write("policy.toml", text.as_bytes());
    network(8);
    let found = error(&[]);
    assert!(found.contains("the first input has the shape [1, 8], expected one row of 7 numbers"), "{found}");
    write("policy.toml", text.replace("rate", "rates").as_bytes());
    let found = error(&[]);
    assert!(found.contains("line 3, column 1: unknown field `rates`"), "{found}");
}

#[test]
fn kinds_of_models_are_listed_with_their_properties() {
    let classes = json(&["model", "list", "--json"]);
    let find = |name: &str| {
        let found = classes.as_array().into_iter().flatten().find(|class| class["name"] == name);
        found.unwrap_or_else(|| panic!("no {name} in {classes}")).clone()
    };
    let (process, movement) = (find("gaussian process"), find("dynamic movement primitive"));
    assert_eq!((&process["parameters"], &process["probabilistic"]), (&"data".into(), &true.into()));
    assert_eq!((&movement["scope"], &movement["data"]), (&"trajectory".into(), &"one".into()));
    let table = printed(&["model", "list"]);
    assert_eq!(table.lines().count(), classes.as_array().map_or(0, Vec::len) + 1);
    assert!(table.lines().all(|line| line.chars().count() <= 120), "{table}");
}

#[test]
fn mjlab_file_becomes_a_policy_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let metadata = [
        ("joint_names", "elbow_joint,shoulder_pan_joint"),
        ("default_joint_pos", "1.000,0.000"),
        ("joint_stiffness", "20.000,30.000"),
        ("joint_damping", "0.500,0.600"),
        ("action_scale", "0.250,0.500"),
        ("observation_names", "joint_pos,joint_vel,actions,command"),
    ];
    let layers = [(vec![0.1; 18], vec![0.0, 0.5])];
    std::fs::write(path("net.onnx"), onnx::write_mlp(9, &layers, Unary::Elu(1.0), &metadata))
        .expect("a file");
    let (file, policy) = (path("net.onnx"), path("policy"));
    let imported = run(&["model", "import", &file, "--output", &policy, "--robot", "ur5e"]);
    assert!(imported.status.success(), "{}", String::from_utf8_lossy(&imported.stderr));
    let report = json(&["model", "check", &policy, "--json"]);
    assert_eq!(
        (&report["robot"], &report["inputs"], &report["rate_hz"]),
        (&"ur5e".into(), &9.into(), &50.0.into())
    );
    assert_eq!(report["joints"][1]["name"], "shoulder_pan_joint");
    assert_eq!(report["joints"][1]["scale"], 0.5);
    let error = |arguments: &[&str]| {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    assert!(error(&["model", "import", &file, "--output", &policy]).contains("policy.toml exists"));
    let other = path("other");
    let found = error(&["model", "import", &file, "--output", &other, "--robot", "panda"]);
    assert!(found.contains("the robot has no joint \"elbow_joint\""), "{found}");
    let found = error(&["model", "import", &file, "--output", &other, "--history", "2"]);
    assert!(found.contains("the observation terms have 18 numbers, but the network reads 9"), "{found}");
    assert!(!std::fs::exists(&other).expect("readable"), "nothing is written");
}

#[test]
fn weights_and_a_table_become_a_policy_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let mut file = Tensors::default();
    for (name, shape, values) in [("0.weight", vec![1, 2], vec![2.0, -1.0]), ("0.bias", vec![1], vec![0.5])] {
        file.tensors.insert(name.to_owned(), Tensor { shape, values });
    }
    let bytes = safetensors::write(&file).expect("tensors");
    std::fs::write(path("actor.safetensors"), bytes).expect("a file");
    let table = "rate = 50.0\nobservations = [{ term = \"joint_positions\" }, { term = \"last_action\" }]\n\
                 action = { joints = [\"elbow_joint\"], default_pose = [1.0] }\n\
                 weights = { layers = [\"0\"], activation = \"elu\" }\n";
    std::fs::write(path("table.toml"), table).expect("a file");
    let (weights, table, policy) = (path("actor.safetensors"), path("table.toml"), path("policy"));
    let output = run(&["model", "import", &weights, "--output", &policy]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("`--table`"));
    let output = run(&["model", "import", &weights, "--table", &table, "--output", &policy]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(json(&["model", "check", &policy, "--robot", "ur5e", "--json"])["inputs"], 2);
    std::fs::write(path("in.json"), r#"{"obs": [[0.25, 1.0]]}"#).expect("a file");
    let (network, inputs) = (format!("{policy}/policy.onnx"), path("in.json"));
    let report = json(&["model", "eval", &network, "--inputs", &inputs, "--json"]);
    assert_eq!(report["outputs"], serde_json::json!([[0.0]]));
}

/// A file of the folder `fixtures`.
fn fixture(name: &str) -> String {
    format!("{}/../fixtures/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// The numbers of an output of a network.
fn evaluated(folder: &std::path::Path, network: &str, inputs: &serde_json::Value) -> Vec<f64> {
    let file = folder.join("in.json");
    std::fs::write(&file, inputs.to_string()).expect("a file");
    let report =
        json(&["model", "eval", network, "--inputs", file.to_str().expect("a plain path"), "--json"]);
    let numbers = report["outputs"][0].as_array().expect("an output").iter();
    numbers.map(|number| number.as_f64().expect("a number")).collect()
}

#[test]
fn a_leapp_bundle_becomes_a_policy_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let (bundle, environment, policy) = (fixture("leapp"), fixture("isaac-lab/env.yaml"), path("policy"));
    printed(&[
        "model",
        "import",
        &bundle,
        "--env",
        &environment,
        "--robot",
        "quadruped",
        "--output",
        &policy,
    ]);
    let report = json(&["model", "check", &policy, "--json"]);
    assert_eq!((&report["inputs"], &report["rate_hz"]), (&33.into(), &50.0.into()));
    let terms: Vec<_> = report["terms"].as_array().expect("terms").iter().map(|term| &term["term"]).collect();
    let expected =
        ["base_angular_velocity", "projected_gravity", "command", "joint_positions", "joint_velocities"];
    assert_eq!(terms, expected);
    // the second action is the hip roll of the left hind leg; its default pose is in env.yaml
    assert_eq!(report["joints"][1]["name"], "hind_left_hip_roll");
    assert_eq!(
        (&report["joints"][8]["name"], &report["joints"][8]["default"]),
        (&"front_left_knee".into(), &(-1.6).into())
    );
    let text = std::fs::read_to_string(path("policy/policy.toml")).expect("a file");
    assert!(text.contains("kp = 25.0") && text.contains("kd = 0.5"), "{text}");
    // the same targets from both networks, for a base that pitches by 0.4 rad
    let (sin, cos) = 0.2_f64.sin_cos();
    let (gravity, orientation) = ([0.4_f64.sin(), 0.0, -(0.4_f64.cos())], [0.0, sin, 0.0, cos]);
    let pose: Vec<f64> = report["joints"]
        .as_array()
        .expect("joints")
        .iter()
        .map(|joint| joint["default"].as_f64().expect("a number"))
        .collect();
    let series = |first: f64| (0..12).map(|k| 0.1 * (first + f64::from(k)).sin()).collect::<Vec<f64>>();
    let (rate, command, relative, velocities, last) =
        ([0.3, -0.2, 0.1], [0.5, 0.0, -0.4], series(0.0), series(5.0), series(9.0));
    let positions: Vec<f64> = relative.iter().zip(&pose).map(|(relative, pose)| relative + pose).collect();
    let expected = evaluated(
        folder.path(),
        &fixture("leapp/quadruped.onnx"),
        &serde_json::json!({
            "robot_root_ang_vel_b": [rate], "robot_root_quat_w": [orientation], "base_velocity": [command],
            "robot_joint_pos": [positions], "robot_joint_vel": [velocities], "last_action_in": [last],
        }),
    );
    let observation = [&rate[..], &gravity, &command, &relative, &velocities].concat();
    let inputs = serde_json::json!({ "obs": [observation], "last_action_in": [last] });
    let found = evaluated(folder.path(), &path("policy/policy.onnx"), &inputs);
    for ((found, pose), expected) in found.iter().zip(&pose).zip(&expected) {
        assert!((found + pose - expected).abs() < 1e-5, "{found} + {pose}, {expected}");
    }
}

#[test]
fn files_of_isaac_lab_become_a_policy_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let [network, descriptors, environment] =
        ["policy.onnx", "IO_descriptors.yaml", "env.yaml"].map(|name| fixture(&format!("isaac-lab/{name}")));
    let policy = path("policy");
    let arguments = ["model", "import", &network, "--descriptors", &descriptors, "--output", &policy];
    let found = complaint(&arguments);
    assert!(found.contains("the stiffness of joint \"front_left_hip_roll\" is unknown"), "{found}");
    printed(&[&arguments[..], &["--env", &environment, "--robot", "quadruped"]].concat());
    let report = json(&["model", "check", &policy, "--json"]);
    assert_eq!((&report["inputs"], &report["rate_hz"]), (&72.into(), &50.0.into()));
    assert_eq!(
        (&report["terms"][4]["term"], &report["terms"][4]["history"]),
        (&"joint_positions".into(), &3.into())
    );
    let joint = &report["joints"][5];
    assert_eq!(
        (&joint["name"], &joint["default"], &joint["scale"]),
        (&"hind_left_hip_pitch".into(), &(-0.8).into(), &0.25.into())
    );
    let text = std::fs::read_to_string(path("policy/policy.toml")).expect("a file");
    let policy = motorium_models::policy::Policy::parse(&text).expect("a policy");
    assert_eq!(policy.action.kp, Some(motorium_models::policy::Numbers::All(25.0)));
    // hips 0.5, knees 0.7
    let damping = policy.action.kd.expect("damping");
    assert_eq!([damping.get(0), damping.get(7), damping.get(8)], [0.5, 0.5, 0.7]);
    assert_eq!(policy.observations[5].clip, Some([-20.0, 20.0]));
}

#[test]
fn mistakes_in_yaml_have_a_line_and_a_column() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let (network, output) = (fixture("isaac-lab/policy.onnx"), path("policy"));
    let changed = |file: &str, from: &str, to: &str| {
        let text = std::fs::read_to_string(fixture(file)).expect("a file");
        assert!(text.contains(from), "{from}");
        std::fs::write(path("changed.yaml"), text.replacen(from, to, 1)).expect("a file");
    };
    let (file, environment) = (path("changed.yaml"), fixture("isaac-lab/env.yaml"));
    let descriptors = |from: &str, to: &str| {
        changed("isaac-lab/IO_descriptors.yaml", from, to);
        complaint(&[
            "model",
            "import",
            &network,
            "--descriptors",
            &file,
            "--env",
            &environment,
            "--output",
            &output,
        ])
    };
    for (from, to, parts) in [
        ("  scale: 0.25", "  scale: quarter", &["line ", "column 10: ", "expected a number"][..]),
        ("decimation: 4", "decimations: 4", &["line ", "missing field `decimation`"]),
        (
            "observations.joint_vel_rel",
            "observations.joint_effort",
            &[
                "line ",
                "column 16: observation \"joint_effort\" is not supported, expected one of base_lin_vel",
            ],
        ),
        (
            "joint_actions.JointPositionAction",
            "JointPositionToLimitsAction",
            &["line 8, column 14: action \"JointPositionToLimitsAction\""],
        ),
        (
            "physics_dt: 0.005",
            "physics_dt: 0.002",
            &["`scene.dt`: found a period of 0.02 s and 4 time steps of 0.002 s"],
        ),
        ("actions:", "actions: [", &["line "]),
    ] {
        let found = descriptors(from, to);
        assert!(
            found.contains("changed.yaml") && parts.iter().all(|part| found.contains(part)),
            "{to}: {found}"
        );
    }
    let given = fixture("isaac-lab/IO_descriptors.yaml");
    for (from, to, part) in [
        ("decimation: 4", "decimation: 8", "`decimation`: found 25 Hz, expected 50 Hz"),
        (".*_hip_(roll|pitch)", ".*_hip_(roll|pitch", "found `(` without `)`"),
        ("stiffness: 25.0", "stiffness: null", "the stiffness of joint"),
        ("hind_.*_knee: 1.6", "hind_.*_knee: 1.5", "has 1.6 in the descriptors and 1.5 in env.yaml"),
    ] {
        changed("isaac-lab/env.yaml", from, to);
        let found = complaint(&[
            "model",
            "import",
            &network,
            "--descriptors",
            &given,
            "--env",
            &file,
            "--output",
            &output,
        ]);
        assert!(found.contains(part), "{to}: {found}");
        // a missing gain has no single faulty entry
        let is_named = found.contains("changed.yaml: line ");
        assert_eq!(is_named, !part.contains("stiffness") && !part.contains("descriptors"), "{found}");
    }
    for name in ["quadruped.onnx", "quadruped_initial_values.safetensors"] {
        std::fs::copy(fixture(&format!("leapp/{name}")), folder.path().join(name)).expect("a copy");
    }
    for (from, to, part) in [
        (
            "state:robot:root_ang_vel_b",
            "state:contact:net_forces_w",
            "line 4, column 13: observation \"robot_root_ang_vel_b\" is not supported",
        ),
        ("backend: onnx", "backend: jit", "help: export with `--export_method onnx-dynamo`"),
        (
            "kind: target/joint/position",
            "kind: target/body/position",
            "action \"joint_pos\" is not supported",
        ),
        ("quadruped/last_action_in]", "quadruped/action_in]", "found \"quadruped/action_in\""),
        ("[[qx, qy, qz, qw]]", "[[a, b, c, d]]", "expected qx, qy, qz and qw"),
        ("sha256sum: d9fc", "sha256sum: d9fd", "quadruped.onnx has the SHA-256 d9fc"),
    ] {
        changed("leapp/quadruped.yaml", from, to);
        let found = complaint(&["model", "import", &file, "--env", &environment, "--output", &output]);
        assert!(found.contains(part), "{to}: {found}");
    }
    let found = complaint(&["model", "import", &fixture("leapp"), "--output", &output]);
    assert!(found.contains("no default pose, expected `--env env.yaml`"), "{found}");
    assert!(!std::fs::exists(&output).expect("readable"), "nothing is written");
}

#[test]
fn mjlab_height_scans_are_supported() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let metadata = [
        ("joint_names", "elbow_joint"),
        ("default_joint_pos", "1.000"),
        ("joint_stiffness", "20.000"),
        ("joint_damping", "0.500"),
        ("action_scale", "0.250"),
        ("observation_names", "height_scan"),
    ];
    // the sum of 1 x, 2 x and so on: mjlab orders the points from the right, each column from the back
    let layers = [((1..=6).map(|k| k as f32).collect(), vec![0.0])];
    std::fs::write(path("net.onnx"), onnx::write_mlp(6, &layers, Unary::Elu(1.0), &metadata))
        .expect("a file");
    let (file, policy) = (path("net.onnx"), path("policy"));
    let import = ["model", "import", &file, "--output", &policy];
    assert!(complaint(&import).contains("`--height-scale`"));
    let scaled = [&import[..], &["--height-scale", "0.5"]].concat();
    assert!(complaint(&scaled).contains("the height scan has 6 points"));
    printed(&[&scaled[..], &["--height-points", "3,2", "--height-offset", "0.25"]].concat());
    let report = json(&["model", "check", &policy, "--robot", "ur5e", "--json"]);
    assert_eq!((&report["terms"][0]["term"], &report["inputs"]), (&"height_scan".into(), &6.into()));
    assert_eq!(report["equals_trained"], serde_json::Value::Null);
    // rows of motorium from the back, each from right to left, times the scale of policy.toml
    let heights = [-0.5, -0.75, -1.0, -1.25, -1.5, -1.75];
    let inputs = serde_json::json!({ "obs_": [heights.map(|height| -0.5 * height)] });
    let found = evaluated(folder.path(), &path("policy/policy.onnx"), &inputs);
    let above = |height: f64| 0.5 * (-height - 0.25);
    let ordered = [0, 2, 4, 1, 3, 5].map(|index| above(heights[index]));
    let expected: f64 = ordered.iter().zip(1..).map(|(value, factor)| value * f64::from(factor)).sum();
    assert!((found[0] - expected).abs() < 1e-5, "{found:?} {expected}");
}

#[test]
fn robots_are_compared_with_the_digest() {
    let folder = tempfile::tempdir().expect("a folder");
    let policy = folder.path().join("go1").to_str().expect("a plain path").to_owned();
    printed(&["model", "import", &fixture("mjlab-go1.onnx"), "--output", &policy, "--robot", "quadruped"]);
    let report = json(&["model", "check", &policy, "--json"]);
    assert_eq!(report["equals_trained"], true);
    let file = folder.path().join("go1/policy.toml");
    let text = std::fs::read_to_string(&file).expect("a policy");
    let digest = |name: &str| report["robot_digest"][name].as_str().expect("a digest").to_owned();
    let other = "0123456789abcdef";
    std::fs::write(&file, text.replace(&digest("dynamics"), other)).expect("written");
    let output = run(&["model", "check", &policy, "--json"]);
    assert!(output.status.success());
    let warning = String::from_utf8_lossy(&output.stderr);
    assert!(warning.contains("masses, drives or gains of quadruped differ"), "{warning}");
    std::fs::write(&file, text.replace(&digest("joints"), other)).expect("written");
    let found = complaint(&["model", "check", &policy]);
    assert!(found.contains("joint axes or limits of quadruped differ"), "{found}");
}

#[test]
fn mjlab_file_fits_the_quadruped() {
    let folder = tempfile::tempdir().expect("a folder");
    let policy = folder.path().join("go1").to_str().expect("a plain path").to_owned();
    printed(&["model", "import", &fixture("mjlab-go1.onnx"), "--output", &policy]);
    let report = json(&["model", "check", &policy, "--robot", "quadruped", "--json"]);
    assert_eq!((&report["inputs"], &report["joints"][1]["policy_index"]), (&45.into(), &1.into()));
    assert_eq!(report["joints"][1]["name"], "hind_left_hip_roll");
    assert_ne!(report["joints"][1]["robot_index"], 1, "the robot has another order");
}
