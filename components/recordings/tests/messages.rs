//! MCAP files of other writers. The files in `fixtures/mcap` were written by Foxglove's Python libraries.

#[path = "../../../fixtures/mcap/joints.rs"]
mod joints;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mcap::WriteOptions;
use mcap::records::MessageHeader;
use motorium_recordings::messages::{
    Decoder, Leaf, LogError, MessageLog, Number, Schema, Unsupported, Value,
};
use motorium_recordings::{Recording, RecordingError, Selection, read};

use joints::position;

const COMPRESSIONS: [&str; 3] = ["none", "lz4", "zstd"];

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/mcap").join(name)
}

fn log(name: &str) -> MessageLog<Vec<u8>> {
    MessageLog::new(std::fs::read(fixture(name)).unwrap()).unwrap()
}

fn check(recording: &Recording) {
    let names: Vec<String> = (1..=7).map(|joint| format!("panda_joint{joint}")).collect();
    assert_eq!((recording.names(), recording.samples()), (names.as_slice(), 20));
    for sample in 0..20 {
        assert!((recording.times()[sample] - 0.01 * sample as f64).abs() < 1e-12);
        for joint in 0..7 {
            let error = recording.values()[(sample, joint)] - position(sample, joint);
            assert!(error.abs() < 1e-12, "sample {sample}, joint {joint}: {error}");
        }
    }
}

#[test]
fn json_and_cdr_are_read_in_every_compression() {
    for encoding in ["json", "ros2"] {
        for compression in COMPRESSIONS {
            let file = fixture(&format!("{encoding}-{compression}.mcap"));
            check(&read(&file, &Selection::default()).unwrap());
        }
    }
}

#[test]
fn velocities_and_single_joints_are_selected() {
    let selection = Selection { field: Some("velocity".into()), ..Selection::default() };
    let velocities = read(&fixture("ros2-zstd.mcap"), &selection).unwrap();
    assert_eq!((velocities.names().len(), velocities.values().amax()), (7, 0.0));
    let channels = vec!["panda_joint3".to_string(), "panda_joint1".to_string()];
    let two = read(&fixture("json-lz4.mcap"), &Selection { channels, ..Selection::default() }).unwrap();
    assert_eq!(two.names(), ["panda_joint3", "panda_joint1"]);
    assert!((two.values()[(4, 0)] - position(4, 2)).abs() < 1e-12);
    let unknown = Selection { channels: vec!["elbow".into()], ..Selection::default() };
    let error = read(&fixture("json-lz4.mcap"), &unknown).unwrap_err().to_string();
    assert!(error.contains("no channel `elbow`") && error.contains("panda_joint7"), "{error}");
    let topic = Selection { topic: Some("/joints".into()), ..Selection::default() };
    let error = read(&fixture("ros2-none.mcap"), &topic).unwrap_err().to_string();
    assert!(
        error.contains("no channel `/joints`") && error.contains("`/tf` (cdr, tf2_msgs/msg/TFMessage)"),
        "{error}"
    );
}

/// Returns the values of the first message of a channel.
fn first(name: &str, topic: &str) -> Value {
    let log = log(name);
    let (channel, decoder) = log.channel(topic).unwrap();
    let message = log.messages().find(|message| message.channel == channel).unwrap();
    decoder.decode(&message.data).unwrap()
}

#[test]
fn every_kind_of_field_is_decoded() {
    for compression in COMPRESSIONS {
        let mixed = first(&format!("ros2-{compression}.mcap"), "/mixed");
        let number = |path: &str| match mixed.get(path) {
            Some(Value::Number(number)) => *number,
            other => panic!("{path}: {other:?}"),
        };
        assert_eq!(number("ready"), Number::Natural(1));
        assert_eq!(number("small"), Number::Integer(-5));
        assert_eq!(number("count"), Number::Natural(9));
        assert_eq!(mixed.get("triple").unwrap().numbers().unwrap(), [1.0, -2.0, 0.0]);
        assert_eq!(number("bounded[1]"), Number::Single(1.5));
        assert_eq!(mixed.get("text"), Some(&Value::Text("abc".into())));
        assert_eq!(mixed.get("words").unwrap().texts().unwrap(), ["x", "yz"]);
        assert_eq!(number("large"), Number::Natural((1 << 63) + 1));
        assert_eq!(mixed.get("id"), Some(&Value::Bytes(vec![1, 2, 3, 4])));
        assert_eq!(mixed.get("pixels"), Some(&Value::Bytes(vec![9, 8, 7])));
        assert_eq!(number("last"), Number::Double(0.0));
        assert!(mixed.get("KIND").is_none() && mixed.get("LABEL").is_none());
    }
}

#[test]
fn nested_types_are_decoded() {
    let tf = first("ros2-lz4.mcap", "/tf");
    assert_eq!(tf.get("transforms[1].child_frame_id"), Some(&Value::Text("bcd".into())));
    assert_eq!(tf.get("transforms[1].transform.translation.x").unwrap().numbers().unwrap(), [1.5]);
    assert_eq!(tf.get("transforms[0].transform.rotation.w").unwrap().numbers().unwrap(), [1.0]);
    let stamp = tf.get("transforms[0].header.stamp.sec").unwrap().numbers().unwrap();
    assert_eq!(stamp, [1_790_000_000.0]);
}

fn schema(name: &str, encoding: &str, text: &str) -> Schema {
    Schema { name: name.into(), encoding: encoding.into(), data: text.as_bytes().to_vec() }
}

const IDL: &str = r#"
// generated
#include "geometry_msgs/msg/Vector3.idl"
module demo { module msg {
    module Shape_Constants { const uint8 SIDES = 3; };
    typedef double double__3[3];
    enum Colour { RED, GREEN };
    @verbatim (language="comment", text="a shape; with } in it")
    struct Shape {
        @unit (value="m")
        demo::msg::Point centre;
        double__3 size;
        sequence<Point, 4> corners;
        short grid[2][SIDES];
        string<8> name;
        unsigned long long count;
        Colour colour;
    };
}; };
================================================================================
IDL: demo/msg/Point
module demo { module msg { struct Base { boolean is_set; }; struct Point : Base { float x; float y; }; }; };
"#;

/// Returns a message of `IDL` in the given byte order.
fn shape(is_little: bool) -> Vec<u8> {
    let mut body: Vec<u8> = Vec::new();
    let mut put = |bytes: &[u8]| {
        body.resize(body.len().next_multiple_of(bytes.len()), 0);
        let mut bytes = bytes.to_vec();
        if !is_little {
            bytes.reverse();
        }
        body.extend(bytes);
    };
    put(&[1]);
    put(&1.0_f32.to_le_bytes());
    put(&2.0_f32.to_le_bytes());
    [0.1_f64, 0.2, 0.3].iter().for_each(|size| put(&size.to_le_bytes()));
    put(&1_u32.to_le_bytes());
    put(&[0]);
    put(&3.0_f32.to_le_bytes());
    put(&4.0_f32.to_le_bytes());
    (0..6_i16).for_each(|entry| put(&(-entry).to_le_bytes()));
    put(&4_u32.to_le_bytes());
    b"box\0".iter().for_each(|letter| put(&[*letter]));
    put(&7_u64.to_le_bytes());
    put(&1_u32.to_le_bytes());
    [vec![0, u8::from(is_little), 0, 0], body].concat()
}

#[test]
fn idl_messages_decode_in_both_byte_orders() {
    for (name, encoding) in [("demo/msg/Shape", "ros2idl"), ("demo::msg::Shape", "omgidl")] {
        let decoder = Decoder::new("cdr", Some(&schema(name, encoding, IDL))).unwrap();
        for is_little in [true, false] {
            let shape = decoder.decode(&shape(is_little)).unwrap();
            let mut numbers = Vec::new();
            shape.visit(&mut |path, leaf| {
                if let Leaf::Number(number) = leaf {
                    numbers.push((path.to_string(), number.as_f64()));
                }
            });
            let value = |path: &str| numbers.iter().find(|(known, _)| known == path).unwrap().1;
            assert_eq!((value("centre.is_set"), value("centre.y"), value("size[2]")), (1.0, 2.0, 0.3));
            assert_eq!((value("corners[0].x"), value("grid[1][0]"), value("grid[1][2]")), (3.0, -3.0, -5.0));
            assert_eq!((value("count"), value("colour"), numbers.len()), (7.0, 1.0, 17));
            assert_eq!(shape.get("name"), Some(&Value::Text("box".into())));
        }
    }
}

#[test]
fn truncated_messages_are_rejected() {
    let decoder = Decoder::new("cdr", Some(&schema("demo/msg/Shape", "ros2idl", IDL))).unwrap();
    let whole = shape(true);
    for length in 0..whole.len() {
        assert!(decoder.decode(&whole[..length]).is_err(), "{length} bytes");
    }
    let long = [whole, vec![0; 12]].concat();
    assert!(decoder.decode(&long).unwrap_err().to_string().contains("schema does not describe this message"));
    let huge = Decoder::new("cdr", Some(&schema("a/msg/B", "ros2msg", "float64[] x\n"))).unwrap();
    let error = huge.decode(&[0, 1, 0, 0, 255, 255, 255, 255]).unwrap_err().to_string();
    assert_eq!(error, "an array of 4294967295 entries, with 0 bytes left");
    let error = huge.decode(&[0, 7, 0, 0, 0, 0, 0, 0]).unwrap_err().to_string();
    assert!(error.contains("representation 00 07"), "{error}");
}

#[test]
fn unreadable_schemas_state_their_reason() {
    let refused = |encoding: &str, text: &str| {
        Decoder::new("cdr", Some(&schema("a/msg/B", encoding, text))).unwrap_err().to_string()
    };
    for (encoding, text, reason) in [
        ("ros2msg", "int32 x\nwstring y\n", "line 2: `wstring y`: wide strings are not supported"),
        ("ros2msg", "C c\n", "`a::msg::B` uses the type `C`, which the schema does not define"),
        ("ros2msg", "B b\n", "type `a::msg::B` contains itself"),
        ("ros2msg", "int32[x] y\n", "`x` is not a length"),
        (
            "ros2idl",
            "module a { module msg { struct C { long x; }; }; };",
            "does not define `a::msg::B`, only a::msg::C",
        ),
        ("ros2idl", "module a {\n union U { };\n};", "line 2: found `union`"),
        (
            "ros2idl",
            "module a { module msg { struct B { @optional long x; }; }; };",
            "expected types without this",
        ),
        ("flatbuffer", "", "expected `ros2msg`, `ros2idl` or `omgidl`"),
    ] {
        let error = refused(encoding, text);
        assert!(error.contains(reason), "{error}");
    }
    assert_eq!(Decoder::new("cdr", None), Err(Unsupported::NoSchema("cdr".into())));
    assert_eq!(Decoder::new("ros1", None), Err(Unsupported::Encoding("ros1".into())));
}

/// Writes a file of JSON messages, given by channel and content, 10 ms apart.
fn written(folder: &Path, messages: &[(&str, &str)]) -> PathBuf {
    let path = folder.join("a.mcap");
    let file = std::io::BufWriter::new(std::fs::File::create(&path).unwrap());
    let mut writer = WriteOptions::new().compression(None).create(file).unwrap();
    let mut channels = BTreeMap::new();
    for (sequence, (topic, content)) in (0_u32..).zip(messages) {
        let channel_id = *channels.entry(*topic).or_insert_with(|| {
            let encoding = if topic.starts_with("/ros1") { "ros1" } else { "json" };
            writer.add_channel(0, topic, encoding, &BTreeMap::new()).unwrap()
        });
        let log_time = u64::from(sequence) * 10_000_000;
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, content.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    path
}

fn refusal(file: &Path, selection: &Selection) -> LogError {
    match read(file, selection).unwrap_err() {
        RecordingError::Messages { reason, .. } => *reason,
        other => panic!("{other}"),
    }
}

#[test]
fn ambiguous_channels_require_a_topic() {
    let folder = tempfile::tempdir().unwrap();
    let number = r#"{"position": [1, 2]}"#;
    let file = written(folder.path(), &[("/left", number), ("/right", number), ("/left", number)]);
    let LogError::Choice { found, .. } = refusal(&file, &Selection::default()) else {
        panic!("two channels")
    };
    assert_eq!(found, ["`/left`", "`/right`"]);
    let left = Selection { topic: Some("/left".into()), ..Selection::default() };
    let recording = read(&file, &left).unwrap();
    assert_eq!(
        (recording.names(), recording.duration()),
        (["position[0]", "position[1]"].map(String::from).as_slice(), 0.02)
    );
    let file = written(folder.path(), &[("/text", r#"{"a": "b"}"#), ("/ros1", "?")]);
    let error = refusal(&file, &Selection::default()).to_string();
    assert_eq!(
        error,
        "no channel has numbers `position`; the channels of the file are `/text` (json), `/ros1` (ros1)"
    );
    let ros1 = Selection { topic: Some("/ros1".into()), ..Selection::default() };
    let error = refusal(&file, &ros1).to_string();
    assert_eq!(
        error,
        "channel `/ros1` (ros1): messages are encoded as `ros1`, expected `cdr`, `json` or `protobuf`"
    );
}

#[test]
fn joints_in_partial_messages_are_selected_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let arm = |x: f64| format!(r#"{{"name": ["a", "b"], "position": [{x}, 1]}}"#);
    let (one, two) = (arm(1.0), arm(2.0));
    let hand = r#"{"name": ["finger"], "position": [0.02]}"#;
    let file = written(folder.path(), &[("/js", &one), ("/js", hand), ("/js", &two), ("/js", hand)]);
    let LogError::Uneven { number, found, expected, .. } = refusal(&file, &Selection::default()) else {
        panic!("uneven")
    };
    assert_eq!((number, found.as_str(), expected.as_str()), (2, "finger", "a, b"));
    let selected = Selection { channels: vec!["a".into()], ..Selection::default() };
    let recording = read(&file, &selected).unwrap();
    assert_eq!((recording.samples(), recording.values()[(1, 0)]), (2, 2.0));
}

#[test]
fn files_without_messages_are_not_reported_as_truncated() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(
        refusal(&written(folder.path(), &[]), &Selection::default()),
        LogError::Empty { is_whole: true }
    );
    let file = folder.path().join("b.mcap");
    std::fs::write(&file, "time_s,x\n").unwrap();
    assert_eq!(refusal(&file, &Selection::default()), LogError::Format);
}

#[test]
fn damaged_files_are_read_or_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    for name in ["json-none.mcap", "ros2-none.mcap", "ros2-zstd.mcap", "ros2-lz4.mcap"] {
        let whole = std::fs::read(fixture(name)).unwrap();
        for (count, place) in (8..whole.len()).step_by(37).enumerate() {
            let mut bytes = whole.clone();
            bytes[place] ^= 1 << (count % 8);
            std::fs::write(&file, &bytes).unwrap();
            // neither panics nor exhausts memory
            let _ = read(&file, &Selection::default());
            let Ok(log) = MessageLog::new(bytes) else { continue };
            for message in log.messages() {
                let _ = log.decoder(message.channel).map(|decoder| decoder.decode(&message.data).is_ok());
            }
        }
    }
}
