//! Recordings, primitives and motion libraries.

use motorium_library::file::{FileError, View};
use motorium_primitives::file::PrimitiveFile;
use motorium_recordings::{Selection, read_text};

use crate::target::{files, target};

/// Reads texts as recordings with this file extension.
fn recordings_as(ending: &str) {
    let corpus = files(&["tests/fuzz/corpus/recordings"], &[ending]);
    let selection = Selection { rate: Some(100.0), ..Selection::default() };
    target(&format!("recordings{ending}"), &corpus, |bytes| {
        let text = String::from_utf8_lossy(bytes);
        for selection in [&selection, &Selection::default()] {
            match read_text(&format!("recording{ending}"), &text, selection) {
                // Any recording with an even grid of samples.
                Ok(recording) => drop(recording.evenly(20, None)),
                Err(error) => assert!(!error.to_string().is_empty()),
            }
        }
    });
}

#[test]
fn tables() {
    recordings_as(".csv");
    recordings_as(".tsv");
}

#[test]
fn recordings_in_json() {
    recordings_as(".json");
    recordings_as(".jsonl");
}

#[test]
fn primitives() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("primitive.json");
    target("primitives", &files(&["tests/fuzz/corpus/primitives"], &[".json"]), |bytes| {
        std::fs::write(&path, bytes).expect("the file can be written");
        if let Err(error) = PrimitiveFile::read(&path) {
            assert!(!error.to_string().is_empty());
        }
    });
}

/// Copies the bytes to an address that is a multiple of 8, as in a mapped file.
fn aligned(bytes: &[u8], read: impl FnOnce(&[u8])) {
    let mut words = vec![0_u64; bytes.len().div_ceil(8)];
    let place = &mut bytemuck::cast_slice_mut::<u64, u8>(&mut words)[..bytes.len()];
    place.copy_from_slice(bytes);
    read(place);
}

fn read_library(bytes: &[u8]) {
    aligned(bytes, |bytes| match View::new(bytes).and_then(|view| view.to_library()) {
        Ok(library) => assert!(library.rank() < 1 << 20),
        Err(error) => assert!(!error.to_string().is_empty()),
    });
}

#[test]
fn libraries() {
    target("libraries", &files(&["tests/fuzz/corpus/libraries"], &[".mtlib"]), read_library);
}

/// Damage made by the writer itself: length and checksum are consistent.
#[test]
fn libraries_with_the_right_checksum() {
    let corpus = files(&["tests/fuzz/corpus/libraries"], &[".mtlib"]);
    target("libraries-checked", &corpus, |bytes| {
        let mut bytes = bytes.to_vec();
        if let Some(length) = (bytes.len() >= 64).then_some(bytes.len() as u64) {
            bytes[16..24].copy_from_slice(&length.to_le_bytes());
            let checksum = twox_hash::XxHash3_64::oneshot(&bytes[64..]);
            bytes[32..40].copy_from_slice(&checksum.to_le_bytes());
        }
        let whole = bytes.clone();
        aligned(&whole, |bytes| {
            if let Err(error) = View::new(bytes) {
                assert!(!matches!(error, FileError::Checksum { .. }), "{error}");
            }
        });
        read_library(&bytes);
    });
}
