//! The library of a policy.

use std::path::{Path, PathBuf};

use motorium::declare::ConfigError;
use nalgebra::DVector;

use super::config::LibraryPolicyConfig;
use motorium_learners::perception::{Coupling, Picture};
use motorium_library::{
    DAMPING, Entry, Metric, MotionLibrary, Recordings, SampledSpring, Truncation, file,
    letters::{Variation, letters},
};
use motorium_recordings::Selection;

/// Samples of each movement if the policy itself learns the library.
const SAMPLES: usize = 200;
/// Number of variations of each built-in letter, and their seed.
const LETTERS: (usize, u64) = (8, 1);

/// Reads or learns the library. `base` is the folder of the graph file, if known.
pub(super) fn load(config: &LibraryPolicyConfig, base: Option<&Path>) -> Result<MotionLibrary, ConfigError> {
    let refuse = |error: &dyn std::fmt::Display| ConfigError::key("library", error.to_string());
    let spring = SampledSpring::new(SAMPLES, DAMPING).map_err(|error| refuse(&error))?;
    let build = |recordings| {
        MotionLibrary::build(&recordings, spring, Metric::Position, Truncation::Rank(super::MAX_WEIGHTS))
            .map_err(|error| refuse(&error))
    };
    if config.library == "letters" && config.pictures.is_empty() {
        return build(letters(LETTERS.0, Variation::default(), LETTERS.1));
    }
    let path =
        base.map_or_else(|| Path::new(&config.library).to_path_buf(), |base| base.join(&config.library));
    if Coupling::is_coupling(&path) {
        return seen(config, base, &Coupling::read(&path).map_err(|error| refuse(&error))?);
    }
    if !config.pictures.is_empty() {
        let message = format!("{} is not a coupling, which `pictures` require", path.display());
        return Err(ConfigError::key("pictures", message).advise("train one with `motorium library couple`"));
    }
    if motorium_recordings::is_recording(&path) {
        let selection = Selection { rate: Some(config.rate), ..Selection::default() };
        return build(Recordings::read([&path], &selection).map_err(|error| refuse(&error))?);
    }
    file::read(&path).map_err(|error| {
        refuse(&error)
            .advise("give a library or a coupling, recordings (.csv, .tsv, .json, .jsonl), or \"letters\"")
    })
}

/// Returns the library of a coupling with a movement for each picture.
fn seen(
    config: &LibraryPolicyConfig,
    base: Option<&Path>,
    coupling: &Coupling,
) -> Result<MotionLibrary, ConfigError> {
    if let Some(speed) = config.pen_speed.filter(|speed| !(*speed > 0.0 && speed.is_finite())) {
        return Err(ConfigError::key("pen_speed", format!("{speed}, expected a positive number")));
    }
    let mut parts = coupling.library().parts().clone();
    let mut columns = vec![];
    for (index, picture) in config.pictures.iter().enumerate() {
        let key = || format!("pictures[{index}]");
        let path = base.map_or_else(|| PathBuf::from(picture), |base| base.join(picture));
        let shown = Picture::read(&path).map_err(|error| ConfigError::key(key(), error.to_string()))?;
        let movement = coupling.written(&shown, config.pen_speed);
        columns.push(DVector::from_vec(movement.weights));
        parts.entries.push(Entry { id: name(picture), label: None, frame: movement.frame });
    }
    let known = parts.weights.ncols();
    let weights = std::mem::take(&mut parts.weights);
    parts.weights = weights.insert_columns(known, columns.len(), 0.0);
    for (column, weights) in columns.iter().enumerate() {
        parts.weights.set_column(known + column, weights);
    }
    MotionLibrary::from_parts(parts).map_err(|error| ConfigError::key("library", error.to_string()))
}

/// Returns the name of a picture: its file name without the extension.
fn name(picture: &str) -> String {
    Path::new(picture)
        .file_stem()
        .map_or_else(|| picture.to_string(), |name| name.to_string_lossy().into_owned())
}

/// Returns the movement with a label or id.
pub(super) fn find(library: &MotionLibrary, name: &str, key: &str) -> Result<usize, ConfigError> {
    library.find(name).ok_or_else(|| {
        let mut labels: Vec<&str> =
            library.entries().iter().filter_map(|entry| entry.label.as_deref()).collect();
        labels.sort_unstable();
        labels.dedup();
        let message = format!("the library has no movement or label `{name}`");
        ConfigError::key(key, message).advise(format!("its labels are {}", labels.join(", ")))
    })
}

/// Returns the movements named in the configuration.
pub(super) fn entries(
    config: &LibraryPolicyConfig,
    library: &MotionLibrary,
) -> Result<Vec<(usize, String)>, ConfigError> {
    if config.movements.is_empty() && config.pictures.is_empty() {
        return Err(ConfigError::key("movements", "the list is empty, expected at least one label or id"));
    }
    let named = config.movements.iter().enumerate();
    let named = named.map(|(k, name)| Ok((find(library, name, &format!("movements[{k}]"))?, name.clone())));
    // The movements of pictures are at the end of the library.
    let first = library.entries().len() - config.pictures.len();
    let pictures = config.pictures.iter().enumerate().map(|(k, picture)| Ok((first + k, name(picture))));
    named.chain(pictures).collect()
}

/// Checks the numbers of a configuration.
pub(super) fn check(config: &LibraryPolicyConfig, library: &MotionLibrary) -> Result<(), ConfigError> {
    if let Some(eigenforces) =
        config.eigenforces.iter().find(|eigenforces| **eigenforces == 0 || **eigenforces > library.rank())
    {
        let message = format!("{eigenforces} eigenforces, but the library has {}", library.rank());
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
