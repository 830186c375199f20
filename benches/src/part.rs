//! A measurement's own processes: the program that measures starts itself again.

use std::path::PathBuf;
use std::process::ExitCode;

use crate::host::run_load;
use crate::pair::{PART, run_part};

/// What a process was started for, if a measurement started it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Part {
    /// One of two that throw something to and fro.
    Throw {
        /// Which of the two.
        side: String,
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
            [_, mark, kind] if mark == crate::host::LOAD => Some(Self::Load(kind.clone())),
            _ => None,
        }
    }

    /// Plays the part to its end.
    pub fn run(&self) -> ExitCode {
        match self {
            Self::Throw { side, folder } => match run_part(side, folder) {
                Ok(()) => ExitCode::SUCCESS,
                Err(error) => {
                    eprintln!("{error}");
                    ExitCode::FAILURE
                }
            },
            Self::Load(kind) => {
                run_load(kind);
                ExitCode::FAILURE
            }
        }
    }
}
