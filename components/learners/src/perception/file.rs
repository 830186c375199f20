//! The file of a coupling: versioned and checked.
//!
//! All numbers are little-endian.
//!
//! | offset | size | content |
//! |---|---|---|
//! | 0 | 8 | `MTCPL\r\n\x1a` |
//! | 8 | 8 | version, 1 |
//! | 16 | 8 | number of outputs of the network |
//! | 24 | 8 | pen speed of the training letters, letter sizes per second (`f64`) |
//! | 32 | 8 | XXH3 (64 bits, seed 0) of all bytes from 40 on |
//! | 40 | | mean (outputs) and scale (outputs x outputs, column by column) as `f64`; weights (column by column) and bias of each layer as `f32`; then the library in its file format |

use std::io::Write as _;
use std::path::{Path, PathBuf};

use motorium_library::file::{FileError, from_bytes, to_bytes};
use motorium_models::networks::ConvolutionalNetwork;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng as _;
use rand_pcg::Pcg64;

use super::Coupling;

const MAGIC: [u8; 8] = *b"MTCPL\r\n\x1a";
const VERSION: u64 = 1;
const HEAD: usize = 40;
/// Largest number of outputs, above the number of weights of any library of letters.
const MOST_OUTPUTS: u64 = 4096;

/// Error of reading a coupling file.
#[derive(Debug, thiserror::Error)]
pub enum CouplingFileError {
    /// The operating system reported an error.
    #[error("{}: {source}", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is not a coupling.
    #[error("{}: not a coupling; train one with `motorium library couple`", path.display())]
    Magic {
        /// Path of the file.
        path: PathBuf,
    },
    /// The version is not supported.
    #[error("{}: coupling version {found}, expected {VERSION}; train it again", path.display())]
    Version {
        /// Path of the file.
        path: PathBuf,
        /// Version found.
        found: u64,
    },
    /// The file is truncated or was changed after it was written.
    #[error("{}: the coupling is truncated or damaged; train it again", path.display())]
    Damaged {
        /// Path of the file.
        path: PathBuf,
    },
    /// The library in the file is invalid.
    #[error("{}: invalid library: {source}", path.display())]
    Library {
        /// Path of the file.
        path: PathBuf,
        /// Error of the library's content.
        source: Box<FileError>,
    },
}

impl Coupling {
    /// Returns `true` if the file begins with the signature of a coupling.
    pub fn is_coupling(path: &Path) -> bool {
        let mut first = [0; 8];
        std::fs::File::open(path)
            .and_then(|mut file| std::io::Read::read_exact(&mut file, &mut first))
            .is_ok_and(|()| first == MAGIC)
    }

    /// Writes the coupling to a file atomically.
    ///
    /// # Errors
    /// Returns the error of the file system.
    pub fn write(&self, path: &Path) -> std::io::Result<()> {
        let mut content = Vec::new();
        let numbers = self.mean.iter().chain(self.scale.iter());
        numbers.for_each(|value| content.extend_from_slice(&value.to_le_bytes()));
        for (weights, bias) in self.network.layers() {
            let values = weights.iter().chain(bias.iter());
            values.for_each(|value| content.extend_from_slice(&value.to_le_bytes()));
        }
        content.extend_from_slice(&to_bytes(&self.library));
        let mut bytes = MAGIC.to_vec();
        bytes.extend_from_slice(&VERSION.to_le_bytes());
        bytes.extend_from_slice(&(self.mean.len() as u64).to_le_bytes());
        bytes.extend_from_slice(&self.pen_speed.to_le_bytes());
        bytes.extend_from_slice(&twox_hash::XxHash3_64::oneshot(&content).to_le_bytes());
        bytes.extend_from_slice(&content);
        let mut beside = path.as_os_str().to_owned();
        beside.push(format!(".{}.part", std::process::id()));
        let beside = PathBuf::from(beside);
        let written = std::fs::File::create(&beside).and_then(|mut file| {
            file.write_all(&bytes)?;
            file.sync_all()
        });
        let moved = written.and_then(|()| std::fs::rename(&beside, path));
        if moved.is_err() {
            let _ = std::fs::remove_file(&beside);
        }
        moved
    }

    /// Reads a coupling from a file written by [`write`](Self::write).
    ///
    /// # Errors
    /// [`CouplingFileError`] if the file cannot be read, has another format or version, or is damaged.
    pub fn read(path: &Path) -> Result<Self, CouplingFileError> {
        let path_buf = || path.to_path_buf();
        let bytes = motorium_recordings::read_bounded(path, super::LONGEST)
            .map_err(|source| CouplingFileError::Io { path: path_buf(), source })?;
        if bytes.get(..8) != Some(&MAGIC) {
            return Err(CouplingFileError::Magic { path: path_buf() });
        }
        let damaged = || CouplingFileError::Damaged { path: path_buf() };
        let head = bytes.get(8..HEAD).ok_or_else(damaged)?;
        let number = |at: usize| u64::from_le_bytes(std::array::from_fn(|k| head[at + k]));
        if number(0) != VERSION {
            return Err(CouplingFileError::Version { path: path_buf(), found: number(0) });
        }
        let (outputs, pen_speed, sum) = (number(8), f64::from_bits(number(16)), number(24));
        let speed = pen_speed.is_finite() && pen_speed > 0.0;
        if twox_hash::XxHash3_64::oneshot(&bytes[HEAD..]) != sum || outputs > MOST_OUTPUTS || !speed {
            return Err(damaged());
        }
        let mut content = Content { rest: &bytes[HEAD..] };
        let outputs = outputs as usize;
        let mean = DVector::from_vec(content.doubles(outputs).ok_or_else(damaged)?);
        let scale = content.doubles(outputs * outputs).ok_or_else(damaged)?;
        let scale = DMatrix::from_vec(outputs, outputs, scale);
        // Layer sizes are determined by a new network with the same number of outputs.
        let pattern = ConvolutionalNetwork::random(outputs.max(1), &mut Pcg64::seed_from_u64(0));
        let mut layers = Vec::new();
        for (weights, bias) in pattern.layers() {
            let (rows, columns) = weights.shape();
            let weights = content.singles(rows * columns).ok_or_else(damaged)?;
            let bias = content.singles(bias.len()).ok_or_else(damaged)?;
            layers.push((DMatrix::from_vec(rows, columns, weights), DVector::from_vec(bias)));
        }
        let layers = layers.try_into().ok().and_then(ConvolutionalNetwork::from_layers);
        let network = layers.ok_or_else(damaged)?;
        let library = from_bytes(content.rest)
            .map_err(|source| CouplingFileError::Library { path: path_buf(), source: Box::new(source) })?;
        if library.rank() + 3 * library.layout().dofs() != outputs {
            return Err(damaged());
        }
        Ok(Self { network, library, mean, scale, pen_speed })
    }
}

/// The unread bytes.
struct Content<'a> {
    rest: &'a [u8],
}

impl Content<'_> {
    fn take(&mut self, count: usize) -> Option<&[u8]> {
        let (first, rest) = self.rest.split_at_checked(count)?;
        self.rest = rest;
        Some(first)
    }

    fn doubles(&mut self, count: usize) -> Option<Vec<f64>> {
        let (numbers, _) = self.take(count.checked_mul(8)?)?.as_chunks::<8>();
        let numbers: Vec<f64> = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        numbers.iter().all(|number| number.is_finite()).then_some(numbers)
    }

    fn singles(&mut self, count: usize) -> Option<Vec<f32>> {
        let (numbers, _) = self.take(count.checked_mul(4)?)?.as_chunks::<4>();
        let numbers: Vec<f32> = numbers.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        numbers.iter().all(|number| number.is_finite()).then_some(numbers)
    }
}
