//! State of one leg: positions, swings, and early or late touchdown.

use motorium_control::with_defaults;
use motorium_robots::FrameId;
use nalgebra::{Rotation3, Vector3};

use super::{GroundPlane, Stepping, Swing};

/// A foot of a [`LegPlanner`](super::LegPlanner).
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedFoot {
    /// Frame of the foot.
    pub frame: FrameId,
    /// Contact points in the axes of the frame, relative to the ground point below the frame's origin \[m\]:
    /// the corners of a sole, or one point at zero.
    pub points: Vec<Vector3<f64>>,
    /// Distance from the frame's origin down to the ground \[m\]: the radius of a ball-shaped foot.
    pub radius: f64,
    /// Coefficient of friction.
    pub friction: f64,
}

with_defaults! {
    /// Reaction to early and late touchdown, if contacts are measured.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Landing;

    /// Fraction of a swing after which a contact ends the swing, 0 to 1. Default 0.5.
    pub early_from: f64 = 0.5;
    /// Speed at which a foot without contact at the end of its swing is lowered to find the ground \[m/s\].
    /// Default 0.3.
    pub search_speed: f64 = 0.3;
    /// Maximum duration of the search for the ground \[s\], after which the foot counts as standing. Default
    /// 0.08.
    pub search_for: f64 = 0.08;
}

/// State of a leg.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    /// Rest position of the ground below the foot, from the centre of mass, in heading axes \[m\].
    pub(super) rest: Vector3<f64>,
    /// Index of the foot's first point among the points of all feet.
    pub(super) first: usize,
    /// Position of the ground below the foot \[m\], and the orientation of its frame.
    pub(super) place: Vector3<f64>,
    pub(super) axes: Rotation3<f64>,
    /// Last stance position \[m\].
    pub(super) stood: Vector3<f64>,
    pub(super) swing: Option<Swing>,
    /// Time of touchdown \[s\].
    pub(super) landed: f64,
    pub(super) load: f64,
    /// Target position of the ground below the foot \[m\], and its velocity \[m/s\].
    pub(super) target: (Vector3<f64>, Vector3<f64>),
    /// Number of swings.
    pub(super) swings: u64,
    /// `true` if the foot's sensor detects a contact; `None` if unknown.
    pub(super) touches: Option<bool>,
    /// End of the last swing according to the gait \[s\].
    lands: f64,
    /// Start of the swing that an early contact ended \[s\].
    early: Option<f64>,
    /// `true` while the foot searches for the ground after its swing.
    late: bool,
    /// Number of early and late touchdowns.
    pub(super) landings: [u64; 2],
}

/// Tolerance for rounding of times, s.
const SAME: f64 = 1e-6;

impl Leg {
    /// Creates a foot at rest at this position.
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

    /// Starts on the ground.
    pub(super) fn begin(&mut self, place: Vector3<f64>) {
        *self = Self { axes: self.axes, touches: self.touches, ..Self::new(self.rest, self.first, place) };
    }

    /// Returns start and end of the swing at `time` \[s\] according to the gait, unless a contact has ended
    /// the swing.
    pub(super) fn swing_at(&self, stepping: &Stepping, index: usize, time: f64) -> Option<(f64, f64)> {
        let early = |began: f64| self.early.is_some_and(|early| (early - began).abs() < SAME);
        stepping.swing(index, time).filter(|(began, _)| !early(*began))
    }

    /// Returns `true` while the foot searches for the ground after its swing.
    pub(super) fn is_late(&self) -> bool {
        self.late
    }

    /// Compares the gait with the measured contact at `now`: ends a swing early, or extends it.
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
                    // it never touched the ground, so the next swing starts at its current position
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
