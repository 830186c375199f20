//! The `motorium` command.
fn main() {}
