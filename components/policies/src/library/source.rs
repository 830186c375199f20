//! The library that a policy moves by.

use std::path::Path;

use motorium::declare::ConfigError;

use super::config::LibraryPolicyConfig;
use motorium_library::{
    DAMPING, Metric, MotionLibrary, Recordings, SampledSpring, Truncation, file,
    letters::{Variation, letters},
};
use motorium_recordings::Selection;

/// Samples of each movement where the policy itself learns the library.
const SAMPLES: usize = 200;
/// Variations of each of our own letters, and their seed.
const LETTERS: (usize, u64) = (8, 1);

/// Reads or learns the library. `base` is the folder of the graph file, if it is known.
pub(super) fn load(config: &LibraryPolicyConfig, base: Option<&Path>) -> Result<MotionLibrary, ConfigError> {
    let refuse = |error: &dyn std::fmt::Display| ConfigError::key("library", error.to_string());
    let spring = SampledSpring::new(SAMPLES, DAMPING).map_err(|error| refuse(&error))?;
    let build = |recordings| {
        MotionLibrary::build(&recordings, spring, Metric::Position, Truncation::Rank(super::MAX_WEIGHTS))
            .map_err(|error| refuse(&error))
    };
    if config.library == "letters" {
        return build(letters(LETTERS.0, Variation::default(), LETTERS.1));
    }
    let path =
        base.map_or_else(|| Path::new(&config.library).to_path_buf(), |base| base.join(&config.library));
    if motorium_recordings::is_recording(&path) {
        let selection = Selection { rate: Some(config.rate), ..Selection::default() };
        return build(Recordings::read([&path], &selection).map_err(|error| refuse(&error))?);
    }
    file::read(&path).map_err(|error| {
        refuse(&error).advise("give a library file, recordings (.csv, .tsv, .json, .jsonl), or \"letters\"")
    })
}

/// The movement of a label or id.
pub(super) fn find(library: &MotionLibrary, name: &str, key: &str) -> Result<usize, ConfigError> {
    library.find(name).ok_or_else(|| {
        let mut labels: Vec<&str> =
            library.entries().iter().filter_map(|entry| entry.label.as_deref()).collect();
        labels.sort_unstable();
        labels.dedup();
        let message = format!("the library has no movement and no label `{name}`");
        ConfigError::key(key, message).advise(format!("its labels are {}", labels.join(", ")))
    })
}

/// The movements that are named in the configuration.
pub(super) fn entries(
    config: &LibraryPolicyConfig,
    library: &MotionLibrary,
) -> Result<Vec<(usize, String)>, ConfigError> {
    if config.movements.is_empty() {
        return Err(ConfigError::key("movements", "the list is empty, expected at least one label or id"));
    }
    let named = config.movements.iter().enumerate();
    named.map(|(k, name)| Ok((find(library, name, &format!("movements[{k}]"))?, name.clone()))).collect()
}

/// Checks the numbers of a configuration.
pub(super) fn check(config: &LibraryPolicyConfig, library: &MotionLibrary) -> Result<(), ConfigError> {
    if let Some(eigenforces) =
        config.eigenforces.iter().find(|eigenforces| **eigenforces == 0 || **eigenforces > library.rank())
    {
        let message = format!("{eigenforces} eigenforces, the library has {}", library.rank());
        return Err(ConfigError::key("eigenforces", message));
    }
    let recognition = &config.recognition;
    for (key, value, least) in [("recognition.still", recognition.still, 0.0), ("rate", config.rate, 1e-6)] {
        if !(value.is_finite() && value >= least) {
            return Err(ConfigError::key(key, format!("{value}, expected at least {least}")));
        }
    }
    for (key, span, least_ms) in [
        ("duration", config.duration, 1),
        ("transit", Some(config.transit), 1),
        ("recognition.pause", Some(recognition.pause), 1),
        ("recognition.longest", Some(recognition.longest), 10),
    ] {
        if let Some(span) = span.filter(|span| span.ns < 1_000_000 * least_ms) {
            return Err(ConfigError::key(key, format!("{span}, expected at least {least_ms} ms")));
        }
    }
    Ok(())
}
