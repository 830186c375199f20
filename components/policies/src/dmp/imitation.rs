//! Demonstrations as paths to a goal, and the accuracy with which they are followed.

use std::path::Path;

use motorium::declare::{ConfigError, RobotReference};
use motorium_robots::{Kinematics, Loaded};
use nalgebra::{DMatrix, Isometry3, UnitQuaternion, Vector3};

use super::config::DemonstrationConfig;
use crate::robot;
use motorium_primitives::dmp::{Demonstration, DmpModel, Regression, Settings, Variant};
use motorium_primitives::file::{Primitive, PrimitiveFile};
use motorium_primitives::reach::PathDeviation;
use motorium_recordings::{Recording, Selection};

/// Number of evenly spaced samples to which a recording is resampled.
const SAMPLES: usize = 400;

/// A learned demonstration.
#[derive(Debug, Clone)]
pub(super) struct Demonstrated {
    pub(super) model: DmpModel,
    /// Positions, evenly spaced in time, m.
    pub(super) path: Vec<Vector3<f64>>,
    pub(super) duration: std::time::Duration,
    /// Orientations at the start and the end, if joints were recorded.
    pub(super) turns: Option<[UnitQuaternion<f64>; 2]>,
}

impl Demonstrated {
    /// Reads, filters and fits a demonstration. `key` is the key of the shape.
    pub(super) fn read(
        config: &DemonstrationConfig,
        robot: Option<&RobotReference>,
        frame: Option<&str>,
        key: &str,
    ) -> Result<Self, ConfigError> {
        let file = format!("{key}.demonstration.file");
        let base = robot.map_or_else(|| Path::new("."), |robot| robot.base.as_path());
        let recording = motorium_recordings::read(&base.join(&config.file), &Selection::default())
            .map_err(|error| ConfigError::key(&file, error.to_string()))?;
        let (positions, turns) = end_effector(&recording, config, robot, frame, key)?;
        let duration = recording.duration();
        let demonstration = Demonstration::from_positions(duration, positions.clone())
            .map_err(|error| ConfigError::key(&file, error.to_string()))?
            // like the motion of the end effector
            .at_rest_at_its_ends();
        let settings = Settings { kernels: config.kernels, ..Settings::default() };
        let model = DmpModel::fit(settings, &[demonstration], Regression::default())
            .map_err(|error| ConfigError::key(format!("{key}.demonstration"), error.to_string()))?;
        let path = positions.row_iter().map(|row| Vector3::new(row[0], row[1], row[2])).collect();
        Ok(Self { model, path, duration: std::time::Duration::from_secs_f64(duration), turns })
    }

    /// Returns the start of the path.
    pub(super) fn start(&self) -> Vector3<f64> {
        self.path[0]
    }

    /// Returns the end of the path.
    pub(super) fn end(&self) -> Vector3<f64> {
        self.path[self.path.len() - 1]
    }
}

type EndEffector = (DMatrix<f64>, Option<[UnitQuaternion<f64>; 2]>);

/// Returns the positions of the end effector, samples x 3, from recorded positions or joints.
fn end_effector(
    recording: &Recording,
    config: &DemonstrationConfig,
    robot: Option<&RobotReference>,
    frame: Option<&str>,
    key: &str,
) -> Result<EndEffector, ConfigError> {
    let cutoff = format!("{key}.demonstration.cutoff");
    let even = recording
        .evenly(SAMPLES, Some(config.cutoff))
        .map_err(|error| ConfigError::key(cutoff, error.to_string()))?;
    let channels = even.ncols();
    if channels == 3 {
        return Ok((even, None));
    }
    let wrong = |message: String| ConfigError::key(format!("{key}.demonstration.file"), message);
    let Some(robot) = robot else {
        let message = format!("{channels} channels, expected the 3 of the position of an end effector");
        return Err(wrong(message).advise("joints need a robot: add `robot = \"NAME\"` to the component"));
    };
    let (Loaded { model, profile, .. }, frame) = robot::load_fixed(robot, frame)?;
    let named: Option<Vec<usize>> = recording.names().iter().map(|name| model.joint_index(name)).collect();
    let joints = match named {
        Some(joints) => joints,
        None if channels == model.nq() => (0..channels).collect(),
        None => {
            let expected = model.nq();
            return Err(wrong(format!(
                "{channels} channels, expected 3 (position of the end effector), {expected} (joints of `{}`), \
                 or channels named after joints",
                robot.name
            )));
        }
    };
    // Joints without a channel stay in the home pose.
    let mut q = model.neutral();
    if let Some(home) = profile.as_ref().and_then(|profile| profile.home(&model).ok()) {
        q.copy_from_slice(home.as_slice());
    }
    let mut kinematics = Kinematics::new(&model);
    let poses: Vec<Isometry3<f64>> = even
        .row_iter()
        .map(|row| {
            joints.iter().zip(row.iter()).for_each(|(joint, position)| q[*joint] = *position);
            kinematics.update(&model, &q);
            kinematics.pose(&model, frame)
        })
        .collect();
    let positions = DMatrix::from_fn(SAMPLES, 3, |k, d| poses[k].translation.vector[d]);
    Ok((positions, Some([poses[0].rotation, poses[SAMPLES - 1].rotation])))
}

/// Reads a primitive of the end effector's position from a file.
pub(super) fn primitive(
    file: &str,
    robot: Option<&RobotReference>,
    key: &str,
) -> Result<DmpModel, ConfigError> {
    let base = robot.map_or_else(|| Path::new("."), |robot| robot.base.as_path());
    let read =
        PrimitiveFile::read(&base.join(file)).map_err(|error| ConfigError::key(key, error.to_string()))?;
    let model = match read.primitive {
        Primitive::Discrete(model) => model,
        other => {
            let message = format!("{file} contains a {} primitive, expected a discrete one", other.kind());
            return Err(ConfigError::key(key, message));
        }
    };
    if model.dimensions() != 3 || model.settings().variant != Variant::QuinticGoal {
        let (dimensions, variant) = (model.dimensions(), model.settings().variant);
        let message = format!(
            "{file} contains a {variant:?} primitive of {dimensions} dimensions, expected QuinticGoal and 3: the position of the end effector"
        );
        return Err(ConfigError::key(key, message));
    }
    Ok(model)
}

/// Deviations of the target and of the measured end effector from the demonstrated paths.
#[derive(Debug, Default)]
pub(super) struct PathRecord {
    /// Demonstrated path of each segment, m; `None` without a demonstration.
    paths: Vec<Option<Vec<Vector3<f64>>>>,
    target: PathDeviation,
    end_effector: PathDeviation,
}

impl PathRecord {
    pub(super) fn new(paths: Vec<Option<Vec<Vector3<f64>>>>) -> Self {
        Self { paths, ..Self::default() }
    }

    /// Returns `true` if a segment has a demonstration.
    pub(super) fn has_path(&self, segment: usize) -> bool {
        self.paths.get(segment).is_some_and(Option::is_some)
    }

    /// Records the target, and the measured position of the end effector if known, at a progress of a
    /// segment.
    pub(super) fn observe(
        &mut self,
        segment: usize,
        progress: f64,
        target: Vector3<f64>,
        end_effector: Option<Vector3<f64>>,
    ) {
        let Some(Some(path)) = self.paths.get(segment) else { return };
        self.target.observe(path, progress, target);
        if let Some(end_effector) = end_effector {
            self.end_effector.observe(path, progress, end_effector);
        }
    }

    /// Returns the result of the run; `None` without a demonstration.
    pub(super) fn result(&self) -> Option<serde_json::Value> {
        self.paths
            .iter()
            .any(Option::is_some)
            .then(|| serde_json::json!({ "target": result(&self.target), "end_effector": result(&self.end_effector) }))
    }
}

fn result(deviation: &PathDeviation) -> Option<serde_json::Value> {
    let (rms, largest, timed) = (deviation.rms()?, deviation.largest()?, deviation.timed_rms()?);
    Some(serde_json::json!({
        "path_error_m": rms,
        "largest_path_error_m": largest,
        "timed_error_m": timed,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_target_is_on_the_path_but_not_in_time() {
        let path = vec![Vector3::zeros(), Vector3::x(), 2.0 * Vector3::x()];
        let mut record = PathRecord::new(vec![None, Some(path)]);
        assert!(record.has_path(1) && !record.has_path(0) && !record.has_path(7));
        record.observe(0, 0.5, Vector3::z(), None);
        record.observe(1, 0.5, 0.8 * Vector3::x(), Some(Vector3::new(0.8, 0.1, 0.0)));
        let result = record.result().unwrap();
        let number = |who: &str, what: &str| result[who][what].as_f64().unwrap();
        assert!(number("target", "path_error_m") < 1e-12);
        assert!((number("target", "timed_error_m") - 0.2).abs() < 1e-12);
        assert!((number("end_effector", "path_error_m") - 0.1).abs() < 1e-12);
    }
}
