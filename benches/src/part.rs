//! A measurement's own processes: the program that measures starts itself again.

use std::path::PathBuf;
use std::process::ExitCode;

use crate::host::run_load;
use crate::pair::{PART, run_part};
use crate::raw_chain::{LINK, run_link};

/// The role that a measurement started a process for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Part {
    /// One of two that throw something to and fro.
    Throw {
        /// Which of the two.
        side: String,
        /// The folder of the measurement.
        folder: PathBuf,
    },
    /// One of a chain that passes something on.
    Link {
        /// Which of them.
        index: String,
        /// The folder of the measurement.
        folder: PathBuf,
    },
    /// Other work for the machine.
    Load(String),
}

impl Part {
    /// Reads the command line of a process. A program that measures asks this first.
    pub fn from_arguments(arguments: &[String]) -> Option<Self> {
        match arguments {
            [_, mark, side, folder] if mark == PART => {
                Some(Self::Throw { side: side.clone(), folder: folder.into() })
            }
            [_, mark, index, folder] if mark == LINK => {
                Some(Self::Link { index: index.clone(), folder: folder.into() })
            }
            [_, mark, kind] if mark == crate::host::LOAD => Some(Self::Load(kind.clone())),
            _ => None,
        }
    }

    /// Plays the part to its end.
    pub fn run(&self) -> ExitCode {
        let ended = match self {
            Self::Throw { side, folder } => run_part(side, folder),
            Self::Link { index, folder } => run_link(index, folder),
            Self::Load(kind) => {
                run_load(kind);
                return ExitCode::FAILURE;
            }
        };
        match ended {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("{error}");
                ExitCode::FAILURE
            }
        }
    }
}
