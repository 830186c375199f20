//! The contact points of a step, and the law of MuJoCo's contacts for surfaces with restitution.
//!
//! A MuJoCo contact is a spring with a damper that never pulls. A body that hits the contact with the speed v
//! leaves with the speed e v, where e depends only on the damping ratio. The closed form describes a linear
//! spring and damper until its force reaches zero.

use nalgebra::{Point3, Vector3};

/// The contact points of a step.
#[derive(Clone, Debug, Default)]
pub(super) struct Seen {
    /// True if two parts were within a centimetre of each other.
    pub(super) near: bool,
    pub(super) touches: Vec<Touch>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Touch {
    pub(super) colliders: [usize; 2],
    pub(super) point: Point3<f64>,
    pub(super) normal: Vector3<f64>,
    pub(super) depth: f64,
    pub(super) force: f64,
    pub(super) friction: Vector3<f64>,
    /// Torque against spinning and rolling, on the second collider \[N m\].
    pub(super) torque: Vector3<f64>,
}

/// Number of contact points that are recorded without allocation.
const TOUCHES: usize = 512;

impl Seen {
    /// Starts without contact points; the next step finds them.
    pub(super) fn new() -> Self {
        Self { near: true, touches: Vec::with_capacity(TOUCHES) }
    }
}

/// Shortest time constant of a contact \[s\]; MuJoCo accepts no less than two integration steps.
const TIME_CONSTANT: f64 = 0.002;

/// Damping ratio of a surface without restitution.
const DAMPED: f64 = 3.0;

/// Impedance of a contact: the fraction of a rigid surface's force, at the surface and a millimetre below.
pub(super) const IMPEDANCE: &str = "0.99 0.999 0.001";

/// Returns MuJoCo's `solref` for a restitution from 0 to 1: time constant \[s\] and damping ratio.
pub(super) fn reference(restitution: f64) -> [f64; 2] {
    let ratio = damping_ratio(restitution);
    [TIME_CONSTANT / ratio.min(1.0), ratio]
}

/// Returns the damping ratio at which a body keeps this fraction of its speed.
fn damping_ratio(restitution: f64) -> f64 {
    let (mut low, mut high) = (1e-4, DAMPED);
    if rebound(high) >= restitution {
        return high;
    }
    // Restitution falls with the ratio, so bisect the interval down to rounding.
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if rebound(middle) > restitution {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Returns the fraction of its speed with which a body leaves a spring of frequency 1 and this damping ratio,
/// once the force is zero.
fn rebound(ratio: f64) -> f64 {
    let z = ratio;
    if z < 1.0 {
        let omega = (1.0 - z * z).sqrt();
        // Time from first contact until the force is zero.
        let time = (2.0 * z * omega).atan2(2.0 * z * z - 1.0) / omega;
        (-z * time).exp()
    } else if z > 1.0 {
        let omega = (z * z - 1.0).sqrt();
        let time = ((z + omega) / (z - omega)).ln() / omega;
        (-z * time).exp()
    } else {
        (-2.0_f64).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computes the same by integration: x'' = -2 z x' - x from x' = 1 until the force is zero.
    fn integrated(z: f64) -> f64 {
        let (mut x, mut v, h) = (0.0_f64, 1.0_f64, 1e-5);
        loop {
            let force = -2.0 * z * v - x;
            if x > 0.0 && force >= 0.0 {
                return -v;
            }
            v += h * force;
            x += h * v;
        }
    }

    #[test]
    fn rebound_matches_an_integrated_damped_spring() {
        for z in [0.05, 0.3, 0.7, 0.9, 1.0, 1.5, 3.0] {
            let (closed, found) = (rebound(z), integrated(z));
            assert!((closed - found).abs() < 1e-3, "{z}: {closed}, integrated {found}");
        }
    }

    #[test]
    fn damping_ratio_reproduces_the_restitution() {
        for restitution in [0.1, 0.3, 0.5, 0.8, 0.95] {
            assert!((rebound(damping_ratio(restitution)) - restitution).abs() < 1e-9);
        }
        assert_eq!(damping_ratio(0.0), DAMPED);
        let [time, ratio] = reference(0.5);
        assert!(time * ratio - TIME_CONSTANT < 1e-12 && ratio < 1.0);
    }
}
