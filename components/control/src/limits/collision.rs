//! Links keep their distance from one another, and from obstacles.

use motorium_robots::{CollisionModel, Collisions, Model, Proximity};

use super::{LimitRows, RowLimit};
use crate::RobotState;

/// Settings of a [`CollisionLimit`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CollisionSettings {
    /// Distance that is kept \[m\]. Default 0.02.
    pub distance: f64,
    /// Distance within which pairs are considered \[m\]. Default 0.2.
    pub range: f64,
    /// Share of what is left of a distance that may be covered per second \[1/s\]. Default 5.
    pub rate: f64,
    /// Largest number of pairs, the nearest ones. Default 16.
    pub pairs: usize,
}

impl Default for CollisionSettings {
    fn default() -> Self {
        Self { distance: 0.02, range: 0.2, rate: 5.0, pairs: 16 }
    }
}

/// Pairs of solids of the robot, and of the robot and obstacles, approach each other ever more slowly:
///
/// ```text
/// dd/dq v  >=  -min(rate, 1/dt) max(d - distance, 0)
/// ```
///
/// with the distance `d` of a pair and its slope (Faverjon and Tournassoud, *A local based approach for path planning of
/// manipulators with a high number of degrees of freedom*, 1987). Pairs that are too near may stay or part, not approach.
pub struct CollisionLimit {
    settings: CollisionSettings,
    collisions: CollisionModel,
    workspace: Collisions,
    nearest: Vec<Proximity>,
    row: Vec<f64>,
}

impl CollisionLimit {
    /// A limit for the pairs of `collisions`, which is that of `model`.
    pub fn new(model: &Model, collisions: CollisionModel, settings: CollisionSettings) -> Self {
        Self {
            settings,
            workspace: Collisions::new(&collisions),
            nearest: Vec::with_capacity(collisions.pairs().len()),
            row: vec![0.0; model.nv()],
            collisions,
        }
    }

    /// The smallest distance of the pairs at the last tick \[m\]; `None` if all were beyond the range.
    pub fn smallest(&self) -> Option<f64> {
        self.nearest.first().map(|pair| pair.distance)
    }
}

impl RowLimit for CollisionLimit {
    fn rows(&self) -> usize {
        self.settings.pairs
    }

    fn write(&mut self, state: &RobotState<'_>, dt: f64, rows: &mut LimitRows<'_>) {
        let Self { settings, collisions, workspace, nearest, row } = self;
        workspace.update(collisions, state.kinematics);
        nearest.clear();
        nearest.extend_from_slice(workspace.within(collisions, settings.range));
        nearest.sort_unstable_by(|a, b| a.distance.total_cmp(&b.distance));
        let rate = settings.rate.min(dt.recip());
        for pair in nearest.iter().take(settings.pairs) {
            collisions.distance_jacobian(state.model, state.kinematics, pair, row);
            let left = (pair.distance - settings.distance).max(0.0);
            rows.push(row.iter().copied(), -rate * left, f64::INFINITY);
        }
    }
}
