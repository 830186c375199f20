//! Depth cameras whose images a task observes.

use std::collections::BTreeMap;

use motorium::units::TimeSpan;
use motorium_models::policy::{Policy, Term};
use motorium_sensors::component::rays::{DepthCamera, DepthCameraConfig, RangeSensor as _};
use motorium_sensors::randomise::{SensorDraw, SensorRanges};
use motorium_worlds::World;
use toml::{Table, Value};

use super::{Mirror, Symmetry, Task, TaskError};

/// Depth cameras of a task by name, each with the keys of `sensor.depth_camera`.
pub type Cameras = BTreeMap<String, DepthCameraConfig>;

/// Creates the camera of a task from a seed of its noise.
pub(crate) fn camera(name: &str, config: &DepthCameraConfig, seed: u64) -> Result<DepthCamera, TaskError> {
    let key = || format!("cameras.{name}");
    let draw = SensorDraw::none(TimeSpan { ns: 0 });
    DepthCamera::new(config, seed, &draw).map_err(|error| TaskError::Setting {
        key: error.key.map_or_else(key, |part| format!("{}.{part}", key())),
        message: error.message,
    })
}

/// Returns the text of a key of a table.
fn text<'a>(table: &'a Table, key: &str) -> Option<&'a str> {
    table.get(key).and_then(Value::as_str)
}

/// Returns `true` if a term is an image.
fn is_image(table: &Table) -> bool {
    [Term::DepthImage, Term::GreyImage].iter().any(|term| text(table, "term") == Some(term.name()))
}

impl Task {
    /// Returns the observation terms as in `policy.toml`: images with the size and the range of their camera.
    pub(super) fn described_observations(&self) -> Result<Vec<Value>, TaskError> {
        let described = self.observations.iter().enumerate().map(|(index, observation)| {
            let Some(table) = observation.as_table().filter(|table| is_image(table)) else {
                return Ok(observation.clone());
            };
            let Some(name) = text(table, "camera") else { return Ok(observation.clone()) };
            let key = |part: &str| format!("observations[{index}].{part}");
            let Some(config) = self.cameras.get(name) else {
                let names: Vec<&str> = self.cameras.keys().map(String::as_str).collect();
                let expected = match &names[..] {
                    [] => format!("a camera of the task, such as a table `[cameras.{name}]`"),
                    names => format!("a camera of the task: {}", names.join(", ")),
                };
                return Err(TaskError::value(key("camera"), format!("\"{name}\""), expected));
            };
            if let Some(pixels) = table.get("pixels") {
                let expected = format!("no value, because `cameras.{name}` has `width` and `height`");
                return Err(TaskError::value(key("pixels"), pixels, expected));
            }
            let mut table = table.clone();
            let pixels = [config.width, config.height].map(|count| Value::Integer(i64::from(count)));
            table.insert("pixels".to_owned(), Value::Array(pixels.to_vec()));
            if text(&table, "term") == Some(Term::DepthImage.name()) && !table.contains_key("range") {
                let range = [config.least, config.most].map(Value::Float);
                table.insert("range".to_owned(), Value::Array(range.to_vec()));
            }
            Ok(Value::Table(table))
        });
        described.collect()
    }

    /// Checks the cameras.
    pub(super) fn check_cameras(&self) -> Result<(), TaskError> {
        for (name, config) in &self.cameras {
            let wrong = |part: &str, found: String, expected: &str| {
                Err(TaskError::value(format!("cameras.{name}.{part}"), found, expected))
            };
            camera(name, config, 0)?;
            if config.world != World::default() {
                return wrong("world", "a world".to_owned(), "no value, because the task has `[world]`");
            }
            if config.latency.ns > 0 {
                return wrong(
                    "latency",
                    config.latency.to_string(),
                    "no value, because images show the observed state",
                );
            }
            if config.drop_out != 0.0 {
                return wrong(
                    "drop_out",
                    config.drop_out.to_string(),
                    "0, because each observation needs an image",
                );
            }
            if let Some(seed) = config.seed {
                return wrong(
                    "seed",
                    seed.to_string(),
                    "no value, because the seed of the run determines the noise",
                );
            }
            if config.randomise != SensorRanges::default() {
                return wrong("randomise", "ranges".to_owned(), "no value; set `depth` and `lost` instead");
            }
        }
        if !self.cameras.is_empty() && self.randomise.terrain != Default::default() {
            let expected = "no value, because cameras of a task see only one terrain";
            return Err(TaskError::value("randomise.terrain", "ranges", expected));
        }
        Ok(())
    }

    /// Checks that every camera is observed.
    pub(super) fn check_images(&self, policy: &Policy) -> Result<(), TaskError> {
        for name in self.cameras.keys() {
            if !policy.observations.iter().any(|observation| observation.camera.as_ref() == Some(name)) {
                let expected = "an observation that uses this camera";
                return Err(TaskError::value(format!("cameras.{name}"), "no observation", expected));
            }
        }
        Ok(())
    }

    /// Returns the mirror of a task. Images have a mirror image if their camera is in the plane of symmetry.
    pub(super) fn mirror(&self, policy: &Policy, symmetry: &Symmetry) -> Result<Mirror, TaskError> {
        let mirror = Mirror::new(policy, symmetry)?;
        for (name, config) in &self.cameras {
            let ([_, y, _], [roll, _, yaw]) = (config.mount.position, config.mount.rpy);
            if [y, roll, yaw] != [0.0; 3] {
                let found = format!("y {y} m, roll {roll} and yaw {yaw} rad");
                let expected = "0 for each, so that the camera is in the plane of symmetry";
                return Err(TaskError::value(format!("cameras.{name}.mount"), found, expected));
            }
        }
        Ok(mirror)
    }
}
