//! Minimum distances of links from each other and from obstacles.

use motorium_robots::{CollisionModel, Collisions, Model, Proximity};
use nalgebra::Isometry3;

use super::{LimitRows, RowLimit};
use crate::RobotState;

/// Settings of a [`CollisionLimit`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CollisionSettings {
    /// Minimum distance \[m\]. Default 0.02.
    pub distance: f64,
    /// Distance within which pairs are considered \[m\]. Default 0.2.
    pub range: f64,
    /// Fraction of the remaining distance that may be covered per second \[1/s\]. Default 5.
    pub rate: f64,
    /// Maximum separation speed of pairs that are too close \[m/s\]. Default 0.01.
    pub recovery: f64,
    /// Largest number of pairs, the nearest ones. Default 16.
    pub pairs: usize,
}

/// Rows for the witnesses of the nearest pairs.
const WITNESSES: usize = 32;

impl Default for CollisionSettings {
    fn default() -> Self {
        Self { distance: 0.02, range: 0.2, rate: 5.0, recovery: 0.01, pairs: 16 }
    }
}

/// Slows down the approach of pairs of solids, of the robot or of robot and obstacle:
///
/// ```text
/// dd/dq v  >=  -min(rate, 1/dt) (d - distance)                    m/s, at most recovery
/// ```
///
/// with the distance `d` of a pair and its slope (Faverjon and Tournassoud, *A local based approach for path
/// planning of manipulators with a high number of degrees of freedom*, 1987). Pairs that are too close
/// separate at up to `recovery`, or stay if other limits prevent this. The motion of an obstacle is not part
/// of `dd/dq v`: the robot does not approach the obstacle, and evades it at up to `recovery`.
///
/// For pairs with flat faces or edges, the gradient at the nearest points does not cover the corner that is
/// nearest after the next step. The nearest pairs therefore have an additional row per
/// [witness](Collisions::witnesses), 32 in total: two pairs all of them, a third at least eight.
///
/// If only a [bound](Proximity::is_bound) of a distance is known, the solids neither approach each other
/// beyond it nor separate.
///
/// ```
/// use motorium_control::limits::{CollisionLimit, CollisionSettings, RowLimit};
/// use motorium_robots::{CollisionModel, CollisionOptions, Geometry, MeshMode, load};
/// use nalgebra::Isometry3;
///
/// let panda = load("panda", std::path::Path::new("."))?.model;
/// let mut solids = CollisionModel::new(&panda, &CollisionOptions::default())?;
/// let at = Isometry3::translation(0.6, 0.0, 0.3);
/// let ball = solids.add_obstacle("ball", at, Geometry::Sphere { radius: 0.1 }, MeshMode::default())?;
/// // the ball is the first object of the world, and moves
/// let mut limit = CollisionLimit::new(&panda, solids, CollisionSettings::default()).objects([(0, ball, Isometry3::identity())]);
/// limit.move_object(0, &Isometry3::translation(0.6, 0.2, 0.3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct CollisionLimit {
    settings: CollisionSettings,
    collisions: CollisionModel,
    workspace: Collisions,
    nearest: Vec<Proximity>,
    witnesses: Vec<Proximity>,
    row: Vec<f64>,
    /// Objects of the world that move, each with its solid.
    objects: Vec<(usize, usize, Isometry3<f64>)>,
}

impl CollisionLimit {
    /// Creates a limit for the pairs of `collisions`, built for `model`.
    pub fn new(model: &Model, collisions: CollisionModel, settings: CollisionSettings) -> Self {
        Self {
            settings,
            workspace: Collisions::new(&collisions),
            nearest: Vec::with_capacity(collisions.pairs().len()),
            witnesses: Vec::with_capacity(WITNESSES),
            row: vec![0.0; model.nv()],
            objects: Vec::new(),
            collisions,
        }
    }

    /// The same limit with obstacles that [`move_object`](RowLimit::move_object) moves: index of the object
    /// in the world, of its solid in the collision model, and frame of the solid in the object.
    #[must_use]
    pub fn objects(mut self, objects: impl IntoIterator<Item = (usize, usize, Isometry3<f64>)>) -> Self {
        self.objects = objects.into_iter().collect();
        self
    }
}

impl RowLimit for CollisionLimit {
    fn rows(&self) -> usize {
        self.settings.pairs + WITNESSES
    }

    fn write(&mut self, state: &RobotState<'_>, dt: f64, rows: &mut LimitRows<'_>) {
        let Self { settings, collisions, workspace, nearest, witnesses, row, .. } = self;
        workspace.update(collisions, state.kinematics);
        nearest.clear();
        nearest.extend_from_slice(workspace.within(collisions, settings.range));
        nearest.sort_unstable_by(|a, b| a.distance.total_cmp(&b.distance));
        let nearest = &nearest[..nearest.len().min(settings.pairs)];
        witnesses.clear();
        for pair in nearest {
            workspace.witnesses(collisions, pair, WITNESSES - witnesses.len(), witnesses);
        }
        let rate = settings.rate.min(dt.recip());
        for points in nearest.iter().chain(&*witnesses) {
            collisions.distance_jacobian(state.model, state.kinematics, points, row);
            let left = points.distance - settings.distance;
            // a bound may be far below the distance and is no reason to separate
            let left = if points.is_bound { left.max(0.0) } else { left };
            rows.push_barrier(row.iter().copied(), left, rate, settings.recovery);
        }
    }

    fn smallest_distance(&self) -> Option<f64> {
        self.nearest.iter().find(|pair| !pair.is_bound).map(|pair| pair.distance)
    }

    fn move_object(&mut self, object: usize, pose: &Isometry3<f64>) {
        for (_, solid, frame) in self.objects.iter().filter(|(moved, ..)| *moved == object) {
            self.workspace.move_obstacle(&self.collisions, *solid, &(pose * frame));
        }
    }
}
