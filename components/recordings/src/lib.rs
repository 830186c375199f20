//! Recorded movements from files, and their resampling.
//!
//! | extension | content |
//! |---|---|
//! | `.csv`, `.tsv` | a table: a header of names, then one sample per line; commas, semicolons or tabs |
//! | `.json` | a list of samples, one recording, a list of recordings, or `{"recordings": [...]}` |
//! | `.jsonl`, `.ndjson` | one sample (as in `motorium topic echo --json`) or one recording per line |
//! | `.mcap` | the messages of one channel; see [`messages`] |
//!
//! **Tables.** Byte-order marks, quotes and CRLF are supported; lines that start with `#` are comments.
//!
//! **Samples in JSON.** A sample is a list of numbers or an object. An object with a field `position`, such
//! as a joint state, provides the numbers of this field; any other object provides all its numbers. The
//! object may also be nested under the key `value`.
//!
//! **MCAP.** Each message provides the array of numbers in its field `position` or [`Selection::field`]. The
//! strings in a field `name` next to the array are the names of the channels. A list of tables, such as the
//! joints of `foxglove.JointStates`, provides one number for each table. The channel is [`Selection::topic`].
//! By default, the channel is the only channel with such numbers or, if there are several, the only channel
//! with joint states. Times are log times.
//!
//! **Recordings in JSON.** A recording is an object with an array of numbers for each channel, or with
//! `positions` (an array of samples) and `names`. `label` or `letter` is the kind of movement, and `id` or
//! `demo` is the name of the recording. `duration` (s) or `rate` (Hz) defines the timing of the samples.
//! Arrays that are all named `v` plus a letter or a number (`vx`, `vy`) are velocities and are integrated.
//!
//! **Time.** A column, field or array `time_s`, `time`, `t`, `timestamp`, `__time`, `log_time` or `%time`
//! contains the time of a sample; `dt_s`, `dt` or `frame_dt` contains the time until the next sample, s.
//! Otherwise samples are evenly spaced at [`Selection::rate`].
//!
//! **Units of time.** The names `time_s`, `time_ms`, `time_us` and `time_ns` state the unit, and so do names
//! such as `t_ms`, `timestamp_ms`, `Time [ms]` and `time (ms)`. Upper and lower case are equivalent. Columns
//! with other names contain seconds, or times since 1970 whose unit (s, ms, us or ns) is recognised by their
//! magnitude. Numbers that are too far apart to be seconds are rejected. A gap caused by setting the clock is
//! also rejected.
//!
//! **Tables of `motorium export`.** The columns `sequence`, `publish_time_ns`, `source_time_ns` and `episode`
//! are not channels.
//!
//! **Velocities.** A column `NAME_velocity` next to a column `NAME` is the velocity of that channel, not a
//! separate channel.
//!
//! **Motion capture.** [`Skeleton`] reads skeletons and motions in the formats Acclaim (`.asf` and `.amc`)
//! and Biovision (`.bvh`) and computes the directions of limbs. [`retarget`](mod@retarget) finds the joint
//! positions of a robot whose limbs have these directions.
//!
//! NaN and infinite values are rejected, with their position in the file.
//!
//! ```
//! use motorium_recordings::{Selection, read_text};
//!
//! let recording = read_text("stroke.csv", "time_s;x;y\n0.0;1;2\n0.5;3;4\n", &Selection::default())?;
//! assert_eq!(recording.names(), ["x", "y"]);
//! let even = recording.evenly(5, None)?; // 5 samples x 2 channels
//! assert_eq!(even[(2, 0)], 2.0);
//! # Ok::<(), motorium_recordings::RecordingError>(())
//! ```

mod acclaim;
mod bvh;
mod continuous;
mod csv;
mod error;
mod even;
mod json;
pub mod messages;
mod movement;
mod names;
mod read;
pub mod retarget;
mod selection;
mod skeleton;
mod table;
mod time;

pub use continuous::Removed;
pub use error::{Place, RecordingError};
pub use even::Interpolation;
pub use motorium_robots::read_bounded;
pub use read::{is_recording, read, read_all, read_text};
pub use selection::Selection;
pub use skeleton::{Limb, Skeleton, Trunk};

use nalgebra::DMatrix;

/// A recorded movement: samples of several channels, with the time of each sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    id: String,
    label: Option<String>,
    names: Vec<String>,
    times: Vec<f64>,
    /// Samples x channels.
    values: DMatrix<f64>,
}

impl Recording {
    /// Creates a recording without id and label. `values` is a matrix (samples x channels), and `times`
    /// contains the increasing time of each sample, s.
    ///
    /// # Errors
    /// There are fewer than two samples or no channel, lengths differ, times do not increase, or a value is
    /// NaN or infinite.
    pub fn new(names: Vec<String>, times: Vec<f64>, values: DMatrix<f64>) -> Result<Self, RecordingError> {
        if times.len() < 2 || values.nrows() != times.len() {
            let found = times.len().min(values.nrows());
            return Err(RecordingError::TooShort { found, expected: 2.max(times.len()) });
        }
        if names.is_empty() || names.len() != values.ncols() {
            let (name, value) = ("the number of channels", values.ncols() as f64);
            return Err(RecordingError::OutOfRange {
                name,
                value,
                expected: "one for each name, at least one",
            });
        }
        for (sample, time) in times.iter().enumerate() {
            if !time.is_finite() || (sample > 0 && *time <= times[sample - 1]) {
                return Err(RecordingError::Backwards { sample: sample + 1, time: *time });
            }
        }
        for (channel, name) in names.iter().enumerate() {
            for sample in 0..times.len() {
                let value = values[(sample, channel)];
                if !value.is_finite() {
                    return Err(RecordingError::NotFinite { sample: sample + 1, name: name.clone(), value });
                }
            }
        }
        Ok(Self { id: String::new(), label: None, names, times, values })
    }

    /// Returns the name of the recording: its `id` or `demo`, otherwise the file name without folder and
    /// extension.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Returns the kind of movement, such as a letter of an alphabet; `None` if the file does not specify it.
    pub fn label(&self) -> Option<&str> {
        self.label.as_deref()
    }

    /// Returns the names of the channels.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns the number of samples.
    pub fn samples(&self) -> usize {
        self.times.len()
    }

    /// Returns the times of the samples, s.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Returns the values (samples x channels).
    pub fn values(&self) -> &DMatrix<f64> {
        &self.values
    }

    /// Returns the time from the first sample to the last, s.
    pub fn duration(&self) -> f64 {
        self.times[self.times.len() - 1] - self.times[0]
    }
}
