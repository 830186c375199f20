//! Tests of the derived schemas, against the descriptors and the wire format of `prost`.

use motorium::state::{Event, JointCommand, JointState, built_in, encode};
use prost::Message as _;
use prost_types::FileDescriptorSet;

use super::*;

motorium::state_buffer! {
    /// A type with every kind of number.
    struct Mixed as "test.Mixed" {
        a: i8, b: u8, c: i16, d: u16, e: i32, f: u32, g: i64, h: u64, i: f32, j: [f32; 3], k: [i16; 2], l: f64,
        m: [u8; 4], n: [u64; 2],
    }
}

#[test]
fn every_runtime_message_has_a_valid_descriptor() {
    for layout in built_in() {
        let derived = Derived::new(&layout).unwrap();
        let set = FileDescriptorSet::decode(&derived.schema().data[..]).unwrap();
        let file = &set.file[0];
        let message = &file.message_type[0];
        let name = format!("{}.{}", file.package(), message.name());
        assert_eq!(name, derived.schema().name);
        assert_eq!(name, layout.type_name.replace("motorium.", "motorium.v1."));
        let fields: Vec<_> = message.field.iter().map(|field| (field.name(), field.number())).collect();
        let of_layout = layout.fields.iter().enumerate().filter(|(_, field)| field.name != "reserved");
        let expected: Vec<_> = std::iter::once(("stamp", 1))
            .chain(of_layout.map(|(index, field)| (field.name.as_str(), index as i32 + 2)))
            .collect();
        assert_eq!(fields, expected);
        assert_eq!(message.nested_type[0].field.len(), 7, "the stamp");
    }
}

#[test]
fn sample_survives_encoding_bit_for_bit() {
    let text = "a=-128 b=255 c=-300 d=65535 e=-2147483648 f=4294967295 g=-9223372036854775808 \
                h=18446744073709551615 i=0.1 j=[1, -0.0, 3] k=[-1, 32767] l=-0.0 m=[1, 2, 3, 255] n=[0, 1]";
    let layout = Mixed::layout();
    let derived = Derived::new(&layout).unwrap();
    let bytes = encode(&layout, text).unwrap();
    let stamp = Stamp {
        sequence: u64::MAX,
        source_time: 1,
        publish_time: u64::MAX - 1,
        state_time: 300,
        episode: u64::MAX,
        publisher: u32::MAX,
        restart_count: u32::MAX,
    };
    let mut message = Vec::new();
    derived.encode(&stamp, &bytes, &mut message);
    assert_eq!(derived.decode(&message), Ok((stamp, bytes)));
}

#[test]
fn unused_entries_are_skipped_and_decode_as_zeros() {
    let layout = JointCommand::layout();
    let derived = Derived::new(&layout).unwrap();
    let mut bytes = encode(&layout, "position=[0.5, -1.25] kp=[1, 2]").unwrap();
    let clean = bytes.clone();
    let last = bytes.len() - 1;
    bytes[last] = 7;
    let mut message = Vec::new();
    derived.encode(&Stamp::default(), &bytes, &mut message);
    assert!(message.len() < 130, "{} bytes", message.len());
    assert_eq!(derived.decode(&message).unwrap().1, clean);
}

#[test]
fn text_is_a_string_and_damage_never_panics() {
    let layout = Event::layout();
    let derived = Derived::new(&layout).unwrap();
    let bytes = encode(&layout, "code=3 severity=1 value=0.5 text=\"out of reach\"").unwrap();
    let mut message = Vec::new();
    derived.encode(&Stamp::default(), &bytes, &mut message);
    assert!(message.windows(12).any(|part| part == b"out of reach"));
    assert_eq!(derived.decode(&message).unwrap().1, bytes);
    for place in 0..message.len() {
        let _ = derived.decode(&message[..place]);
        for value in [0, 1, 0x7f, 0x80, 0xff] {
            let mut damaged = message.clone();
            damaged[place] = value;
            let _ = derived.decode(&damaged);
        }
    }
}

#[test]
fn layout_with_a_non_numeric_field_is_rejected_by_name() {
    let mut layout = JointState::layout();
    layout.fields[2].kind = "[f128; 64]".to_string();
    let error = Derived::new(&layout).unwrap_err().to_string();
    assert!(error.contains("`position` of `motorium.JointState` has type [f128; 64]"), "{error}");
    layout.fields[2].kind = "[f64; 99999999999]".to_string();
    assert!(Derived::new(&layout).is_err());
}
