//! DBC database, by which the frames of a CAN bus are decoded.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_can::{Database, Decoded, Record};

use crate::exit;
use crate::out::errln;

/// Options for the database of a command.
#[derive(Debug, clap::Args)]
pub(super) struct Words {
    /// A DBC file with the names, units and values of the signals in frames
    #[arg(long, value_name = "FILE")]
    dbc: Option<PathBuf>,
    /// Mask of the identifier bits to compare, such as 0x1F for ODrives, whose database is for node 0
    #[arg(long, value_name = "BITS", requires = "dbc", value_parser = mask)]
    dbc_mask: Option<u32>,
}

/// Reads a mask: a number of at most 29 bits, decimal or hexadecimal.
fn mask(text: &str) -> Result<u32, String> {
    let number = match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => u32::from_str_radix(digits, 16),
        None => text.parse(),
    };
    let fits = number.ok().filter(|number| (1..1 << 29).contains(number));
    fits.ok_or_else(|| "expected a number of 1 to 29 bits, such as 0x1F".to_string())
}

/// Longest database, bytes.
const LONGEST: u64 = 256 << 20;

/// The database of a command.
pub(super) struct Interpreter(Option<Database>);

impl Words {
    /// Reads the named database, if any. Returns an exit code after reporting an error if it cannot be read.
    pub(super) fn interpreter(&self) -> Result<Interpreter, ExitCode> {
        let Some(path) = &self.dbc else { return Ok(Interpreter(None)) };
        let refuse = |cause: &dyn core::fmt::Display, code| {
            errln!("{} {}: {cause}", crate::style::error("error:"), path.display());
            code
        };
        let bytes = motorium_recordings::read_bounded(path, LONGEST);
        let bytes = bytes.map_err(|error| refuse(&error, exit::FAILED))?;
        // names in old files are in Windows-1252, one byte per letter
        let text = String::from_utf8(bytes)
            .unwrap_or_else(|error| error.as_bytes().iter().map(|byte| char::from(*byte)).collect());
        let read = Database::parse(&text).and_then(|database| match self.dbc_mask {
            Some(mask) => database.with_mask(mask),
            None => Ok(database),
        });
        read.map(|database| Interpreter(Some(database))).map_err(|error| refuse(&error, exit::invalid()))
    }
}

impl Interpreter {
    /// Decodes a record; `None` without a database or for an unknown message.
    pub(super) fn decode(&self, record: &Record) -> Option<Decoded<'_>> {
        self.0.as_ref()?.decode(&record.frame()?)
    }
}
