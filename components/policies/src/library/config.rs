//! The `config` table of `policy.library`.

use schemars::JsonSchema;
use serde::Deserialize;

use motorium_primitives::reach::Repeat;

/// Configuration of `policy.library`.
///
/// ```toml
/// library   = "letters"
/// movements = ["a"]
/// terms     = [4, 8, 16]
/// hand      = { origin = [0.45, -0.2, 0.4], pitch = 0.15 }
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LibraryPolicyConfig {
    /// A library file; recordings (.jsonl, .json, .csv) to learn one from; or "letters", those of our own. Relative to
    /// the graph file.
    pub library: String,
    /// Samples per second of recordings that do not say.
    #[serde(default = "rate")]
    pub rate: f64,
    /// Labels or ids of the movements, in their order.
    pub movements: Vec<String>,
    /// Numbers of eigenforces: each movement is made with each of them. Without it, with all.
    #[serde(default)]
    pub terms: Vec<usize>,
    /// What follows the last movement: "once" stays there, "forever" goes back to the first.
    #[serde(default)]
    pub repeat: Repeat,
    /// Seconds of each movement. Without it, its own duration.
    #[serde(default)]
    pub duration: Option<f64>,
    /// Seconds from one movement to the start of the next.
    #[serde(default = "transit")]
    pub transit: f64,
    /// Seconds to rest before and after each movement.
    #[serde(default = "rest")]
    pub rest: f64,
    /// Moves a hand in a plane, for libraries of two degrees of freedom. Without it, the movements are setpoints of joints.
    #[serde(default)]
    pub hand: Option<HandConfig>,
    /// What counts as rest for recognition: a movement is what lies between two rests.
    #[serde(default)]
    pub recognition: RecognitionConfig,
    /// An SVG file to draw the movements into when the run ends (in the folder the run was started from).
    #[serde(default)]
    pub picture: Option<String>,
}

/// The plane that a hand moves in.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HandConfig {
    /// Frame of the robot that is led. Without it, that of the robot's only end effector.
    #[serde(default)]
    pub frame: Option<String>,
    /// Where the centre of the first movement is, in the world frame, m.
    pub origin: [f64; 3],
    /// Direction of the first degree of freedom, in the world frame.
    #[serde(default = "across")]
    pub x_axis: [f64; 3],
    /// Direction of the second degree of freedom, in the world frame; at right angles to the first.
    #[serde(default = "up")]
    pub y_axis: [f64; 3],
    /// The larger side of a movement, m.
    #[serde(default = "size")]
    pub size: f64,
    /// From the centre of one movement to that of the next, along the first axis, m.
    #[serde(default)]
    pub pitch: f64,
    /// How far the hand leaves the plane between movements, m.
    #[serde(default = "lift")]
    pub lift: f64,
}

/// What counts as rest.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecognitionConfig {
    /// Speed below which it rests, in units of the library per second.
    #[serde(default = "still")]
    pub still: f64,
    /// Seconds that a rest takes at least.
    #[serde(default = "pause")]
    pub pause: f64,
    /// The longest movement, s: what takes longer is not recognised.
    #[serde(default = "longest")]
    pub longest: f64,
    /// Eigenforces to recognise by.
    #[serde(default = "terms")]
    pub terms: usize,
}

impl Default for RecognitionConfig {
    fn default() -> Self {
        Self { still: still(), pause: pause(), longest: longest(), terms: terms() }
    }
}

fn rate() -> f64 {
    100.0
}
fn transit() -> f64 {
    1.0
}
fn rest() -> f64 {
    0.25
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
fn pause() -> f64 {
    0.1
}
fn longest() -> f64 {
    10.0
}
fn terms() -> usize {
    16
}
