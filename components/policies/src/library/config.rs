//! The `config` table of `policy.library`.

use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

use motorium_primitives::reach::Repeat;

/// Configuration of `policy.library`.
///
/// ```toml
/// library   = "letters"
/// movements = ["a"]
/// eigenforces = [4, 8, 16]
/// end_effector = { origin = [0.45, -0.2, 0.4], pitch = 0.15 }
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LibraryPolicyConfig {
    /// Source of the library, relative to the graph file: a library; recordings (.jsonl, .json, .csv) from
    /// which a library is built; "letters" for the built-in letters; or a coupling, which converts `pictures`
    /// to movements.
    #[schemars(extend("format" = "path", "words" = ["letters"]))]
    pub library: String,
    /// Sample rate of recordings without time stamps, Hz.
    #[serde(default = "rate")]
    pub rate: f64,
    /// Labels or ids of the movements, in order. Not required with `pictures`.
    #[serde(default)]
    pub movements: Vec<String>,
    /// Paths of pictures of letters (.pgm), relative to the graph file. The coupling in `library` converts
    /// them to movements, which are appended to `movements`. Each movement is named after its file.
    #[serde(default)]
    #[schemars(extend("format" = "path"))]
    pub pictures: Vec<String>,
    /// Speed at which letters are written from pictures, in letter sizes per second. Default: the mean speed
    /// of the coupling's training letters.
    #[serde(default)]
    pub pen_speed: Option<f64>,
    /// Numbers of eigenforces. Each movement is executed once with each of these numbers. Default: all
    /// eigenforces.
    #[serde(default)]
    pub eigenforces: Vec<usize>,
    /// Behaviour after the last movement: "once" stays at its end, "forever" returns to the first movement.
    #[serde(default)]
    pub repeat: Repeat,
    /// Duration of each movement, such as "4 s". Default: the duration of its recording.
    #[serde(default)]
    pub duration: Option<TimeSpan>,
    /// Duration of the transition from one movement to the start of the next, at least 1 ms. Default "1 s".
    #[serde(default = "transit")]
    pub transit: TimeSpan,
    /// Rest time before and after each movement. Default "250 ms".
    #[serde(default = "rest")]
    pub rest: TimeSpan,
    /// Plane in which an end effector moves, for libraries with two degrees of freedom. Default: the
    /// movements are joint setpoints.
    #[serde(default)]
    pub end_effector: Option<EndEffectorConfig>,
    /// Definition of rest for recognition. A recognised movement lies between two rests.
    #[serde(default)]
    pub recognition: RecognitionConfig,
    /// Path of an SVG file to which the movements are drawn when the run ends, relative to the folder in
    /// which the run was started.
    #[serde(default)]
    pub picture: Option<String>,
}

/// Plane in which an end effector moves.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EndEffectorConfig {
    /// Frame of the robot that moves in the plane. Default: the frame of the robot's only end effector.
    #[serde(default)]
    pub frame: Option<String>,
    /// Centre of the first movement, in the world frame, m.
    pub origin: [f64; 3],
    /// Direction of the first degree of freedom, in the world frame.
    #[serde(default = "across")]
    pub x_axis: [f64; 3],
    /// Direction of the second degree of freedom, in the world frame. Must be perpendicular to the first.
    #[serde(default = "up")]
    pub y_axis: [f64; 3],
    /// Larger side of a movement, m.
    #[serde(default = "size")]
    pub size: f64,
    /// Distance from the centre of one movement to the centre of the next, along the first axis, m.
    #[serde(default)]
    pub pitch: f64,
    /// Distance by which the end effector is lifted off the plane between two movements, m.
    #[serde(default = "lift")]
    pub lift: f64,
}

/// Definition of rest, for recognition.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecognitionConfig {
    /// Speed below which the robot counts as resting, in units of the library per second.
    #[serde(default = "still")]
    pub still: f64,
    /// Minimum duration of a rest, at least 1 ms. Default "100 ms".
    #[serde(default = "pause")]
    pub pause: TimeSpan,
    /// Maximum duration of a recognised movement, at least 10 ms. Default "10 s".
    #[serde(default = "longest")]
    pub longest: TimeSpan,
    /// Number of eigenforces used for recognition.
    #[serde(default = "eigenforces")]
    pub eigenforces: usize,
}

impl Default for RecognitionConfig {
    fn default() -> Self {
        Self { still: still(), pause: pause(), longest: longest(), eigenforces: eigenforces() }
    }
}

fn rate() -> f64 {
    100.0
}
fn transit() -> TimeSpan {
    milliseconds(1000)
}
fn rest() -> TimeSpan {
    milliseconds(250)
}
fn across() -> [f64; 3] {
    [0.0, -1.0, 0.0]
}
fn up() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}
fn size() -> f64 {
    0.12
}
fn lift() -> f64 {
    0.03
}
fn still() -> f64 {
    0.05
}
fn pause() -> TimeSpan {
    milliseconds(100)
}
fn longest() -> TimeSpan {
    milliseconds(10_000)
}
const fn milliseconds(count: u64) -> TimeSpan {
    TimeSpan { ns: 1_000_000 * count }
}
fn eigenforces() -> usize {
    16
}
