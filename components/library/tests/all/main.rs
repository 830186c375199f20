//! Integration tests of the crate, one module per subject.

mod files;
mod library;
mod recorded;
