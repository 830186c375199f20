//! Standard output and standard error, written so that a closed pipe is not an error. For example, `motorium
//! library evaluate | head` ends quietly with the exit code that it would have without `head`, and `motorium
//! run 2>&1 | head` keeps running its robot.

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
    () => { $crate::out::print_error(format_args!("\n")) };
    ($($text:tt)*) => { $crate::out::print_error(format_args!("{}\n", format_args!($($text)*))) };
}

/// Prints to standard error.
macro_rules! err {
    ($($text:tt)*) => { $crate::out::print_error(format_args!($($text)*)) };
}

pub(crate) use {err, errln, out, outln};

/// Prints to standard output, without colours where it is not a terminal. A closed pipe is ignored; any other
/// failure ends the program with exit code 1.
pub(crate) fn print(text: Arguments<'_>) {
    if let Err(error) = written(anstream::stdout().lock().write_fmt(text)) {
        errln!("{}: writing to standard output: {error}", crate::style::error("error"));
        std::process::exit(1);
    }
}

/// Prints to standard error, without colours where it is not a terminal, and wrapped between words on a
/// narrow terminal. Failures are ignored.
pub(crate) fn print_error(text: Arguments<'_>) {
    let mut stream = anstream::stderr().lock();
    let _ = match crate::wrap::width() {
        Some(width) => stream.write_all(crate::wrap::wrapped(&text.to_string(), width).as_bytes()),
        None => stream.write_fmt(text),
    };
}

/// Success if the text was written, or if its reader has closed the pipe.
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
    fn closed_pipe_succeeds_and_full_disk_fails() {
        assert!(written(Err(ErrorKind::BrokenPipe.into())).is_ok());
        assert!(written(Err(ErrorKind::StorageFull.into())).is_err());
    }
}
