//! Recordings exported for other programs, and read back by them: Parquet and datasets by pyarrow, pictures
//! by Python's zlib.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::MOTORIUM;
use crate::support::{run, workspace};

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

/// Returns the interpreter with these modules; prints the reason and returns `None` if there is none.
pub(crate) fn python(modules: &str) -> Option<PathBuf> {
    let python = std::env::var_os("MOTORIUM_PYTHON").map_or_else(|| "python3".into(), PathBuf::from);
    let check = Command::new(&python).args(["-c", &format!("import {modules}")]).output();
    if check.is_ok_and(|check| check.status.success()) {
        return Some(python);
    }
    eprintln!("SKIPPED: no python3 with {modules} (pip install {modules}, then MOTORIUM_PYTHON)");
    None
}

/// Returns the output of a script whose arguments are paths.
pub(crate) fn printed(python: &Path, script: &str, arguments: &[&Path]) -> String {
    let output = Command::new(python).args(["-c", script]).args(arguments).output().expect("python runs");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Two episodes of the Panda, each of 400 ms.
fn recorded(folder: &Path) -> PathBuf {
    let file = folder.join("a.mcap");
    let arguments = ["--clock", "lockstep", "--for", "400 ms", "--episodes", "2", "--no-expect", "--record"];
    let ended = run(&workspace().join("graphs/panda-reach.toml"), &[&arguments[..], &[text(&file)]].concat());
    assert_eq!(ended.report().results["recorder"]["lost"], 0, "{}", ended.stderr);
    file
}

/// The Parquet table and the CSV table contain the same numbers.
const TABLES: &str = r#"
import csv, sys
import pyarrow.parquet as parquet
file = parquet.ParquetFile(sys.argv[1])
table = file.read().to_pydict()
assert file.schema_arrow.metadata[b"motorium.type"] == b"motorium.JointState"
rows = list(csv.DictReader(open(sys.argv[2])))
assert len(rows) == len(table["sequence"]) == 800
for index, row in enumerate(rows):
    for name in ["time_ns", "sequence", "publish_time_ns", "source_time_ns", "episode"]:
        assert int(row[name]) == table[name][index], (name, index)
    for name in ["position", "velocity", "effort"]:
        found = [float(row[f"{name}[{joint}]"]) for joint in range(8)]
        assert found == table[name][index], (name, index, found)
print(len(rows), len(table["position"][0]))
"#;

/// The files of a dataset as required by the specification of version 3.0.
const DATASET: &str = r#"
import json, math, sys
from pathlib import Path
import pyarrow as arrow
import pyarrow.parquet as parquet
root = Path(sys.argv[1])
info = json.loads((root / "meta/info.json").read_text())
assert info["codebase_version"] == "v3.0" and info["fps"] == 30 and info["robot_type"] == "panda"
assert (info["total_episodes"], info["total_tasks"], info["splits"]) == (2, 1, {"train": "0:2"})
place = dict(chunk_index=0, file_index=0)
file = parquet.ParquetFile(root / info["data_path"].format(**place))
data = file.read()
assert data.num_rows == info["total_frames"] == 24 and file.num_row_groups == 2
features = info["features"]
assert set(data.column_names) == set(features)
for name, feature in features.items():
    kind, of = data.schema.field(name).type, arrow.type_for_alias(feature["dtype"])
    if feature["shape"] == [1]:
        assert kind == of, name
    else:
        assert kind.value_type == of, name
        assert all(len(row) == feature["shape"][0] for row in data[name].to_pylist()), name
        assert len(feature["names"]) == feature["shape"][0], name
assert features["action"]["names"][0] == "panda_joint1.position"
assert features["observation.state"]["names"][7] == "panda_finger_joint1.position"
frames = data.to_pydict()
assert frames["index"] == list(range(24)) and frames["frame_index"] == list(range(12)) * 2
assert frames["episode_index"] == [0] * 12 + [1] * 12 and set(frames["task_index"]) == {0}
for time, frame in zip(frames["timestamp"], frames["frame_index"]):
    assert abs(time - frame / 30) < 1e-6
episodes = parquet.read_table(root / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
for index, episode in enumerate(episodes):
    assert episode["episode_index"] == index and episode["length"] == 12
    assert (episode["dataset_from_index"], episode["dataset_to_index"]) == (12 * index, 12 * index + 12)
    assert episode["tasks"] == ["reach and rest"]
    for key in ["data/chunk_index", "data/file_index", "meta/episodes/chunk_index", "meta/episodes/file_index"]:
        assert episode[key] == 0, key
    own = {"episode_index", "tasks", "length", "dataset_from_index", "dataset_to_index"}
    places = {key for key in episode if key.endswith(("/chunk_index", "/file_index"))}
    kinds = ["min", "max", "mean", "std", "q01", "q10", "q50", "q90", "q99", "count"]
    assert set(episode) == own | places | {f"stats/{name}/{kind}" for name in features for kind in kinds}
    for name, feature in features.items():
        rows = [row if isinstance(row, list) else [row] for row in frames[name][12 * index:12 * index + 12]]
        assert episode[f"stats/{name}/count"] == [12], name
        for entry in range(feature["shape"][0]):
            values = sorted(row[entry] for row in rows)
            of = {kind: episode[f"stats/{name}/{kind}"][entry] for kind in kinds[:-1]}
            assert (of["min"], of["max"]) == (values[0], values[-1]), name
            mean = math.fsum(values) / 12
            assert math.isclose(of["mean"], mean, rel_tol=1e-9, abs_tol=1e-12), name
            deviation = math.sqrt(math.fsum((value - mean) ** 2 for value in values) / 12)
            assert math.isclose(of["std"], deviation, rel_tol=1e-6, abs_tol=1e-9), name
            # numpy.quantile: 11 gaps between 12 values
            assert math.isclose(of["q50"], (values[5] + values[6]) / 2, rel_tol=1e-9, abs_tol=1e-12), name
            assert math.isclose(of["q90"], values[9] + 0.9 * (values[10] - values[9]), rel_tol=1e-9, abs_tol=1e-12)
            assert len(episode[f"stats/{name}/q01"]) == feature["shape"][0], name
assert set(info) == {
    "codebase_version", "robot_type", "total_episodes", "total_frames", "total_tasks", "chunks_size", "fps", "splits",
    "data_files_size_in_mb", "video_files_size_in_mb", "data_path", "video_path", "features"}
assert info["video_path"] is None and info["chunks_size"] == 1000
assert sorted(str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()) == [
    "data/chunk-000/file-000.parquet", "meta/episodes/chunk-000/file-000.parquet", "meta/info.json", "meta/stats.json",
    "meta/tasks.parquet"]
dtypes = {"timestamp": "float32", "frame_index": "int64", "episode_index": "int64", "index": "int64", "task_index": "int64"}
for name, dtype in dtypes.items():
    assert features[name] == {"dtype": dtype, "shape": [1], "names": None}, name
for name in ["observation.state", "action"]:
    assert features[name]["dtype"] == "float32" and features[name]["shape"] == [8], name
tasks = parquet.read_table(root / "meta/tasks.parquet")
assert tasks.to_pylist() == [{"task_index": 0, "task": "reach and rest"}]
assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]
stats = json.loads((root / "meta/stats.json").read_text())
assert set(stats) == set(features)
for name, feature in features.items():
    rows = [row if isinstance(row, list) else [row] for row in frames[name]]
    assert stats[name]["count"] == [24]
    for entry in range(feature["shape"][0]):
        values = [row[entry] for row in rows]
        mean = math.fsum(values) / 24
        deviation = math.sqrt(math.fsum((value - mean) ** 2 for value in values) / 24)
        assert (stats[name]["min"][entry], stats[name]["max"][entry]) == (min(values), max(values)), name
        assert math.isclose(stats[name]["mean"][entry], mean, rel_tol=1e-9, abs_tol=1e-12), name
        assert math.isclose(stats[name]["std"][entry], deviation, rel_tol=1e-6, abs_tol=1e-9), name
table = parquet.read_table(sys.argv[2]).to_pydict()
# The first frame of each episode is at its first sample; the next one a thirtieth later: the 33rd sample after it.
for episode in range(2):
    rows = [index for index, found in enumerate(table["episode"]) if found == episode]
    for frame in [0, 1, 11]:
        found = frames["observation.state"][12 * episode + frame]
        sample = table["position"][rows[0] + frame * 1000 // 30]
        assert all(abs(a - b) < 1e-6 for a, b in zip(found, sample)), (episode, frame)
try:
    import pandas
    index = pandas.read_parquet(root / "meta/tasks.parquet").index
    assert list(index) == ["reach and rest"]
except ImportError:
    pass
print("whole")
"#;

#[test]
fn pyarrow_reads_the_tables_and_the_dataset_of_a_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = recorded(folder.path());
    let tables = folder.path().join("tables");
    for format in ["csv", "parquet"] {
        let arguments = ["export", text(&file), "--format", format, "--output", text(&tables)];
        let exported = motorium(&[&arguments[..], &["--topic", "panda/joint_state"]].concat());
        assert!(exported.status.success(), "{}", String::from_utf8_lossy(&exported.stderr));
    }
    let (table, values) = (tables.join("panda-joint_state.parquet"), tables.join("panda-joint_state.csv"));
    let bytes = std::fs::read(&table).expect("written");
    assert!(bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"));

    let dataset = folder.path().join("reach");
    let arguments = ["export", text(&file), "--format", "lerobot", "--output", text(&dataset)];
    let exported = motorium(&[&arguments[..], &["--fps", "30", "--task", "reach and rest"]].concat());
    assert!(exported.status.success(), "{}", String::from_utf8_lossy(&exported.stderr));
    let said = String::from_utf8_lossy(&exported.stdout).into_owned();
    assert!(said.ends_with("reach: 24 frames in 2 episodes\n"), "{said}");

    let Some(python) = python("pyarrow") else { return };
    assert_eq!(printed(&python, TABLES, &[&table, &values]), "800 8\n");
    assert_eq!(printed(&python, DATASET, &[&dataset, &table]), "whole\n");
}

#[test]
fn a_dataset_of_an_unrecorded_topic_is_refused_with_choices() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = recorded(folder.path());
    let refused = |arguments: &[&str]| {
        let output = motorium(&[&["export", text(&file)], arguments].concat());
        assert!(!output.status.success(), "{arguments:?}");
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let said = refused(&["--format", "lerobot", "--state", "panda/joint_state.positon"]);
    assert!(said.contains("did you mean `position`?"), "{said}");
    let said = refused(&["--format", "lerobot", "--action", "panda/joint_comand.position"]);
    assert!(said.contains("did you mean `panda/joint_command`?"), "{said}");
    let said = refused(&["--format", "parquet", "--fps", "30"]);
    assert!(said.contains("`--fps` is an option of `--format lerobot`"), "{said}");
    let said = refused(&["--format", "lerobot", "--topic", "*"]);
    assert!(said.contains("not of `--topic`"), "{said}");
}

/// Size of a picture, and the number of its dots of two colours: the first line, and the background.
const PICTURE: &str = r#"
import struct, sys, zlib
data, at, parts = open(sys.argv[1], "rb").read(), 8, b""
assert data[:8] == b"\x89PNG\r\n\x1a\n"
while at < len(data):
    length, kind = struct.unpack(">I4s", data[at:at + 8])
    content = data[at + 8:at + 8 + length]
    assert zlib.crc32(kind + content) == struct.unpack(">I", data[at + 8 + length:at + 12 + length])[0]
    if kind == b"IHDR":
        width, height, depth, colour = struct.unpack(">IIBB", content[:10])
        assert (depth, colour) == (8, 2)
    if kind == b"IDAT":
        parts += content
    at += 12 + length
rows, above, counts = zlib.decompress(parts), bytes(3 * width), {}
assert len(rows) == height * (3 * width + 1)
for row in range(height):
    line = rows[row * (3 * width + 1):(row + 1) * (3 * width + 1)]
    done, corner = bytearray(), lambda at: (done[at - 3], above[at - 3]) if at >= 3 else (0, 0)
    for at, byte in enumerate(line[1:]):
        (a, c), b = corner(at), above[at]
        nearest = min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
        done.append((byte + {1: a, 2: b, 4: nearest}[line[0]]) & 255)
    above = bytes(done)
    for column in range(width):
        dot = above[3 * column:3 * column + 3]
        counts[dot] = counts.get(dot, 0) + 1
print(width, height, counts.get(bytes([31, 111, 235]), 0) > 1000, counts[bytes([255] * 3)] > width * height // 2)
"#;

#[test]
fn a_plot_is_a_picture_that_the_standard_reader_accepts() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = recorded(folder.path());
    let picture = folder.path().join("a.png");
    let plotted = motorium(&["plot", text(&file), "panda/joint_state.position[0..3]", "-o", text(&picture)]);
    assert!(plotted.status.success(), "{}", String::from_utf8_lossy(&plotted.stderr));
    let bytes = std::fs::read(&picture).expect("written");
    assert!(bytes.starts_with(b"\x89PNG\r\n\x1a\n") && bytes.len() < 400_000, "{} bytes", bytes.len());
    let Some(python) = python("zlib") else { return };
    assert_eq!(printed(&python, PICTURE, &[&picture]), "1640 880 True True\n");
}
