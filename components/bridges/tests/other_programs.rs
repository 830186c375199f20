//! MCAP files of other programs as curves and tables. The files in `fixtures/mcap` were written by Foxglove's
//! Python libraries.

#[path = "../../../fixtures/mcap/joints.rs"]
mod joints;

use std::path::{Path, PathBuf};

use motorium_bridges::recording::{Opened, OtherLog, ReadError, Recording, Signal, SignalsError, open};

use joints::position;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/mcap").join(name)
}

fn log(name: &str) -> Box<OtherLog> {
    match open(&fixture(name)).unwrap() {
        Opened::Other(log) => log,
        Opened::Run(_) => panic!("{name} is a recording of motorium"),
    }
}

fn signals(texts: &[&str]) -> Vec<Signal> {
    texts.iter().map(|text| text.parse().unwrap()).collect()
}

#[test]
fn joints_of_other_programs_become_curves_with_names() {
    for encoding in ["json", "ros2"] {
        for compression in ["none", "lz4", "zstd"] {
            let log = log(&format!("{encoding}-{compression}.mcap"));
            assert!(log.faults().is_empty() && log.writer().contains("mcap-python"), "{:?}", log.faults());
            let curves = log.curves(&signals(&["/joint_states.position[0..7]"])).unwrap();
            assert_eq!(curves.len(), 7);
            for (joint, curve) in curves.iter().enumerate() {
                assert_eq!(curve.label.as_deref(), Some(format!("panda_joint{}", joint + 1).as_str()));
                assert_eq!(curve.points.len(), 20);
                for (sample, (time, value)) in curve.points.iter().enumerate() {
                    assert!((time - 0.01 * sample as f64).abs() < 1e-12);
                    assert!((value - position(sample, joint)).abs() < 1e-12);
                }
            }
        }
    }
}

#[test]
fn nested_fields_become_curves() {
    let log = log("ros2-zstd.mcap");
    let curves = log.curves(&signals(&["/tf.transforms[1].transform.translation", "/mixed.pixels"])).unwrap();
    let names: Vec<&str> = curves.iter().map(|curve| curve.name.as_str()).collect();
    let translation = "/tf.transforms[1].transform.translation";
    let expected = ["x", "y", "z"].map(|axis| format!("{translation}.{axis}"));
    assert_eq!(names[..3], expected);
    assert_eq!(names[3..], ["/mixed.pixels[0]", "/mixed.pixels[1]", "/mixed.pixels[2]"]);
    let expected = [(0.0, 1.5), (0.05, 6.5), (0.1, 11.5), (0.15, 16.5)];
    for ((time, value), (at, number)) in curves[0].points.iter().zip(expected) {
        assert!((time - at).abs() < 1e-12 && *value == number, "{time}: {value}");
    }
    assert_eq!(curves[0].points.len(), 4);
}

#[test]
fn unknown_fields_of_other_programs_are_refused() {
    let log = log("ros2-none.mcap");
    let refused = |signal: &str| log.curves(&signals(&[signal])).unwrap_err();
    assert!(matches!(refused("/joints.position"), SignalsError::NoTopic { .. }));
    assert!(matches!(refused("/joint_states.positions"), SignalsError::NoField { .. }));
    assert!(matches!(refused("/joint_states.position[5..9]"), SignalsError::NoEntry { most: 7, .. }));
    assert!(matches!(refused("/joint_states.effort"), SignalsError::NoNumbers { .. }));
    assert!(matches!(refused("/mixed.text"), SignalsError::NoNumbers { .. }));
    let error = Recording::open(&fixture("ros2-none.mcap")).unwrap_err();
    assert!(matches!(error, ReadError::Foreign { .. }), "{error}");
    let channels = "`/joint_states` (cdr, sensor_msgs/msg/JointState), `/tf` (cdr, tf2_msgs/msg/TFMessage)";
    assert!(error.to_string().contains(channels), "{error}");
}

#[test]
fn channels_of_other_programs_become_tables() {
    let log = log("ros2-lz4.mcap");
    let channel = |topic: &str| log.channels().iter().position(|channel| channel.topic == topic).unwrap();
    let table = |topic: &str| {
        let mut out = Vec::new();
        let rows = log.write_csv(channel(topic), &mut out).unwrap();
        (rows, String::from_utf8(out).unwrap())
    };
    let (rows, states) = table("/joint_states");
    let head = states.lines().next().unwrap();
    assert!(
        head.starts_with("time_ns,header.stamp.sec,header.stamp.nanosec,header.frame_id,name[0]"),
        "{head}"
    );
    assert!(head.contains(",position[panda_joint1],position[panda_joint2],"), "{head}");
    assert_eq!((rows, states.lines().count()), (20, 21));
    let (_, mixed) = table("/mixed");
    let mut lines = mixed.lines();
    assert_eq!(
        lines.next().unwrap(),
        "time_ns,ready,small,count,triple[0],triple[1],triple[2],bounded[0],bounded[1],text,words[0],words[1],large,last"
    );
    let row = "1790000000050000000,1,-5,9,1,-2,5,0.5,1.5,abc,x,yz,9223372036854775809,1.25";
    assert_eq!(lines.nth(1).unwrap(), row);
    let mut parquet = Vec::new();
    assert_eq!(log.write_parquet(channel("/tf"), &mut parquet).unwrap(), 4);
    assert!(parquet.starts_with(b"PAR1") && parquet.ends_with(b"PAR1"));
    // the table is read back with the names of the joints
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("states.csv");
    std::fs::write(&file, states).unwrap();
    let again = motorium_recordings::read(&file, &motorium_recordings::Selection::default()).unwrap();
    assert_eq!((again.names()[6].as_str(), again.names().len()), ("panda_joint7", 7));
    assert_eq!(again.values()[(9, 3)], position(9, 3));
}
