//! Rhythmic primitives.

mod model;
mod run;

pub use model::{PeriodError, RhythmicModel, RhythmicSettings, StoredRhythmicModel};
pub use run::RhythmicDmp;
