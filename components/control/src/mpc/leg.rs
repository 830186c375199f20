//! A leg on its way: places, swings, and landings that come before or after their time.

use motorium_robots::FrameId;
use nalgebra::{Rotation3, Vector3};

use super::{GroundPlane, Stepping, Swing};

/// A foot of a [`LegPlanner`](super::LegPlanner).
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedFoot {
    /// Its frame.
    pub frame: FrameId,
    /// Points at which the ground pushes, from the ground below the origin of the frame, in its axes \[m\]:
    /// the corners of a sole, or zero alone.
    pub points: Vec<Vector3<f64>>,
    /// Distance of the ground below the origin of the frame: the radius of a ball \[m\].
    pub radius: f64,
    /// Coefficient of friction.
    pub friction: f64,
}

/// Reaction of a planner to feet that touch the ground before or after their time, where their contacts are
/// measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landing {
    /// Share of a swing from which a contact ends it, 0 to 1. Default 0.5.
    pub early_from: f64,
    /// Speed at which a foot that has not touched at the end of its swing is moved on into the ground
    /// \[m/s\]. Default 0.3.
    pub search_speed: f64,
    /// Longest time for which it is \[s\]; it then counts as standing all the same. Default 0.08.
    pub search_for: f64,
}

impl Default for Landing {
    fn default() -> Self {
        Self { early_from: 0.5, search_speed: 0.3, search_for: 0.08 }
    }
}

/// A foot on its way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    /// Place of the ground below it in the pose at rest, from the centre of mass, axes of the heading \[m\].
    pub(super) rest: Vector3<f64>,
    /// First of its points among those of all feet.
    pub(super) first: usize,
    /// Place of the ground below it \[m\], and the orientation of its frame.
    pub(super) place: Vector3<f64>,
    pub(super) axes: Rotation3<f64>,
    /// Place at which it stood last \[m\].
    pub(super) stood: Vector3<f64>,
    pub(super) swing: Option<Swing>,
    /// Time at which it landed \[s\].
    pub(super) landed: f64,
    pub(super) load: f64,
    /// Target of the ground below it \[m\], and its velocity \[m/s\].
    pub(super) target: (Vector3<f64>, Vector3<f64>),
    /// Number of its swings.
    pub(super) swings: u64,
    /// True if its sensor feels a contact; `None` where nothing is known.
    pub(super) touches: Option<bool>,
    /// End of its last swing by the gait \[s\].
    lands: f64,
    /// Beginning of the swing that a contact ended before its time \[s\].
    early: Option<f64>,
    /// True while it is still moved towards the ground after its swing.
    late: bool,
    /// Numbers of swings that ended before and after their time.
    pub(super) landings: [u64; 2],
}

/// Rounding of times, s.
const SAME: f64 = 1e-6;

impl Leg {
    /// A foot at rest at this place.
    pub(super) fn new(rest: Vector3<f64>, first: usize, place: Vector3<f64>) -> Self {
        Self {
            rest,
            first,
            place,
            axes: Rotation3::identity(),
            stood: place,
            swing: None,
            landed: f64::NEG_INFINITY,
            load: 1.0,
            target: (place, Vector3::zeros()),
            swings: 0,
            touches: None,
            lands: f64::NEG_INFINITY,
            early: None,
            late: false,
            landings: [0; 2],
        }
    }

    /// On the ground, at the beginning.
    pub(super) fn begin(&mut self, place: Vector3<f64>) {
        *self = Self { axes: self.axes, touches: self.touches, ..Self::new(self.rest, self.first, place) };
    }

    /// Beginning and end of the swing that it is in at `time` \[s\] as the gait has it, unless that has ended
    /// by a contact.
    pub(super) fn swing_at(&self, stepping: &Stepping, index: usize, time: f64) -> Option<(f64, f64)> {
        let early = |began: f64| self.early.is_some_and(|early| (early - began).abs() < SAME);
        stepping.swing(index, time).filter(|(began, _)| !early(*began))
    }

    /// True while it is moved on towards the ground after its swing.
    pub(super) fn is_late(&self) -> bool {
        self.late
    }

    /// Compares the gait with what is felt at `now`: ends a swing before its time, or moves the foot on after
    /// it.
    pub(super) fn watch(
        &mut self,
        (stepping, index): (&Stepping, usize),
        now: f64,
        landing: &Landing,
        ground: &GroundPlane,
    ) {
        match self.swing_at(stepping, index, now) {
            Some((began, lands)) => {
                if std::mem::take(&mut self.late) {
                    // it never touched: it swings on from where it is
                    self.swing = None;
                }
                self.lands = lands;
                let ripe = now >= began + landing.early_from * (lands - began);
                if self.touches == Some(true) && self.swing.is_some() && ripe {
                    self.early = Some(began);
                    self.landings[0] += 1;
                    self.land(now, self.place);
                }
            }
            None => {
                let Some(swing) = self.swing else { return };
                let over = now - self.lands;
                if self.touches == Some(false) && over < landing.search_for {
                    self.landings[1] += u64::from(!self.late);
                    self.late = true;
                    let down = -ground.normal() * landing.search_speed;
                    self.target = (swing.to + down * over.max(0.0), down);
                    return;
                }
                let late = std::mem::take(&mut self.late);
                let place = if late || self.touches == Some(true) { self.place } else { swing.to };
                self.land(now, place);
            }
        }
    }

    fn land(&mut self, now: f64, place: Vector3<f64>) {
        self.swing = None;
        self.landed = now;
        self.target = (place, Vector3::zeros());
    }
}
