//! The stamp of a sample in a message.

use motorium::state::Stamp;

use motorium_recordings::messages::wire;

/// Field number of the stamp.
pub(super) const STAMP: u32 = 1;

/// Bytes of a stamp.
pub(super) fn stamp_bytes(stamp: &Stamp) -> [u8; size_of::<Stamp>()] {
    let Stamp { sequence, source_time, publish_time, state_time, episode, publisher, restart_count } = *stamp;
    let mut raw = [0; size_of::<Stamp>()];
    let longs = [sequence, source_time, publish_time, state_time, episode];
    for (place, number) in raw.chunks_exact_mut(8).zip(longs) {
        place.copy_from_slice(&number.to_le_bytes());
    }
    raw[40..44].copy_from_slice(&publisher.to_le_bytes());
    raw[44..].copy_from_slice(&restart_count.to_le_bytes());
    raw
}

/// Stamp with these bytes.
pub(super) fn stamp_of(raw: &[u8]) -> Stamp {
    let long = |index: usize| {
        raw.get(8 * index..).and_then(|rest| rest.first_chunk()).map_or(0, |bytes| u64::from_le_bytes(*bytes))
    };
    let last = long(5);
    Stamp {
        sequence: long(0),
        source_time: long(1),
        publish_time: long(2),
        state_time: long(3),
        episode: long(4),
        publisher: last as u32,
        restart_count: (last >> 32) as u32,
    }
}

/// Descriptor of the stamp field.
pub(super) fn stamp_field(type_name: &str) -> Vec<u8> {
    let mut out = Vec::new();
    wire::bytes(1, b"stamp", &mut out);
    for (field, value) in [(3, u64::from(STAMP)), (4, 1), (5, 11)] {
        wire::key(field, wire::VARINT, &mut out);
        wire::varint(value, &mut out);
    }
    wire::bytes(6, type_name.as_bytes(), &mut out);
    out
}
