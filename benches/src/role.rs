//! Processes of a measurement: the measuring program starts itself again.

use std::path::PathBuf;
use std::process::ExitCode;

use crate::host::run_load;
use crate::pair::{ROLE, run_role};
use crate::raw_chain::{LINK, run_link};

/// The role of a process that a measurement has started.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Role {
    /// One side of a ping-pong.
    PingPong {
        /// The side, `ping` or `pong`.
        side: String,
        /// The folder of the measurement.
        folder: PathBuf,
    },
    /// One process of a chain.
    Link {
        /// Index of the process.
        index: String,
        /// The folder of the measurement.
        folder: PathBuf,
    },
    /// Background load.
    Load(String),
}

impl Role {
    /// Parses the command line of a process that a measurement has started; `None` for all other command
    /// lines. A measuring program must call this function first.
    pub fn from_arguments(arguments: &[String]) -> Option<Self> {
        match arguments {
            [_, mark, side, folder] if mark == ROLE => {
                Some(Self::PingPong { side: side.clone(), folder: folder.into() })
            }
            [_, mark, index, folder] if mark == LINK => {
                Some(Self::Link { index: index.clone(), folder: folder.into() })
            }
            [_, mark, kind] if mark == crate::host::LOAD => Some(Self::Load(kind.clone())),
            _ => None,
        }
    }

    /// Runs the process to its end.
    pub fn run(&self) -> ExitCode {
        let ended = match self {
            Self::PingPong { side, folder } => run_role(side, folder),
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
