//! The reading thread of a recorder, as scheduled by the system.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use crate::MOTORIUM;
use crate::recording::text;
use crate::support::{machine, workspace};

/// Returns scheduling policy and real-time priority of a thread with this name among the descendants of a
/// process.
fn scheduling(process: u32, thread: &str) -> Option<(u32, u32)> {
    let folder = PathBuf::from(format!("/proc/{process}/task"));
    for task in std::fs::read_dir(&folder).ok()?.flatten().map(|entry| entry.path()) {
        let read = |name: &str| std::fs::read_to_string(task.join(name)).unwrap_or_default();
        if read("comm").trim_end() == thread {
            // field 3 is the first after the name in parentheses, see proc_pid_stat(5)
            let stat = read("stat");
            let mut fields = stat.rsplit_once(") ")?.1.split(' ').skip(37).map(str::parse);
            return Some((fields.next()?.ok()?, fields.next()?.ok()?))
                .map(|(priority, policy)| (policy, priority));
        }
        let children = read("children");
        let found = children.split_whitespace().find_map(|child| scheduling(child.parse().ok()?, thread));
        if found.is_some() {
            return found;
        }
    }
    None
}

#[test]
fn the_recorder_thread_is_not_delayed_by_ordinary_programs() {
    let scratch = tempfile::tempdir().expect("a folder");
    let file = scratch.path().join("a.mcap");
    let _alone = machine();
    let mut run = Command::new(MOTORIUM)
        .args(["run", "graphs/panda-reach.toml", "--for", "1s", "--set", "realtime.lost_steps=1", "--json"])
        .args(["--record", text(&file)])
        .current_dir(workspace())
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .expect("motorium starts");
    let mut seen = None;
    while run.try_wait().expect("a status").is_none() {
        // it waits with its priority, and hands over without it
        seen = seen.max(scheduling(run.id(), "recorder"));
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let output = run.wait_with_output().expect("its report");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("a report");
    let components = report["components"].as_array().expect("components");
    // if the components may not have real-time priority, neither may this thread
    let is_allowed = components.iter().any(|component| component["fifo_priority"] != 0);
    const FIFO: u32 = 1;
    assert_eq!(seen, Some(if is_allowed { (FIFO, 1) } else { (0, 0) }));
}
