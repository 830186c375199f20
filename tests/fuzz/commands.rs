//! Commands that read a user's file, run with damaged files as a user would run them.
//!
//! Each input gets 5 s of processor time and 200 MB of data memory, enforced by the system. A command that
//! needs more, panics, or waits for ever fails. `MOTORIUM_FUZZ_CASES` sets the total number of damaged inputs
//! of all commands (about 10,000 for a thorough run); without it each command gets one batch.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::target::{Length, cases, files, target_for, workspace};

const MOTORIUM: &str = env!("CARGO_BIN_EXE_motorium-under-test");
/// Largest processor time of one command, s.
const LONGEST_S: u32 = 5;
/// Largest data memory of one command, kB.
const LARGEST_KB: u32 = 200 * 1024;

/// A reader: arguments of `motorium` in which `FILE` is the damaged file, the file extension, and its
/// undamaged files.
struct Reader {
    arguments: &'static [&'static str],
    ending: &'static str,
    corpus: Vec<Vec<u8>>,
}

fn reader(arguments: &'static [&'static str], ending: &'static str, corpus: Vec<Vec<u8>>) -> Reader {
    Reader { arguments, ending, corpus }
}

/// Returns the command under the limits of one input. A shell sets them, because they pass to the program
/// that replaces it.
fn limited(arguments: &[String], folder: &Path) -> Command {
    let limits = format!("ulimit -c 0; ulimit -t {LONGEST_S}; ulimit -d {LARGEST_KB}; exec \"$@\"");
    let mut command = Command::new("timeout");
    // A command that waits for ever uses no processor time, so limit the wall time as well.
    command.args(["--signal=KILL", "120", "sh", "-c", &limits, "sh", MOTORIUM]).args(arguments);
    command.current_dir(folder).stdin(Stdio::null()).env("RUST_BACKTRACE", "0");
    command
}

fn run(folder: &Path, arguments: &[&str], file: &str) {
    let arguments: Vec<String> = arguments.iter().map(|argument| argument.replace("FILE", file)).collect();
    let output = limited(&arguments, folder).output().expect("the command starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    // 101 is a panic; above 123 the command was killed, aborted or not started.
    let is_orderly = output.status.code().is_some_and(|code| code < 100);
    assert!(is_orderly && !errors.contains("panicked"), "{arguments:?}: {}\n{errors}", output.status);
}

fn try_all(name: &str, readers: Vec<Reader>) {
    let share = cases().map_or(1, |all| all.div_ceil(COMMANDS));
    for (place, Reader { arguments, ending, corpus }) in readers.into_iter().enumerate() {
        let file = format!("file{ending}");
        target_for(&format!("{name}-{place}"), &corpus, Length::Cases(share), &|bytes: &[u8]| {
            let folder = tempfile::tempdir().expect("a folder");
            let beside = companions(&file);
            let damaged = (file.as_str(), bytes);
            for (name, bytes) in beside.iter().map(|(name, text)| (*name, text.as_bytes())).chain([damaged]) {
                std::fs::write(folder.path().join(name), bytes).expect("the file can be written");
            }
            run(folder.path(), arguments, &file);
        });
    }
}

/// Number of commands below, which share the inputs.
const COMMANDS: u64 = 34;
/// Frames in the output format of `candump -L`.
const LOG: &str = "(1436509052.249713) vcan0 044#2A366C2BBA\n(1436509052.449847) vcan0 0F6#7ADFE07BD2\n\
    (1436509052.850018) vcan0 1F334455#1122334455667788\n(1436509053.100000) can1 123##50011223344\n";

/// Undamaged files that refer to the damaged one, or that a command needs in addition.
fn companions(file: &str) -> [(&'static str, String); 4] {
    let world = format!(
        r#"name = "world"
        [robot.arm]
        urdf = "pendulum"
        [world]
        file = "{file}"
        [component.physics]
        kind = "physics.articulated"
        robot = "arm"
        rate = "1 kHz"
        subscribe = {{ joint_command = "arm/joint_command" }}
        publish = {{ joint_state = "arm/joint_state" }}
        [component.policy]
        kind = "policy.home"
        robot = "arm"
        trigger = "arm/joint_state"
        subscribe = {{ joint_state = "arm/joint_state" }}
        publish = {{ joint_command = "arm/joint_command" }}"#
    );
    let drives = std::fs::read_to_string(workspace().join("graphs/panda-can-sim.toml"));
    let drives = drives.expect("the graph is there").replace("drives/panda.toml", file);
    let robot = format!(
        r#"<robot name="own"><link name="base"/><link name="arm"><inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0"
        iyy="0.1" iyz="0" izz="0.1"/></inertial><collision><geometry><mesh filename="{file}"/></geometry></collision></link>
        <joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/></joint></robot>"#
    );
    [("log", LOG.to_string()), ("world.toml", world), ("drives.toml", drives), ("robot.urdf", robot)]
}

fn texts(texts: &[&str]) -> Vec<Vec<u8>> {
    texts.iter().map(|text| text.as_bytes().to_vec()).collect()
}

#[test]
fn files_of_robots_and_worlds() {
    let urdf = || files(&["robots/catalogue/rrbot", "tests/fuzz/corpus/urdf"], &[".urdf"]);
    let mjcf = || files(&["robots/tests/mujoco", "tests/fuzz/corpus/mjcf"], &[".xml"]);
    let states = r#"{"joints": ["joint1", "joint2"], "gravity": [0, 0, -9.81], "cases": [{"q": [0.1, -0.4], "v": [1.0, 0.0],
        "a": [0, 1], "tau": [0, 2], "fext": {"frame": "tool_link", "wrench_local": [1, 2, 3, 4, 5, 6]}}]}"#;
    let named = r#"{"cases": [{"joint_positions": {"joint1": 0.5}}], "dt": 0.01}"#;
    try_all(
        "robots",
        vec![
            reader(&["robot", "check", "FILE"], ".urdf", urdf()),
            reader(&["robot", "show", "FILE", "--json"], ".xml", mjcf()),
            reader(&["robot", "profile", "FILE"], ".urdf", urdf()),
            reader(&["robot", "draw", "FILE"], ".xml", mjcf()),
            reader(
                &["robot", "eval", "rrbot", "--states", "FILE", "--json"],
                ".json",
                texts(&[states, named]),
            ),
        ],
    );
}

#[test]
fn graphs_and_tables_of_drives() {
    let graphs = || -> Vec<Vec<u8>> {
        // A graph with a program would start whatever path the damage produces.
        let all = files(&["graphs", "tests/fuzz/corpus/graphs"], &[".toml"]);
        all.into_iter().filter(|bytes| !bytes.windows(4).any(|word| word == b"exec")).collect()
    };
    try_all(
        "graphs",
        vec![
            reader(&["check", "FILE"], ".toml", graphs()),
            reader(&["can", "check", "FILE"], ".toml", graphs()),
            reader(&["can", "check", "drives.toml"], ".toml", files(&["graphs/drives"], &[".toml"])),
            reader(
                &["check", "world.toml"],
                ".xml",
                files(&["components/worlds/tests/worlds/mujoco"], &["world.xml"]),
            ),
            reader(&["check", "world.toml"], ".sdf", texts(&[SDF])),
        ],
    );
}

/// A world with a part of each supported kind.
const SDF: &str = r#"<?xml version="1.0"?><sdf version="1.9"><world name="w"><gravity>0 0 -1.62</gravity>
<model name="stone"><pose degrees="true">0 0 5 0 90 0</pose><link name="l"><inertial auto="true"><density>1000</density></inertial>
<collision name="c"><pose>0.1 0 0 0 0 0</pose><geometry><sphere><radius>0.1</radius></sphere></geometry>
<surface><friction><ode><mu>0.5</mu></ode></friction><bounce><restitution_coefficient>0.3</restitution_coefficient></bounce>
</surface></collision></link></model>
<model name="ground"><static>true</static><link name="l"><collision name="c"><geometry><plane><normal>0 0 1</normal>
<size>9 9</size></plane></geometry></collision><visual name="v"><geometry><box><size>1 2 3</size></box></geometry>
<material><diffuse>1 0 0 1</diffuse></material></visual></link></model></world></sdf>"#;

#[test]
fn meshes() {
    let obj =
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nf 1 3 2\nf 1 2 4\nf 1//1 4//1 3//1\nf -3 -2 -1\n";
    let stl = "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n\
               facet normal 1 0 0\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet\nendsolid s\n";
    let corner =
        |numbers: [f32; 12]| numbers.iter().flat_map(|x| x.to_le_bytes()).chain([0, 0]).collect::<Vec<u8>>();
    let triangles = [
        corner([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
        corner([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
    ];
    let binary = [vec![b'x'; 80], 2_u32.to_le_bytes().to_vec(), triangles.concat()].concat();
    let dae = r##"<COLLADA version="1.4.1"><asset><unit meter="0.01"/></asset><library_geometries><geometry id="g"><mesh>
        <source id="p"><float_array id="a" count="12">0 0 0 1 0 0 0 1 0 0 0 1</float_array><technique_common>
        <accessor source="#a" count="4" stride="3"/></technique_common></source><vertices id="v"><input semantic="POSITION"
        source="#p"/></vertices><polylist count="2"><input semantic="VERTEX" source="#v" offset="0"/><vcount>3 4</vcount>
        <p>0 1 2 0 1 2 3</p></polylist></mesh></geometry></library_geometries><library_visual_scenes><visual_scene id="s">
        <node><matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix><instance_geometry url="#g"/></node></visual_scene>
        </library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"##;
    let stl = vec![stl.as_bytes().to_vec(), binary];
    try_all(
        "meshes",
        vec![
            reader(&["robot", "draw", "robot.urdf"], ".obj", texts(&[obj])),
            reader(&["robot", "draw", "robot.urdf"], ".stl", stl.clone()),
            reader(&["robot", "draw", "robot.urdf"], ".dae", texts(&[dae])),
            reader(&["robot", "check", "robot.urdf"], ".stl", stl),
            reader(&["robot", "hulls", "robot.urdf", "--output", "out"], ".obj", texts(&[obj])),
        ],
    );
}

#[test]
fn problems_and_measurements() {
    let problem = r#"{"P": [[2, 0], [0, 2]], "q": [-2, -5], "G": [[1, 2], [-1, 2]], "h": [6, 2], "A": [[1, 1]], "b": [3],
        "lb": [0, 0], "ub": [9, 9]}"#;
    let rows = r#"{"problems": [{"hessian": [[1]], "gradient": [1], "lower": [0], "upper": [1]}]}"#;
    let bench = r#"{"arguments": ["latency"], "began_unix_s": 1, "denied": [], "machine": {}, "measurements": [
        {"name": "a", "unit": "us", "turns": [1.0, 2.0, 3.0, 4.0, 5.0]}]}"#;
    try_all(
        "problems",
        vec![
            reader(&["qp", "solve", "FILE", "--each", "--json"], ".json", texts(&[problem, rows])),
            reader(&["qp", "solve", "FILE", "--solver", "clarabel"], ".json", texts(&[problem, rows])),
            reader(&["bench", "compare", "FILE", "FILE"], ".json", texts(&[bench])),
        ],
    );
}

#[test]
fn files_of_buses() {
    let databases = files(&["components/can/tests/can/databases"], &[".dbc"]);
    try_all(
        "buses",
        vec![
            reader(&["can", "log", "--read", "FILE"], ".log", texts(&[LOG])),
            reader(&["can", "log", "--read", "log", "--dbc", "FILE"], ".dbc", databases),
        ],
    );
}

#[test]
fn primitives_and_demonstrations() {
    let recordings = |ending| files(&["tests/fuzz/corpus/recordings"], &[ending]);
    let primitives = || files(&["tests/fuzz/corpus/primitives"], &[".json"]);
    try_all(
        "primitives",
        vec![
            reader(&["primitive", "fit", "FILE"], ".csv", recordings(".csv")),
            reader(&["primitive", "fit", "FILE"], ".jsonl", recordings(".jsonl")),
            reader(
                &["primitive", "fit", "FILE", "FILE", "--output", "out.json"],
                ".json",
                recordings(".json"),
            ),
            reader(&["primitive", "show", "FILE"], ".json", primitives()),
            reader(&["primitive", "replay", "FILE", "--json"], ".json", primitives()),
        ],
    );
}

#[test]
fn motion_libraries() {
    let libraries = || files(&["tests/fuzz/corpus/libraries"], &[".mtlib"]);
    let recordings = files(&["tests/fuzz/corpus/recordings"], &[".csv"]);
    try_all(
        "libraries",
        vec![
            reader(&["library", "inspect", "FILE"], ".mtlib", libraries()),
            reader(&["library", "generate", "FILE"], ".mtlib", libraries()),
            reader(&["library", "build", "FILE", "--output", "out.mtlib"], ".csv", recordings),
        ],
    );
}

/// A recording of a typical graph, with and without checksums. Without them damage reaches the content.
fn recordings() -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("run.mcap");
    let mut command = Command::new(MOTORIUM);
    command.arg("run").arg(workspace().join("graphs/panda-reach.toml")).arg("--record").arg(&file);
    command.args(["--clock", "lockstep", "--for", "20 ms", "--no-expect"]).stdin(Stdio::null());
    let output = command.output().expect("motorium starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let whole = std::fs::read(&file).expect("the recording is there");
    let unsummed = without_sums(&whole);
    vec![whole, unsummed]
}

/// Returns an MCAP file whose checksums are 0, which marks missing checksums.
fn without_sums(file: &[u8]) -> Vec<u8> {
    const MAGIC: usize = 8;
    const HEAD: usize = 9;
    let (mut bytes, mut place) = (file.to_vec(), MAGIC);
    while place + HEAD <= bytes.len() - MAGIC {
        let (kind, length) = (bytes[place], bytes[place + 1..place + HEAD].try_into().expect("8 bytes"));
        let start = place + HEAD;
        let end = start + usize::try_from(u64::from_le_bytes(length)).expect("a length");
        match kind {
            // A chunk: after its times and its size.
            0x06 => bytes[start + 24..start + 28].fill(0),
            // An attachment, the end of the data, the footer: at the end.
            0x09 | 0x0f | 0x02 => bytes[end - 4..end].fill(0),
            _ => {}
        }
        place = end;
    }
    bytes
}

#[test]
fn recordings_of_runs() {
    let corpus = recordings();
    try_all(
        "runs",
        vec![
            reader(&["recover", "FILE", "--output", "out.mcap", "--overwrite"], ".mcap", corpus.clone()),
            reader(&["score", "FILE"], ".mcap", corpus.clone()),
            reader(&["export", "FILE", "--output", "tables", "--overwrite"], ".mcap", corpus.clone()),
            reader(&["report", "FILE", "--output", "out.html", "--overwrite"], ".mcap", corpus.clone()),
            reader(
                &["animate", "FILE", "--size", "64x48", "--output", "out.png", "--overwrite"],
                ".mcap",
                corpus.clone(),
            ),
            reader(&["replay", "FILE", "--speed", "0"], ".mcap", corpus.clone()),
            reader(
                &["plot", "FILE", "panda/joint_state.position", "--output", "out.svg", "--overwrite"],
                ".mcap",
                corpus,
            ),
        ],
    );
}
