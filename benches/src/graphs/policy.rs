//! The policy of measured graphs, in a folder that exists while they run.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use motorium_models::inference::Unary;
use motorium_models::onnx;

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

/// Number of the next folder.
static NEXT: AtomicU32 = AtomicU32::new(0);

/// A folder with a policy of the Panda; removed when dropped.
#[derive(Debug)]
pub struct PolicyFiles(PathBuf);

impl PolicyFiles {
    /// Writes a policy that runs at a rate \[Hz\].
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn new(rate_hz: u32) -> Result<Self, MeasureError> {
        let name = format!("motorium-bench-policy-{}-{}", std::process::id(), NEXT.fetch_add(1, Relaxed));
        let folder = Self(std::env::temp_dir().join(name));
        let written = std::fs::create_dir_all(&folder.0)
            .and_then(|()| {
                std::fs::write(folder.0.join("policy.toml"), format!("rate = {rate_hz}.0\n{DESCRIPTION}"))
            })
            .and_then(|()| std::fs::write(folder.0.join("policy.onnx"), network()));
        written.map_err(|error| MeasureError::system("writing a policy", error))?;
        Ok(folder)
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for PolicyFiles {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A network with smooth, aperiodic weights.
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
