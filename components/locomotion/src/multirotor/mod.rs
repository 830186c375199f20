//! Attitude and position control of multirotors.
//!
//! [`FlightControl`] is the geometric controller of Lee, Leok and McClamroch (*Geometric tracking control of
//! a quadrotor UAV on SE(3)*, CDC 2010), without Euler angles and their singularities. With the errors `e_x`,
//! `e_v` of the centre of the base, the rotation `R` of the base and the desired rotation `R_d`,
//!
//! ```text
//! F   = -k_x e_x - k_v e_v - k_i int e_x + m g      the desired force, along the third axis of R_d
//! f   = F . R e_3                                   the thrust
//! e_R = 1/2 vee(R_d' R - R' R_d)
//! M   = -k_R e_R - k_W (W - W_d) + W x J W          the torque, J the inertia
//! ```
//!
//! with gains from bandwidths: `k_x = m w^2`, `k_v = 2 m w`, `k_R = J w_a^2`, `k_W = 2 J w_a`. The integral
//! term, an addition to the paper, removes the position error that a wrong mass or thrust causes.
//!
//! [`Mixer`] distributes thrust and torque among the rotors, and reduces torque before thrust at saturation.

mod flight;
mod mixer;

pub use flight::{Flight, FlightControl, FlightSettings, FlightTarget};
pub use mixer::{Mixer, MixerError, Propeller};
