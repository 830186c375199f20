//! Random bytes in the shared files of a run: launcher and actuator must not crash for any of them.
//!
//! `MOTORIUM_FUZZ_ROUNDS` sets the number of rounds for each kind of file (3), `MOTORIUM_FUZZ_SEED` the first
//! seed (1).

use std::fs::OpenOptions;
use std::os::unix::fs::FileExt as _;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use crate::support::{Run, leftovers, machine, panda_reach, signal};

/// A reproducible random sequence.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end.max(1)
    }
}

fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

/// Returns the shared files of a run whose names have one of these endings.
fn files(run: &Run, endings: &[&str]) -> Vec<PathBuf> {
    let id = run.folder.id();
    let mut found: Vec<PathBuf> = leftovers(id)
        .into_iter()
        .map(|name| PathBuf::from("/dev/shm").join(name))
        .chain([run.folder.path().join("region")])
        .filter(|path| path.is_file())
        .filter(|path| endings.iter().any(|ending| path.to_string_lossy().ends_with(ending)))
        .collect();
    found.sort();
    found.dedup();
    found
}

/// Writes random bytes, single ones and sequences, into files, never beyond their ends.
fn damage(files: &[PathBuf], random: &mut Random) {
    for _ in 0..40 {
        let path = &files[random.below(files.len() as u64) as usize];
        let Ok(file) = OpenOptions::new().write(true).open(path) else { continue };
        let size = file.metadata().map_or(0, |metadata| metadata.len());
        if size == 0 {
            continue;
        }
        let at = random.below(size);
        let length = [1, 1, 4, 8, 64][random.below(5) as usize].min(size - at);
        let bytes: Vec<u8> =
            (0..length).map(|_| if random.below(4) == 0 { 0xff } else { random.next() as u8 }).collect();
        let _ = file.write_at(&bytes, at);
    }
}

/// Waits, up to a limit, until a component steps again in a process other than `before` or the run has ended.
/// The limit is needed because the fields that show this may be damaged, too.
fn await_return(run: &mut Run, before: u32) {
    let started = Instant::now();
    let mut last = None;
    while !run.has_ended() && started.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(20));
        let Some((pid, steps)) = run.glance("controller") else { continue };
        if pid != before && last.is_some_and(|last| steps > last) {
            return;
        }
        last = (pid != before).then_some(steps);
    }
}

/// Damages a running graph, then restarts a component and ends the run.
fn round(endings: &[&str], seed: u64) {
    // Lost steps do not matter here: a restarting component loses some.
    let settings = ["controller.restart.when=failure", "realtime.lost_steps=1"];
    let settings = settings.into_iter().flat_map(|one| ["--set", one]);
    let arguments: Vec<&str> = ["--for", "60 s", "--force"].into_iter().chain(settings).collect();
    let mut run = Run::start(&panda_reach(), &arguments);
    let id = run.folder.id().to_string();
    let files = files(&run, endings);
    assert!(!files.is_empty(), "no file ends in {endings:?}");
    let (launcher, physics, controller) = (run.launcher(), run.pid_of("physics"), run.pid_of("controller"));
    let mut random = Random(seed);
    for _ in 0..4 {
        damage(&files, &mut random);
        std::thread::sleep(Duration::from_millis(50));
    }
    let message = format!("seed {seed}, {endings:?}, launcher {launcher}, physics {physics}");
    // A component that survived the damage is killed: its slots are freed, and it joins again.
    if let Some(pid) = rustix::process::Pid::from_raw(controller as i32) {
        let _ = rustix::process::kill_process(pid, rustix::process::Signal::KILL);
    }
    await_return(&mut run, controller);
    if !run.has_ended() {
        signal(launcher, rustix::process::Signal::INT);
    }
    let ended = run.finish();
    let text = format!("{message}: {:?}\n{}{}", ended.code, ended.stdout, ended.stderr);
    // A regular end, or a safe stop that names its cause; a signal has no code, a panic has 101.
    assert!(matches!(ended.code, Some(0 | 1 | 4)), "{text}");
    assert!(!ended.stderr.contains("the launcher of"), "the guard had to act: {text}");
    for crash in ["SIGSEGV", "SIGBUS", "SIGABRT", "panicked"] {
        let line = ended.stderr.lines().find(|line| line.contains("`physics`") && line.contains(crash));
        assert!(line.is_none(), "{line:?} {text}");
    }
    assert_eq!(leftovers(&id), Vec::<String>::new(), "{text}");
}

fn rounds(endings: &[&str]) {
    let _machine = machine();
    let first = number("MOTORIUM_FUZZ_SEED", 1);
    for seed in first..first + number("MOTORIUM_FUZZ_ROUNDS", 3) {
        round(endings, seed);
    }
}

#[test]
fn damaged_iceoryx2_records_crash_nothing() {
    rounds(&[".dynamic"]);
}

#[test]
fn a_damaged_control_block_crashes_nothing() {
    rounds(&["region"]);
}

#[test]
fn damaged_topics_crash_neither_launcher_nor_actuator() {
    rounds(&[".topic"]);
}

#[test]
fn damage_anywhere_crashes_neither_launcher_nor_actuator() {
    rounds(&["region", ".topic", ".dynamic", ".global_mgmt", ".mgmt", ".data", "_spare", "_lock"]);
}
