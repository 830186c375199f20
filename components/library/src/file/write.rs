//! Writing of library files.

use std::io::Write as _;
use std::path::Path;

use super::{ALIGNMENT, HEAD, Head, MAGIC, Sections, VERSION, checksum};
use crate::MotionLibrary;

/// Returns a library as the bytes of a file.
pub fn to_bytes(library: &MotionLibrary) -> Vec<u8> {
    let parts = library.parts();
    let frames: Vec<f64> = parts
        .entries
        .iter()
        .flat_map(|entry| {
            let frame = &entry.frame;
            [frame.start.as_slice(), &frame.goal, &frame.velocity, &[frame.duration]].concat()
        })
        .collect();
    let energy = [parts.energy];
    let contents: [&[f64]; 6] = [
        parts.basis.as_slice(),
        &parts.singular,
        &parts.spectrum,
        &energy,
        parts.weights.as_slice(),
        &frames,
    ];
    // The head contains the offsets, which depend on its length: repeat until they are consistent, a few
    // times at most.
    let mut places = [[0, 0]; 6];
    let head = loop {
        let [basis, singular, spectrum, energy, weights, frames] = places;
        let head = Head {
            names: parts.layout.names().to_vec(),
            samples: parts.spring.samples(),
            damping: parts.spring.damping(),
            interpolation: parts.spring.interpolation(),
            metric: parts.metric,
            ids: parts.entries.iter().map(|entry| entry.id.clone()).collect(),
            labels: parts.entries.iter().map(|entry| entry.label.clone()).collect(),
            sections: Sections { basis, singular, spectrum, energy, weights, frames },
        };
        let head = serde_json::to_vec(&head).expect("names, numbers and text always become JSON");
        let mut offset = HEAD + head.len();
        let mut next = places;
        for (place, content) in next.iter_mut().zip(contents) {
            offset = offset.next_multiple_of(ALIGNMENT);
            *place = [offset, content.len()];
            offset += 8 * content.len();
        }
        if next == places {
            break head;
        }
        places = next;
    };
    let mut bytes = vec![0; HEAD];
    bytes.extend_from_slice(&head);
    for (place, content) in places.iter().zip(contents) {
        bytes.resize(place[0], 0);
        content.iter().for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()));
    }
    let sum = checksum(&bytes[HEAD..]);
    bytes[..8].copy_from_slice(&MAGIC);
    bytes[8..12].copy_from_slice(&VERSION.to_le_bytes());
    let length = bytes.len() as u64;
    for (at, value) in [(16, length), (24, head.len() as u64), (32, sum)] {
        bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
    }
    bytes
}

/// Writes a library to a file. An existing file is replaced.
///
/// # Errors
/// Returns the error of the file system.
pub fn write(library: &MotionLibrary, path: &Path) -> std::io::Result<()> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(format!(".{}.part", std::process::id()));
    let beside = std::path::PathBuf::from(beside);
    let written = std::fs::File::create(&beside).and_then(|mut file| {
        file.write_all(&to_bytes(library))?;
        file.sync_all()
    });
    let moved = written.and_then(|()| std::fs::rename(&beside, path));
    if moved.is_err() {
        let _ = std::fs::remove_file(&beside);
    }
    moved
}
