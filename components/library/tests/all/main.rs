//! Integration tests of the crate, one module a subject.

mod files;
mod library;
mod recorded;
