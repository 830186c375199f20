//! Tests of programs that join a run while it is being created.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use super::*;

/// Joins every run with a given name as soon as it appears, like a stock iceoryx2 program. Returns the number
/// of joined runs.
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
fn joining_a_run_during_its_creation_does_not_prevent_it() {
    let mut plan = Bench::new(Wrench::layout(), TopicPattern::State).plan.clone();
    plan.name = format!("joined{}", std::process::id());
    let done = AtomicBool::new(false);
    let mut made = Vec::new();
    let joined = std::thread::scope(|scope| {
        let joining = scope.spawn(|| join_all(&plan.name, &done));
        let mut make = || -> Result<(), Box<dyn std::error::Error>> {
            let (folder, _region) = RunFolder::create(&plan)?;
            let node = folder.domain()?.node()?;
            std::thread::yield_now();
            drop(node);
            folder.remove();
            made.push(folder);
            Ok(())
        };
        let all_made = (0..200).try_for_each(|_| make());
        done.store(true, Relaxed);
        let joined = joining.join().unwrap();
        all_made.unwrap();
        joined
    });
    // A run that was joined during its end may have been recreated by the join.
    for run in &made {
        run.remove();
    }
    assert!(joined > 20, "{joined} of 200 runs were joined");
}
