//! A forked child of a program that drives a run in processes.

#![allow(unsafe_code)] // forks a process

use std::time::Duration;

use motorium::graph::{self, Machine, Override};
use motorium::launcher::{Exit, Options};
use motorium::session::{Session, SessionError};
use motorium::state::JointState;

use crate::support::{MOTORIUM, leftovers, machine, panda_reach};

/// The newest sequence of the joint states.
fn newest(session: &mut Session<'_>) -> u64 {
    let state = session.read::<JointState>("panda/joint_state").expect("a state");
    state.map_or(0, |state| state.stamp.sequence)
}

/// Steps until the joint states have advanced by this number.
fn advance(session: &mut Session<'_>, by: u64) {
    let until = newest(session) + by;
    while newest(session) < until {
        session.step_until(session.time() + Duration::from_millis(2)).expect("the run continues");
    }
}

#[test]
fn a_run_in_processes_outlives_a_fork_of_its_driver() {
    let _machine = machine();
    let text = std::fs::read_to_string(panda_reach()).expect("the graph is there");
    let settings: [Override; 2] =
        ["realtime.lost_steps=1", "duration=60 s"].map(|one| one.parse().expect("a setting"));
    let registry = motorium_tools::registry();
    let checked = graph::check(&panda_reach(), text, &settings, &registry, &Machine::detect());
    let plan = checked.unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    let options = Options::processes(MOTORIUM.into()).leaving_signals();
    let mut session = Session::launch(plan, &registry, &options).expect("it starts");
    let id = session.id().to_string();
    advance(&mut session, 20);

    let mut session = Some(session);
    // SAFETY: the child compares and drops, calls nothing that waits for a lock of another thread, and ends
    // by `_exit`.
    let child = unsafe { libc::fork() };
    if child == 0 {
        let refused = session.as_mut().is_some_and(|session| {
            let stepped = session.step_until(Duration::from_secs(60));
            matches!(stepped, Err(SessionError::OtherProcess(_)))
        });
        drop(session);
        // SAFETY: ends the child.
        unsafe { libc::_exit(i32::from(!refused)) }
    }
    assert!(child > 0, "a process can be forked");
    let mut status = 0;
    // SAFETY: waits for the child and writes its status to a local.
    assert_eq!(unsafe { libc::waitpid(child, &raw mut status, 0) }, child);
    assert!(libc::WIFEXITED(status) && libc::WEXITSTATUS(status) == 0, "status {status}");

    let mut session = session.expect("the parent keeps its session");
    advance(&mut session, 50);
    let report = session.stop();
    assert_eq!(report.exit, Exit::Finished);
    assert!(report.components.iter().all(|component| component.restarts == 0), "{report:?}");
    assert_eq!(leftovers(&id), Vec::<String>::new());
}
