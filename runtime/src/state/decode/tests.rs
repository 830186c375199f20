use crate::state::{FieldLayout, JointCommand, JointState, PoseTarget, StateBuffer};

use super::*;

crate::state_buffer! {
    /// Every primitive once, with padding in between.
    struct Everything as "test.Everything" {
        small: u8,
        wide: u64,
        signed: i16,
        single: f32,
        bytes: [u8; 3],
        pairs: [f32; 2],
        negative: i64,
        target: Target,
        legs: [Target; 2],
    }
}

crate::state_buffer! {
    /// A part of another buffer.
    struct Target as "test.Target" {
        place: [f64; 2],
        index: i32,
    }
}

/// Returns a sample whose named fields contain these bytes and whose other fields are zero.
fn sample(layout: &TypeLayout, content: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut sample = vec![0; layout.size];
    for (name, bytes) in content {
        let field = layout.fields.iter().find(|field| field.name == *name).expect(name);
        sample[field.offset..][..bytes.len()].copy_from_slice(bytes);
    }
    sample
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_ne_bytes()).collect()
}

fn json<T: StateBuffer>(content: &[(&str, Vec<u8>)]) -> String {
    let layout = T::layout();
    let decoder = Decoder::new(&layout).unwrap();
    serde_json::to_string(&decoder.decode(&sample(&layout, content)).unwrap()).unwrap()
}

#[test]
fn all_field_types_survive_decoding() {
    let singles = |values: [f32; 2]| values.iter().flat_map(|value| value.to_ne_bytes()).collect();
    let content = [
        ("small", vec![200]),
        ("wide", u64::MAX.to_ne_bytes().to_vec()),
        ("signed", (-5i16).to_ne_bytes().to_vec()),
        ("single", 0.1f32.to_ne_bytes().to_vec()),
        ("bytes", vec![1, 2, 3]),
        ("pairs", singles([1.5, -2.5])),
        ("negative", i64::MIN.to_ne_bytes().to_vec()),
        ("target.place", doubles(&[0.25, -1e-9])),
        ("target.index", (-7i32).to_ne_bytes().to_vec()),
        ("legs[0].place", doubles(&[1.0, 2.0])),
        ("legs[1].place", doubles(&[4.0, 5.0])),
        ("legs[1].index", 6i32.to_ne_bytes().to_vec()),
    ];
    assert_eq!(
        json::<Everything>(&content),
        concat!(
            r#"{"small":200,"wide":18446744073709551615,"signed":-5,"single":0.1,"bytes":[1,2,3],"#,
            r#""pairs":[1.5,-2.5],"negative":-9223372036854775808,"#,
            r#""target.place":[0.25,-1e-9],"target.index":-7,"#,
            r#""legs[0].place":[1.0,2.0],"legs[0].index":0,"legs[1].place":[4.0,5.0],"legs[1].index":6}"#
        )
    );
}

#[test]
fn only_counted_joints_are_shown() {
    let content = [
        ("count", 2u32.to_ne_bytes().to_vec()),
        ("reserved", vec![9; 4]),
        ("position", doubles(&[1.0, 2.0, 3.0])),
        ("effort", doubles(&[0.0, -0.5])),
    ];
    assert_eq!(
        json::<JointState>(&content),
        r#"{"count":2,"position":[1.0,2.0],"velocity":[0.0,0.0],"effort":[0.0,-0.5]}"#
    );
    assert!(json::<JointCommand>(&[]).ends_with(r#""kp":[],"kd":[]}"#));
}

#[test]
fn bytes_named_text_are_shown_as_text() {
    let content = [("count", 3u32.to_ne_bytes().to_vec()), ("text", b"go\xff".to_vec())];
    assert_eq!(json::<crate::state::Text>(&content), "{\"count\":3,\"text\":\"go\u{fffd}\"}");
}

#[test]
fn arrays_without_a_count_are_shown_completely() {
    let content = [("orientation", doubles(&[0.0, 0.0, 0.0, 1.0])), ("goal", 2u64.to_ne_bytes().to_vec())];
    let text = json::<PoseTarget>(&content);
    assert!(text.contains(r#""orientation":[0.0,0.0,0.0,1.0]"#) && text.contains(r#""goal":2"#), "{text}");
}

#[test]
fn excessive_count_is_rejected_first() {
    let layout = JointState::layout();
    let sample = sample(&layout, &[("count", 65u32.to_ne_bytes().to_vec())]);
    let error = Decoder::new(&layout).unwrap().decode(&sample).unwrap_err();
    assert_eq!(error.to_string(), "`count` is 65, expected at most 64, the capacity of `position`");
}

#[test]
fn truncated_sample_is_refused() {
    let decoder = Decoder::new(&PoseTarget::layout()).unwrap();
    let expected = size_of::<PoseTarget>();
    assert_eq!(decoder.decode(&[0; 8]).unwrap_err(), DecodeError::Short { found: 8, expected });
}

fn layout(kind: &str, offset: usize) -> TypeLayout {
    let field = FieldLayout { name: "x".into(), offset, kind: kind.into(), size: 8, count: None };
    TypeLayout { type_name: "test.Made".into(), size: 16, alignment: 8, fields: vec![field] }
}

#[test]
fn unknown_field_type_is_named() {
    for kind in ["f128", "[f64; many]", "[f64 3]", "", "[[f64; 2]; 2]"] {
        let error = Decoder::new(&layout(kind, 0)).unwrap_err();
        assert!(matches!(&error, DecodeError::Kind { kind: found, .. } if found == kind), "{error}");
    }
}

#[test]
fn field_outside_the_sample_is_refused() {
    for (kind, offset) in [("f64", 9), ("[f64; 3]", 0), ("[u8; 18446744073709551615]", 8)] {
        let error = Decoder::new(&layout(kind, offset)).unwrap_err();
        assert!(matches!(error, DecodeError::Outside { size: 16, .. }), "{kind}: {error}");
    }
    assert!(Decoder::new(&layout("[f64; 2]", 0)).is_ok());
}

#[test]
fn numbers_keep_their_width_and_extremes_get_an_exponent() {
    let texts = [0.0, -1.5, 1234.5678901, 1e-7, 2.5e9, f64::NAN].map(|x| Number::from(x).to_string());
    assert_eq!(texts, ["0.000000", "-1.500000", "1234.567890", "1.000e-7", "2.500e9", "NaN"]);
}

#[test]
fn built_in_types_decode_up_to_their_count() {
    for layout in crate::state::built_in() {
        let decoder = Decoder::new(&layout).unwrap_or_else(|error| panic!("{error}"));
        let zeros = vec![0; layout.size];
        for (name, value) in decoder.decode(&zeros).unwrap().0 {
            let field = layout.fields.iter().find(|field| field.name == name).unwrap();
            assert_eq!(value.numbers().is_empty(), field.count.is_some(), "{}.{name}", layout.type_name);
        }
    }
}
