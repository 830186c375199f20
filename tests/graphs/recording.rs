//! Recordings of whole graphs: reproduced to the last bit, read by the official Python reader, ended by a
//! full disk.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use foxglove::Decode as _;

use crate::MOTORIUM;
use crate::support::{machine, run, workspace};

pub(crate) fn motorium(arguments: &[&str]) -> Output {
    Command::new(MOTORIUM)
        .args(arguments)
        .current_dir(workspace())
        .stdin(Stdio::null())
        .output()
        .expect("motorium starts")
}

pub(crate) fn text(path: &Path) -> &str {
    path.to_str().expect("a path of text")
}

/// Records a graph in lockstep and returns its recording.
pub(crate) fn recorded(folder: &Path, graph: &str, arguments: &[&str]) -> PathBuf {
    let file = folder.join("a.mcap");
    let arguments = [&["--clock", "lockstep", "--overwrite", "--record", text(&file)], arguments].concat();
    let ended = run(&workspace().join("graphs").join(graph), &arguments);
    let result = &ended.report().results["recorder"];
    assert_eq!(result["lost"], 0, "{}", ended.stderr);
    assert_eq!(result["ended"], serde_json::Value::Null);
    file
}

pub(crate) fn verified(file: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let output = motorium(&[&["replay", text(file), "--verify"], arguments].concat());
    let said = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8_lossy(&said).into_owned())
}

#[test]
fn arm_quadruped_and_two_arms_replay_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    for graph in ["panda-reach.toml", "quadruped-trot.toml", "two-arms.toml"] {
        let file = recorded(folder.path(), graph, &["--for", "400 ms"]);
        let (code, said) = verified(&file, &[]);
        assert_eq!(code, Some(0), "{graph}: {said}");
        assert!(said.contains("are equal to the last bit"), "{said}");
    }
}

#[test]
fn a_damaged_value_is_named_with_its_topic_and_field() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = recorded(folder.path(), "panda-reach.toml", &["--for", "300 ms"]);
    let mut bytes = std::fs::read(&file).expect("readable");
    // A target is at rest at first, so many samples have the same position. One sample in the middle is
    // changed.
    let recording = motorium_bridges::recording::Recording::open(&file).expect("a recording");
    let topic = recording.topic("panda/target").expect("recorded");
    let sample = recording
        .samples()
        .map(|sample| sample.expect("readable"))
        .filter(|sample| sample.topic == topic)
        .nth(150)
        .expect("the sample exists");
    let mut message = Vec::new();
    recording.topics()[topic].derived().encode(&sample.stamp, &sample.bytes, &mut message);
    drop(recording);
    let place = bytes.windows(message.len()).position(|part| part == message).expect("it is there");
    let position = message.windows(8).position(|part| part == &sample.bytes[..8]).expect("the first number");
    bytes[place + position] ^= 1;
    std::fs::write(&file, bytes).expect("written");
    let (code, said) = verified(&file, &[]);
    assert_eq!(code, Some(1), "{said}");
    let sequence = sample.stamp.sequence;
    assert!(
        said.contains("topic `panda/target`, tick") && said.contains(&format!("sample {sequence})")),
        "{said}"
    );
    assert!(said.contains("field `position[0]`: recorded "), "{said}");
}

#[test]
fn a_controller_runs_on_the_recorded_sensors() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = recorded(folder.path(), "panda-reach.toml", &["--for", "300 ms"]);
    let output = motorium(&["replay", text(&file), "--live", "controller", "--speed", "0", "--json"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    let report: serde_json::Value =
        serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{errors}"));
    assert_eq!(report["results"]["encoder"]["published"], 300, "{errors}");
    assert_eq!(report["results"]["encoder"]["left"], 0);
    let steps = report["components"].as_array().expect("components").iter();
    let controller = steps.clone().find(|component| component["name"] == "controller").expect("it runs");
    assert_eq!(controller["steps"], 300);
    let unknown = motorium(&["replay", text(&file), "--live", "contoller"]);
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("no component `contoller`"));
}

#[test]
fn the_cost_of_a_recording_is_reported() {
    let _machine = machine();
    let graph = workspace().join("graphs/panda-reach.toml");
    let output = motorium(&["bench", "recording", text(&graph), "--turns", "2", "--for", "300 ms", "--json"]);
    let shown: serde_json::Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)));
    let times = shown["times"].as_array().expect("times");
    let names: Vec<&str> = times.iter().filter_map(|row| row["name"].as_str()).collect();
    let expected =
        ["panda/true_joint_state -> panda/joint_command", "physics", "encoder", "policy", "controller"];
    assert_eq!(names, expected);
    for row in times {
        let of = |side: &str| -> f64 {
            let turns = row["p50"][side].as_array().expect("turns");
            assert_eq!(turns.len(), 2);
            turns.iter().filter_map(serde_json::Value::as_f64).sum()
        };
        let ratio = row["p50"]["ratio"].as_f64().expect("a ratio");
        assert!((ratio - of("with_ns") / of("without_ns")).abs() < 1e-12, "{row}");
    }
}

#[test]
fn a_recording_holds_the_world_of_an_mjcf_file_in_its_colours() {
    let folder = tempfile::tempdir().expect("a folder");
    let (world, overlay) = (folder.path().join("yard.xml"), folder.path().join("yard.toml"));
    let text_of = r#"<mujoco><asset><material name="wood" rgba="0.6 0.4 0.2 1"/></asset><worldbody>
      <geom type="plane" size="0 0 1" pos="0 0 -0.5" rgba="0.1 0.6 0.2 1"/>
      <geom name="shelf" type="box" size="0.1 0.1 0.1" pos="2 0 0" material="wood"/>
      <body name="ball" pos="2 1 1"><freejoint/><geom size="0.1" rgba="0.9 0.1 0.1 1"/></body>
    </worldbody></mujoco>"#;
    std::fs::write(&world, text_of).expect("written");
    std::fs::write(&overlay, format!("[world]\nfile = {:?}\n", text(&world))).expect("written");
    let options = ["--for", "20 ms", "--no-expect", "--with", text(&overlay)];
    let file = recorded(folder.path(), "panda-reach.toml", &options);
    let recording = motorium_bridges::recording::Recording::open(&file).expect("a recording");
    let message = recording.latched("/world/scene").expect("the world");
    let scene = foxglove::messages::SceneUpdate::decode(message).expect("a scene");
    let colours = scene.entities.iter().map(|entity| {
        let cubes = entity.cubes.iter().map(|cube| cube.color);
        let color =
            cubes.chain(entity.spheres.iter().map(|sphere| sphere.color)).flatten().next().expect("a colour");
        (entity.id.as_str(), [color.r, color.g, color.b])
    });
    let colours: Vec<_> = colours.collect();
    let expected = [("shelf", [0.6, 0.4, 0.2]), ("ball", [0.9, 0.1, 0.1]), ("ground", [0.1, 0.6, 0.2])];
    assert_eq!(colours, expected);
}

/// A full disk: files of this process are limited to one megabyte, and the shared memory of a run needs less.
#[test]
fn a_full_disk_ends_the_recording_and_not_the_run() {
    let _machine = machine();
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("a.mcap");
    let script = format!(
        "trap '' XFSZ; ulimit -f 16384; exec {MOTORIUM} run graphs/panda-reach.toml --clock lockstep --hosting inline \
         --for 20s --no-expect --json --record {}",
        text(&file)
    );
    let output =
        Command::new("bash").args(["-c", &script]).current_dir(workspace()).output().expect("bash starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    let report: serde_json::Value =
        serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{errors}"));
    assert_eq!(report["exit"]["kind"], "finished", "{errors}");
    let ended = report["results"]["recorder"]["ended"].as_str().expect("a reason");
    assert!(ended.contains("too large"), "{ended}");
    let whole = folder.path().join("whole.mcap");
    let recovered = motorium(&["recover", text(&file), "--output", text(&whole)]);
    assert!(recovered.status.success(), "{}", String::from_utf8_lossy(&recovered.stderr));
    let (code, said) = verified(&whole, &[]);
    assert_eq!(code, Some(0), "{said}");
}

const READER: &str = r#"
import sys
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

counts, first, frames, attachments = {}, {}, set(), []
with open(sys.argv[1], "rb") as stream:
    reader = make_reader(stream, decoder_factories=[DecoderFactory()])
    attachments = [attachment.name for attachment in reader.iter_attachments()]
    for schema, channel, message, decoded in reader.iter_decoded_messages():
        counts[channel.topic] = counts.get(channel.topic, 0) + 1
        first.setdefault(channel.topic, (schema.name, decoded))
        if schema.name == "foxglove.FrameTransforms":
            frames.update(transform.child_frame_id for transform in decoded.transforms)
name, state = first["panda/joint_state"]
print(name, counts["panda/joint_state"], state.stamp.sequence, len(state.position), state.position[1])
name, drawn = first["panda/joint_state/joints"]
print(name, drawn.joints[1].name, drawn.joints[1].position == state.position[1])
print("panda_hand" in frames, "<robot" in first["/robot_description"][1].data)
print(first["/log"][0], "plan.json" in attachments, "panda.urdf" in attachments)
"#;

#[test]
fn the_reader_of_mcap_for_python_reads_every_sample() {
    let python = std::env::var_os("MOTORIUM_PYTHON").map_or_else(|| "python3".into(), PathBuf::from);
    let check = Command::new(&python).args(["-c", "import mcap, mcap_protobuf"]).output();
    if !check.is_ok_and(|check| check.status.success()) {
        eprintln!(
            "skipped: no python3 with the reader (pip install mcap-protobuf-support, then MOTORIUM_PYTHON)"
        );
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let file = recorded(folder.path(), "panda-reach.toml", &["--for", "250 ms"]);
    let output = Command::new(&python).args(["-c", READER, text(&file)]).output().expect("python runs");
    let errors = String::from_utf8_lossy(&output.stderr);
    let lines = String::from_utf8_lossy(&output.stdout);
    let lines: Vec<&str> = lines.lines().collect();
    assert!(lines[0].starts_with("motorium.v1.JointState 250 1 8 "), "{lines:?}\n{errors}");
    assert_eq!(lines[1], "foxglove.JointStates panda_joint2 True");
    assert_eq!(lines[2], "True True");
    assert_eq!(lines[3], "foxglove.Log True True");
}

const PICTURES: &str = r#"
import struct, sys
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

times, last = [], {}
with open(sys.argv[1], "rb") as stream:
    reader = make_reader(stream, decoder_factories=[DecoderFactory()])
    for schema, channel, message, decoded in reader.iter_decoded_messages():
        last[channel.topic] = (schema.name, decoded)
        if channel.topic == sys.argv[2] + "/image":
            times.append(message.log_time)
name, image = last[sys.argv[2] + "/image"]
print(name, image.encoding, image.width, image.height, image.step, len(image.data), image.frame_id, len(times))
name, calibration = last[sys.argv[3] + "/calibration"]
print(name, calibration.width, calibration.height, calibration.K[0] == calibration.K[4] > 100, calibration.K[2], calibration.K[5])
if image.encoding == "rgb8":
    red = [i for i in range(image.width * image.height) if image.data[3 * i] > 3 * image.data[3 * i + 1] and image.data[3 * i] > 60]
    column = sum(i % image.width for i in red) / len(red) - calibration.K[2]
    row = sum(i // image.width for i in red) / len(red) - calibration.K[5]
    print(len(red) > 50, (column ** 2 + row ** 2) ** 0.5 < 10)
else:
    depths = struct.unpack(f"<{image.width * image.height}f", image.data)
    print(max(depths) <= 5.0, sum(depth > 0.1 for depth in depths) > 1000)
"#;

#[test]
fn the_python_mcap_reader_sees_ball_and_depths() {
    let python = std::env::var_os("MOTORIUM_PYTHON").map_or_else(|| "python3".into(), PathBuf::from);
    let check = Command::new(&python).args(["-c", "import mcap, mcap_protobuf"]).output();
    if !check.is_ok_and(|check| check.status.success()) {
        eprintln!(
            "skipped: no python3 with the reader (pip install mcap-protobuf-support, then MOTORIUM_PYTHON)"
        );
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    for (graph, topics, span, expected) in [
        (
            "camera-servo.toml",
            ["camera/image", "camera/info"],
            "1500 ms",
            ["foxglove.RawImage rgb8 160 120 480 57600 camera 44", "True 79.5 59.5", "True True"],
        ),
        (
            "lidar-drive.toml",
            ["rover/depth", "rover/camera_info"],
            "500 ms",
            ["foxglove.RawImage 32FC1 160 120 640 76800 camera 14", "True 79.5 59.5", "True True"],
        ),
    ] {
        let file = recorded(folder.path(), graph, &["--for", span, "--no-expect"]);
        let output = Command::new(&python).args(["-c", PICTURES, text(&file), topics[0], topics[1]]).output();
        let output = output.expect("python runs");
        let errors = String::from_utf8_lossy(&output.stderr);
        let lines = String::from_utf8_lossy(&output.stdout);
        let lines: Vec<&str> = lines.lines().collect();
        assert_eq!(lines.len(), 3, "{graph}: {lines:?}\n{errors}");
        assert_eq!((lines[0], lines[2]), (expected[0], expected[2]), "{graph}: {lines:?}");
        assert_eq!(lines[1], format!("foxglove.CameraCalibration 160 120 {}", expected[1]), "{graph}");
        let (code, said) = verified(&file, &[]);
        assert_eq!(code, Some(0), "{graph}: {said}");
    }
}

#[test]
fn the_score_of_a_recording_shows_a_missed_goal() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("a.mcap");
    let arguments = ["--clock", "lockstep", "--for", "5s", "--record", text(&file)];
    let ended = run(&workspace().join("graphs/panda-reach.toml"), &arguments);
    let reported = &ended.report().results["controller"];
    let scored = |arguments: &[&str]| -> serde_json::Value {
        let output = motorium(&[&["score", text(&file), "--json"], arguments].concat());
        let errors = String::from_utf8_lossy(&output.stderr);
        serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{errors}"))
    };
    let score = scored(&[]);
    let pose = &score["poses"][0];
    assert_eq!(score["poses"].as_array().map(Vec::len), Some(1), "{score}");
    assert_eq!((&pose["reader"], &pose["frame"]), (&"controller".into(), &"panda_hand_tcp".into()));
    let number = |value: &serde_json::Value| value.as_f64().unwrap_or_else(|| panic!("{value} of {score}"));
    for count in ["goals_reached", "goals_missed"] {
        assert_eq!(pose[count], reported[count], "{count}: {pose}");
    }
    assert!(number(&pose["goals_reached"]) >= 2.0, "{pose}");
    for error in ["position_error_m", "orientation_error_rad"] {
        let (found, reported_error) = (number(&pose[error]), number(&reported[error]));
        assert!(
            (found - reported_error).abs() < 1e-9,
            "{error}: {found}, the controller found {reported_error}"
        );
        assert!(found > 0.0);
    }
    assert!(number(&pose["path_position_max_m"]) >= number(&pose["path_position_rms_m"]));
    assert!(number(&pose["path_position_max_m"]) >= number(&pose["position_error_m"]));
    let smoothness = number(&pose["smoothness"]);
    assert!((-2.2..-1.3).contains(&smoothness), "a primitive moves in one bell: {smoothness}");
    let strict = scored(&["--position-tolerance", "1e-9"]);
    assert_eq!(strict["poses"][0]["goals_reached"], 0);
    assert_eq!(strict["poses"][0]["goals_missed"], pose["goals_reached"]);

    let joints = score["joints"].as_array().expect("joint states").iter();
    let truth = joints.clone().find(|joints| joints["state"] == "panda/true_joint_state").expect("recorded");
    assert_eq!(truth["command"], "panda/joint_command");
    let first = &truth["joints"][0];
    assert_eq!(first["name"], "panda_joint1");
    assert!(
        number(&first["tracking_rms"]) > 0.0
            && number(&first["tracking_rms"]) <= number(&first["tracking_max"])
    );
    assert!(number(&first["position_margin"]) > 0.0 && first["beyond_limits"] == 0, "{first}");
    assert!((0.0..1.0).contains(&number(&first["velocity_share"])), "{first}");
    let said = motorium(&["score", text(&file), "--position-tolerance", "1e-9"]);
    let said = String::from_utf8_lossy(&said.stdout).into_owned();
    assert!(said.contains("goals      0 reached") && said.contains("  missed     goal "), "{said}");
}

#[test]
fn report_page_shows_only_its_own_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, json) = (folder.path().join("a.mcap"), folder.path().join("a.json"));
    let graph = workspace().join("graphs/panda-reach.toml");
    let arguments = ["--clock", "lockstep", "--for", "300 ms", "--json", "--record", text(&file)];
    let ended = motorium(&[&["run", text(&graph)], &arguments[..]].concat());
    std::fs::write(&json, &ended.stdout).expect("a file");
    let page = folder.path().join("a.html");
    let common = ["report", text(&file), "--overwrite", "--output", text(&page)];
    let report = |json: &Path| motorium(&[&common[..], &["--results", text(json)]].concat());
    let output = report(&json);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let written = std::fs::read_to_string(&page).expect("written");
    assert!(written.contains("<li>readings 300</li>"));

    let other = String::from_utf8_lossy(&ended.stdout).replace("\"panda-reach\"", "\"rover\"");
    std::fs::write(&json, other).expect("a file");
    let refused = report(&json);
    assert_eq!(refused.status.code(), Some(1));
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(said.contains("is the report of graph `rover`, expected `panda-reach`"), "{said}");
}

#[test]
fn a_recording_is_drawn_summarised_and_exported() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = recorded(folder.path(), "panda-reach.toml", &["--for", "300 ms"]);
    let picture = folder.path().join("a.svg");
    let signal = "panda/joint_state.position[0..7]";
    let plotted = motorium(&["plot", text(&file), signal, "--output", text(&picture)]);
    assert!(plotted.status.success(), "{}", String::from_utf8_lossy(&plotted.stderr));
    let picture = std::fs::read_to_string(picture).expect("written");
    assert!(picture.contains("panda_joint7") && !picture.contains("panda_finger"), "{picture}");
    let shown = motorium(&["plot", text(&file), "panda/joint_state.position[3]"]);
    assert!(String::from_utf8_lossy(&shown.stdout).chars().any(|c| ('\u{2801}'..='\u{28ff}').contains(&c)));
    let wrong = motorium(&["plot", text(&file), "panda/joint_state.positon"]);
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("did you mean `position`?"));

    let page = folder.path().join("a.html");
    let output = motorium(&["report", text(&file), "--output", text(&page)]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let page = std::fs::read_to_string(page).expect("written");
    let sections =
        ["Motion", "Goals", "Limits: panda/joint_state", "Graph", "Topics", "Misses", "Tracking", "Events"];
    for part in sections.iter().chain(&["0.30 s</span>", "panda/joint_command", ">measured<", "panda_joint3"])
    {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("<h2>Results"), "the recording alone holds none");
    assert_eq!(
        page.matches("src=").count(),
        page.matches("src=\"data:image/png;base64,").count(),
        "needs no network"
    );
    assert_eq!(page.matches("src=").count(), 5, "pictures of the motion");

    let tables = folder.path().join("tables");
    let exported =
        motorium(&["export", text(&file), "--topic", "panda/joint_state", "--output", text(&tables)]);
    assert!(exported.status.success(), "{}", String::from_utf8_lossy(&exported.stderr));
    let table = std::fs::read_to_string(tables.join("panda-joint_state.csv")).expect("written");
    assert_eq!(table.lines().count(), 301);
    let header = table.lines().next().expect("a header");
    assert!(
        header.starts_with("time_ns,sequence,publish_time_ns,") && header.contains(",position[7],"),
        "{header}"
    );
}
