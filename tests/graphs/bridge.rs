//! Python programs of the book and of graphs, in parallel to a running graph.

use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::program::printed;
use crate::support::{Run, leftovers, machine, workspace};
use motorium::launcher::Exit;

/// Returns a Python with iceoryx2's wheel: `MOTORIUM_PYTHON`, which must then have it, or the system's
/// Python.
fn python() -> Option<PathBuf> {
    let named = std::env::var_os("MOTORIUM_PYTHON").map(PathBuf::from);
    let python = named.clone().unwrap_or_else(|| "python3".into());
    let check = Command::new(&python).args(["-c", "import iceoryx2"]).stderr(Stdio::null()).status();
    let works = check.is_ok_and(|status| status.success());
    assert!(works || named.is_none(), "{} cannot import iceoryx2", python.display());
    works.then_some(python)
}

/// The block of this kind and index in the page of the bridge.
fn example(kind: &str, index: usize) -> String {
    let page = workspace().join("docs/src/kinds/bridge-iceoryx2.md");
    let page = std::fs::read_to_string(page).expect("the page is there");
    let opening = format!("```{kind}\n");
    let program = page.split(&opening).nth(index + 1).and_then(|rest| rest.split("```").next());
    program.expect("the page holds it").to_string()
}

/// Returns a Python with the wheel, or reports that the test is skipped.
fn python_or_skip() -> Option<PathBuf> {
    let python = python();
    if python.is_none() {
        eprintln!(
            "skipped: no python3 with the wheel (pip install \"iceoryx2==0.10.*\", then MOTORIUM_PYTHON)"
        );
    }
    python
}

#[test]
fn python_program_of_the_book_moves_the_arm() {
    let Some(python) = python_or_skip() else { return };
    let _machine = machine();
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    write("motorium_types.py", &printed(&["schema", "python"]));
    write("lift.py", &example("python", 0));
    let program = || {
        let mut program = Command::new(&python);
        program
            .arg("lift.py")
            .env("PYTHONUNBUFFERED", "1")
            .current_dir(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        program
    };

    let run = Run::start(Path::new("graphs/panda-bridge.toml"), &["--for", "6 s"]);
    let name = run.folder.id().to_string();
    // the first program is killed immediately: its slot must be free for the next
    let mut killed = program().spawn().expect("python starts");
    let mut first = String::new();
    BufReader::new(killed.stdout.take().expect("it is piped")).read_line(&mut first).expect("its first line");
    killed.kill().expect("it runs");
    killed.wait().expect("it ends");
    let output = program().output().expect("python runs");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let lines = String::from_utf8_lossy(&output.stdout);
    let joints: Vec<(u64, f64)> = lines
        .lines()
        .filter_map(|line| line.split_once(' '))
        .map(|(sequence, joint)| (sequence.parse().expect("a number"), joint.parse().expect("an angle")))
        .collect();

    let ended = run.finish();
    let report = ended.report();
    assert_eq!(report.exit, Exit::Finished);
    assert!(joints.len() > 10, "{} samples", joints.len());
    assert!(joints.windows(2).all(|pair| pair[0].0 < pair[1].0), "{joints:?}");
    let (first, last) = (joints[0].1, joints[joints.len() - 1].1);
    assert!((first - last).abs() > 0.005, "joint 2 from {first} to {last} rad");
    let counts = &report.results["bridge"]["in"]["panda/target"];
    // the bridge shares its core with everything else: only the limit is certain
    assert!((Some(10)..=Some(600)).contains(&counts["published"].as_u64()), "{counts}");
    assert_eq!(counts["refused"]["not_finite"].as_u64(), Some(0), "{counts}");
    assert_eq!(leftovers(&name), Vec::<String>::new());
}

#[test]
fn the_python_program_of_the_book_filters_a_cloud() {
    let Some(python) = python_or_skip() else { return };
    let _machine = machine();
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    write("motorium_types.py", &printed(&["schema", "python"]));
    write("obstacles.py", &example("python", 1));
    let below = workspace().join("graphs/lidar-drive.toml");
    let graph = example("toml cloud", 0);
    write("cloud.toml", &graph.replace("lidar-drive.toml", below.to_str().expect("a plain path")));

    let run = Run::start(&folder.path().join("cloud.toml"), &["--for", "6 s"]);
    let name = run.folder.id().to_string();
    let output = Command::new(&python).arg("obstacles.py").current_dir(folder.path()).output();
    let output = output.expect("python runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8_lossy(&output.stdout);
    let numbers = |line: &str| line.split(' ').map(|number| number.parse().expect("a number")).collect();
    let scans: Vec<Vec<u64>> = lines.lines().map(numbers).collect();
    let ended = run.finish();
    let report = ended.report();
    assert_eq!(report.exit, Exit::Finished, "{}", ended.stderr);
    assert_eq!(scans.len(), 10, "{lines}");
    // sequences, points of a scan, and those nearby: walls are farther away than 1.5 m, some of them
    assert!(scans.windows(2).all(|pair| pair[0][0] < pair[1][0]), "{lines}");
    assert!(scans.iter().all(|scan| scan[1] <= 360 && scan[2] < scan[1]), "{lines}");
    let counts = &report.results["bridge"]["in"]["rover/obstacles"];
    assert_eq!((counts["received"].as_u64(), counts["published"].as_u64()), (Some(10), Some(10)), "{counts}");
    assert_eq!(counts["lost"].as_u64(), Some(0), "{counts}");
    assert!(report.results["bridge"]["out"]["rover/points"]["mirrored"].as_u64() >= Some(10));
    assert_eq!(leftovers(&name), Vec::<String>::new());
}

#[test]
fn chunks_of_a_python_program_move_the_arm() {
    let Some(python) = python_or_skip() else { return };
    let _machine = machine();
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("motorium_types.py"), printed(&["schema", "python"])).expect("written");
    let run = Run::start(Path::new("graphs/panda-chunks.toml"), &["--for", "8 s"]);
    let name = run.folder.id().to_string();
    // it ends before the run, and then the arm holds
    let output = Command::new(&python)
        .arg(workspace().join("graphs/panda-chunks/play.py"))
        .arg("4")
        .env("PYTHONPATH", folder.path())
        .output()
        .expect("python runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let ended = run.finish();
    let report = ended.report();
    assert_eq!(report.exit, Exit::Finished, "{}", ended.stderr);
    let result = &report.results["controller"];
    let count = |key: &str| result["chunks"][key].as_u64().unwrap_or_else(|| panic!("no {key} in {result}"));
    assert!(count("played") >= 3 && count("refused") == 0, "{result}");
    // every chunk is at least 50 ms late, which is more than a period of its actions
    assert!(count("late_actions") >= count("played"), "{result}");
    assert!(result["stale"].as_u64() >= Some(1), "the chunks end before the run: {result}");
    assert_eq!(leftovers(&name), Vec::<String>::new());
}
