//! Integration tests of the crate, one module per subject.

mod chunks;
mod couplings;
mod dmp;
mod gaits;
mod grippers;
mod imitation;
mod joint_policies;
mod joint_targets;
mod kernelised;
mod latent_policy;
mod library_policy;
mod live_goals;
mod live_weights;
mod network;
mod pictures;
mod roads;
mod support;
mod trajectory;
mod waypoints;
