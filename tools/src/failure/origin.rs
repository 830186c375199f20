//! The position in a file, and the found and expected values, that an error of a library contains.

use std::path::Path;

use motorium_benches::latency::ReadError;
use motorium_library::file::FileError;
use motorium_primitives::file::{PrimitiveFile, PrimitiveFileError};
use motorium_recordings::RecordingError;
use motorium_robots::{LoadError, MjcfError, ProfileError, UrdfError};

/// File, position and values of one error in a chain; unknown ones are empty.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Origin {
    /// `true` for an error in an input file.
    pub invalid: bool,
    pub file: Option<String>,
    pub line: Option<usize>,
    pub column: Option<usize>,
    pub found: Option<String>,
    pub expected: Option<String>,
    pub help: Option<String>,
}

impl Origin {
    /// Returns the facts of an error of a known type.
    pub(super) fn from_error(error: &(dyn std::error::Error + 'static)) -> Self {
        if let Some(error) = error.downcast_ref() {
            Self::of_robot(error)
        } else if let Some(error) = error.downcast_ref::<UrdfError>() {
            Self::of_urdf(error)
        } else if let Some(error) = error.downcast_ref::<MjcfError>() {
            Self::of_mjcf(error)
        } else if let Some(error) = error.downcast_ref() {
            Self::of_recording(error)
        } else if let Some(error) = error.downcast_ref() {
            Self::of_primitive(error)
        } else if let Some(error) = error.downcast_ref::<FileError>() {
            let (FileError::Io { path, .. } | FileError::In { path, .. }) = error else {
                return Self::default();
            };
            Self::file(path)
        } else if let Some(error) = error.downcast_ref() {
            Self::of_bench(error)
        } else if let Some(error) = error.downcast_ref::<serde_json::Error>() {
            Self { line: Some(error.line()), column: Some(error.column()), ..Self::default() }
        } else {
            Self::default()
        }
    }

    fn file(path: &Path) -> Self {
        Self { file: Some(path.display().to_string()), ..Self::default() }
    }

    fn of_robot(error: &LoadError) -> Self {
        let help = |nearest: &String| format!("did you mean `{nearest}`?");
        match error {
            LoadError::Urdf(error) => Self::of_urdf(error),
            LoadError::Mjcf(error) => Self::of_mjcf(error),
            LoadError::NotFound { path, nearest, reference } => {
                // A name with an extension is a file name.
                let invalid = Path::new(reference).extension().is_some();
                let found = Some(reference.clone());
                Self { invalid, found, help: nearest.as_ref().map(help), ..Self::file(path) }
            }
            LoadError::Setting(_) => Self { invalid: true, ..Self::default() },
            LoadError::NoUrdf(folder) | LoadError::SeveralUrdf { folder, .. } => Self::file(folder),
            LoadError::Read { path, .. } => Self::file(path),
            LoadError::NotMjcf(path) => Self { invalid: true, ..Self::file(path) },
            LoadError::NotText { path, at, byte } => Self {
                invalid: true,
                line: Some(at.line as usize),
                column: Some(at.column as usize),
                found: Some(format!("{byte:#04x}")),
                expected: Some("UTF-8".to_string()),
                ..Self::file(path)
            },
            LoadError::Profile { path, source } => {
                let (line, column) = place_in_profile(path, source).unzip();
                Self { invalid: true, line, column, ..Self::file(path) }
            }
        }
    }

    fn of_urdf(error: &UrdfError) -> Self {
        Self {
            invalid: true,
            file: error.file.as_ref().map(|file| file.display().to_string()),
            line: error.at.map(|at| at.line as usize),
            column: error.at.map(|at| at.column as usize),
            ..Self::default()
        }
    }

    fn of_mjcf(error: &MjcfError) -> Self {
        Self {
            invalid: true,
            file: error.file.as_ref().map(|file| file.display().to_string()),
            line: Some(error.at.line as usize),
            column: Some(error.at.column as usize),
            ..Self::default()
        }
    }

    fn of_recording(error: &RecordingError) -> Self {
        match error {
            RecordingError::System { path, .. }
            | RecordingError::Format { path }
            | RecordingError::NoTime { path } => Self::file(Path::new(path)),
            RecordingError::Count { path, found, expected } => Self {
                found: Some(found.to_string()),
                expected: Some((*expected).to_string()),
                ..Self::file(Path::new(path))
            },
            RecordingError::TooShort { found, expected } => Self {
                found: Some(found.to_string()),
                expected: Some(format!("at least {expected}")),
                ..Self::default()
            },
            RecordingError::NotFinite { value, .. } => Self {
                found: Some(value.to_string()),
                expected: Some("a finite number".to_string()),
                ..Self::default()
            },
            RecordingError::OutOfRange { value, expected, .. } => Self {
                found: Some(value.to_string()),
                expected: Some((*expected).to_string()),
                ..Self::default()
            },
            RecordingError::NoChannel { path, name, known } => Self {
                found: Some(name.clone()),
                expected: Some(known.clone()),
                ..Self::file(Path::new(path))
            },
            RecordingError::Malformed { place, found, expected, advice } => Self {
                line: place.line,
                column: place.column.as_ref().map(|(number, _)| *number),
                found: Some(found.clone()),
                expected: Some(expected.clone()),
                help: advice.map(str::to_string),
                ..Self::file(Path::new(&place.path))
            },
            _ => Self::default(),
        }
    }

    fn of_primitive(error: &PrimitiveFileError) -> Self {
        match error {
            PrimitiveFileError::System { path, .. }
            | PrimitiveFileError::Foreign { path }
            | PrimitiveFileError::Content { path, .. } => Self::file(path),
            PrimitiveFileError::Text { path, source } => {
                Self { line: Some(source.line()), column: Some(source.column()), ..Self::file(path) }
            }
            PrimitiveFileError::Version { path, found } => Self {
                found: Some(format!("version {found}")),
                expected: Some(format!("version {}", PrimitiveFile::VERSION)),
                help: Some("fit it again".to_string()),
                ..Self::file(path)
            },
        }
    }

    fn of_bench(error: &ReadError) -> Self {
        let in_file = |file: &String| Self { invalid: true, ..Self::file(Path::new(file)) };
        match error {
            ReadError::File { file, .. } => in_file(file),
            ReadError::Version { file, found } => Self {
                found: Some(found.clone()),
                expected: Some(motorium_benches::latency::VERSION.to_string()),
                ..in_file(file)
            },
            ReadError::Content { file, error } => {
                Self { line: Some(error.line()), column: Some(error.column()), ..in_file(file) }
            }
        }
    }
}

/// Returns line and column of a fault in the text of a profile.
fn place_in_profile(path: &Path, error: &ProfileError) -> Option<(usize, usize)> {
    let ProfileError::Toml(error) = error else { return None };
    let text = std::fs::read_to_string(path).ok()?;
    let before = text.get(..error.span()?.start)?;
    let line = before.rsplit('\n').next()?;
    Some((before.matches('\n').count() + 1, line.chars().count() + 1))
}
