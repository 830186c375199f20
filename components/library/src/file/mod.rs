//! File format of a motion library: versioned, checksummed and suitable for memory mapping.
//!
//! All numbers are little-endian. The sections are arrays of `f64` aligned to 64 bytes, so a mapped file is
//! used in place ([`View`]).
//!
//! | offset | size | content |
//! |---|---|---|
//! | 0 | 8 | `MTLIB\r\n\x1a` |
//! | 8 | 4 | version, 1 |
//! | 12 | 4 | 0 |
//! | 16 | 8 | length of the file |
//! | 24 | 8 | length of the head |
//! | 32 | 8 | XXH3 (64 bits, seed 0) of all bytes from 64 on |
//! | 40 | 24 | 0 |
//! | 64 | | the head, as JSON |
//! | | | the sections, each as `[offset, count]` in the head |
//!
//! The head has `names`, `samples`, `damping`, `interpolation` (`spline` or `linear`; `linear` if missing),
//! `metric`, `ids`, `labels` and `sections`.
//!
//! | section | shape, column by column | |
//! |---|---|---|
//! | `basis` | dofs (samples - 1) x rank | orthonormal in the metric |
//! | `singular` | rank | singular values |
//! | `spectrum` | any | all known singular values |
//! | `energy` | 1 | sum of the squares of the data |
//! | `weights` | rank x movements | weights of the movements |
//! | `frames` | (3 dofs + 1) x movements | start, goal, velocity, duration of each |
//!
//! Reading rejects a file that is truncated, modified or of another version, and reports the reason. Files
//! are written under a temporary name and then renamed, so the old file survives if the writer dies.

mod read;
mod write;

pub use read::{FileError, View, from_bytes, read};
pub use write::{to_bytes, write};

use serde::{Deserialize, Serialize};

use crate::{Interpolation, Metric};

const MAGIC: [u8; 8] = *b"MTLIB\r\n\x1a";
const VERSION: u32 = 1;
/// Offset of the head, bytes.
const HEAD: usize = 64;
const ALIGNMENT: usize = 64;

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Head {
    names: Vec<String>,
    samples: usize,
    damping: f64,
    /// Absent in files of earlier versions, whose paths were sampled along straight lines unless they had
    /// been splined before.
    #[serde(default = "Interpolation::of_old_files")]
    interpolation: Interpolation,
    metric: Metric,
    ids: Vec<String>,
    labels: Vec<Option<String>>,
    sections: Sections,
}

/// Byte offset and number of entries of each section.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Sections {
    basis: [usize; 2],
    singular: [usize; 2],
    spectrum: [usize; 2],
    energy: [usize; 2],
    weights: [usize; 2],
    frames: [usize; 2],
}

fn checksum(bytes: &[u8]) -> u64 {
    twox_hash::XxHash3_64::oneshot(bytes)
}
