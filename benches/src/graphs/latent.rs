//! The latent model and the movement of a measured graph, in a folder that exists while the graph runs.

use std::path::Path;

use motorium_models::gplvm::{LatentModel, Settings, SpaceData};

use super::folder::Folder;
use crate::MeasureError;

/// Poses of the model, and rows of the movement: as in `graphs/mimic`.
const POSES: usize = 93;
const ROWS: usize = 241;
/// Columns of the human: the directions of three limbs.
const HUMAN: usize = 9;
/// Space of each robot: its joints and their middle positions, rad.
const ROBOTS: [(&str, &[(&str, f64)]); 3] = [
    (
        "panda",
        &[
            ("panda_joint1", 0.0),
            ("panda_joint2", -0.8),
            ("panda_joint3", 0.0),
            ("panda_joint4", -2.3),
            ("panda_joint5", 0.0),
            ("panda_joint6", 1.6),
        ],
    ),
    (
        "iiwa14",
        &[
            ("iiwa_joint_1", 0.0),
            ("iiwa_joint_2", 0.5),
            ("iiwa_joint_3", 0.0),
            ("iiwa_joint_4", -1.2),
            ("iiwa_joint_5", 0.0),
            ("iiwa_joint_6", 1.0),
        ],
    ),
    (
        "ur5e",
        &[
            ("shoulder_pan_joint", 0.0),
            ("shoulder_lift_joint", -1.2),
            ("elbow_joint", 1.2),
            ("wrist_1_joint", -1.5),
            ("wrist_2_joint", -1.5),
        ],
    ),
];

/// A folder with a latent model of a human and three arms, and a movement of the human. The folder is removed
/// when this value is dropped.
#[derive(Debug)]
pub struct LatentFiles(Folder);

impl LatentFiles {
    /// File name of the model.
    pub const MODEL: &'static str = "arms.latent";
    /// File name of the movement.
    pub const MOTION: &'static str = "take.csv";

    /// Writes a model with the size of the model in `graphs/mimic`, and a movement. The model is only trained
    /// for a short time, which does not affect the cost of a step.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn new() -> Result<Self, MeasureError> {
        let folder = Folder::new("latent").map_err(|error| MeasureError::system("writing a model", error))?;
        let failed = |error: &dyn core::fmt::Display| MeasureError::system("writing a model", error);
        let names: Vec<String> = (0..HUMAN).map(|column| format!("human{column}")).collect();
        let human = rows(POSES, &[0.0; HUMAN]);
        let robots = ROBOTS.map(|(name, joints)| {
            let (columns, middle): (Vec<_>, Vec<_>) =
                joints.iter().map(|(joint, middle)| (joint.to_string(), *middle)).unzip();
            (name, columns, rows(POSES, &middle))
        });
        let mut spaces = vec![SpaceData { name: "human", columns: names.clone(), values: &human }];
        spaces.extend(robots.iter().map(|(name, columns, values)| SpaceData {
            name,
            columns: columns.clone(),
            values,
        }));
        let settings = Settings { iterations: 5, ..Settings::default() };
        let (model, _) = LatentModel::train(&spaces, &settings).map_err(|error| failed(&error))?;
        model.save(&folder.path().join(Self::MODEL)).map_err(|error| failed(&error))?;
        let mut text = names.join(",") + "\n";
        for row in rows(ROWS, &[0.0; HUMAN]).chunks_exact(HUMAN) {
            text += &(row.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n");
        }
        std::fs::write(folder.path().join(Self::MOTION), text).map_err(|error| failed(&error))?;
        Ok(Self(folder))
    }

    /// Returns the path of the folder.
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

/// Rows of values that follow two smooth causes, around the middle of each column.
fn rows(count: usize, middle: &[f64]) -> Vec<f64> {
    let value = |row: usize, column: usize| {
        let (u, v) = ((0.11 * row as f64).sin(), (0.07 * row as f64 + 1.0).cos());
        let angle = column as f64;
        middle[column] + 0.3 * (angle.cos() * u + angle.sin() * v).tanh() + 0.02 * u * v
    };
    (0..count).flat_map(|row| (0..middle.len()).map(move |column| value(row, column))).collect()
}
