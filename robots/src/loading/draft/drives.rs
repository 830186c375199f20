//! Limits and gains of a draft profile.

use nalgebra::{DMatrix, DVector, Vector3};

use super::text::{numbers, rounded};
use super::wheels::Wheels;
use crate::model::configuration::with_joints;
use crate::{Dynamics, JointKind, Model};

/// Deflection at which a drive reaches its full effort, rad or m: 0.2 rad for a revolute joint.
const FULL_EFFORT_AT: [f64; 2] = [0.2, 0.02];
/// Largest sag under the robot's weight without feed-forward, rad or m.
const LARGEST_SAG: [f64; 2] = [0.05, 0.005];
/// Largest deflection at which the friction of a joint stops its drive, rad or m: half of the tolerance of a
/// joint goal.
const STUCK_WITHIN: f64 = 0.005;
/// Maximum natural frequency of a drive, 1/s, for steps of 1 ms.
const HIGHEST_FREQUENCY: f64 = 250.0;
/// Minimum natural frequency, for a drive without an effort limit, 1/s.
const LOWEST_FREQUENCY: f64 = 30.0;
/// Speed of a joint without a velocity limit, rad/s or m/s.
const MODERATE_SPEED: [f64; 2] = [2.0, 0.25];
/// Shortest rise time from rest to full speed, s.
const SHORTEST_RISE: f64 = 0.1;
/// Fraction of the effort remaining beyond the weight that may accelerate the joint.
const ACCELERATING_PART: f64 = 0.5;

/// Drafts the limits; `holding` contains the efforts that hold the robot at home. Each of the `wheels` moves
/// a share of the robot.
pub(super) fn limits(
    model: &Model,
    home: &DVector<f64>,
    holding: Option<&[f64]>,
    wheels: Option<&Wheels>,
) -> String {
    let joints = 0..model.joint_count();
    let velocity: Vec<f64> = joints.clone().map(|index| speed(model, index)).collect();
    let at = Weights::at_home(model, home, holding).on_wheels(model, wheels);
    let acceleration = joints.map(|index| {
        let effort = model.effort_limit()[index];
        let left = effort - at.holding[index].abs();
        let reached = velocity[index] / SHORTEST_RISE;
        match effort.is_finite() && left > 0.0 {
            true => rounded((ACCELERATING_PART * left / at.inertia[index]).min(reached)),
            false => rounded(reached),
        }
    });
    let mut text = "\n[limits]\n# Speed limits of the file, rad/s or m/s, or moderate defaults. All components respect lower values.\n".to_string();
    text += &numbers("velocity", velocity.iter().copied());
    text += "# Half of the effort left after carrying the weight at home, divided by the inertia there, rad/s^2 or m/s^2;\n# full speed after at least 0.1 s. `inf` for no limit.\n";
    text + &numbers("acceleration", acceleration)
}

/// Drafts the gains, with `holding` and `wheels` as in [`limits`].
pub(super) fn gains(
    model: &Model,
    home: &DVector<f64>,
    holding: Option<&[f64]>,
    wheels: Option<&Wheels>,
) -> String {
    let at = Weights::at_home(model, home, holding).on_wheels(model, wheels);
    let pairs: Vec<(f64, f64)> = (0..model.joint_count())
        .map(|index| {
            if is_passive(model, index) {
                return (0.0, 0.0);
            }
            let slides = usize::from(model.joint(index).kind == JointKind::Prismatic);
            let (effort, free) = (model.effort_limit()[index], at.free_inertia[index]);
            let wanted = match effort.is_finite() {
                true => effort / FULL_EFFORT_AT[slides],
                false => (at.inertia[index] * LOWEST_FREQUENCY.powi(2))
                    .max(at.holding[index].abs() / LARGEST_SAG[slides]),
            };
            let friction = model.joint(index).dynamics.friction;
            let mut least = friction / STUCK_WITHIN;
            if holding.is_some() {
                // feet on the ground resist with more inertia than feet in the air
                least = least.max(at.holding[index].abs() / LARGEST_SAG[slides]);
            }
            let kp = rounded_above(wanted.min(free * HIGHEST_FREQUENCY.powi(2)), least);
            let critical = 2.0 * (kp * at.inertia[index]).sqrt();
            (kp, rounded(critical.min(2.0 * free * HIGHEST_FREQUENCY)))
        })
        .collect();
    let mut text = "\n# Stiffness, N m/rad or N/m: the full effort at a deflection of 0.2 rad or 20 mm, less for a small inertia,\n# but enough to overcome the friction of the joint within half of a tolerance of 0.01 rad or m.\n# Damping, N m s/rad or N s/m: critical for the inertia at home, of a driven wheel with its\n# share of the robot's mass.\n[gains]\n".to_string();
    text += &numbers("kp", pairs.iter().map(|pair| pair.0));
    text + &numbers("kd", pairs.iter().map(|pair| pair.1))
}

/// Inertias and weights at a posture.
struct Weights {
    /// Inertia moved by each joint while the others are fixed, kg m^2 or kg.
    inertia: Vec<f64>,
    /// Inertia at each joint while the others are free.
    free_inertia: Vec<f64>,
    /// Effort that holds each joint against gravity, N m or N.
    holding: Vec<f64>,
}

impl Weights {
    fn at_home(model: &Model, home: &DVector<f64>, holding: Option<&[f64]>) -> Self {
        let q = with_joints(model, home.as_slice());
        let (nv, first) = (model.nv(), model.nv() - model.joint_count());
        let mut dynamics = Dynamics::new(model);
        let mut mass = DMatrix::zeros(nv, nv);
        dynamics.crba(model, &q, &mut mass);
        let mut gravity = vec![0.0; nv];
        dynamics.gravity(model, &q, Vector3::new(0.0, 0.0, -9.81), &mut gravity);
        // links without mass have a negligible inertia
        let least = 1e-6;
        let inertia: Vec<f64> = (first..nv).map(|index| mass[(index, index)].max(least)).collect();
        let inverse = mass.clone().try_inverse();
        let free_inertia = (first..nv)
            .zip(&inertia)
            .map(|(index, fallback)| {
                let free = inverse.as_ref().map(|inverse| 1.0 / inverse[(index, index)]);
                free.filter(|free| *free > least && free.is_finite()).unwrap_or(*fallback)
            })
            .collect();
        let holding = holding.map_or_else(|| gravity[first..].to_vec(), <[f64]>::to_vec);
        Self { inertia, free_inertia, holding }
    }

    /// Adds a share of the robot's mass to the inertia of each wheel that rolls on the ground.
    fn on_wheels(mut self, model: &Model, wheels: Option<&Wheels>) -> Self {
        for (joint, inertia) in wheels.iter().flat_map(|wheels| wheels.carried(model)) {
            self.inertia[joint] += inertia;
            self.free_inertia[joint] += inertia;
        }
        self
    }
}

pub(super) fn is_passive(model: &Model, index: usize) -> bool {
    model.effort_limit()[index] == 0.0
}

fn speed(model: &Model, index: usize) -> f64 {
    let limit = model.velocity_limit()[index];
    let slides = usize::from(model.joint(index).kind == JointKind::Prismatic);
    if limit.is_finite() && limit > 0.0 { limit } else { MODERATE_SPEED[slides] }
}

/// Returns the larger number with two digits, at least `least`.
fn rounded_above(number: f64, least: f64) -> f64 {
    let near = rounded(number.max(least));
    if near < least { rounded(1.05 * least) } else { near }
}
