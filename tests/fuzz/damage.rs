//! Damages of an input: typical file damage, and changes that are most likely to find a bug in a reader.

use proptest::prelude::*;

/// Numbers at the limits of readers, and texts that are not numbers.
const EXTREMES: [&str; 24] = [
    "0",
    "-0.0",
    "-1",
    "1e308",
    "-1e308",
    "1e-320",
    "1e15",
    "nan",
    "inf",
    "255",
    "65536",
    "2147483648",
    "4294967295",
    "9007199254740993",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551615",
    "99999999999999999999999",
    "0x7f",
    "1_0",
    "1e",
    "\"\"",
    "[]",
    "",
];

/// One damage. Positions are fractions of the input, so they remain valid after earlier damages.
#[derive(Debug, Clone)]
pub(crate) enum Damage {
    /// Flips bits of a byte.
    Flip { at: prop::sample::Index, bits: u8 },
    /// Inserts a byte.
    Insert { at: prop::sample::Index, byte: u8 },
    /// Removes a part.
    Cut { at: prop::sample::Index, length: usize },
    /// Removes the end.
    Truncate { at: prop::sample::Index },
    /// Repeats a part.
    Repeat { at: prop::sample::Index, length: usize, times: usize },
    /// Inserts a part of another input.
    Splice { at: prop::sample::Index, from: prop::sample::Index, start: prop::sample::Index, length: usize },
    /// Replaces a number in the text by an extreme value.
    Number { which: prop::sample::Index, extreme: usize },
    /// Replaces eight bytes by an extreme value.
    Word { at: prop::sample::Index, value: u64 },
}

pub(crate) fn damage() -> impl Strategy<Value = Damage> {
    let at = any::<prop::sample::Index>;
    let words = prop_oneof![
        any::<u64>(),
        Just(0),
        Just(u64::MAX),
        Just(1 << 63),
        Just(u64::from(u32::MAX)),
        Just(f64::NAN.to_bits()),
        Just(f64::INFINITY.to_bits()),
        Just(1e308_f64.to_bits()),
    ];
    prop_oneof![
        3 => (at(), 1..=255_u8).prop_map(|(at, bits)| Damage::Flip { at, bits }),
        2 => (at(), any::<u8>()).prop_map(|(at, byte)| Damage::Insert { at, byte }),
        2 => (at(), 1..200_usize).prop_map(|(at, length)| Damage::Cut { at, length }),
        1 => at().prop_map(|at| Damage::Truncate { at }),
        1 => (at(), 1..100_usize, 1..50_usize)
            .prop_map(|(at, length, times)| Damage::Repeat { at, length, times }),
        2 => (at(), at(), at(), 1..400_usize)
            .prop_map(|(at, from, start, length)| Damage::Splice { at, from, start, length }),
        6 => (at(), 0..EXTREMES.len()).prop_map(|(which, extreme)| Damage::Number { which, extreme }),
        1 => (at(), words).prop_map(|(at, value)| Damage::Word { at, value }),
    ]
}

impl Damage {
    /// Applies the damage to an input; `corpus` contains the others.
    pub(crate) fn apply(&self, bytes: &mut Vec<u8>, corpus: &[Vec<u8>]) {
        let place = |at: &prop::sample::Index, bytes: &[u8]| at.index(bytes.len() + 1);
        match self {
            Self::Flip { at, bits } => {
                if !bytes.is_empty() {
                    let at = at.index(bytes.len());
                    bytes[at] ^= bits;
                }
            }
            Self::Insert { at, byte } => bytes.insert(place(at, bytes), *byte),
            Self::Cut { at, length } => {
                let start = place(at, bytes);
                bytes.drain(start..(start + length).min(bytes.len()));
            }
            Self::Truncate { at } => bytes.truncate(place(at, bytes)),
            Self::Repeat { at, length, times } => {
                let start = place(at, bytes);
                let part = bytes[start..(start + length).min(bytes.len())].repeat(*times);
                bytes.splice(start..start, part);
            }
            Self::Splice { at, from, start, length } => {
                let other = &corpus[from.index(corpus.len())];
                let start = place(start, other);
                let part = other[start..(start + length).min(other.len())].to_vec();
                let at = place(at, bytes);
                bytes.splice(at..at, part);
            }
            Self::Number { which, extreme } => {
                let numbers = numbers(bytes);
                if !numbers.is_empty() {
                    bytes.splice(numbers[which.index(numbers.len())].clone(), EXTREMES[*extreme].bytes());
                }
            }
            Self::Word { at, value } => {
                if let Some(last) = bytes.len().checked_sub(8) {
                    let at = at.index(last + 1);
                    bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
                }
            }
        }
    }
}

/// Returns the positions of the numbers in a text.
fn numbers(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let mut found: Vec<std::ops::Range<usize>> = Vec::new();
    for (at, byte) in bytes.iter().enumerate() {
        let goes_on = found.last().is_some_and(|last| last.end == at);
        let begins = byte.is_ascii_digit() || (matches!(byte, b'-' | b'.') && !goes_on);
        match found.last_mut() {
            Some(last)
                if goes_on && (byte.is_ascii_digit() || matches!(byte, b'.' | b'e' | b'E' | b'-' | b'+')) =>
            {
                last.end = at + 1;
            }
            _ if begins => found.push(at..at + 1),
            _ => {}
        }
    }
    found.retain(|range| bytes[range.clone()].iter().any(u8::is_ascii_digit));
    found
}

#[test]
fn numbers_of_a_text_are_found_whole() {
    let text = b"a = [-1.5e-3, 20]\nname = \"x-y\" # 7.";
    let found: Vec<&str> =
        numbers(text).into_iter().map(|range| std::str::from_utf8(&text[range]).unwrap()).collect();
    assert_eq!(found, ["-1.5e-3", "20", "7."]);
}
