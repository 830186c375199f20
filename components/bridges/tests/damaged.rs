//! Damaged recordings: reading around the damage, repair, and reports.

mod walk;

use motorium::launcher::Options;
use motorium_bridges::recording::{self, Recording, recover, verify};

use walk::{GRAPH, recorder, registry, run};

/// Offsets of the records in the chunks of a file, in file order.
fn records_in_chunks(bytes: &[u8]) -> Vec<usize> {
    let length = |place: usize| u64::from_le_bytes(bytes[place + 1..place + 9].try_into().unwrap()) as usize;
    let (mut place, mut records) = (8, Vec::new());
    while place + 9 < bytes.len() - 8 {
        let end = place + 9 + length(place);
        if bytes[place] == 6 {
            let mut record = place + 9 + 40;
            while record < end {
                records.push(record);
                record += 9 + length(record);
            }
        }
        place = end;
    }
    records
}

#[test]
fn a_damaged_length_loses_one_message_and_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let (file, whole) = (folder.path().join("a.mcap"), folder.path().join("whole.mcap"));
    run(&format!("{GRAPH}{}", recorder(&file)), &Options::inline());
    let original = Recording::open(&file).unwrap();
    let all = original.samples().count();
    assert!(original.faults().is_empty() && original.missing() == 0, "{:?}", original.faults());
    let clean = recover(&file, &whole).unwrap();
    assert!(clean.is_clean() && clean.was_whole, "{clean:?}");
    let mut bytes = std::fs::read(&file).unwrap();
    let records = records_in_chunks(&bytes);
    bytes[records[records.len() / 2] + 1 + 7] ^= 0x40;
    std::fs::write(&file, &bytes).unwrap();

    let damaged = Recording::open(&file).unwrap();
    assert!(damaged.samples().map(Result::unwrap).count() + 1 >= all);
    assert!(damaged.faults().iter().any(|fault| fault.starts_with("is damaged")), "{:?}", damaged.faults());
    let recovered = recover(&file, &whole).unwrap();
    assert!(!recovered.is_clean() && recovered.damaged_chunks == 1, "{recovered:?}");
    let repaired = Recording::open(&whole).unwrap();
    assert!(
        repaired.faults().iter().any(|fault| fault.contains("recovered from a damaged file")),
        "{:?}",
        repaired.faults()
    );
    if damaged.missing() > 0 {
        let error = verify(&damaged, &registry(), &Options::inline(), &[]).unwrap_err().to_string();
        assert!(error.contains("of its messages, so it cannot be compared"), "{error}");
    }
}

#[test]
fn damage_gets_no_fresh_checksum() {
    let folder = tempfile::tempdir().unwrap();
    let (file, whole) = (folder.path().join("a.mcap"), folder.path().join("whole.mcap"));
    run(&format!("{GRAPH}{}", recorder(&file)), &Options::inline());
    let mut bytes = std::fs::read(&file).unwrap();
    let records = records_in_chunks(&bytes);
    // a content byte of a message
    bytes[records[records.len() / 2] - 3] ^= 0x10;
    std::fs::write(&file, &bytes).unwrap();
    let recovered = recover(&file, &whole).unwrap();
    assert_eq!((recovered.damaged_chunks, recovered.missing_messages), (1, 0), "{recovered:?}");
    let copy = std::fs::read(&whole).unwrap();
    let (mut place, mut sums) = (8, Vec::new());
    while place + 9 < copy.len() - 8 {
        if copy[place] == 6 {
            sums.push(u32::from_le_bytes(copy[place + 33..place + 37].try_into().unwrap()));
        }
        place += 9 + u64::from_le_bytes(copy[place + 1..place + 9].try_into().unwrap()) as usize;
    }
    assert_eq!(sums.iter().filter(|sum| **sum == 0).count(), 1, "{sums:?}");
    assert!(!Recording::open(&whole).unwrap().faults().is_empty());
}

#[test]
fn a_recording_of_nothing_is_neither_replayed_nor_verified() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    run(&format!("{GRAPH}{}", recorder(&file)), &Options::inline());
    let bytes = std::fs::read(&file).unwrap();
    let first = records_in_chunks(&bytes)[0];
    std::fs::write(&file, &bytes[..first]).unwrap();
    let nothing = Recording::open(&file).unwrap();
    let error = recording::replayed(&nothing, &[], None).unwrap_err().to_string();
    assert!(error.contains("the recording contains no samples to replay"), "{error}");
    let error = verify(&nothing, &registry(), &Options::inline(), &[]).unwrap_err().to_string();
    assert!(error.contains("the recording contains no samples to compare"), "{error}");
}
