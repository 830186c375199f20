//! Recordings read by third-party programs: by Foxglove's own Python classes.

use std::path::PathBuf;
use std::process::Command;

use crate::recording::{recorded, text};

/// Reads each Foxglove message with Foxglove's generated class, and with the schema in the file; prints the
/// number of messages.
const READER: &str = r#"
import importlib, sys
from google.protobuf.json_format import MessageToDict
from google.protobuf.unknown_fields import UnknownFieldSet
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

counts = {}
with open(sys.argv[1], "rb") as stream:
    reader = make_reader(stream, decoder_factories=[DecoderFactory()])
    for schema, channel, message, by_schema in reader.iter_decoded_messages():
        if not schema.name.startswith("foxglove."):
            continue
        name = schema.name.removeprefix("foxglove.")
        module = importlib.import_module(f"foxglove_schemas_protobuf.{name}_pb2")
        official = getattr(module, name).FromString(message.data)
        assert len(UnknownFieldSet(official)) == 0, (channel.topic, official)
        assert MessageToDict(official) == MessageToDict(by_schema), channel.topic
        counts[name] = counts.get(name, 0) + 1
print(" ".join(f"{name} {count}" for name, count in sorted(counts.items())))
"#;

#[test]
fn the_foxglove_classes_read_every_message_for_viewers() {
    let python = std::env::var_os("MOTORIUM_PYTHON").map_or_else(|| "python3".into(), PathBuf::from);
    let check =
        Command::new(&python).args(["-c", "import mcap_protobuf, foxglove_schemas_protobuf"]).output();
    if !check.is_ok_and(|check| check.status.success()) {
        eprintln!(
            "skipped: no python3 with them (pip install mcap-protobuf-support foxglove-schemas-protobuf, then MOTORIUM_PYTHON)"
        );
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let contacts = ["--set", "physics.publish.contacts=\"quadruped/contacts\""];
    let of_camera = [
        "CameraCalibration",
        "FrameTransforms",
        "JointStates",
        "Log",
        "PoseInFrame",
        "RawImage",
        "SceneUpdate",
    ];
    for (graph, options, expected) in [
        ("camera-servo.toml", &[][..], &of_camera[..]),
        ("drive-square.toml", &[], &["Odometry"]),
        ("quadruped-trot.toml", &contacts, &["SceneUpdate"]),
    ] {
        let options = [&["--for", "500 ms", "--no-expect"], options].concat();
        let file = recorded(folder.path(), graph, &options);
        let output = Command::new(&python).args(["-c", READER, text(&file)]).output().expect("python runs");
        let (lines, errors) =
            (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(output.status.success(), "{graph}: {errors}");
        for name in expected {
            assert!(lines.contains(&format!("{name} ")), "{graph} has no {name}: {lines}");
        }
    }
}
