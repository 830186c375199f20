//! The Python program of the book beside a running graph.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::program::printed;
use crate::support::{Run, leftovers, machine, workspace};
use motorium::launcher::Exit;

/// A Python with iceoryx2's wheel: `MOTORIUM_PYTHON`, which must then have it, or the system's Python.
fn python() -> Option<PathBuf> {
    let named = std::env::var_os("MOTORIUM_PYTHON").map(PathBuf::from);
    let python = named.clone().unwrap_or_else(|| "python3".into());
    let check = Command::new(&python).args(["-c", "import iceoryx2"]).stderr(Stdio::null()).status();
    let works = check.is_ok_and(|status| status.success());
    assert!(works || named.is_none(), "{} cannot import iceoryx2", python.display());
    works.then_some(python)
}

/// The program in the page of the bridge.
fn example() -> String {
    let page = workspace().join("docs/src/kinds/bridge-iceoryx2.md");
    let page = std::fs::read_to_string(page).expect("the page is there");
    let program = page.split("```python\n").nth(1).and_then(|rest| rest.split("```").next());
    program.expect("the page holds a program").to_string()
}

#[test]
fn the_python_program_of_the_book_moves_the_arm() {
    let Some(python) = python() else {
        eprintln!(
            "skipped: no python3 with the wheel (pip install \"iceoryx2==0.10.*\", then MOTORIUM_PYTHON)"
        );
        return;
    };
    let _machine = machine();
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    write("motorium_types.py", &printed(&["schema", "python"]));
    write("lift.py", &example());
    let program = || {
        let mut program = Command::new(&python);
        program.arg("lift.py").current_dir(folder.path()).stdout(Stdio::piped()).stderr(Stdio::piped());
        program
    };

    let run = Run::start(Path::new("graphs/panda-bridge.toml"), &["--for", "6 s"]);
    let name = run.folder.id().to_string();
    // the first is killed at once: its place must be free for the next
    let mut killed = program().spawn().expect("python starts");
    std::thread::sleep(std::time::Duration::from_millis(700));
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
    // the bridge shares its core with all else: only the limit is certain
    assert!((Some(10)..=Some(600)).contains(&counts["published"].as_u64()), "{counts}");
    assert_eq!(counts["refused"]["not_finite"].as_u64(), Some(0), "{counts}");
    assert_eq!(leftovers(&name), Vec::<String>::new());
}
