//! The loop of a fuzzer: inputs, damages, verdicts.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestCaseError, TestError, TestRng, TestRunner};

use crate::damage::{Damage, damage};

/// Largest processor time for one input, ns.
const LONGEST_NS: u64 = 1_000_000_000;
/// Number of cases between two checks of the clock.
const BATCH: u32 = 16;

pub(crate) fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests are in the workspace").to_path_buf()
}

fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

/// Returns the files in folders of the workspace whose names have one of these endings, sorted by name.
pub(crate) fn files(folders: &[&str], endings: &[&str]) -> Vec<Vec<u8>> {
    let mut paths: Vec<PathBuf> = folders
        .iter()
        .flat_map(|folder| std::fs::read_dir(workspace().join(folder)).into_iter().flatten().flatten())
        .map(|entry| entry.path())
        .filter(|path| endings.iter().any(|ending| path.to_string_lossy().ends_with(ending)))
        .collect();
    paths.sort();
    assert!(!paths.is_empty(), "no {endings:?} in {folders:?}");
    paths.into_iter().map(|path| std::fs::read(path).expect("the file can be read")).collect()
}

/// Reads one input. Returns an error if it took too long.
fn try_one(read: &dyn Fn(&[u8]), bytes: &[u8]) -> Result<(), TestCaseError> {
    let before = motorium::os::thread_cpu_ns();
    read(bytes);
    let took = motorium::os::thread_cpu_ns().saturating_sub(before);
    let text = || format!("reading {} bytes took {} ms", bytes.len(), took / 1_000_000);
    if took > LONGEST_NS { Err(TestCaseError::fail(text())) } else { Ok(()) }
}

/// End condition of a target.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Length {
    /// After this time.
    Time(Duration),
    /// After this number of damaged inputs, rounded up to whole batches.
    Cases(u64),
}

/// Returns the total number of damaged inputs of all commands, if `MOTORIUM_FUZZ_CASES` sets it.
pub(crate) fn cases() -> Option<u64> {
    std::env::var("MOTORIUM_FUZZ_CASES").ok().and_then(|text| text.parse().ok())
}

/// Reads the undamaged inputs, then damaged ones until the time is over.
pub(crate) fn target(name: &str, corpus: &[Vec<u8>], read: impl Fn(&[u8])) {
    let length = Length::Time(Duration::from_secs(number("MOTORIUM_FUZZ_SECONDS", 1)));
    target_for(name, corpus, length, &read);
}

/// Reads the undamaged inputs, then damaged ones.
pub(crate) fn target_for(name: &str, corpus: &[Vec<u8>], length: Length, read: &dyn Fn(&[u8])) {
    for bytes in corpus {
        try_one(read, bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
    }
    let began = Instant::now();
    let is_over = |batches: u64| match length {
        Length::Time(time) => began.elapsed() >= time,
        Length::Cases(cases) => batches * u64::from(BATCH) >= cases,
    };
    let config =
        Config { cases: BATCH, failure_persistence: None, max_shrink_iters: 512, ..Config::default() };
    let runner = |batch: u64| {
        let mut seed = [0; 32];
        seed[..8].copy_from_slice(&number("MOTORIUM_FUZZ_SEED", 1).to_le_bytes());
        seed[8..16].copy_from_slice(&batch.to_le_bytes());
        TestRunner::new_with_rng(config.clone(), TestRng::from_seed(RngAlgorithm::ChaCha, &seed))
    };
    let strategy = (any::<prop::sample::Index>(), prop::collection::vec(damage(), 1..8));
    let damaged = |(which, damages): &(prop::sample::Index, Vec<Damage>)| {
        let mut bytes = corpus[which.index(corpus.len())].clone();
        damages.iter().for_each(|damage| damage.apply(&mut bytes, corpus));
        bytes
    };
    let mut batches = 0_u64;
    while !is_over(batches) {
        let result = runner(batches).run(&strategy, |input| try_one(read, &damaged(&input)));
        if let Err(error) = result {
            let TestError::Fail(reason, input) = error else { panic!("{name}: {error}") };
            let path = std::env::temp_dir().join(format!("motorium-fuzz-{name}"));
            std::fs::write(&path, damaged(&input)).expect("the input can be kept");
            panic!("{name}: {reason}\nthe input is kept in {}", path.display());
        }
        batches += 1;
    }
    println!("{name}: {} damaged inputs", batches * u64::from(BATCH));
}
