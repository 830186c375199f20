//! Reading of library files.

use std::path::{Path, PathBuf};

use motorium_recordings::read_bounded;
use nalgebra::DMatrix;

use super::{HEAD, Head, MAGIC, VERSION, checksum};
use crate::{BuildError, Entry, Frame, Layout, LibraryParts, Metric, MotionLibrary, SampledSpring};

/// Largest size of a library file, bytes.
const LONGEST: u64 = 2 * 1024 * 1024 * 1024;

/// Error returned when a file cannot be read as a library.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The file system reported an error.
    #[error("{path}: {source}")]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The content of a readable file is invalid.
    #[error("{path}: {source}")]
    In {
        /// Path of the file.
        path: PathBuf,
        /// Error in the content.
        source: Box<FileError>,
    },
    /// The file is not a motion library.
    #[error(
        "not a motion library: it begins with `{}`; `motorium library build` creates libraries from recordings",
        .found.escape_ascii()
    )]
    Magic {
        /// First bytes of the file.
        found: Vec<u8>,
    },
    /// The version is not supported.
    #[error("the library has format version {found}, expected {VERSION}")]
    Version {
        /// Version found.
        found: u32,
    },
    /// The file is too short or too long.
    #[error(
        "{found} bytes, expected {expected}: the file is truncated or has extra bytes; build the library again"
    )]
    Length {
        /// Number of bytes found.
        found: usize,
        /// Number of bytes expected.
        expected: u64,
    },
    /// The checksum is wrong, because the file was changed after it was written.
    #[error(
        "the checksum is {found:016x}, expected {expected:016x}: the file is damaged; build the library again"
    )]
    Checksum {
        /// Checksum of the bytes found.
        found: u64,
        /// Checksum stored in the file.
        expected: u64,
    },
    /// The header lacks an entry or contradicts the file.
    #[error("invalid header: {0}")]
    Head(String),
    /// A section is outside the file, or its size contradicts the header.
    #[error(
        "section `{name}` has {found} entries at byte {offset}, expected {expected} inside the file at a multiple of 8"
    )]
    Section {
        /// Name of the section.
        name: &'static str,
        /// Number of entries according to the header.
        found: usize,
        /// Byte offset of the start of the section.
        offset: usize,
        /// Expected number of entries.
        expected: String,
    },
    /// The bytes are not aligned to 8 bytes in memory.
    #[error("the bytes are not aligned, expected an address that is a multiple of 8, as for a mapped file")]
    Misaligned,
    /// The parts of the library do not match each other.
    #[error(transparent)]
    Parts(#[from] BuildError),
}

/// A checked library that borrows the bytes of a file, such as a mapped file. Nothing is copied.
#[derive(Debug)]
pub struct View<'a> {
    head: Head,
    /// Basis: columns that are orthonormal in the metric, stored one after the other.
    pub basis: &'a [f64],
    /// Singular value of each column.
    pub singular: &'a [f64],
    /// All known singular values of the data.
    pub spectrum: &'a [f64],
    /// Weights, stored one movement after the other.
    pub weights: &'a [f64],
    frames: &'a [f64],
    energy: f64,
}

impl<'a> View<'a> {
    /// Checks the bytes of a file and creates the view.
    ///
    /// # Errors
    /// [`FileError`] if the file is invalid.
    pub fn new(bytes: &'a [u8]) -> Result<Self, FileError> {
        let head = head(bytes)?;
        let s = &head.sections;
        let dofs = head.names.len();
        let rows = head.samples.checked_sub(1).and_then(|forces| forces.checked_mul(dofs));
        let rows = rows.ok_or_else(|| {
            FileError::Head(format!(
                "{} samples of {dofs} degrees of freedom, which exceed the size of any file",
                head.samples
            ))
        })?;
        let (rank, movements) = (s.singular[1], head.ids.len());
        let section = |name, [offset, count]: [usize; 2], expected: Option<usize>| {
            let wrong = || FileError::Section {
                name,
                found: count,
                offset,
                expected: expected.map_or("any number".to_string(), |n| n.to_string()),
            };
            let end = count.checked_mul(8).and_then(|size| size.checked_add(offset)).ok_or_else(wrong)?;
            if expected.is_some_and(|n| n != count) || offset % 8 != 0 {
                return Err(wrong());
            }
            let inside = bytes.get(offset..end).ok_or_else(wrong)?;
            bytemuck::try_cast_slice::<u8, f64>(inside).map_err(|_| FileError::Misaligned)
        };
        // an overflowing product is larger than any section
        let product = |a: usize, b: usize| Some(a.saturating_mul(b));
        Ok(Self {
            basis: section("basis", s.basis, product(rows, rank))?,
            singular: section("singular", s.singular, None)?,
            spectrum: section("spectrum", s.spectrum, None)?,
            weights: section("weights", s.weights, product(rank, movements))?,
            frames: section("frames", s.frames, product(3 * dofs + 1, movements))?,
            energy: section("energy", s.energy, Some(1))?[0],
            head,
        })
    }

    /// Returns the metric in which the basis is orthonormal.
    pub fn metric(&self) -> Metric {
        self.head.metric
    }

    /// Returns the names of the degrees of freedom.
    pub fn names(&self) -> &[String] {
        &self.head.names
    }

    /// Returns the ids and labels of the movements.
    pub fn movements(&self) -> impl Iterator<Item = (&str, Option<&str>)> {
        let labels = self.head.labels.iter().map(|label| label.as_deref());
        self.head.ids.iter().map(String::as_str).zip(labels)
    }

    /// Copies the view into an owned library.
    ///
    /// # Errors
    /// [`FileError`] if the contents do not form a library.
    pub fn to_library(&self) -> Result<MotionLibrary, FileError> {
        let (dofs, rank) = (self.head.names.len(), self.singular.len());
        let movements = self.head.ids.len();
        let spring = SampledSpring::new(self.head.samples, self.head.damping)
            .map_err(BuildError::from)?
            .with_interpolation(self.head.interpolation);
        let layout = Layout::new(self.head.names.clone()).map_err(BuildError::from)?;
        let frames = self.frames.chunks_exact(3 * dofs + 1).map(|numbers| Frame {
            start: numbers[..dofs].to_vec(),
            goal: numbers[dofs..2 * dofs].to_vec(),
            velocity: numbers[2 * dofs..3 * dofs].to_vec(),
            duration: numbers[3 * dofs],
        });
        let names = self.head.ids.iter().zip(&self.head.labels);
        let entries = names.zip(frames).map(|((id, label), frame)| Entry {
            id: id.clone(),
            label: label.clone(),
            frame,
        });
        Ok(MotionLibrary::from_parts(LibraryParts {
            basis: DMatrix::from_column_slice(dofs * spring.forces(), rank, self.basis),
            layout,
            spring,
            metric: self.head.metric,
            singular: self.singular.to_vec(),
            spectrum: self.spectrum.to_vec(),
            energy: self.energy,
            weights: DMatrix::from_column_slice(rank, movements, self.weights),
            entries: entries.collect(),
        })?)
    }
}

fn head(bytes: &[u8]) -> Result<Head, FileError> {
    if bytes.len() < 8 || bytes[..8] != MAGIC {
        return Err(FileError::Magic { found: bytes[..bytes.len().min(8)].to_vec() });
    }
    if bytes.len() < HEAD {
        return Err(FileError::Length { found: bytes.len(), expected: HEAD as u64 });
    }
    let number = |at: usize| u64::from_le_bytes(std::array::from_fn(|k| bytes[at + k]));
    let version = (number(8) & 0xffff_ffff) as u32;
    if version != VERSION {
        return Err(FileError::Version { found: version });
    }
    if number(16) != bytes.len() as u64 {
        return Err(FileError::Length { found: bytes.len(), expected: number(16) });
    }
    let (found, expected) = (checksum(&bytes[HEAD..]), number(32));
    if found != expected {
        return Err(FileError::Checksum { found, expected });
    }
    let end = usize::try_from(number(24)).ok().and_then(|length| length.checked_add(HEAD));
    let text = end.and_then(|end| bytes.get(HEAD..end));
    let text =
        text.ok_or_else(|| FileError::Head(format!("{} bytes, more than the file has", number(24))))?;
    let head: Head = serde_json::from_slice(text).map_err(|error| FileError::Head(error.to_string()))?;
    if head.labels.len() != head.ids.len() {
        let (ids, labels) = (head.ids.len(), head.labels.len());
        return Err(FileError::Head(format!("{ids} ids and {labels} labels, expected equal numbers")));
    }
    Ok(head)
}

/// Reads a library from a file.
///
/// # Errors
/// [`FileError`] if the file system reports an error, or the file is invalid.
pub fn read(path: &Path) -> Result<MotionLibrary, FileError> {
    let io = |source| FileError::Io { path: path.to_path_buf(), source };
    let content = read_bounded(path, LONGEST).map_err(io)?;
    let at = |source: FileError| FileError::In { path: path.to_path_buf(), source: Box::new(source) };
    from_bytes(&content).map_err(at)
}

/// Reads a library from the bytes of a file. The bytes may have any alignment.
///
/// # Errors
/// [`FileError`] if the bytes are not a valid library.
pub fn from_bytes(content: &[u8]) -> Result<MotionLibrary, FileError> {
    // an array of words, so that its numbers are aligned
    let mut words = vec![0_u64; content.len().div_ceil(8)];
    let bytes = &mut bytemuck::cast_slice_mut::<u64, u8>(&mut words)[..content.len()];
    bytes.copy_from_slice(content);
    View::new(bytes).and_then(|view| view.to_library())
}
