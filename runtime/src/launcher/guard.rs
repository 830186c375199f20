//! The guard, a process that outlives a killed launcher: it brings the robot to its safe state and cleans up.

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use rustix::process::Signal;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::os::{Watch, monotonic_ns};
use crate::plan::Plan;
use crate::region::{Command, Phase, Region};
use crate::run_folder::RunFolder;

/// Waits for the end of the launcher, and ends the run in its place. A launcher that ends in good order kills its guard
/// first.
pub fn main(folder: &RunFolder) -> ExitCode {
    // The signals of the launcher's terminal session must not end the guard.
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        let _ = signal_hook::flag::register(signal, Arc::new(AtomicBool::new(false)));
    }
    let (plan, region) = match (folder.plan(), folder.region()) {
        (Ok(plan), Ok(region)) => (plan, region),
        (Err(error), _) | (_, Err(error)) => {
            eprintln!("motorium guard: {error}");
            return ExitCode::FAILURE;
        }
    };
    // Held in its own right: the run is alive until the guard has seen to its end.
    let mut folder = folder.clone();
    if let Err(error) = folder.hold() {
        eprintln!("motorium guard: {error}");
    }
    let folder = &folder;
    if let Ok(launcher) = Watch::new(region.header().launcher.load(Relaxed)) {
        while !launcher.wait(None) {}
    }
    let noticed = monotonic_ns();
    let workers = workers(&plan, &region, folder);
    region.header().safe_stop_ns.store(noticed, Relaxed);
    region.header().order(Command::SafeStop);
    workers.iter().for_each(|(_, watch)| watch.signal(Signal::USR2));
    std::thread::sleep(Duration::from_nanos(plan.safety.settle_ns));
    let safe = describe_safety(&plan, &region, noticed);
    region.header().order(Command::Stop);
    let until = Instant::now() + Duration::from_secs(1);
    for (_, watch) in &workers {
        while !watch.has_ended() && Instant::now() < until {
            watch.signal(Signal::USR2);
            watch.wait(Some(Duration::from_millis(20)));
        }
        watch.signal(Signal::KILL);
        watch.wait(Some(Duration::from_millis(500)));
    }
    let removed = folder.remove().len();
    eprintln!(
        "motorium: the launcher of {} was killed; {safe}; {} components stopped, {removed} shared memory objects removed",
        folder.id(),
        workers.len()
    );
    ExitCode::SUCCESS
}

/// The living workers of the run. A process number may have been reused since: only programs that were started for this
/// run count.
fn workers(plan: &Plan, region: &Region, folder: &RunFolder) -> Vec<(String, Watch)> {
    plan.components
        .iter()
        .zip(region.components())
        .filter_map(|(component, block)| {
            let pid = block.pid.load(Relaxed);
            let watch = Watch::new(pid).ok()?;
            let arguments = std::fs::read(format!("/proc/{pid}/cmdline")).ok()?;
            let path = folder.path().as_os_str().as_encoded_bytes();
            let ours = arguments.windows(path.len()).any(|window| window == path);
            ours.then(|| (component.name.clone(), watch))
        })
        .collect()
}

fn describe_safety(plan: &Plan, region: &Region, noticed: u64) -> String {
    let mut words = Vec::new();
    for (component, block) in plan.components.iter().zip(region.components()) {
        if !component.actuator {
            continue;
        }
        let state = serde_json::to_value(plan.safety.safe_state).unwrap_or_default();
        let state = state.as_str().unwrap_or_default();
        words.push(if block.safe.load(Relaxed) != 0 && block.phase() != Phase::Faulted {
            let after = (block.safe_since_ns.load(Relaxed) as i64).wrapping_sub(noticed as i64);
            format!("`{}` in its safe state ({state}) {:.1} ms after", component.name, after as f64 * 1e-6)
        } else {
            format!("`{}` was not there to reach its safe state", component.name)
        });
    }
    if words.is_empty() { "the graph has no actuators".to_string() } else { words.join(", ") }
}
