//! State estimation: signal filters, Kalman filters, and the base of a legged robot.
//!
//! - [`LowPass`], [`Biquad`]: filters of a signal with a constant rate.
//! - [`SlopeEstimator`]: velocity and its delay from positions.
//! - [`ComplementaryFilter`]: attitude from gyroscope and accelerometer.
//! - [`KalmanFilter`]: the linear filter, with sizes known at compile time.
//! - [`InvariantFilter`]: pose and velocity of a legged base from an inertial measurement unit and the
//!   contacts of its feet.
//!
//! The estimators do not depend on the runtime. Functions called in a loop do not allocate.

mod biquad;
mod complementary;
mod invariant;
mod kalman;
mod low_pass;
mod slope;

pub use biquad::{Biquad, BiquadError, BiquadShape};
pub use complementary::ComplementaryFilter;
pub use invariant::{ContactKinematics, FilterNoise, FilterState, InvariantFilter, StartDeviations};
pub use kalman::{KalmanFilter, SingularInnovation};
pub use low_pass::LowPass;
pub use slope::{Slope, SlopeEstimator};
