//! Integration tests of the crate, one module a subject.

mod body;
mod perception;
mod search;
