//! Forked children of the program that drives a run.

#![allow(unsafe_code)] // forks a process

use std::time::Duration;

use super::episodes::{await_episode, launch};
use crate::session::{Session, SessionError};
use crate::state::Wrench;

/// Forks a child that runs `act` and exits with the returned code, without running any destructor of the
/// program.
fn in_child(act: impl FnOnce() -> i32) -> i32 {
    // SAFETY: the child calls nothing that waits for a lock that another thread of this program may hold: it
    // compares, reads and drops, and ends by `_exit`.
    match unsafe { libc::fork() } {
        0 => {
            let code = act();
            // SAFETY: ends the child.
            unsafe { libc::_exit(code) }
        }
        child => {
            assert!(child > 0, "a process can be forked");
            let mut status = 0;
            // SAFETY: waits for the child and writes its status to a local.
            let waited = unsafe { libc::waitpid(child, &raw mut status, 0) };
            assert_eq!(waited, child);
            assert!(libc::WIFEXITED(status), "the child exited: status {status}");
            libc::WEXITSTATUS(status)
        }
    }
}

/// Returns `true` if a call was refused because of the process.
fn is_refused<T>(call: Result<T, SessionError>) -> bool {
    matches!(call, Err(SessionError::OtherProcess(other)) if other.owner != std::process::id())
}

#[test]
fn run_survives_a_forked_child_that_drops_its_session() {
    let mut session = launch("", &[]);
    await_episode(&mut session, "fast", 0);
    let mut reader = session.reader("fast").unwrap();
    let tap = session.tap("slow").unwrap();
    assert!(reader.poll());
    let id = session.id().to_string();
    let seen = reader.stamp().unwrap().sequence;
    // The parent keeps its handles; a child has copies of them.
    let mut handles = Some((session, reader, tap));
    let code = in_child(|| {
        let Some((mut session, mut reader, mut tap)) = handles.take() else { return 90 };
        let refused = [
            is_refused(session.step_until(Duration::from_secs(1))),
            is_refused(session.begin_episode(1)),
            is_refused(session.read::<Wrench>("fast")),
            is_refused(session.publish("fast", &Wrench::default())),
            is_refused(session.set("fast", "gain", 1.0)),
            is_refused(session.reader("fast")),
            is_refused(session.tap("fast")),
            !reader.poll() && reader.bytes().is_none() && reader.check().is_err(),
            !tap.read(|_, _| ()) && tap.check().is_err(),
        ];
        drop((session, reader, tap));
        refused.iter().position(|refused| !refused).map_or(0, |place| place as i32 + 1)
    });
    assert_eq!(code, 0, "the call of this number was not refused");
    let Some((session, reader, tap)) = &mut handles else { panic!("the parent keeps its handles") };
    assert_eq!(reader.stamp().unwrap().sequence, seen, "its pin is unchanged");
    await_next(session, seen);
    assert!(reader.poll() && reader.stamp().unwrap().sequence > seen);
    while !tap.read(|_, _| ()) {
        session.step_until(session.time() + Duration::from_millis(2)).unwrap();
    }
    let Some((session, reader, tap)) = handles.take() else { panic!("the parent keeps its handles") };
    drop((reader, tap));
    let report = session.stop();
    assert_eq!(report.exit, crate::launcher::Exit::Finished);
    let left = std::fs::read_dir("/dev/shm").unwrap().filter_map(Result::ok);
    let left: Vec<_> = left.filter(|entry| entry.file_name().to_string_lossy().contains(&id)).collect();
    assert!(left.is_empty(), "{left:?}");
}

/// Steps until `fast` has published more than this.
fn await_next(session: &mut Session<'_>, sequence: u64) {
    while session.read::<Wrench>("fast").unwrap().is_none_or(|newest| newest.stamp.sequence <= sequence) {
        session.step_until(session.time() + Duration::from_millis(2)).unwrap();
    }
}
