//! Heights from a greyscale image: a PNG file of 8 or 16 bits.

use std::path::Path;

use motorium_robots::read_bounded;

/// Maximum number of pixels of an image.
const MOST: usize = 1 << 24;

/// Maximum size of an image file, bytes.
const LONGEST: u64 = 256 * 1024 * 1024;

/// The first bytes of every PNG file.
const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// A greyscale image: 0 is black, 1 is white.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Picture {
    /// Pixels along a row, and rows.
    size: [usize; 2],
    /// Grey values row by row, starting at the top.
    grey: Vec<f64>,
}

impl Picture {
    /// Reads a file; the error states what was found and expected.
    pub(crate) fn read(path: &Path) -> Result<Self, String> {
        let bytes = read_bounded(path, LONGEST).map_err(|error| error.to_string())?;
        Self::decode(&bytes)
    }

    fn decode(bytes: &[u8]) -> Result<Self, String> {
        let mut rest = bytes.strip_prefix(SIGNATURE).ok_or("this is not a PNG file")?;
        let (mut header, mut packed) = (None, Vec::new());
        while let Some((head, after)) = rest.split_first_chunk::<8>() {
            let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
            let (data, after) = after.split_at_checked(length).ok_or("the file ends within a chunk")?;
            match &head[4..] {
                b"IHDR" => header = Some(Header::read(data)?),
                b"IDAT" => packed.extend_from_slice(data),
                b"IEND" => break,
                _ => {}
            }
            // a checksum follows the data; the pixels' checksum is checked below
            rest = after.get(4..).ok_or("the file ends within a chunk")?;
        }
        let Header { size, bytes_per_pixel } = header.ok_or("its header (IHDR) is missing")?;
        let stride = size[0] * bytes_per_pixel;
        let room = size[1] * (stride + 1);
        let rows = miniz_oxide::inflate::decompress_to_vec_zlib_with_limit(&packed, room)
            .map_err(|error| format!("its pixels cannot be unpacked: {error}"))?;
        if rows.len() != room {
            return Err(format!("it unpacks to {} bytes of pixels, expected {room}", rows.len()));
        }
        let mut grey = Vec::with_capacity(size[0] * size[1]);
        let (mut above, mut row) = (vec![0; stride], vec![0; stride]);
        for line in rows.chunks_exact(stride + 1) {
            row.copy_from_slice(&line[1..]);
            unfilter(line[0], bytes_per_pixel, &above, &mut row)?;
            grey.extend(row.chunks_exact(bytes_per_pixel).map(|pixel| match *pixel {
                [high, low] => f64::from(u16::from_be_bytes([high, low])) / 65_535.0,
                _ => f64::from(pixel[0]) / 255.0,
            }));
            core::mem::swap(&mut above, &mut row);
        }
        Ok(Self { size, grey })
    }

    /// Pixels along a row, and rows.
    pub(crate) fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Returns the grey value of each pixel, row by row, starting at the top.
    pub(crate) fn grey(&self) -> &[f64] {
        &self.grey
    }

    /// Returns the grey value at a position from 0 (left) to 1 (right) and from 0 (top) to 1 (bottom),
    /// interpolated from the four surrounding pixels. The centres of the outermost pixels are on the edges;
    /// beyond them the value is constant.
    pub(super) fn grey_at(&self, right: f64, down: f64) -> f64 {
        let [width, height] = self.size;
        let part = |share: f64, count: usize| {
            let place = share.clamp(0.0, 1.0) * (count - 1) as f64;
            let first = (place as usize).min(count.saturating_sub(2));
            (first, (first + 1).min(count - 1), place - first as f64)
        };
        let ((left, right, u), (top, bottom, v)) = (part(right, width), part(down, height));
        let pixel = |column: usize, row: usize| self.grey[row * width + column];
        let row = |row: usize| pixel(left, row) * (1.0 - u) + pixel(right, row) * u;
        row(top) * (1.0 - v) + row(bottom) * v
    }
}

struct Header {
    size: [usize; 2],
    bytes_per_pixel: usize,
}

impl Header {
    fn read(data: &[u8]) -> Result<Self, String> {
        let [w0, w1, w2, w3, h0, h1, h2, h3, depth, colour, 0, 0, interlace] = *data else {
            return Err("its header (IHDR) is not valid".to_owned());
        };
        let size = [[w0, w1, w2, w3], [h0, h1, h2, h3]].map(|bytes| u32::from_be_bytes(bytes) as usize);
        if size.contains(&0) || size[0].saturating_mul(size[1]) > MOST {
            return Err(format!("{} x {} pixels, expected 1 to {MOST}", size[0], size[1]));
        }
        let kind = match colour {
            0 => "grey",
            2 => "colours",
            3 => "a palette",
            4 => "grey with transparency",
            _ => "colours with transparency",
        };
        if colour != 0 || !matches!(depth, 8 | 16) || interlace != 0 {
            let order = if interlace == 0 { "" } else { ", interlaced" };
            return Err(format!(
                "{kind} of {depth} bits{order}, expected grey of 8 or 16 bits; \
                 `magick in.png -colorspace gray -depth 16 -interlace none -define png:color-type=0 out.png` makes it"
            ));
        }
        Ok(Self { size, bytes_per_pixel: usize::from(depth / 8) })
    }
}

/// Reverts the filter of a row, whose bytes are stored as differences from their neighbours.
fn unfilter(filter: u8, width: usize, above: &[u8], row: &mut [u8]) -> Result<(), String> {
    for (index, b) in above.iter().copied().enumerate() {
        let before = index.checked_sub(width);
        let a = before.map_or(0, |at| row[at]);
        let c = before.map_or(0, |at| above[at]);
        let guess = match filter {
            0 => 0,
            1 => a,
            2 => b,
            3 => ((u16::from(a) + u16::from(b)) / 2) as u8,
            4 => paeth(a, b, c),
            _ => return Err(format!("a row has the filter {filter}, expected 0 to 4")),
        };
        row[index] = row[index].wrapping_add(guess);
    }
    Ok(())
}

/// Paeth predictor: returns the value among left, above and corner that is nearest to left plus above minus
/// corner.
fn paeth(a: u8, b: u8, c: u8) -> u8 {
    let guess = i16::from(a) + i16::from(b) - i16::from(c);
    let [to_a, to_b, to_c] = [a, b, c].map(|value| (guess - i16::from(value)).abs());
    if to_a <= to_b && to_a <= to_c {
        a
    } else if to_b <= to_c {
        b
    } else {
        c
    }
}
