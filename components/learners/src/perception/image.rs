//! Pictures of letters from files: portable grey maps (PGM), text or binary.

use std::path::{Path, PathBuf};

use super::picture::{EXTENT, LINE, PIXELS, Picture};

/// Distance from the centre of a line at which its profile falls to one half, in standard deviations of the
/// profile.
const EDGE: f64 = 1.177;

/// Largest side of an input picture, px.
const LARGEST: usize = 4096;

/// Error of reading a picture of a letter.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The operating system reported an error.
    #[error("{}: {source}", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file has another format or is inconsistent.
    #[error("{}: {problem}, expected a portable grey map (PGM: P2 or P5)", path.display())]
    Format {
        /// Path of the file.
        path: PathBuf,
        /// Description of the defect.
        problem: String,
    },
    /// All pixels of the picture are equal.
    #[error("{}: the picture is blank: all pixels are equal", path.display())]
    Blank {
        /// Path of the file.
        path: PathBuf,
    },
}

impl Picture {
    /// Reads a picture of a letter and normalises it to the size and position of the training letters. Pixels
    /// that differ from the corners count as ink, whether dark on light or light on dark.
    ///
    /// # Errors
    /// [`ImageError`] if the file cannot be read, is not a grey map, or is blank.
    pub fn read(path: &Path) -> Result<Self, ImageError> {
        let bytes = motorium_recordings::read_bounded(path, super::LONGEST)
            .map_err(|source| ImageError::Io { path: path.to_path_buf(), source })?;
        let grey =
            parse(&bytes).map_err(|problem| ImageError::Format { path: path.to_path_buf(), problem })?;
        grey.normalised().ok_or_else(|| ImageError::Blank { path: path.to_path_buf() })
    }

    /// Returns the picture as the bytes of a binary PGM file, with light strokes on a dark background.
    pub fn to_pgm(&self) -> Vec<u8> {
        let mut bytes = format!("P5\n{PIXELS} {PIXELS}\n255\n").into_bytes();
        bytes.extend(self.0.iter().map(|grey| (255.0 * grey.clamp(0.0, 1.0)).round() as u8));
        bytes
    }
}

/// Grey values of a file, row by row from the top, 0 to 1.
struct Grey {
    width: usize,
    values: Vec<f64>,
}

fn parse(bytes: &[u8]) -> Result<Grey, String> {
    let binary = match bytes.get(..2) {
        Some(b"P5") => true,
        Some(b"P2") => false,
        _ => return Err("it begins with neither P2 nor P5".to_owned()),
    };
    let mut at = 2;
    let mut number = || -> Result<usize, String> {
        loop {
            match bytes.get(at) {
                Some(b'#') => at += bytes[at..].iter().take_while(|byte| **byte != b'\n').count(),
                Some(byte) if byte.is_ascii_whitespace() => at += 1,
                _ => break,
            }
        }
        let digits = bytes[at.min(bytes.len())..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        let text = String::from_utf8_lossy(&bytes[at.min(bytes.len())..][..digits]).into_owned();
        at += digits;
        text.parse().map_err(|_| format!("no number at byte {at}"))
    };
    let (width, height, most) = (number()?, number()?, number()?);
    if !(1..=LARGEST).contains(&width) || !(1..=LARGEST).contains(&height) || !(1..=65535).contains(&most) {
        return Err(format!("{width} x {height} pixels of {most} greys"));
    }
    let count = width * height;
    let mut values = Vec::with_capacity(count);
    if binary {
        let size = if most > 255 { 2 } else { 1 };
        let pixels = bytes.get(at + 1..).unwrap_or_default();
        if pixels.len() < count * size {
            return Err(format!("it ends after {} of {} bytes of pixels", pixels.len(), count * size));
        }
        values.extend(pixels.chunks_exact(size).take(count).map(|pixel| {
            f64::from(pixel.iter().fold(0_u32, |value, byte| 256 * value + u32::from(*byte))) / most as f64
        }));
    } else {
        for _ in 0..count {
            values.push(number()? as f64 / most as f64);
        }
    }
    Ok(Grey { width, values })
}

impl Grey {
    /// Returns the ink, 0 to 1, centred in a picture and scaled so that its larger side matches the training
    /// letters.
    fn normalised(&self) -> Option<Picture> {
        let (width, height) = (self.width, self.values.len() / self.width);
        let corners =
            [0, width - 1, (height - 1) * width, height * width - 1].map(|corner| self.values[corner]);
        let paper = corners.iter().sum::<f64>() / 4.0;
        let ink: Vec<f64> = self.values.iter().map(|value| (value - paper).abs()).collect();
        let darkest = ink.iter().copied().fold(0.0, f64::max);
        if darkest < 1e-3 {
            return None;
        }
        // The edge of the ink is at half the darkest grey.
        let inked = |row: usize, column: usize| ink[row * width + column] > 0.5 * darkest;
        let (mut rows, mut columns) = ((usize::MAX, 0), (usize::MAX, 0));
        for row in 0..height {
            for column in (0..width).filter(|column| inked(row, *column)) {
                rows = (rows.0.min(row), rows.1.max(row));
                columns = (columns.0.min(column), columns.1.max(column));
            }
        }
        // An edge is about half a pixel beyond the last inked pixel.
        let side = (rows.1 - rows.0).max(columns.1 - columns.0) as f64 + 1.0;
        let step = side / (EXTENT + 2.0 * EDGE * LINE);
        let middle = [rows, columns].map(|(low, high)| 0.5 * (low + high) as f64);
        // Each pixel is the mean over its area in the file, or interpolated if the file's pixels are larger.
        let fine = (step.ceil() as usize).clamp(1, 32);
        let mut pixels = Vec::with_capacity(PIXELS * PIXELS);
        for row in 0..PIXELS {
            for column in 0..PIXELS {
                let mut sum = 0.0;
                for (a, b) in (0..fine).flat_map(|a| (0..fine).map(move |b| (a, b))) {
                    let part = |k: usize| (k as f64 + 0.5) / fine as f64 - 0.5;
                    let at =
                        |pixel: usize, part: f64| (pixel as f64 + part - 0.5 * (PIXELS - 1) as f64) * step;
                    sum +=
                        between(&ink, width, middle[0] + at(row, part(a)), middle[1] + at(column, part(b)));
                }
                pixels.push((sum / (fine * fine) as f64 / darkest) as f32);
            }
        }
        Some(Picture(pixels))
    }
}

/// Returns the grey interpolated between four pixels; 0 outside.
fn between(ink: &[f64], width: usize, row: f64, column: f64) -> f64 {
    let height = ink.len() / width;
    let at = |row: f64, column: f64| {
        let inside = row >= 0.0 && column >= 0.0 && row < height as f64 && column < width as f64;
        if inside { ink[row as usize * width + column as usize] } else { 0.0 }
    };
    let (r, c) = (row.floor(), column.floor());
    let (y, x) = (row - r, column - c);
    (1.0 - y) * ((1.0 - x) * at(r, c) + x * at(r, c + 1.0))
        + y * ((1.0 - x) * at(r + 1.0, c) + x * at(r + 1.0, c + 1.0))
}
