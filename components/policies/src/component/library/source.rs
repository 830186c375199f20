//! The library that a policy moves by.

use std::path::Path;

use motorium::component::ConfigError;

use super::config::LibraryPolicyConfig;
use crate::library::{
    DAMPING, Keep, Metric, MotionLibrary, SampledSpring, data, file,
    letters::{Variation, letters},
};

/// Samples of each movement where the policy itself learns the library.
const SAMPLES: usize = 200;
/// Variations of each of our own letters, and their seed.
const LETTERS: (usize, u64) = (8, 1);

/// Reads or learns the library. `base` is the folder of the graph file, if it is known.
pub(super) fn load(config: &LibraryPolicyConfig, base: Option<&Path>) -> Result<MotionLibrary, ConfigError> {
    let refuse = |error: &dyn std::fmt::Display| ConfigError::key("library", error.to_string());
    let spring = SampledSpring::new(SAMPLES, DAMPING).map_err(|error| refuse(&error))?;
    let build = |recordings| {
        MotionLibrary::build(&recordings, spring, Metric::Position, Keep::Rank(super::MAX_WEIGHTS))
            .map_err(|error| refuse(&error))
    };
    if config.library == "letters" {
        return build(letters(LETTERS.0, Variation::default(), LETTERS.1));
    }
    let path =
        base.map_or_else(|| Path::new(&config.library).to_path_buf(), |base| base.join(&config.library));
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    if ["jsonl", "json", "csv"].contains(&ending) {
        let options = data::Options { rate: config.rate, columns: Vec::new() };
        return build(data::read(&path, &options).map_err(|error| refuse(&error))?);
    }
    file::read(&path).map_err(|error| {
        refuse(&error).advise("give a library file, recordings (.jsonl, .json, .csv), or \"letters\"")
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
