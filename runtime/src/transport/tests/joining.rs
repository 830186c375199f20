//! Programs that join a run while it is being made.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use super::*;

/// Joins every run of a name as soon as it is seen, as a stock program of iceoryx2 does. Returns how many it joined.
fn join_all(name: &str, done: &AtomicBool) -> usize {
    let mut joined = BTreeSet::new();
    while !done.load(Relaxed) {
        for run in RunFolder::list().into_iter().filter(|run| run.id().starts_with(name)) {
            if !joined.contains(run.id()) && run.domain().is_ok_and(|domain| domain.node().is_ok()) {
                joined.insert(run.id().to_string());
            }
        }
    }
    joined.len()
}

#[test]
fn a_program_that_joins_a_run_while_it_is_made_does_not_keep_it_from_being_made() {
    let mut plan = Bench::new(Wrench::layout(), TopicPattern::State).plan.clone();
    plan.name = format!("joined{}", std::process::id());
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let joining = scope.spawn(|| join_all(&plan.name, &done));
        for _ in 0..200 {
            let (folder, _region) = RunFolder::create(&plan).unwrap();
            let node = folder.domain().unwrap().node().unwrap();
            std::thread::yield_now();
            drop(node);
            folder.remove();
        }
        done.store(true, Relaxed);
        let joined = joining.join().unwrap();
        // The folder of one that was joined while it ended may have been made anew.
        for run in RunFolder::list().into_iter().filter(|run| run.id().starts_with(&plan.name)) {
            run.remove();
        }
        assert!(joined > 20, "{joined} of 200 runs were joined");
    });
}
