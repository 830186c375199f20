//! Standard output and standard error, whose readers may have had enough: `motorium library evaluate | head` ends quietly
//! with the exit code that it would have had, and `motorium run 2>&1 | head` goes on running its robot.

use std::fmt::Arguments;
use std::io::{ErrorKind, Result, Write as _};

/// Prints a line to standard output.
macro_rules! outln {
    () => { $crate::out::print(format_args!("\n")) };
    ($($text:tt)*) => { $crate::out::print(format_args!("{}\n", format_args!($($text)*))) };
}

/// Prints to standard output.
macro_rules! out {
    ($($text:tt)*) => { $crate::out::print(format_args!($($text)*)) };
}

/// Prints a line to standard error.
macro_rules! errln {
    () => { $crate::out::tell(format_args!("\n")) };
    ($($text:tt)*) => { $crate::out::tell(format_args!("{}\n", format_args!($($text)*))) };
}

/// Prints to standard error.
macro_rules! err {
    ($($text:tt)*) => { $crate::out::tell(format_args!($($text)*)) };
}

pub(crate) use {err, errln, out, outln};

/// To standard output, without colours where it is no terminal. What nobody reads is dropped; any other failure ends the
/// program, for what was asked for is not there.
pub(crate) fn print(text: Arguments<'_>) {
    if let Err(error) = written(anstream::stdout().lock().write_fmt(text)) {
        errln!("{}: writing to standard output: {error}", crate::style::error("error"));
        std::process::exit(1);
    }
}

/// To standard error, without colours where it is no terminal. Where that fails there is nobody to tell.
pub(crate) fn tell(text: Arguments<'_>) {
    let _ = anstream::stderr().lock().write_fmt(text);
}

/// Whether it was written, or nobody reads it.
fn written(result: Result<()>) -> Result<()> {
    match result {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_that_has_had_enough_is_no_failure_and_a_full_disk_is_one() {
        assert!(written(Err(ErrorKind::BrokenPipe.into())).is_ok());
        assert!(written(Err(ErrorKind::StorageFull.into())).is_err());
    }
}
