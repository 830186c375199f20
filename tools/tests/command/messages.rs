//! MCAP files of other programs, from `fixtures/mcap`: drawn, reported, exported, learned and played.

#[path = "../../../fixtures/mcap/joints.rs"]
mod joints;

use std::path::{Path, PathBuf};

use crate::program::{json, printed, run};

use joints::position;

fn fixture(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/mcap").join(name);
    path.to_str().expect("a plain path").to_string()
}

fn all() -> Vec<String> {
    let names = ["json", "ros2"].into_iter();
    let files = names.flat_map(|name| ["none", "lz4", "zstd"].map(|kind| format!("{name}-{kind}.mcap")));
    files.map(|file| fixture(&file)).collect()
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

#[test]
fn foreign_files_are_plotted_and_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    for file in all() {
        let (plot, page) = (folder.path().join("a.csv"), folder.path().join("a.html"));
        printed(&["plot", &file, "/joint_states.position[0..7]", "--overwrite", "--output", text(&plot)]);
        let table = std::fs::read_to_string(&plot).expect("the numbers");
        let lines: Vec<&str> = table.lines().skip(1).collect();
        assert_eq!(lines.len(), 7 * 20, "{table}");
        for (index, line) in lines.iter().enumerate() {
            let cells: Vec<&str> = line.split(',').collect();
            let number = |cell: usize| cells[cell].parse::<f64>().expect("a number");
            assert_eq!(cells[0], format!("panda_joint{}", index / 20 + 1), "{file}");
            assert!((number(1) - 0.01 * (index % 20) as f64).abs() < 1e-9, "{line}");
            assert!((number(2) - position(index % 20, index / 20)).abs() < 1e-12, "{line}");
        }
        printed(&["report", &file, "--overwrite", "--output", text(&page)]);
        let page = std::fs::read_to_string(&page).expect("the page");
        assert!(page.contains("/joint_states") && page.contains("panda_joint7"), "{file}");
        assert!(page.contains("mcap-python") && page.contains("0.190 s"), "{page}");
        assert!(!page.contains("not decoded"), "{file}");
    }
}

#[test]
fn nested_fields_of_foreign_files_are_plotted() {
    let folder = tempfile::tempdir().expect("a folder");
    let plot = folder.path().join("a.csv");
    let signal = "/tf.transforms[1].transform.translation";
    printed(&["plot", &fixture("ros2-zstd.mcap"), signal, "--output", text(&plot)]);
    let table = std::fs::read_to_string(&plot).expect("the numbers");
    let first: Vec<&str> = table.lines().filter(|line| line.contains(",0,")).collect();
    assert_eq!(first.len(), 3, "{table}");
    assert!(first[0].ends_with(".x,0,1.5,0") && first[1].ends_with(".y,0,2,0"), "{table}");
    let refused = |signal: &str| {
        let output = run(&["plot", &fixture("ros2-none.mcap"), signal]);
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    for (signal, reason) in [
        ("/joints.position", "no topic `/joints`"),
        ("/joint_states.positions", "no field `positions`"),
        ("/joint_states.position[5..9]", "has 7 entries in this recording, found 5..9"),
        ("/joint_states.effort", "has no numbers in this recording"),
        ("/mixed.text", "has no numbers in this recording"),
    ] {
        let error = refused(signal);
        assert!(error.contains(reason), "{error}");
    }
}

#[test]
fn foreign_files_are_exported_as_tables() {
    let folder = tempfile::tempdir().expect("a folder");
    printed(&["export", &fixture("ros2-lz4.mcap"), "--output", text(folder.path())]);
    let states = std::fs::read_to_string(folder.path().join("joint_states.csv")).expect("the table");
    let head = states.lines().next().expect("a header");
    assert!(
        head.starts_with("time_ns,header.stamp.sec,header.stamp.nanosec,header.frame_id,name[0]"),
        "{head}"
    );
    assert!(head.contains(",position[panda_joint1],"), "{head}");
    assert_eq!(states.lines().count(), 21);
    let mixed = std::fs::read_to_string(folder.path().join("mixed.csv")).expect("the table");
    assert_eq!(
        mixed.lines().next().expect("a header"),
        "time_ns,ready,small,count,triple[0],triple[1],triple[2],bounded[0],bounded[1],text,words[0],words[1],large,last"
    );
    assert!(
        mixed
            .lines()
            .nth(2)
            .expect("a row")
            .ends_with(",1,-5,9,1,-2,5,0.5,1.5,abc,x,yz,9223372036854775809,1.25")
    );
    let parquet =
        ["export", &fixture("json-zstd.mcap"), "--format", "parquet", "--output", text(folder.path())];
    assert!(printed(&parquet).contains("joint_states.parquet: 20 rows"));
}

#[test]
fn foreign_files_and_their_tables_are_learned() {
    let folder = tempfile::tempdir().expect("a folder");
    printed(&["export", &fixture("ros2-none.mcap"), "--output", text(folder.path())]);
    let table = folder.path().join("joint_states.csv");
    for file in [fixture("ros2-lz4.mcap"), text(&table).to_string()] {
        let report = json(&["primitive", "fit", &file, "--json"]);
        let names: Vec<&str> = report["dimensions"]
            .as_array()
            .expect("dimensions")
            .iter()
            .map(|dimension| dimension["name"].as_str().expect("a name"))
            .collect();
        let expected: Vec<String> = (1..=7).map(|joint| format!("panda_joint{joint}")).collect();
        assert_eq!(names, expected, "{file}");
        let duration = report["duration"].as_f64().unwrap_or_default();
        assert!((duration - 0.19).abs() < 1e-9 || report.get("duration").is_none(), "{report}");
    }
}

/// The commanded positions that a recording of `play` has at the times of the samples.
fn commanded(recording: &Path, folder: &Path) -> Vec<Vec<f64>> {
    let arguments = [
        "export",
        text(recording),
        "--topic",
        "robot/joint_command",
        "--overwrite",
        "--output",
        text(folder),
    ];
    printed(&arguments);
    let table = std::fs::read_to_string(folder.join("robot-joint_command.csv")).expect("the table");
    let head: Vec<&str> = table.lines().next().expect("a header").split(',').collect();
    let columns: Vec<usize> = (0..7)
        .map(|joint| head.iter().position(|name| *name == format!("position[{joint}]")).expect("a column"))
        .collect();
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        columns.iter().map(|column| cells[*column].parse().expect("a number")).collect()
    };
    table.lines().skip(1).map(row).collect()
}

#[test]
fn recorded_joints_are_played_exactly() {
    let folder = tempfile::tempdir().expect("a folder");
    let shown = folder.path().join("shown.csv");
    // columns in another order, and times in ns since 1970
    let mut lines = vec![
        "time_ns,panda_joint2,panda_joint1,panda_joint3,panda_joint4,panda_joint5,panda_joint6,panda_joint7"
            .to_string(),
    ];
    for sample in 0..20_usize {
        let order = [1, 0, 2, 3, 4, 5, 6];
        let cells: Vec<String> = order.iter().map(|joint| position(sample, *joint).to_string()).collect();
        lines.push(format!("{},{}", 1_790_000_000_000_000_000 + sample as u64 * 10_000_000, cells.join(",")));
    }
    std::fs::write(&shown, lines.join("\n")).expect("the folder takes files");
    let files = [text(&shown).to_string(), fixture("ros2-zstd.mcap"), fixture("json-none.mcap")];
    for (index, file) in files.iter().enumerate() {
        let recording: PathBuf = folder.path().join(format!("{index}.mcap"));
        let output = run(&["play", file, "--robot", "panda", "--record", text(&recording)]);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{errors}");
        assert!(errors.contains("has no columns `panda_finger_joint1`"), "{errors}");
        let rows = commanded(&recording, folder.path());
        // the policy starts at the first sample with the first joint state
        let is_first = |row: &Vec<f64>| (0..7).all(|joint| (row[joint] - position(0, joint)).abs() < 1e-12);
        let start = rows.iter().rposition(is_first);
        let start = start.expect("the first sample is commanded");
        for sample in 0..20 {
            for (joint, commanded) in rows[start + 10 * sample].iter().take(7).enumerate() {
                let error = commanded - position(sample, joint);
                // a column of ns since 1970 is read with an error of 128 ns
                let tolerance = if index == 0 { 1e-6 } else { 1e-12 };
                assert!(error.abs() < tolerance, "{file}: sample {sample}, joint {joint}: {error}");
            }
        }
    }
}

#[test]
fn follower_columns_are_compared_with_their_leaders() {
    let folder = tempfile::tempdir().expect("a folder");
    let played = |table: &str| {
        let file = folder.path().join("shown.csv");
        std::fs::write(&file, table).expect("the folder takes files");
        let output = run(&["play", text(&file), "--robot", "panda"]);
        let errors = String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
        (output.status.code(), errors)
    };
    let table = |second: [f64; 2]| {
        let [a, b] = second;
        format!("time_s,panda_joint1,panda_finger_joint1,panda_finger_joint2\n0,0,0.01,{a}\n1,0.1,0.02,{b}\n")
    };
    let (code, errors) = played(&table([0.0101, 0.02]));
    assert!(code == Some(0) && !errors.contains("finger_joint2"), "{errors}");
    let (code, errors) = played(&table([0.01, 0.035]));
    assert_eq!(code, Some(0), "{errors}");
    let difference = "`panda_finger_joint2` follows `panda_finger_joint1`, but is at 0.035 at 1.000 s, expected 0.0200, a \
                      difference of 0.0150; its column is ignored";
    assert!(errors.contains(difference), "{errors}");
    let (code, errors) = played("time_s,panda_joint1,panda_finger_joint2\n0,0,0.01\n1,0.1,0.02\n");
    assert!(
        code == Some(0) && errors.contains("follows `panda_finger_joint1`, which has no column"),
        "{errors}"
    );
    let (code, errors) = played("time_s,panda_finger_joint2\n0,0.01\n1,0.02\n");
    assert!(code == Some(1) && errors.contains("all columns are of joints that follow others"), "{errors}");
}

#[test]
fn columns_that_do_not_fit_the_robot_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let refused = |table: &str, arguments: &[&str]| {
        let file = folder.path().join("shown.csv");
        std::fs::write(&file, table).expect("the folder takes files");
        let output = run(&[&["play", text(&file), "--robot", "panda"], arguments].concat());
        assert_eq!(output.status.code(), Some(1), "{table}");
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    for (table, reason) in [
        (
            "time_s,panda_joint1,elbow,wrist\n0,0,0,0\n1,0,0,0\n",
            "has no joints `elbow`, `wrist`; its joints are `panda_joint1`",
        ),
        ("time_s,panda_joint1,panda_joint1\n0,0,0\n1,0,0\n", "a second column `panda_joint1`"),
        (
            "time_s,panda_joint1\n0,0\n1,4\n",
            "joint `panda_joint1` is at 4 at 1.000 s, expected -2.8973 to 2.8973",
        ),
        (
            "time_s,panda_joint1\n0,0\n0.1,1\n",
            "moves at 10.000 rad/s or m/s, expected at most 2.175; slow down by `--speed 0.21`",
        ),
        ("time_s,a,b\n0,0,0\n1,0,0\n", "has no joints `a`, `b`"),
        (
            "time_s,panda_finger_joint1\n0,20\n1,30\n",
            "expected 0 to 0.04; the column seems to be in mm, and positions of joints that slide are in m",
        ),
    ] {
        let error = refused(table, &[]);
        assert!(error.contains(reason), "{error}");
    }
    let degrees = "; the table seems to be in degrees, and positions of joints that turn are in rad: 90 degrees are 1.5708 rad";
    let error = refused("time_s,panda_joint1,panda_joint2\n0,0,0\n1,2,1\n2,3,2\n3,90,20\n", &[]);
    assert!(error.contains(degrees), "{error}");
    // 300 degrees are out of reach, too
    let error = refused("time_s,panda_joint1\n0,0\n1,90\n2,300\n", &[]);
    assert!(error.contains("is at 90 at 1.000 s") && !error.contains("degrees"), "{error}");
    let error = refused("time_s,panda_joint1\n0,0\n1,0\n", &["--topic", "joint_states"]);
    assert!(error.contains("`--topic` selects a channel of an .mcap file"), "{error}");
    let error = refused("time_s,panda_joint1\n0,0\n1,0\n", &["--speed", "0"]);
    assert!(error.contains("expected a number above 0"), "{error}");
}
