//! Integration tests of the crate, one module per subject.

mod body;
mod perception;
mod search;
