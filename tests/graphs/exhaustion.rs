//! Exhausted resources: each is named in an error, and nothing is left behind.

use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use motorium::launcher::Exit;

use rustix::process::{Pid, Resource, Rlimit};

use crate::faults::faulty;
use crate::support::{Ended, MOTORIUM, Run, is_root, kill, leftovers, machine, panda_reach, workspace};

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

/// A shell line in which `$MOTORIUM` is the command under test.
fn shell(line: &str) -> Command {
    let mut command = Command::new("bash");
    command.args(["-c", line]).env("MOTORIUM", MOTORIUM).env_remove("XDG_RUNTIME_DIR");
    command.current_dir(workspace()).stdin(Stdio::null());
    command
}

/// Name of each run in this file, which shows whether the run has left anything behind; other runs may exist
/// at the same time.
const NAME: &str = "short-of-something";

/// Runs a graph under a limit. It must run, or end with exit code 1 and one of these words. Nothing may stay
/// behind: checked in a separate `/dev/shm` if mounts are allowed, otherwise by name.
fn limited(limit: &str, words: &[&str]) -> bool {
    let line = format!(
        "{limit}; exec \"$MOTORIUM\" run graphs/panda-reach.toml --name {NAME} --force --for 200ms --set realtime.lost_steps=1"
    );
    let alone = mounts_are_allowed();
    let output = match alone {
        true => with_shared_memory("64m", 10_000, &format!("({line}) 2>&1")),
        false => shell(&line).output().expect("bash runs"),
    };
    let text = text(&output);
    let is_clean = !alone || text.contains("left: \n") || text.ends_with("left:\n");
    assert!(is_clean && leftovers(NAME).is_empty(), "`{limit}` left something behind: {text}");
    if output.status.success() {
        return true;
    }
    assert_eq!(output.status.code(), Some(1), "`{limit}`: {:?} {text}", output.status);
    assert!(words.iter().any(|word| text.contains(word)), "`{limit}`: {text}");
    false
}

#[test]
fn too_few_descriptors_are_named_and_nothing_is_left_behind() {
    let _machine = machine();
    let words = ["open files", "files open", "Too many open files", "error while loading shared libraries"];
    let ran: Vec<bool> = [5, 6, 8, 10, 12, 16, 20, 24, 30, 40, 60, 80, 200]
        .map(|n| limited(&format!("ulimit -n {n}"), &words))
        .into();
    assert_eq!((ran.first(), ran.last()), (Some(&false), Some(&true)), "{ran:?}");
    // A soft limit is raised as far as permitted.
    assert!(limited("ulimit -S -n 12", &words));
}

#[test]
fn files_that_may_not_grow_are_named_before_anything_is_made() {
    let _machine = machine();
    for blocks in [0, 1, 10, 100] {
        assert!(!limited(&format!("ulimit -f {blocks}"), &["the limit on file sizes"]));
    }
}

#[test]
fn too_few_processes_are_named_and_nothing_is_left_behind() {
    let _machine = machine();
    const LONELY: u32 = 64_321;
    if !is_root() || !shell("\"$MOTORIUM\" --version").uid(LONELY).output().is_ok_and(|o| o.status.success())
    {
        return eprintln!("skipped: needs root, and a program that other users can start");
    }
    let mut ran = Vec::new();
    // The shell is one process, and each process of the graph has several threads.
    for processes in [1, 2, 3, 4, 6, 8, 10, 12, 16, 17, 18, 19, 20, 200] {
        let line = format!(
            "ulimit -u {processes}; exec \"$MOTORIUM\" run graphs/panda-reach.toml --name {NAME} --force --for 200ms --set realtime.lost_steps=1"
        );
        let output = shell(&line).uid(LONELY).gid(LONELY).output().expect("bash runs");
        let text = text(&output);
        assert_eq!(leftovers(NAME), Vec::<String>::new(), "{processes} processes: {text}");
        assert_eq!(
            leftovers(&format!("motorium-{LONELY}")),
            Vec::<String>::new(),
            "{processes} processes: {text}"
        );
        assert!(matches!(output.status.code(), Some(0 | 1)), "{processes}: {:?} {text}", output.status);
        assert!(!text.contains("panicked"), "{processes}: {text}");
        assert!(output.status.success() || text.contains("`ulimit -u"), "{processes}: {text}");
        ran.push(output.status.success());
    }
    assert_eq!((ran.first(), ran.last()), (Some(&false), Some(&true)), "{ran:?}");
}

/// Counts the threads of a process by name, or all of them for `None`.
fn threads(pid: u32, named: Option<&[&str]>) -> u64 {
    let tasks = std::fs::read_dir(format!("/proc/{pid}/task")).expect("the process is there").flatten();
    let names = tasks.map(|task| std::fs::read_to_string(task.path().join("comm")).unwrap_or_default());
    names.filter(|name| named.is_none_or(|named| named.contains(&name.trim()))).count() as u64
}

#[test]
fn run_needs_only_the_computed_processes_and_threads() {
    let _machine = machine();
    const LONELY: u32 = 64_322;
    let command = "ulimit -u 8; exec \"$MOTORIUM\" run graphs/panda-reach.toml --force --for 200ms --set realtime.lost_steps=1";
    if !is_root() || !shell("\"$MOTORIUM\" --version").uid(LONELY).output().is_ok_and(|o| o.status.success())
    {
        return eprintln!("skipped: needs root, and a program that other users can start");
    }
    let message = text(&shell(command).uid(LONELY).gid(LONELY).output().expect("bash runs"));
    let needs = message.split_once("the graph needs ").and_then(|(_, rest)| rest.split_once(" more"));
    let needs: u64 = needs.and_then(|(number, _)| number.parse().ok()).unwrap_or_else(|| panic!("{message}"));
    let run = Run::start(&panda_reach(), &["--for", "60 s"]);
    let components = ["physics", "encoder", "policy", "controller"];
    let takes = threads(run.launcher(), Some(&["relay", "ending"]))
        + threads(run.guard(), None)
        + components.map(|component| threads(run.pid_of(component), None)).iter().sum::<u64>();
    // One more frees the slots of dead processes.
    assert_eq!(needs, takes + 1, "{message}");
}

#[test]
fn exhausted_files_of_a_component_follow_the_policy() {
    let _machine = machine();
    let restart = "restart = { when = \"failure\" }\ncore = 0\ncpu_limit = \"30 s\"\nhang_after = \"30 s\"";
    let (_folder, graph) = faulty("{ fault = \"open\", at = 200, once = true }", restart);
    let run = format!(
        "ulimit -n 256; exec \"$MOTORIUM\" run {} --name {NAME} --force --for 4s --set realtime.lost_steps=1",
        graph.display()
    );
    let output = shell(&run).output().expect("bash runs");
    let text = text(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    let message = ["`faulty` at tick 200", "Too many open files", "`faulty` steps again after"];
    assert!(message.iter().all(|words| text.contains(words)), "{text}");
    assert_eq!(leftovers(NAME), Vec::<String>::new(), "{text}");
}

#[test]
fn a_launcher_without_descriptors_stops_safely() {
    let _machine = machine();
    let restart = ["--for", "60 s", "--set", "controller.restart.when=failure"];
    let run = Run::start(&panda_reach(), &restart);
    let id = run.folder.id().to_string();
    // The limit equals the number of open descriptors, so that none is available for another one. Descriptors
    // that the launcher releases at the end are used for its clean-up.
    let is_open = |number: &u64| Path::new(&format!("/proc/{}/fd/{number}", run.launcher())).exists();
    let open = (0..1_000_000).find(|number| !is_open(number));
    let none = Rlimit { current: open, maximum: open };
    rustix::process::prlimit(Pid::from_raw(run.launcher() as i32), Resource::Nofile, none)
        .expect("it is a process of this user");
    kill(run.pid_of("controller"));
    let ended = run.finish();
    assert_eq!(ended.code, Some(4), "{}", ended.stderr);
    let Exit::SafeStop { reason } = &ended.report().exit else { panic!("{:?}", ended.report().exit) };
    assert!(reason.contains("controller") && reason.contains("Too many open files"), "{reason}");
    assert!(ended.stderr.contains("all actuators in their safe state"), "{}", ended.stderr);
    assert_eq!(leftovers(&id), Vec::<String>::new());
}

/// Runs a shell line with a separate `/dev/shm` of this size and number of files; the remaining files are
/// printed last.
fn with_shared_memory(size: &str, files: u32, line: &str) -> Output {
    let script = format!(
        "mount -t tmpfs -o size={size},nr_inodes={files},mode=1777 tmpfs /dev/shm || exit 77\n{line}\nrc=$?\n\
         echo left: $(find /dev/shm -mindepth 1); exit $rc"
    );
    let mut command = Command::new("unshare");
    command.args(["--mount", "sh", "-c", &script]).env("MOTORIUM", MOTORIUM).env_remove("XDG_RUNTIME_DIR");
    command.current_dir(workspace()).stdin(Stdio::null()).output().expect("unshare runs")
}

fn mounts_are_allowed() -> bool {
    is_root() && with_shared_memory("1m", 100, "true").status.code() == Some(0)
}

const RUN: &str =
    "\"$MOTORIUM\" run graphs/panda-reach.toml --force --for 200ms --set realtime.lost_steps=1 2>&1";

#[test]
fn too_little_shared_memory_is_named_before_the_start() {
    let _machine = machine();
    if !mounts_are_allowed() {
        return eprintln!("skipped: no mounts for this user");
    }
    let mut ran = Vec::new();
    for size in
        ["4k", "64k", "288k", "320k", "400k", "512k", "640k", "800k", "1m", "1200k", "1500k", "2m", "4m"]
    {
        let output = with_shared_memory(size, 10_000, RUN);
        let text = text(&output);
        assert!(text.contains("left: \n") || text.ends_with("left:\n"), "{size}: {text}");
        match output.status.code() {
            Some(0) => ran.push(true),
            Some(1) => {
                ran.push(false);
                assert!(
                    text.contains("shared memory") && text.contains("free in /dev/shm"),
                    "{size}: {text}"
                );
            }
            other => panic!("{size}: {other:?} {text}"),
        }
    }
    assert_eq!((ran.first(), ran.last()), (Some(&false), Some(&true)), "{ran:?}");
    for files in [2, 8, 30, 60] {
        let output = with_shared_memory("16m", files, RUN);
        let text = text(&output);
        assert_eq!(output.status.code(), Some(1), "{files} files: {text}");
        assert!(text.contains("can be created in /dev/shm"), "{files} files: {text}");
    }
}

/// The run continues while `fill` runs; then the controller is killed.
fn killed_after(fill: &str) -> String {
    let line = format!(
        "\"$MOTORIUM\" run graphs/panda-reach.toml --force --no-expect --for 5s --json --set realtime.lost_steps=1 --set controller.restart.when=failure >/dev/null 2>/tmp/motorium-full-$$ &\n\
         run=$!; sleep 2; {fill}\n\
         kill -9 $(pgrep -P $run -f 'motorium-worker .* controller$'); wait $run; rc=$?\n\
         rm -f /dev/shm/fill; cat /tmp/motorium-full-$$; rm /tmp/motorium-full-$$; (exit $rc)"
    );
    let output = with_shared_memory("8m", 10_000, &line);
    let text = text(&output);
    assert!(text.contains("left: \n") || text.ends_with("left:\n"), "{text}");
    // 7: components could not write their results.
    assert!(matches!(output.status.code(), Some(0 | 4 | 7)), "{:?} {text}", output.status);
    text
}

#[test]
fn a_component_restarts_despite_full_shared_memory() {
    let _machine = machine();
    if !mounts_are_allowed() {
        return eprintln!("skipped: no mounts for this user");
    }
    let text = killed_after("cat /dev/zero > /dev/shm/fill 2>/dev/null");
    assert!(text.contains("controller") && text.contains("again"), "{text}");
    assert!(!text.contains("SIGBUS"), "{text}");
}

#[test]
fn a_restart_that_finds_no_memory_names_it() {
    let _machine = machine();
    if !mounts_are_allowed() {
        return eprintln!("skipped: no mounts for this user");
    }
    // The memory reserved for restarts is taken, too: its object truncated, the space filled.
    let text = killed_after("truncate -s 0 /dev/shm/mt_*_spare; cat /dev/zero > /dev/shm/fill 2>/dev/null");
    assert!(text.contains("/dev/shm is full"), "{text}");
}

#[test]
fn a_component_out_of_memory_dies_alone() {
    let _machine = machine();
    let restart = "restart = { when = \"failure\" }";
    let settings = format!("{restart}\ncore = 0\ncpu_limit = \"30 s\"\nhang_after = \"30 s\"");
    let (_folder, graph) = faulty("{ fault = \"devour\", at = 200, once = true }", &settings);
    let line = format!(
        "ulimit -v 1500000; exec \"$MOTORIUM\" run {} --name {NAME} --force --for 6s --set realtime.lost_steps=1",
        graph.display()
    );
    let output = shell(&line).output().expect("bash runs");
    let text = text(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    let message = ["`faulty` at tick 200", "memory allocation of", "SIGABRT", "`faulty` steps again after"];
    assert!(message.iter().all(|words| text.contains(words)), "{text}");
    assert_eq!(leftovers(NAME), Vec::<String>::new(), "{text}");
}

#[test]
fn a_full_disk_takes_reports_but_not_the_run() {
    let _machine = machine();
    let run = format!(
        "\"$MOTORIUM\" run graphs/panda-reach.toml --name {NAME} --force --for 500ms --set realtime.lost_steps=1"
    );
    let events =
        Ended::from_output(&shell(&format!("{run} --json 2>/dev/full")).output().expect("bash runs"));
    assert_eq!((events.code, &events.report().exit), (Some(0), &Exit::Finished));
    let report = shell(&format!("{run} --json >/dev/full")).output().expect("bash runs");
    let message = text(&report);
    assert_eq!(report.status.code(), Some(1), "{message}");
    assert!(message.contains("No space left on device"), "{message}");
    assert_eq!(leftovers(NAME), Vec::<String>::new(), "{message}");
}
