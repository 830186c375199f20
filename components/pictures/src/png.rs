//! PNG files of 8-bit colours. <https://www.w3.org/TR/png-3/>

use miniz_oxide::deflate::compress_to_vec_zlib;

/// Compression level, from 0 to 10: the lowest level that compresses flat areas and gentle slopes well.
const LEVEL: u8 = 4;

/// First bytes of every file.
pub(crate) const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Encodes row-major RGB pixels as a PNG file.
///
/// ```
/// let red_and_blue = [255, 0, 0, 0, 0, 255];
/// let file = motorium_pictures::png::encode(2, 1, &red_and_blue);
/// assert!(file.starts_with(b"\x89PNG\r\n\x1a\n"));
/// ```
pub fn encode(width: usize, height: usize, pixels: &[u8]) -> Vec<u8> {
    let mut file = SIGNATURE.to_vec();
    let size = |value: usize| (value as u32).to_be_bytes();
    // 8 bits per channel, RGB, and the only methods defined by the standard.
    let head = [&size(width)[..], &size(height), &[8, 2, 0, 0, 0]].concat();
    chunk(b"IHDR", &head, &mut file);
    chunk(b"IDAT", &compress_to_vec_zlib(&filtered(3 * width, pixels), LEVEL), &mut file);
    chunk(b"IEND", &[], &mut file);
    file
}

/// Returns a PNG file with an added text under an ASCII keyword. Returns `None` if the bytes are not a PNG
/// file.
///
/// ```
/// use motorium_pictures::png::{encode, text, with_text};
///
/// let file = with_text(&encode(1, 1, &[0; 3]), "page", "3f2a").unwrap();
/// assert_eq!(text(&file, "page").as_deref(), Some("3f2a"));
/// assert_eq!(text(&file, "author"), None);
/// ```
pub fn with_text(file: &[u8], keyword: &str, text: &str) -> Option<Vec<u8>> {
    let (end, _) = chunks(file)?.into_iter().find(|(at, _)| &file[at + 4..at + 8] == b"IEND")?;
    let mut longer = file[..end].to_vec();
    chunk(b"tEXt", &[keyword.as_bytes(), &[0], text.as_bytes()].concat(), &mut longer);
    longer.extend(&file[end..]);
    Some(longer)
}

/// Returns the text with this keyword in a PNG file, or `None` if there is no such text.
pub fn text(file: &[u8], keyword: &str) -> Option<String> {
    chunks(file)?.into_iter().find_map(|(at, data)| {
        let found = data.strip_prefix(keyword.as_bytes())?.strip_prefix(&[0])?;
        (&file[at + 4..at + 8] == b"tEXt").then(|| String::from_utf8_lossy(found).into_owned())
    })
}

/// Offsets and data of the chunks of a complete file.
pub(crate) fn chunks(file: &[u8]) -> Option<Vec<(usize, &[u8])>> {
    let (mut at, mut found) = (SIGNATURE.len(), Vec::new());
    if !file.starts_with(SIGNATURE) {
        return None;
    }
    while at < file.len() {
        let length = u32::from_be_bytes(file.get(at..at + 4)?.try_into().ok()?) as usize;
        let end = (at + 8).checked_add(length)?;
        found.push((at, file.get(at + 8..end)?));
        at = end + 4;
    }
    let (last, _) = found.last()?;
    (&file[last + 4..last + 8] == b"IEND" && at == file.len()).then_some(found)
}

pub(crate) fn chunk(kind: &[u8; 4], data: &[u8], file: &mut Vec<u8>) {
    file.extend((data.len() as u32).to_be_bytes());
    let from = file.len();
    file.extend(kind);
    file.extend(data);
    let sum = crc32fast::hash(&file[from..]);
    file.extend(sum.to_be_bytes());
}

/// Filters each row with the filter that has the smallest residual, and prepends the filter's number.
fn filtered(bytes_per_row: usize, pixels: &[u8]) -> Vec<u8> {
    let bytes_per_row = bytes_per_row.max(1);
    let mut above = vec![0; bytes_per_row];
    let mut candidates = [const { Vec::new() }; 3];
    let mut rows = Vec::with_capacity(pixels.len() + pixels.len() / bytes_per_row);
    for row in pixels.chunks_exact(bytes_per_row) {
        for (filter, candidate) in FILTERS.iter().zip(&mut candidates) {
            candidate.clear();
            candidate.push(filter.number);
            candidate.extend((0..bytes_per_row).map(|at| {
                let (left, corner) = if at < 3 { (0, 0) } else { (row[at - 3], above[at - 3]) };
                row[at].wrapping_sub((filter.expected)(left, above[at], corner))
            }));
        }
        // Heuristic recommended by the standard: the sum of the differences as signed numbers.
        let left =
            |row: &&Vec<u8>| row.iter().map(|byte| u64::from((*byte as i8).unsigned_abs())).sum::<u64>();
        rows.extend(candidates.iter().min_by_key(left).into_iter().flatten());
        above.copy_from_slice(row);
    }
    rows
}

/// A filter of the standard: its number, and the predicted byte from the bytes to the left, above and above
/// left.
struct Filter {
    number: u8,
    expected: fn(u8, u8, u8) -> u8,
}

const FILTERS: [Filter; 3] = [
    Filter { number: 2, expected: |_, above, _| above },
    Filter { number: 1, expected: |left, _, _| left },
    Filter { number: 4, expected: paeth },
];

/// Paeth predictor: the neighbour nearest to left + above - corner.
fn paeth(left: u8, above: u8, corner: u8) -> u8 {
    let [a, b, c] = [left, above, corner].map(i16::from);
    let distance = |neighbour: i16| (a + b - c - neighbour).abs();
    if distance(a) <= distance(b) && distance(a) <= distance(c) {
        left
    } else if distance(b) <= distance(c) {
        above
    } else {
        corner
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn truncated_or_foreign_file_has_no_text() {
        let file = with_text(&encode(1, 1, &[0; 3]), "page", "3f2a").unwrap();
        for length in 0..file.len() {
            assert_eq!(text(&file[..length], "page"), None, "{length} of {} bytes", file.len());
        }
        assert_eq!(with_text(b"GIF89a", "page", "3f2a"), None);
    }

    /// Decodes a file according to the standard.
    fn pixels(file: &[u8], bytes_per_row: usize) -> Vec<u8> {
        let (mut at, mut data) = (8, Vec::new());
        while at < file.len() {
            let length = u32::from_be_bytes(file[at..at + 4].try_into().unwrap()) as usize;
            if &file[at + 4..at + 8] == b"IDAT" {
                data.extend(&file[at + 8..at + 8 + length]);
            }
            at += 12 + length;
        }
        let rows = miniz_oxide::inflate::decompress_to_vec_zlib(&data).expect("a stream of zlib");
        let mut pixels: Vec<u8> = Vec::new();
        for row in rows.chunks(bytes_per_row + 1) {
            let from = pixels.len();
            for (at, byte) in row[1..].iter().enumerate() {
                let before = |back: usize| (from + at).checked_sub(back).map_or(0, |start| pixels[start]);
                let left = if at < 3 { 0 } else { pixels[from + at - 3] };
                let corner = if at < 3 { 0 } else { before(bytes_per_row + 3) };
                let expected = match row[0] {
                    1 => left,
                    2 => before(bytes_per_row),
                    4 => paeth(left, before(bytes_per_row), corner),
                    other => panic!("filter {other}"),
                };
                pixels.push(byte.wrapping_add(expected));
            }
        }
        pixels
    }

    #[test]
    fn image_survives_encoding_and_flat_areas_compress() {
        let (width, height) = (64, 48);
        let slope = |x: usize, y: usize| [2 * x + y, x + 3 * y, 7].map(|value| value as u8);
        let noise = |x: usize, y: usize| {
            let mixed = (x * 7919 + y * 104_729).wrapping_mul(2_654_435_761);
            [mixed >> 8, mixed >> 13, mixed >> 21].map(|value| value as u8)
        };
        for (of, most) in [(slope as fn(usize, usize) -> [u8; 3], 700), (noise, 10_000)] {
            let picture: Vec<u8> = (0..height).flat_map(|y| (0..width).flat_map(move |x| of(x, y))).collect();
            let file = encode(width, height, &picture);
            assert_eq!(pixels(&file, 3 * width), picture);
            assert!(file.len() < most, "{} bytes", file.len());
        }
    }

    #[test]
    fn end_chunk_has_the_standard_checksum() {
        assert!(encode(1, 1, &[1, 2, 3]).ends_with(b"\0\0\0\0IEND\xae\x42\x60\x82"));
    }

    #[test]
    fn paeth_matches_the_standard() {
        // Section 9.4 of the standard: the initial estimate is a + b - c; ties prefer left, then above.
        for ((a, b, c), expected) in [
            ((10, 20, 15), 15),
            ((10, 20, 10), 20),
            ((10, 20, 20), 10),
            ((3, 3, 200), 3),
            ((200, 3, 100), 100),
        ] {
            assert_eq!(paeth(a, b, c), expected, "{a} {b} {c}");
        }
    }
}
