//! Images of a dataset: the latest image of each camera at each frame, as PNG files within the table.

use std::sync::Arc;

use foxglove::messages::RawImage;
use motorium_pictures::png;
use serde_json::{Value, json};

use super::super::Recording;
use super::dataset::Camera;
use super::error::DatasetError;
use super::stats::QUANTILES;
use crate::parquet::{Column, Values};

/// Encoding of depths in metres.
const DEPTH: &str = "32FC1";

/// Returns the cameras whose images a dataset can store (8 bits per colour), and the image topics that a
/// dataset cannot store, such as depth images.
pub fn usual_cameras(recording: &Recording) -> (Vec<Camera>, Vec<String>) {
    let mut is_depth = vec![None; recording.pictures().len()];
    for picture in recording.images() {
        if is_depth[picture.pictures].is_none() {
            is_depth[picture.pictures] = picture.image().map(|image| image.encoding == DEPTH);
        }
        if is_depth.iter().all(Option::is_some) {
            break;
        }
    }
    let (mut cameras, mut depths) = (Vec::new(), Vec::new());
    for (pictures, is_depth) in recording.pictures().iter().zip(is_depth) {
        match is_depth {
            Some(false) => cameras.push(Camera::of_topic(&pictures.topic)),
            Some(true) => depths.push(pictures.topic.clone()),
            None => {}
        }
    }
    (cameras, depths)
}

/// Images of one camera.
#[derive(Debug)]
pub(super) struct Pictures {
    camera: Camera,
    /// Index among the images of the recording.
    index: usize,
    /// Times of the images, ns, ascending.
    times: Vec<u64>,
    size: (usize, usize),
    /// PNG file of each frame.
    files: Vec<Arc<[u8]>>,
    /// Brightness histogram of each episode.
    brightness: Vec<Brightness>,
}

/// Histogram of brightness for red, green and blue.
type Brightness = [[u64; 256]; 3];

impl Pictures {
    /// Finds the cameras of a dataset, and reads the times of their images.
    pub(super) fn from_recording(
        recording: &Recording,
        cameras: &[Camera],
    ) -> Result<Vec<Self>, DatasetError> {
        let mut all = Vec::new();
        for camera in cameras {
            let known = || recording.pictures().iter().map(|pictures| pictures.topic.as_str());
            let index = known().position(|topic| topic == camera.topic).ok_or_else(|| {
                let advice = motorium::nearest::suggest(&camera.topic, known(), "its cameras are");
                DatasetError::NoPictures { topic: camera.topic.clone(), advice }
            })?;
            all.push(Self {
                camera: camera.clone(),
                index,
                times: Vec::new(),
                size: (0, 0),
                files: Vec::new(),
                brightness: Vec::new(),
            });
        }
        if all.is_empty() {
            return Ok(all);
        }
        for picture in recording.images() {
            for pictures in all.iter_mut().filter(|pictures| pictures.index == picture.pictures) {
                pictures.times.push(picture.time_ns);
            }
        }
        Ok(all)
    }

    /// Time of the first image at or after `time_ns`.
    pub(super) fn first_from(&self, time_ns: u64) -> Option<u64> {
        self.times.get(self.times.partition_point(|time| *time < time_ns)).copied()
    }

    /// Reads and encodes the latest image at each of these ascending times. `lengths` contains the number of
    /// frames of each episode.
    pub(super) fn read(
        &mut self,
        recording: &Recording,
        frames_ns: &[u64],
        lengths: &[usize],
    ) -> Result<(), DatasetError> {
        self.brightness = vec![[[0; 256]; 3]; lengths.len()];
        let newest = |time_ns: &u64| self.times.partition_point(|time| time <= time_ns).checked_sub(1);
        let wanted: Vec<usize> = frames_ns.iter().filter_map(newest).collect();
        let of_camera = recording.images().filter(|picture| picture.pictures == self.index);
        for (number, picture) in of_camera.enumerate() {
            let frames = wanted.partition_point(|it| *it <= number) - self.files.len();
            if frames == 0 {
                continue;
            }
            let time_s =
                picture.time_ns.saturating_sub(recording.times().map_or(0, |(first, _)| first)) as f64 * 1e-9;
            let wrong =
                |found: String| DatasetError::Picture { topic: self.camera.topic.clone(), time_s, found };
            let image = picture.image().ok_or_else(|| wrong("is damaged".to_string()))?;
            let pixels = colours(&image).map_err(wrong)?;
            let size = (image.width as usize, image.height as usize);
            if self.files.is_empty() {
                self.size = size;
            } else if self.size != size {
                let (width, height) = self.size;
                let found =
                    format!("has {} x {} pixels, expected {width} x {height} as before", size.0, size.1);
                return Err(wrong(found));
            }
            let mut of_picture: Brightness = [[0; 256]; 3];
            for pixel in pixels.as_chunks::<3>().0 {
                for (brightness, part) in of_picture.iter_mut().zip(pixel) {
                    brightness[usize::from(*part)] += 1;
                }
            }
            let (shown, mut end) = (self.files.len()..self.files.len() + frames, 0);
            for (brightness, length) in self.brightness.iter_mut().zip(lengths) {
                let first = end;
                end += length;
                let times = end.min(shown.end).saturating_sub(first.max(shown.start));
                if times > 0 {
                    add(brightness, &of_picture, times as u64);
                }
            }
            let file: Arc<[u8]> = png::encode(size.0, size.1, &pixels).into();
            self.files.extend(std::iter::repeat_n(file, frames));
        }
        Ok(())
    }

    /// Name of the feature.
    pub(super) fn feature(&self) -> String {
        format!("observation.images.{}", self.camera.name)
    }

    /// Column with the file of each frame, and its name.
    pub(super) fn column(&self) -> Column {
        let names = (0..self.files.len()).map(|frame| format!("frame-{frame:06}.png")).collect();
        let file = Column { name: "bytes".to_string(), values: Values::Bytes(self.files.clone()) };
        let name = Column { name: "path".to_string(), values: Values::Text(names) };
        Column { name: self.feature(), values: Values::Group(vec![file, name]) }
    }

    /// Entry of `info.json`.
    pub(super) fn info(&self) -> Value {
        let (width, height) = self.size;
        json!({ "dtype": "image", "shape": [height, width, 3], "names": ["height", "width", "channels"] })
    }

    /// Entry of `stats.json`: statistics of each colour channel over all pixels of all frames, as fractions
    /// of full brightness, nested in lists as LeRobot expects.
    pub(super) fn stats(&self) -> Value {
        let mut all: Brightness = [[0; 256]; 3];
        self.brightness.iter().for_each(|of_episode| add(&mut all, of_episode, 1));
        let of_colours = |parts: [f64; 3]| json!(parts.map(|part| [[part]]));
        let named = named(&all).into_iter().map(|(name, parts)| (name.to_string(), of_colours(parts)));
        named.chain([("count".to_string(), json!([self.files.len()]))]).collect()
    }

    /// Returns the statistics of each episode, in one column per statistic.
    pub(super) fn stats_of_episodes(&self, lengths: &[usize]) -> Vec<Column> {
        let list = |length: usize, entries: Values| {
            let lists = entries.len() / length.max(1);
            Values::List { lengths: vec![length; lists], entries: Box::new(entries) }
        };
        let of: Vec<_> = self.brightness.iter().map(named).collect();
        let names = of.first().into_iter().flatten().map(|(name, _)| *name);
        let mut made: Vec<_> = names
            .enumerate()
            .map(|(place, name)| {
                let parts = of.iter().flat_map(|named| named[place].1).collect();
                (name, list(3, list(1, list(1, Values::Double(parts)))))
            })
            .collect();
        made.push(("count", list(1, Values::Int64(lengths.iter().map(|length| *length as i64).collect()))));
        let named = |(name, values)| Column { name: format!("stats/{}/{name}", self.feature()), values };
        made.into_iter().map(named).collect()
    }
}

/// Adds a histogram `times` times.
fn add(to: &mut Brightness, pixels: &Brightness, times: u64) {
    for (sum, count) in to.as_flattened_mut().iter_mut().zip(pixels.as_flattened()) {
        *sum += count * times;
    }
}

/// Statistics by name, for red, green and blue, as fractions of full brightness.
fn named(brightness: &Brightness) -> Vec<(&'static str, [f64; 3])> {
    let each = |of: &dyn Fn(&[u64]) -> f64| brightness.each_ref().map(|counts| of(counts) / 255.0);
    let mut named = vec![
        ("min", each(&|counts| ranked(counts, 0.0))),
        ("max", each(&|counts| ranked(counts, 1.0))),
        ("mean", each(&mean)),
        ("std", each(&deviation)),
    ];
    named.extend(QUANTILES.map(|(name, part)| (name, each(&|counts| ranked(counts, part)))));
    named
}

/// Returns the pixels of an image as contiguous RGB, or the reason why it is invalid.
fn colours(image: &RawImage) -> Result<Vec<u8>, String> {
    let places: &[usize] = match image.encoding.as_str() {
        "rgb8" => &[0, 1, 2],
        "bgr8" => &[2, 1, 0],
        "mono8" => &[0, 0, 0],
        DEPTH => {
            return Err("contains depths in metres, but a dataset requires 8 bits per colour; \
                        select other cameras with `--pictures`"
                .to_string());
        }
        other => return Err(format!("has the encoding {other}, expected rgb8, bgr8 or mono8")),
    };
    let bytes = places.iter().max().map_or(1, |last| last + 1);
    let (width, height, step) = (image.width as usize, image.height as usize, image.step as usize);
    if step < width * bytes || image.data.len() < step * height {
        return Err(format!(
            "has {} bytes, which are too few for {width} x {height} pixels",
            image.data.len()
        ));
    }
    let rows = image.data.chunks_exact(step.max(1)).take(height);
    let pixels = rows.flat_map(|row| row[..width * bytes].chunks_exact(bytes));
    Ok(pixels.flat_map(|pixel| places.iter().map(|place| pixel[*place])).collect())
}

fn total(counts: &[u64]) -> f64 {
    counts.iter().sum::<u64>().max(1) as f64
}

fn mean(counts: &[u64]) -> f64 {
    counts.iter().enumerate().map(|(value, count)| value as f64 * *count as f64).sum::<f64>() / total(counts)
}

/// Population standard deviation (`ddof = 0`).
fn deviation(counts: &[u64]) -> f64 {
    let mean = mean(counts);
    let squares =
        counts.iter().enumerate().map(|(value, count)| (value as f64 - mean).powi(2) * *count as f64);
    (squares.sum::<f64>() / total(counts)).sqrt()
}

/// Quantile `part` (0 to 1) of the values, with linear interpolation between neighbours.
fn ranked(counts: &[u64], part: f64) -> f64 {
    let place = part * (counts.iter().sum::<u64>().saturating_sub(1)) as f64;
    let at = |rank: u64| {
        let mut below = 0;
        let found = counts.iter().position(|count| {
            below += count;
            below > rank
        });
        found.unwrap_or(0) as f64
    };
    let low = at(place.floor() as u64);
    low + (place - place.floor()) * (at(place.ceil() as u64) - low)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(encoding: &str, step: u32, data: &[u8]) -> RawImage {
        let data = data.to_vec().into();
        RawImage { width: 2, height: 2, encoding: encoding.to_string(), step, data, ..RawImage::default() }
    }

    #[test]
    fn pixels_convert_to_rgb_from_any_encoding() {
        let bgr = [3, 2, 1, 6, 5, 4, 0, 9, 8, 7, 12, 11, 10, 0];
        assert_eq!(colours(&image("bgr8", 7, &bgr)).unwrap(), [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]);
        assert_eq!(colours(&image("mono8", 2, &[1, 2, 3, 4])).unwrap(), [1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4]);
        assert!(colours(&image("rgb8", 6, &[0; 11])).unwrap_err().contains("11 bytes"));
        assert!(colours(&image("32FC1", 8, &[0; 16])).unwrap_err().contains("--pictures"));
    }

    /// Expected figures from numpy for [3, 3, 3, 10, 200]: `numpy.mean`, `numpy.std`, `numpy.quantile`.
    #[test]
    fn brightness_statistics_match_numpy() {
        let mut counts = vec![0; 256];
        (counts[3], counts[10], counts[200]) = (3, 1, 1);
        let near =
            |found: f64, expected: f64| assert!((found - expected).abs() < 1e-9, "{found}, {expected}");
        near(mean(&counts), 43.8);
        near(deviation(&counts), 78.147_040_890_874_42);
        near(ranked(&counts, 0.0), 3.0);
        near(ranked(&counts, 0.5), 3.0);
        near(ranked(&counts, 0.9), 124.0);
        near(ranked(&counts, 0.6), 5.8);
        near(ranked(&counts, 1.0), 200.0);
    }
}
