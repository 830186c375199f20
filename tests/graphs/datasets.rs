//! Datasets with pictures, read back by pyarrow and Python's zlib, and by LeRobot itself if
//! `MOTORIUM_LEROBOT` names an interpreter that has it: its packages are several gigabytes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use motorium_bridges::recording::{RecordedPicture, Recording};

use crate::exports::{motorium, printed, python, text};
use crate::support::{run, workspace};

const FPS: u64 = 20;

/// A depth camera next to a colour camera.
const DEPTH: &str = r#"
[component.scene]
kind      = "sensor.depth_camera"
robot     = "panda"
rate      = "20 Hz"
spin      = "0 us"
budget    = "4 ms"
subscribe = { joint_state = "panda/true_joint_state", object_poses = "world/objects" }
publish   = { depth = "scene/depth", grey = "scene/grey", info = "scene/info" }

[component.scene.config]
width  = 64
height = 48
mount  = { frame = "world", position = [1.4, 0.0, 0.8], rpy = [0.0, 0.5, 3.14159] }
"#;

/// Two episodes of a Panda with a camera in its hand and another next to it, each of 400 ms.
pub(crate) fn recorded(folder: &Path) -> PathBuf {
    let (file, overlay) = (folder.join("eyes.mcap"), folder.join("depth.toml"));
    fs::write(&overlay, DEPTH).expect("written");
    let arguments = ["--clock", "lockstep", "--for", "400 ms", "--episodes", "2", "--no-expect"];
    let files = ["--with", text(&overlay), "--record", text(&file)];
    let graph = workspace().join("graphs/camera-servo.toml");
    let ended = run(&graph, &[&arguments[..], &files].concat());
    assert_eq!(ended.report().results["recorder"]["lost"], 0, "{}", ended.stderr);
    file
}

/// Returns the pixels (red, green, blue) of a topic's newest picture at each frame of an episode that begins
/// at `from_ns` in the recording. The first frame is at the time when all topics of the dataset have values.
fn expected(recording: &Recording, topic: &str, cameras: &[&str], from_ns: u64, frames: u64) -> Vec<Vec<u8>> {
    let of_topic = |topic: &str| {
        let index = recording.pictures().iter().position(|pictures| pictures.topic == topic).expect(topic);
        let found = recording.images().filter(move |picture| picture.pictures == index);
        found.filter(|picture| picture.time_ns >= from_ns).collect::<Vec<RecordedPicture>>()
    };
    let signals = ["panda/joint_state", "panda/joint_command"].map(|topic| {
        let index = recording.topic(topic).expect(topic);
        let mut samples = recording.samples().map(Result::unwrap);
        samples.find(|sample| sample.topic == index && sample.time_ns >= from_ns).expect("a sample").time_ns
    });
    let pictures = cameras.iter().map(|camera| of_topic(camera)[0].time_ns);
    let first_ns = pictures.chain(signals).max().unwrap();
    let own = of_topic(topic);
    let frames = (0..frames).map(|frame| first_ns + frame * 1_000_000_000 / FPS);
    frames
        .map(|time_ns| {
            let newest = own.iter().take_while(|picture| picture.time_ns <= time_ns).last().unwrap();
            let image = newest.image().expect("a picture");
            match image.encoding.as_str() {
                "rgb8" => image.data.to_vec(),
                "mono8" => image.data.iter().flat_map(|grey| [*grey; 3]).collect(),
                other => panic!("{other}"),
            }
        })
        .collect()
}

/// The pictures of each frame equal the raw files pixel by pixel; the statistics cover all pixels.
const WITH_PYARROW: &str = r#"
import json, math, struct, sys, zlib
from pathlib import Path
import pyarrow as arrow
import pyarrow.parquet as parquet

def pixels(data):
    at, parts = 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        content = data[at + 8:at + 8 + length]
        assert zlib.crc32(kind + content) == struct.unpack(">I", data[at + 8 + length:at + 12 + length])[0]
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", content[:10])
            assert (depth, colour) == (8, 2)
        parts += content if kind == b"IDAT" else b""
        at += 12 + length
    rows, above, all = zlib.decompress(parts), bytes(3 * width), b""
    for row in range(height):
        line, done = rows[row * (3 * width + 1):(row + 1) * (3 * width + 1)], bytearray()
        for at, byte in enumerate(line[1:]):
            a, b, c = (done[at - 3] if at >= 3 else 0), above[at], (above[at - 3] if at >= 3 else 0)
            nearest = min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
            done.append((byte + {1: a, 2: b, 4: nearest}[line[0]]) & 255)
        above = bytes(done)
        all += above
    return width, height, all

root, raw = Path(sys.argv[1]), Path(sys.argv[2])
info = json.loads((root / "meta/info.json").read_text())
stats = json.loads((root / "meta/stats.json").read_text())
data = parquet.read_table(root / "data/chunk-000/file-000.parquet")
frames = data.num_rows
episodes = parquet.read_table(root / "meta/episodes/chunk-000/file-000.parquet")

def agree(of, count, counts):
    for colour in range(3):
        values = [value for value in range(256) if counts[colour][value]]
        total = sum(counts[colour])
        mean = math.fsum(value * counts[colour][value] for value in values) / total
        deviation = math.sqrt(math.fsum((value - mean) ** 2 * counts[colour][value] for value in values) / total)
        found = {key: value if key == "count" else value[colour][0][0] for key, value in of.items()}
        assert found["count"] == [count] and (found["min"], found["max"]) == (values[0] / 255, values[-1] / 255)
        assert math.isclose(found["mean"], mean / 255) and math.isclose(found["std"], deviation / 255)

for name, size in [("camera", (160, 120)), ("scene_grey", (64, 48))]:
    feature = f"observation.images.{name}"
    assert info["features"][feature] == {
        "dtype": "image", "shape": [size[1], size[0], 3], "names": ["height", "width", "channels"]}
    kind = data.schema.field(feature).type
    assert kind.field("bytes").type == arrow.binary() and kind.field("path").type == arrow.string()
    counts = [[[0] * 256 for _ in range(3)] for _ in range(episodes.num_rows)]
    of_frames = list(zip(data["episode_index"].to_pylist(), data["frame_index"].to_pylist()))
    for frame, file in enumerate(data[feature].to_pylist()):
        raw_file = raw / "{}-{}-{}".format(name, *of_frames[frame])
        width, height, found = pixels(file["bytes"])
        assert (width, height) == size and file["path"] == f"frame-{frame:06d}.png"
        assert found == raw_file.read_bytes(), (name, frame)
        for colour in range(3):
            for value in found[colour::3]:
                counts[of_frames[frame][0]][colour][value] += 1
    agree(stats[feature], frames, [[sum(both) for both in zip(*of_colour)] for of_colour in zip(*counts)])
    for index, episode in enumerate(episodes.to_pylist()):
        prefix = f"stats/{feature}/"
        of = {key.removeprefix(prefix): value for key, value in episode.items() if key.startswith(prefix)}
        assert set(of) == set(stats[feature]), of
        agree(of, episode["length"], counts[index])
        assert episodes.schema.field(prefix + "mean").type.value_type.value_type.value_type == arrow.float64()
assert not any("depth" in name for name in info["features"])
print(frames, "frames of", len(set(info["features"]) & set(stats)), "features")
"#;

/// LeRobot opens the dataset and returns each frame with its pictures, as for its own datasets: alone, in
/// batches, with frames before and after it, and for chosen episodes. Its tools split the dataset, and its
/// recorder appends to it.
const WITH_LEROBOT: &str = r#"
import sys
from pathlib import Path
import numpy
from lerobot.datasets.lerobot_dataset import LeRobotDataset
root, raw = Path(sys.argv[1]), Path(sys.argv[2])
data = LeRobotDataset("user/eyes", root=root)
assert data.meta.camera_keys == ["observation.images.camera", "observation.images.scene_grey"], data.meta.camera_keys
for name, (width, height) in [("camera", (160, 120)), ("scene_grey", (64, 48))]:
    for frame in range(len(data)):
        item = data[frame]
        picture = item[f"observation.images.{name}"]
        raw_file = raw / f"{name}-{item['episode_index']}-{item['frame_index']}"
        assert tuple(picture.shape) == (3, height, width) and str(picture.dtype) == "torch.float32"
        found = (picture * 255).round().to("cpu").numpy().astype(numpy.uint8).transpose(1, 2, 0)
        assert found.tobytes() == raw_file.read_bytes(), (name, frame)
    assert data.meta.stats[f"observation.images.{name}"]["mean"].shape == (3, 1, 1)
item = data[len(data) - 1]
assert item["task"] == "look at the ball" and item["episode_index"] == 1, item
before_and_after = {"observation.state": [-0.05, 0.0], "action": [0.0, 0.05, 0.1]}
around = LeRobotDataset("user/eyes", root=root, delta_timestamps=before_and_after)
for frame in range(len(data)):
    item, found = data[frame], around[frame]
    episode = data.meta.episodes[int(item["episode_index"])]
    first, end = episode["dataset_from_index"], episode["dataset_to_index"]
    for feature, steps in [("observation.state", [-1, 0]), ("action", [0, 1, 2])]:
        for place, step in enumerate(steps):
            there = min(max(frame + step, first), end - 1)
            assert (found[feature][place] == data[there][feature]).all(), (frame, feature, step)
            assert bool(found[feature + "_is_pad"][place]) == (there != frame + step), (frame, feature, step)
second = LeRobotDataset("user/eyes", root=root, episodes=[1])
assert len(second) == data.meta.episodes[1]["length"] and int(second[0]["episode_index"]) == 1
assert (second[0]["observation.images.camera"] == data[len(data) - len(second)]["observation.images.camera"]).all()
states = numpy.stack([data[frame]["observation.state"].numpy() for frame in range(len(data))]).astype(numpy.float64)
for name, of in [("mean", states.mean(0)), ("std", states.std(0)), ("q10", numpy.quantile(states, 0.1, axis=0))]:
    assert numpy.allclose(data.meta.stats["observation.state"][name], of, rtol=1e-5, atol=1e-7), name

import shutil
import tempfile
with tempfile.TemporaryDirectory() as folder:
    from lerobot.datasets.dataset_tools import delete_episodes
    kept = delete_episodes(data, [0], output_dir=Path(folder) / "kept", repo_id="user/kept")
    assert kept.num_episodes == 1 and kept.num_frames == len(second)
    found = kept.meta.stats["observation.images.camera"]
    pictures = numpy.stack([second[frame]["observation.images.camera"].numpy() for frame in range(len(second))])
    assert numpy.allclose(numpy.ravel(found["mean"]), pictures.mean(axis=(0, 2, 3)), rtol=1e-5), found
    shutil.copytree(root, Path(folder) / "more")
    more = LeRobotDataset.resume("user/more", root=Path(folder) / "more")
    for frame in range(3):
        empty = {"observation.state": (8,), "action": (8,)}
        frame = {name: numpy.zeros(shape, numpy.float32) for name, shape in empty.items()}
        for name, shape in [("camera", (120, 160, 3)), ("scene_grey", (48, 64, 3))]:
            frame[f"observation.images.{name}"] = numpy.zeros(shape, numpy.uint8)
        more.add_frame({**frame, "task": "look away"})
    more.save_episode()
    more.finalize()
    more = LeRobotDataset("user/more", root=Path(folder) / "more")
    assert (more.num_episodes, more.num_frames) == (3, len(data) + 3)
    assert (more[0]["task"], more[len(data)]["task"]) == ("look at the ball", "look away")
from torch.utils.data import DataLoader
batch = next(iter(DataLoader(data, batch_size=4, shuffle=False)))
assert tuple(batch["observation.images.camera"].shape) == (4, 3, 120, 160)
import lerobot
print("lerobot", lerobot.__version__, "opens", data.num_episodes, "episodes of", len(data), "frames")
"#;

#[test]
fn each_dataset_frame_has_the_newest_picture_of_each_camera() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = recorded(folder.path());
    let recording = Recording::open(&file).expect("a recording");
    let cameras: Vec<&str> = recording.pictures().iter().map(|pictures| pictures.topic.as_str()).collect();
    assert_eq!(cameras, ["camera/image", "scene/depth", "scene/grey"]);

    let (dataset, raw) = (folder.path().join("eyes"), folder.path().join("raw"));
    let arguments = ["export", text(&file), "--format", "lerobot", "--fps", "20", "--output", text(&dataset)];
    let exported = motorium(&[&arguments[..], &["--task", "look at the ball"]].concat());
    let (said, note) =
        (String::from_utf8_lossy(&exported.stdout), String::from_utf8_lossy(&exported.stderr).into_owned());
    assert!(exported.status.success(), "{note}");
    assert!(note.contains("`scene/depth`") && note.contains("left out"), "{note}");
    let frames =
        said.split_whitespace().find_map(|word| word.parse::<u64>().ok()).expect("a number of frames");
    assert!(frames >= 12 && said.ends_with("frames in 2 episodes\n"), "{said}");

    fs::create_dir(&raw).expect("a folder");
    let kept = ["camera/image", "scene/grey"];
    let second_ns =
        recording.samples().map(Result::unwrap).find(|sample| sample.stamp.episode == 1).unwrap().time_ns;
    for (topic, name) in [("camera/image", "camera"), ("scene/grey", "scene_grey")] {
        for (episode, from_ns) in [0, second_ns].into_iter().enumerate() {
            let of_each = expected(&recording, topic, &kept, from_ns, frames);
            for (frame, pixels) in of_each.iter().enumerate() {
                fs::write(raw.join(format!("{name}-{episode}-{frame}")), pixels).expect("written");
            }
        }
    }
    if let Some(python) = python("pyarrow") {
        assert_eq!(
            printed(&python, WITH_PYARROW, &[&dataset, &raw]),
            format!("{frames} frames of 9 features\n")
        );
    }
    let Some(python) = std::env::var_os("MOTORIUM_LEROBOT").map(PathBuf::from) else {
        eprintln!("SKIPPED: MOTORIUM_LEROBOT names no interpreter with lerobot (pip install lerobot)");
        return;
    };
    let printed = printed(&python, WITH_LEROBOT, &[&dataset, &raw]);
    assert!(printed.ends_with(&format!("opens 2 episodes of {frames} frames\n")), "{printed}");
    eprint!("{printed}");
}

#[test]
fn unsupported_pictures_are_refused_but_may_be_left_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, dataset) = (recorded(folder.path()), folder.path().join("eyes"));
    let export = |arguments: &[&str]| {
        let common = ["export", text(&file), "--format", "lerobot", "--output", text(&dataset)];
        let output =
            Command::new(crate::MOTORIUM).args(common).args(arguments).output().expect("motorium starts");
        (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (done, said) = export(&["--pictures", "scene/depth"]);
    assert!(!done && said.contains("`scene/depth`") && said.contains("depths in metres"), "{said}");
    let (done, said) = export(&["--pictures", "camera/imag"]);
    assert!(!done && said.contains("did you mean `camera/image`?"), "{said}");
    let (done, said) = export(&["--no-pictures"]);
    assert!(done && !said.contains("note"), "{said}");
    let info = fs::read_to_string(dataset.join("meta/info.json")).expect("written");
    assert!(!info.contains("observation.images"), "{info}");
}
