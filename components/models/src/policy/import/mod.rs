//! Import of policies from other training frameworks.
//!
//! - [`import_mjlab`]: an ONNX file with the metadata of mjlab (`mjlab/rl/exporter_utils.py`: `joint_names`,
//!   `default_joint_pos`, `joint_stiffness`, `joint_damping`, `action_scale`, `observation_names`, and in
//!   later versions `observation_terms_scale`, `_clip`, `_history_length` and `_flatten_history_dim`).
//!   Numbers in the metadata have three decimals.
//! - [`import_isaac`]: the ONNX file of Isaac Lab 2 with its `IO_descriptors.yaml` and `env.yaml`.
//! - [`import_leapp`]: a LEAPP bundle of Isaac Lab 3.
//! - [`import_weights`]: weights of rsl_rl, Stable-Baselines3 or CleanRL in a safetensors file, and a
//!   handwritten table that describes the policy.

mod error;
mod isaac;
mod leapp;
mod mjlab;
mod names;
mod served;
mod weights;

pub use error::{ImportError, ImportOptions, Mark};
use error::{NETWORK, TERMS};
pub use isaac::{
    ActionDescriptor, Actuator, Articulation, Descriptors, Environment, Gain, ObservationDescriptor,
    import_isaac,
};
pub use leapp::{Bundle, BundleModel, BundlePort, import_leapp};
pub use mjlab::import_mjlab;
pub use served::HeightGrid;
pub use weights::import_weights;
