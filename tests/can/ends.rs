//! The virtual machine ends together with the program that started it.

use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Returns `true` if a process has this text in its command line.
fn runs(text: &str) -> bool {
    let processes = std::fs::read_dir("/proc").expect("/proc").filter_map(Result::ok);
    let line = |entry: std::fs::DirEntry| std::fs::read(entry.path().join("cmdline")).unwrap_or_default();
    processes.map(line).any(|line| line.windows(text.len()).any(|part| part == text.as_bytes()))
}

/// Waits until such a process runs, or no longer runs. Returns `false` after a minute.
fn awaited(text: &str, is_running: bool) -> bool {
    let until = Instant::now() + Duration::from_secs(60);
    while runs(text) != is_running {
        if Instant::now() > until {
            return false;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    true
}

#[test]
fn the_machine_ends_with_a_killed_program() {
    if super::machine().is_none() {
        eprintln!("skipped: no virtual machine");
        return;
    }
    let scratch = tempfile::tempdir().expect("a folder");
    let (folder, script) = (scratch.path(), scratch.path().join("script"));
    std::fs::write(&script, "sleep 3600").expect("a file");
    let vm = Path::new(env!("CARGO_MANIFEST_DIR")).join("can/vm.sh");
    let program = format!("bash {} {} & wait", vm.display(), script.display());
    let mut program = Command::new("bash")
        .args(["-c", &program])
        .env("TMPDIR", folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .process_group(0)
        .spawn()
        .expect("bash starts");
    // the emulator writes its output into the folder
    let emulator = format!("file:{}", folder.display());
    let has_started = awaited(&emulator, true);
    program.kill().expect("it is killed");
    program.wait().expect("it has ended");
    assert!(has_started, "the machine starts");
    assert!(awaited(&emulator, false), "the machine ends");
    let left = || {
        let files = std::fs::read_dir(folder).expect("the folder").filter_map(Result::ok);
        files.filter(|file| file.path() != script).map(|file| file.path()).collect::<Vec<_>>()
    };
    let until = Instant::now() + Duration::from_secs(60);
    while !left().is_empty() && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(50));
    }
    assert_eq!(left(), Vec::<std::path::PathBuf>::new(), "nothing of it is left");
}
