//! The policy of measured graphs, in a folder that exists while they run.

use std::path::Path;

use motorium_models::inference::Unary;
use motorium_models::onnx;

use super::folder::Folder;
use crate::MeasureError;

/// Units of each layer: 54,464 weights from the observation of the Panda to its seven joints.
const LAYERS: [usize; 5] = [51, 256, 128, 64, 7];
/// Joints and observation of the policy. The actions are bounded to a fraction of a degree.
const DESCRIPTION: &str = r#"
network = "policy.onnx"
observations = [
    { term = "joint_positions", history = 3 },
    { term = "joint_velocities", scale = 0.1, history = 3 },
    { term = "last_action" },
    { term = "phase", period = 2.0 },
]
[action]
joints = [
    "panda_joint1", "panda_joint2", "panda_joint3", "panda_joint4", "panda_joint5", "panda_joint6",
    "panda_joint7",
]
default_pose = [0.0, -0.7854, 0.0, -2.3562, 0.0, 1.5708, 0.7854]
scale = 0.005
clip = [-1.0, 1.0]
"#;

/// A folder with a policy of the Panda. The folder is removed when this value is dropped.
#[derive(Debug)]
pub struct PolicyFiles(Folder);

impl PolicyFiles {
    /// Writes a policy that runs at `rate_hz`.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn new(rate_hz: u32) -> Result<Self, MeasureError> {
        let write = || {
            let folder = Folder::new("policy")?;
            let text = format!("rate = {rate_hz}.0\n{DESCRIPTION}");
            std::fs::write(folder.path().join("policy.toml"), text)?;
            std::fs::write(folder.path().join("policy.onnx"), network())?;
            Ok(Self(folder))
        };
        write().map_err(|error: std::io::Error| MeasureError::system("writing a policy", error))
    }

    /// Returns the path of the folder.
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

/// Returns a network with smooth, aperiodic weights.
fn network() -> Vec<u8> {
    let layer = |pair: &[usize]| {
        let [inputs, outputs] = [pair[0], pair[1]];
        let scale = 1.0 / (inputs as f32).sqrt();
        let weights = (0..inputs * outputs).map(|k| scale * (0.37 * k as f32).sin()).collect();
        (weights, vec![0.1; outputs])
    };
    let layers: Vec<(Vec<f32>, Vec<f32>)> = LAYERS.windows(2).map(layer).collect();
    onnx::write_mlp(LAYERS[0], &layers, Unary::Elu(1.0), &[])
}
