//! Access to a run by other users and from other namespaces, and to the folders that contain runs.

use std::fs;
use std::os::unix::fs::{PermissionsExt as _, chown};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use motorium::run_folder::RunFolder;

use crate::support::{
    ANY_LOSS, MOTORIUM, Run, is_root, kill, leftovers, machine, panda_reach, signal, workspace,
};

/// A user without any rights.
const NOBODY: u32 = 65_534;
/// Another user without rights.
const STRANGER: u32 = 64_123;

fn motorium(arguments: &[&str]) -> Command {
    let mut command = Command::new(MOTORIUM);
    command.args(arguments).current_dir(workspace()).stdin(Stdio::null()).env_remove("XDG_RUNTIME_DIR");
    command
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

/// Returns `true` if other users can start the program under test.
fn others_can_start() -> bool {
    let mut command = motorium(&["--version"]);
    command.uid(NOBODY).gid(NOBODY).output().is_ok_and(|output| output.status.success())
}

#[test]
fn another_user_can_read_and_write_no_object_of_a_run() {
    let _machine = machine();
    if !is_root() {
        return eprintln!("skipped: only root can look as another user");
    }
    let run = Run::start(&panda_reach(), &["--for", "60 s", "--force"]);
    let id = run.folder.id().to_string();
    let find = |test: &[&str]| -> Vec<String> {
        let mut command = Command::new("find");
        command.args(["/dev/shm", "-path", &format!("*{id}*")]).args(test).uid(STRANGER).gid(STRANGER);
        let output = command.current_dir("/").output().expect("find runs");
        String::from_utf8_lossy(&output.stdout).lines().map(str::to_string).collect()
    };
    assert!(find(&[]).len() > 5, "the objects of the run are seen: {:?}", find(&[]));
    assert_eq!(find(&["-readable"]), Vec::<String>::new());
    assert_eq!(find(&["-writable"]), Vec::<String>::new());
    // None of them depends only on the permissions of a parent folder either.
    let open: Vec<String> = leftovers(&id)
        .into_iter()
        .filter(|name| {
            let mode = fs::metadata(Path::new("/dev/shm").join(name)).map(|m| m.permissions().mode());
            mode.is_ok_and(|mode| mode & 0o077 != 0)
        })
        .collect();
    assert_eq!(open, Vec::<String>::new());
    drop(run);
}

/// Creates the folder for a user's runs with another owner and open to all, and removes it at the end.
struct Squat(PathBuf);

impl Squat {
    fn on(user: u32, by: u32) -> Self {
        let path = PathBuf::from(format!("/dev/shm/motorium-{user}"));
        let _ = fs::remove_dir(&path);
        fs::DirBuilder::new().create(&path).expect("the folder is made");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o777)).expect("it is opened");
        chown(&path, Some(by), Some(by)).expect("it is given away");
        Self(path)
    }
}

impl Drop for Squat {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn a_run_folder_of_another_user_is_refused_untouched() {
    let _machine = machine();
    if !is_root() || !others_can_start() {
        return eprintln!("skipped: needs root, and a program that other users can start");
    }
    let squat = Squat::on(NOBODY, STRANGER);
    let mut command = motorium(&["run", "graphs/panda-reach.toml", "--for", "100 ms", "--force"]);
    let output = command.uid(NOBODY).gid(NOBODY).output().expect("motorium starts");
    let text = text(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    for words in ["motorium-65534", "of user 64123, not of 65534", "XDG_RUNTIME_DIR"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert_eq!(fs::read_dir(&squat.0).expect("it is there").count(), 0, "nothing was made in it");
    // Nothing in it is recognised as a run of this user either.
    fs::create_dir(squat.0.join("panda-reach-0123456789")).expect("a false run");
    let output = motorium(&["topic", "list"]).uid(NOBODY).gid(NOBODY).output().expect("motorium starts");
    assert!(self::text(&output).contains("no graph is running"), "{}", self::text(&output));
}

/// Returns the run whose folder is in `place`, once it steps.
fn await_run_in(place: &Path, child: &mut Child) -> RunFolder {
    let started = Instant::now();
    loop {
        let folders = fs::read_dir(place).into_iter().flatten().flatten();
        let steps = |folder: &RunFolder| {
            folder.region().is_ok_and(|region| {
                !region.components().is_empty()
                    && region
                        .components()
                        .iter()
                        .all(|block| block.steps.load(std::sync::atomic::Ordering::Relaxed) > 5)
            })
        };
        if let Some(folder) = folders.map(|entry| RunFolder::open(&entry.path())).find(steps) {
            return folder;
        }
        assert!(child.try_wait().expect("it can be asked").is_none(), "the run ended before it stepped");
        assert!(started.elapsed() < Duration::from_secs(60), "the run does not step");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_run_uses_the_runtime_folder_of_the_session() {
    let _machine = machine();
    let session = tempfile::tempdir().expect("a folder");
    fs::set_permissions(session.path(), fs::Permissions::from_mode(0o700)).expect("it is closed");
    let inside = |arguments: &[&str]| {
        let mut command = motorium(arguments);
        command.env("XDG_RUNTIME_DIR", session.path());
        command
    };
    let mut child = inside(&["run", "graphs/panda-reach.toml", "--for", "60 s", "--json", "--force"])
        .args(ANY_LOSS)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("motorium starts");
    let folder = await_run_in(&session.path().join("motorium"), &mut child);
    let listed = inside(&["topic", "list", "--run", folder.id()]).output().expect("motorium starts");
    assert!(text(&listed).contains("panda/joint_state"), "{}", text(&listed));
    let id = folder.id().to_string();
    rustix::process::kill_process(
        rustix::process::Pid::from_raw(child.id() as i32).expect("a process id"),
        rustix::process::Signal::INT,
    )
    .expect("it is there");
    let ended = child.wait_with_output().expect("it ends");
    assert!(ended.status.success(), "{}{}", text(&ended), String::from_utf8_lossy(&ended.stderr));
    assert_eq!(leftovers(&id), Vec::<String>::new());
    assert_eq!(fs::read_dir(session.path()).expect("it is there").count(), 0);
    // A folder that others can write to is not used.
    fs::set_permissions(session.path(), fs::Permissions::from_mode(0o777)).expect("it is opened");
    let output = inside(&["run", "graphs/panda-reach.toml", "--for", "50 ms", "--force"])
        .args(ANY_LOSS)
        .output()
        .expect("it starts");
    assert!(output.status.success(), "{}", text(&output));
    assert_eq!(fs::read_dir(session.path()).expect("it is there").count(), 0);
}

/// Returns the command in a separate process namespace, as in a container that shares `/dev/shm` with its
/// host.
fn contained(arguments: &[&str]) -> Command {
    let mut command = Command::new("unshare");
    command.args(["--pid", "--fork", "--kill-child", "--mount-proc", MOTORIUM]).args(arguments);
    command.current_dir(workspace()).stdin(Stdio::null());
    command
}

fn namespaces_are_allowed() -> bool {
    is_root() && contained(&["--version"]).output().is_ok_and(|output| output.status.success())
}

#[test]
fn cleaning_up_in_another_namespace_spares_a_live_run() {
    let _machine = machine();
    if !namespaces_are_allowed() {
        return eprintln!("skipped: no process namespaces for this user");
    }
    let run =
        Run::start(&panda_reach(), &["--for", "60 s", "--force", "--set", "controller.restart.when=failure"]);
    let id = run.folder.id().to_string();
    let before = leftovers(&id);
    let output = contained(&["doctor", "--clean", "--json"]).output().expect("unshare runs");
    assert!(!output.stdout.is_empty(), "{}", text(&output));
    assert_eq!(leftovers(&id), before);
    assert!(run.folder.is_alive());
    // The remaining files are still usable.
    let controller = run.pid_of("controller");
    kill(controller);
    let killed = Instant::now();
    while run.pid_of("controller") == controller {
        assert!(killed.elapsed() < Duration::from_secs(10), "the controller is not restarted");
        std::thread::sleep(Duration::from_millis(5));
    }
    run.await_running("controller");
    signal(run.launcher(), rustix::process::Signal::INT);
    let ended = run.finish();
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_eq!(leftovers(&id), Vec::<String>::new());
}

#[test]
fn a_run_of_a_killed_container_is_detected_and_removed() {
    let _machine = machine();
    if !namespaces_are_allowed() {
        return eprintln!("skipped: no process namespaces for this user");
    }
    let session = tempfile::tempdir().expect("a folder");
    fs::set_permissions(session.path(), fs::Permissions::from_mode(0o700)).expect("it is closed");
    let mut child = contained(&["run", "graphs/panda-reach.toml", "--for", "60 s", "--json", "--force"])
        .args(ANY_LOSS)
        .env("XDG_RUNTIME_DIR", session.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("unshare runs");
    let folder = await_run_in(&session.path().join("motorium"), &mut child);
    assert!(folder.is_alive(), "a living run of another namespace");
    let id = folder.id().to_string();
    let launcher = fs::read_to_string(format!("/proc/{0}/task/{0}/children", child.id())).expect("its child");
    kill(launcher.trim().parse().expect("one process id"));
    child.wait().expect("it ends");
    let killed = Instant::now();
    while folder.is_alive() {
        assert!(killed.elapsed() < Duration::from_secs(10), "the run is dead, but seems alive");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_ne!(leftovers(&id), Vec::<String>::new(), "its guard died with it");
    let mut doctor = motorium(&["doctor", "--clean", "--json"]);
    doctor.env("XDG_RUNTIME_DIR", session.path()).output().expect("motorium starts");
    assert!(!folder.path().exists());
    assert_eq!(leftovers(&id), Vec::<String>::new());
}

#[test]
fn graph_runs_in_a_separate_user_namespace() {
    let _machine = machine();
    if !is_root() || !others_can_start() {
        return eprintln!("skipped: needs root, and a program that other users can start");
    }
    let unshared = |program: &str, arguments: &[&str]| {
        let mut command = Command::new("unshare");
        command.args(["--user", "--map-root-user", program]).args(arguments).uid(NOBODY).gid(NOBODY);
        command.current_dir(workspace()).stdin(Stdio::null()).env_remove("XDG_RUNTIME_DIR");
        command.output().expect("unshare runs")
    };
    if !unshared("true", &[]).status.success() {
        return eprintln!("skipped: no user namespaces on this machine");
    }
    // The folder of root itself, which belongs to another user inside the namespace.
    let outside = Run::start(&panda_reach(), &["--for", "60 s", "--force"]);
    let arguments = ["run", "graphs/panda-reach.toml", "--for", "100 ms", "--force"];
    let output = unshared(MOTORIUM, &[&arguments[..], &ANY_LOSS].concat());
    assert!(output.status.success(), "{}", text(&output));
    assert!(!Path::new("/dev/shm/motorium-65534").exists());
    drop(outside);
}

#[test]
fn a_run_of_another_user_is_reported() {
    let _machine = machine();
    if !is_root() || !others_can_start() {
        return eprintln!("skipped: needs root, and a program that other users can start");
    }
    let user = NOBODY.to_string();
    let mut command = Command::new("setpriv");
    command.args(["--clear-groups", "--inh-caps=+sys_nice", "--ambient-caps=+sys_nice"]);
    command.args(["--reuid", &user, "--regid", &user, MOTORIUM]);
    command.args(["run", "graphs/panda-reach.toml", "--for", "60 s", "--force"]);
    command.current_dir(workspace()).stdin(Stdio::null()).env_remove("XDG_RUNTIME_DIR");
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("setpriv runs");
    let folder = await_run_in(Path::new("/dev/shm/motorium-65534"), &mut child);
    let priority = |block: &motorium::region::ComponentBlock| {
        block.fifo_priority.load(std::sync::atomic::Ordering::Relaxed)
    };
    let has_priorities =
        folder.region().is_ok_and(|region| region.components().iter().all(|block| priority(block) > 0));
    // Its folder and its plan are closed to others; the real-time threads on its core are visible.
    let ours = crate::support::run(&panda_reach(), &["--for", "100 ms", "--force"]);
    rustix::process::kill_process(rustix::process::Pid::from_child(&child), rustix::process::Signal::INT)
        .expect("it is there");
    assert!(child.wait().is_ok());
    if !has_priorities {
        return eprintln!("skipped: the other user was granted no real-time priority");
    }
    let words = "other users have real-time work on the cores of this run";
    let line = ours.stderr.lines().find(|line| line.contains(words));
    let line = line.unwrap_or_else(|| panic!("{}", ours.stderr));
    assert!(line.contains("of user 65534, SCHED_FIFO ") && line.contains("on core "), "{line}");
    let event = ours.report().events.iter().find(|event| event.text.starts_with(words));
    assert_eq!(event.map(|event| event.severity), Some(motorium::region::EventSeverity::Warning));
}

#[test]
fn run_ids_are_unguessable_but_can_be_typed() {
    let _machine = machine();
    let id = |run: Run| run.folder.id().to_string();
    let (first, second) = (
        id(Run::start(&panda_reach(), &["--for", "60 s", "--force"])),
        id(Run::start(&panda_reach(), &["--for", "60 s", "--force"])),
    );
    let tail = |id: &str| id.strip_prefix("panda-reach-").expect("the name of the graph").to_string();
    assert_ne!(tail(&first), tail(&second));
    for id in [&first, &second] {
        assert!(tail(id).len() == 10 && tail(id).chars().all(|c| c.is_ascii_alphanumeric()), "{id}");
    }
    // Only the random part distinguishes two runs started at the same moment: all its characters vary.
    let same = tail(&first).chars().zip(tail(&second).chars()).filter(|(a, b)| a == b).count();
    assert!(same < 6, "{first} {second}");
}
