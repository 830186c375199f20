//! PNG encoder for images and animations with at most 255 colours. <https://www.w3.org/TR/png-3/>

use miniz_oxide::deflate::compress_to_vec_zlib;

use crate::png::{SIGNATURE, chunk};

/// Compression level from 0 to 10. The slowest level is used, because a file is written once.
const LEVEL: u8 = 10;
/// Number of colours in a file. Index 0 is transparent: the pixel of the previous frame remains visible.
const COLOURS: usize = 255;
/// Bits per channel in the colour histogram.
const BITS: u32 = 6;

/// Encodes row-major RGB images of `width` x `height` pixels as one PNG file. Several images become an
/// endlessly looping animation that shows each frame for `delay_ms`. Each colour is replaced by the nearest
/// of 255 palette colours.
///
/// ```
/// let (red, blue) = ([255, 0, 0], [0, 0, 255]);
/// let file = motorium_pictures::animation::encode(1, 1, 40, &[red.to_vec(), blue.to_vec()]);
/// assert_eq!(motorium_pictures::animation::frames(&file), Some(2));
/// ```
///
/// # Panics
///
/// Panics if the images differ in size, or if `pictures` is empty.
pub fn encode(width: usize, height: usize, delay_ms: u16, pictures: &[Vec<u8>]) -> Vec<u8> {
    assert!(!pictures.is_empty() && pictures.iter().all(|picture| picture.len() == 3 * width * height));
    let palette = Palette::new(pictures);
    let mut file = SIGNATURE.to_vec();
    let size = |value: usize| (value as u32).to_be_bytes();
    // 8 bits per pixel, palette indices, and the only methods defined by the standard.
    chunk(b"IHDR", &[&size(width)[..], &size(height), &[8, 3, 0, 0, 0]].concat(), &mut file);
    if pictures.len() > 1 {
        // 0 plays: loops endlessly.
        chunk(b"acTL", &[size(pictures.len()), size(0)].concat(), &mut file);
    }
    chunk(b"PLTE", &palette.colours.concat(), &mut file);
    chunk(b"tRNS", &[0], &mut file);
    let mut before: Vec<u8> = Vec::new();
    let mut number = 0;
    for picture in pictures {
        let indices = palette.indices(picture);
        let [left, top, right, bottom] = changed(&before, &indices, width);
        if pictures.len() > 1 {
            let place = [number, right - left, bottom - top, left, top].map(size).concat();
            let delay = [delay_ms, 1000].map(u16::to_be_bytes).concat();
            // The frame is kept, and the next one is blended over it.
            chunk(b"fcTL", &[&place[..], &delay, &[0, 1]].concat(), &mut file);
            number += 1;
        }
        let mut rows = Vec::with_capacity((right - left + 1) * (bottom - top));
        for row in top..bottom {
            rows.push(0);
            rows.extend((left..right).map(|column| {
                let at = row * width + column;
                if before.get(at) == Some(&indices[at]) { 0 } else { indices[at] }
            }));
        }
        let data = compress_to_vec_zlib(&rows, LEVEL);
        if before.is_empty() {
            chunk(b"IDAT", &data, &mut file);
        } else {
            chunk(b"fdAT", &[&size(number)[..], &data].concat(), &mut file);
            number += 1;
        }
        before = indices;
    }
    chunk(b"IEND", &[], &mut file);
    file
}

/// Returns the number of frames in a PNG file; `None` if the bytes are not a PNG file.
pub fn frames(file: &[u8]) -> Option<usize> {
    let chunks = crate::png::chunks(file)?;
    let control = chunks.iter().find(|(at, _)| &file[at + 4..at + 8] == b"acTL");
    let Some((_, data)) = control else { return Some(1) };
    Some(u32::from_be_bytes(data.get(..4)?.try_into().ok()?) as usize)
}

/// Bounding rectangle (left, top, right, bottom) of the pixels that differ; a single pixel if all are equal.
fn changed(before: &[u8], now: &[u8], width: usize) -> [usize; 4] {
    let height = now.len() / width.max(1);
    if before.is_empty() {
        return [0, 0, width, height];
    }
    let mut found = [width, height, 0, 0];
    for (at, _) in before.iter().zip(now).enumerate().filter(|(_, (one, other))| one != other) {
        let (column, row) = (at % width, at / width);
        found = [found[0].min(column), found[1].min(row), found[2].max(column + 1), found[3].max(row + 1)];
    }
    if found[0] < found[2] { found } else { [0, 0, 1, 1] }
}

/// Palette of a file, and the index of the nearest palette colour for each colour of the images.
struct Palette {
    colours: Vec<[u8; 3]>,
    nearest: Vec<u8>,
}

/// Pixels whose colours share their upper bits.
#[derive(Clone, Copy, Default)]
struct Bin {
    bin: usize,
    count: f64,
    sum: [f64; 3],
}

impl Bin {
    fn mean(&self, channel: usize) -> f64 {
        self.sum[channel] / self.count
    }
}

/// Bin of a colour.
fn bin(pixel: &[u8]) -> usize {
    pixel.iter().fold(0, |bin, channel| bin << BITS | usize::from(channel >> (8 - BITS)))
}

impl Palette {
    /// Splits the colours of the images into boxes: the box with the largest error is split first, at its
    /// mean (median cut: Heckbert, "Color Image Quantization for Frame Buffer Display", SIGGRAPH 1982).
    fn new(pictures: &[Vec<u8>]) -> Self {
        let mut bins = vec![Bin::default(); 1 << (3 * BITS)];
        for pixel in pictures.iter().flat_map(|picture| picture.chunks_exact(3)) {
            let found = &mut bins[bin(pixel)];
            found.count += 1.0;
            found.sum.iter_mut().zip(pixel).for_each(|(sum, channel)| *sum += f64::from(*channel));
        }
        let used = bins.iter().enumerate().filter(|(_, found)| found.count > 0.0);
        let mut boxes = vec![used.map(|(bin, found)| Bin { bin, ..*found }).collect::<Vec<_>>()];
        let mut errors = vec![error(&boxes[0])];
        while boxes.len() < COLOURS {
            let worst = (0..boxes.len()).max_by(|a, b| errors[*a].0.total_cmp(&errors[*b].0)).unwrap_or(0);
            let (largest, channel, middle) = errors[worst];
            if largest <= 0.0 {
                break;
            }
            let whole = core::mem::take(&mut boxes[worst]);
            let (low, high): (Vec<_>, Vec<_>) =
                whole.into_iter().partition(|bin| bin.mean(channel) <= middle);
            (errors[worst], boxes[worst]) = (error(&low), low);
            errors.push(error(&high));
            boxes.push(high);
        }
        let mut nearest = vec![0; bins.len()];
        // The colour of index 0 is not visible.
        let mut colours = vec![[0; 3]];
        for of_box in &boxes {
            for bin in of_box {
                nearest[bin.bin] = colours.len() as u8;
            }
            let count: f64 = of_box.iter().map(|bin| bin.count).sum();
            let mean = |channel: usize| of_box.iter().map(|bin| bin.sum[channel]).sum::<f64>() / count;
            colours.push([0, 1, 2].map(|channel| mean(channel).round() as u8));
        }
        Self { colours, nearest }
    }

    fn indices(&self, picture: &[u8]) -> Vec<u8> {
        picture.chunks_exact(3).map(|pixel| self.nearest[bin(pixel)]).collect()
    }
}

/// Largest squared error over the channels of a box when its pixels are replaced by the box mean, with the
/// channel and its mean.
fn error(bins: &[Bin]) -> (f64, usize, f64) {
    let count: f64 = bins.iter().map(|bin| bin.count).sum();
    let of = |channel: usize| {
        let mean = bins.iter().map(|bin| bin.sum[channel]).sum::<f64>() / count;
        let square = |bin: &Bin| bin.count * (bin.mean(channel) - mean).powi(2);
        (bins.iter().map(square).sum::<f64>(), channel, mean)
    };
    let errors = [0, 1, 2].map(of);
    let whole = if bins.len() > 1 { 1.0 } else { 0.0 };
    let (largest, channel, mean) = errors.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default();
    (whole * largest, channel, mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::png::chunks;

    /// Plays a file according to the standard: returns the composited frames as palette indices.
    fn played(file: &[u8], width: usize, height: usize) -> Vec<Vec<[u8; 3]>> {
        let chunks = chunks(file).unwrap();
        let kind = |at: usize| &file[at + 4..at + 8];
        let palette = chunks.iter().find(|(at, _)| kind(*at) == b"PLTE").unwrap().1;
        let number =
            |data: &[u8], at: usize| u32::from_be_bytes(data[at..at + 4].try_into().unwrap()) as usize;
        let (mut canvas, mut place, mut shown) = (vec![[0; 3]; width * height], [0; 4], Vec::new());
        for (at, data) in &chunks {
            let data = match kind(*at) {
                b"fcTL" => {
                    assert_eq!(&data[24..26], [0, 1], "stays, and is laid over");
                    place = [4, 8, 12, 16].map(|at| number(data, at));
                    continue;
                }
                b"IDAT" => data,
                b"fdAT" => &data[4..],
                _ => continue,
            };
            let [wide, high, left, top] = place;
            let rows = miniz_oxide::inflate::decompress_to_vec_zlib(data).unwrap();
            assert_eq!(rows.len(), (wide + 1) * high);
            for (row, indices) in rows.chunks(wide + 1).enumerate() {
                for (column, index) in indices[1..].iter().enumerate().filter(|(_, index)| **index > 0) {
                    let colour = &palette[3 * usize::from(*index)..][..3];
                    canvas[(top + row) * width + left + column] = colour.try_into().unwrap();
                }
            }
            shown.push(canvas.clone());
        }
        shown
    }

    #[test]
    fn animation_plays_its_pictures() {
        let (width, height) = (12, 9);
        let picture = |time: usize| -> Vec<u8> {
            let colour = |at: usize| match (at % width, at / width) {
                (x, y) if x == time && y == 4 => [250, 10, 20],
                (x, _) => [20 * x as u8, 40, 90],
            };
            (0..width * height).flat_map(colour).collect()
        };
        let pictures: Vec<Vec<u8>> = [0, 1, 1, 5].map(picture).to_vec();
        let file = encode(width, height, 40, &pictures);
        assert_eq!(frames(&file), Some(4));
        let shown = played(&file, width, height);
        for (shown, picture) in shown.iter().zip(&pictures) {
            assert_eq!(&shown.concat(), picture);
        }
        assert_eq!(shown.len(), 4);
    }

    #[test]
    fn many_colours_are_replaced_by_near_ones() {
        let (width, height) = (64, 64);
        let slope = |at: usize| [4 * (at % 64), 4 * (at / 64), 2 * (at % 64)].map(|value| value as u8);
        let picture: Vec<u8> = (0..width * height).flat_map(slope).collect();
        let still = encode(width, height, 40, std::slice::from_ref(&picture));
        assert_eq!(frames(&still), Some(1));
        let file = encode(width, height, 40, &[picture.clone(), picture.clone()]);
        let shown = played(&file, width, height)[1].concat();
        let most = shown.iter().zip(&picture).map(|(one, other)| one.abs_diff(*other)).max();
        assert!(most <= Some(20), "{most:?}");
    }
}
