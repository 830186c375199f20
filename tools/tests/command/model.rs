//! `motorium model` on small networks.

use motorium_models::inference::Unary;
use motorium_models::onnx;
use motorium_models::safetensors::{self, Tensor, Tensors};

use crate::program::{json, printed, run};

#[test]
fn a_network_gives_its_outputs_for_inputs_in_json() {
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
    network(8);
    let found = error(&[]);
    assert!(found.contains("the first input is [1, 8], expected 7 numbers in a row"), "{found}");
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
fn a_file_of_mjlab_becomes_a_policy_folder() {
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
    assert!(found.contains("the observation terms have 18 numbers, the network reads 9"), "{found}");
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
