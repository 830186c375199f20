//! In place of the crate `bindgen`, which nothing here uses: see `[patch.crates-io]` in `../Cargo.toml`.

/// A builder without methods. A build script that needs the real one finds its reason in the name.
pub type Builder = RemoveThePatchOfBindgenInCargoToml;

/// The reason.
#[derive(Debug, Default)]
pub struct RemoveThePatchOfBindgenInCargoToml;
