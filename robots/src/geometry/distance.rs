//! Workspace for the distances between the pairs of solids in a collision model.

use super::depth::Polytope;
use super::pairs::CollisionModel;
use super::search::{Search, TOUCHING, lines, search};
use super::solid::pose;
use super::support::Placed;
use super::witness_room::WitnessRoom;
use crate::Kinematics;
use crate::math::{M3, V3, v3};
use nalgebra::{Isometry3, IsometryMatrix3, Point3, Rotation3, Unit, Vector3};
use parry3d_f64::query::gjk::VoronoiSimplex;
use parry3d_f64::query::{ClosestPoints, DefaultQueryDispatcher, QueryDispatcher};

/// Signed distance between two solids, with the nearest points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proximity {
    /// Index of the pair of solids in [`CollisionModel::pairs`].
    pub pair: usize,
    /// Signed distance \[m\]: the gap, or the negative penetration depth.
    pub distance: f64,
    /// For each solid, its point nearest to the other solid, in the world \[m\]. If the solids overlap, the
    /// point of each solid that is deepest inside the other solid.
    pub points: [Point3<f64>; 2],
    /// Unit vector from the first to the second solid, in world axes, such that `distance == normal .
    /// (points[1] - points[0])`.
    pub normal: Unit<Vector3<f64>>,
    /// `true` if the search for the nearest points failed. In this case, `distance` is only a lower bound,
    /// computed from the bounding spheres, or NaN. `points` and `normal` then refer to the bounding spheres.
    pub is_bound: bool,
}

/// Workspace for the distances between the solids of one [`CollisionModel`]. Only [`new`](Self::new)
/// allocates, except for pairs with a [`MeshMode::Surface`](super::MeshMode).
pub struct Collisions {
    pub(super) rotations: Vec<M3>,
    pub(super) positions: Vec<V3>,
    /// Direction from the first to the second solid of each pair, from the last measurement.
    hints: Vec<V3>,
    near: Vec<Proximity>,
    /// The pair that was nearest in the last search.
    last: usize,
    simplex: VoronoiSimplex,
    polytope: Polytope,
    pub(super) room: WitnessRoom,
}

impl Collisions {
    /// Creates a workspace for `model`. Obstacles are at their initial poses. Solids of the robot have no
    /// valid pose before the first [`update`](Self::update).
    pub fn new(model: &CollisionModel) -> Self {
        Self {
            rotations: model.solids.iter().map(|solid| solid.rotation).collect(),
            positions: model.solids.iter().map(|solid| solid.position).collect(),
            hints: vec![V3::ZERO; model.pairs.len()],
            near: Vec::with_capacity(model.pairs.len()),
            last: 0,
            simplex: VoronoiSimplex::new(),
            polytope: Polytope::new(),
            room: WitnessRoom::new(),
        }
    }

    /// Places the robot's solids according to `kinematics`, whose last update must have covered all bodies.
    /// If the model contains several robots, only the first robot is placed.
    pub fn update(&mut self, model: &CollisionModel, kinematics: &Kinematics) {
        self.update_robot(model, 0, kinematics);
    }

    /// Moves the obstacle with solid index `index` to `pose` in the world. This pose replaces the obstacle's
    /// initial placement.
    ///
    /// Panics if `index` is not an obstacle.
    pub fn move_obstacle(&mut self, model: &CollisionModel, index: usize, pose: &Isometry3<f64>) {
        assert!(model.is_obstacle(index), "solid {index} belongs to the robot");
        // The frames of hulls and fitted capsules are at their own centre; their offset from the file's frame
        // is kept.
        let solid = &model.solids[index];
        let original = &model.obstacle_frames[index - model.robot_solids];
        let (r, p) = (nalgebra::Matrix3::from(solid.rotation), Vector3::from(solid.position));
        let inverse = original.inverse();
        let rotation = pose.rotation * inverse.rotation;
        self.rotations[index] = (rotation.to_rotation_matrix().into_inner() * r).into();
        self.positions[index] = (pose * inverse * Point3::from(p)).coords.into();
    }

    /// Sets the pose of any solid in the world directly, without [`update`](Self::update). `pose` is the pose
    /// of the solid's [placement](CollisionModel::placement).
    pub fn set_pose(&mut self, index: usize, pose: &Isometry3<f64>) {
        self.rotations[index] = pose.rotation.to_rotation_matrix().into_inner().into();
        self.positions[index] = pose.translation.vector.into();
    }

    /// Returns the pose of solid `index` in the world: the pose of its
    /// [placement](CollisionModel::placement).
    pub fn pose(&self, index: usize) -> IsometryMatrix3<f64> {
        let rotation = Rotation3::from_matrix_unchecked(self.rotations[index].into());
        IsometryMatrix3::from_parts(Vector3::from(self.positions[index]).into(), rotation)
    }

    /// Returns the position \[m\] of the origin of solid `index` in the world.
    pub fn position(&self, index: usize) -> Vector3<f64> {
        self.positions[index].into()
    }

    /// Resets the search directions, so that the next distances depend only on the poses.
    pub fn forget(&mut self) {
        self.hints.fill(V3::ZERO);
        self.last = 0;
    }

    /// Returns the search directions of the last distance computations, one per pair, with which the next
    /// searches start. These hints and the poses together determine the next distances bit for bit.
    pub fn hints(&self) -> Vec<[f64; 3]> {
        self.hints.iter().map(|hint| hint.array()).collect()
    }

    /// Restores search directions that [`hints`](Self::hints) returned earlier.
    pub fn set_hints(&mut self, hints: &[[f64; 3]]) {
        assert_eq!(hints.len(), self.hints.len(), "one direction per pair");
        for (hint, given) in self.hints.iter_mut().zip(hints) {
            *hint = V3::from_slice(given);
        }
    }

    /// Returns the distance between the solids of the pair with index `pair`. Returns `None` if this distance
    /// is certainly above `range` \[m\].
    pub fn distance_within(&mut self, model: &CollisionModel, pair: usize, range: f64) -> Option<Proximity> {
        self.measure(model, pair, range)
    }

    /// Returns the distance between the solids of the pair with index `pair`.
    pub fn distance(&mut self, model: &CollisionModel, pair: usize) -> Proximity {
        // no distance exceeds this range; only surfaces can fail
        self.measure(model, pair, f64::MAX).unwrap_or_else(|| self.bound(model, pair))
    }

    /// Returns all pairs that are closer than `range` \[m\], in the order of [`CollisionModel::pairs`]. Pairs
    /// that are far apart cost little time.
    pub fn within(&mut self, model: &CollisionModel, range: f64) -> &[Proximity] {
        self.near.clear();
        for pair in 0..model.pairs.len() {
            if let Some(proximity) = self.measure(model, pair, range)
                && (proximity.distance <= range || proximity.distance.is_nan())
            {
                self.near.push(proximity);
            }
        }
        &self.near
    }

    /// Returns the pairs found by the last call of [`within`](Self::within).
    pub fn found(&self) -> &[Proximity] {
        &self.near
    }

    /// Returns the pair with the smallest signed distance; `None` if there are no pairs to check.
    pub fn nearest(&mut self, model: &CollisionModel) -> Option<Proximity> {
        if model.pairs.is_empty() {
            return None;
        }
        // The previous nearest pair is probably still near, and its distance excludes most others by their
        // bounding spheres.
        let mut best = self.distance(model, self.last);
        for pair in 0..model.pairs.len() {
            if pair != best.pair
                && let Some(proximity) = self.measure(model, pair, best.distance)
                && proximity.distance < best.distance
            {
                best = proximity;
            }
        }
        self.last = best.pair;
        Some(best)
    }

    /// Returns a pair that is closer than `margin` \[m\] or overlaps; `None` if there is no such pair.
    pub fn colliding(&mut self, model: &CollisionModel, margin: f64) -> Option<Proximity> {
        (0..model.pairs.len()).find_map(|pair| {
            self.measure(model, pair, margin).filter(|proximity| proximity.distance < margin)
        })
    }

    /// Returns the distance of a pair unless it is certainly above `range`.
    fn measure(&mut self, model: &CollisionModel, pair: usize, range: f64) -> Option<Proximity> {
        let [a, b] = model.pairs[pair];
        let (first, second) = (&model.solids[a], &model.solids[b]);
        let between = self.positions[b] - self.positions[a];
        let apart = between.dot(between).sqrt();
        if apart - first.reach - second.reach > range {
            return None;
        }
        if !apart.is_finite() {
            return Some(Proximity { distance: f64::NAN, ..self.bound(model, pair) });
        }
        if first.is_half_space() || second.is_half_space() {
            return Some(self.measure_half_space(model, pair));
        }
        if first.is_surface() || second.is_surface() {
            return self.measure_surfaces(model, pair, range);
        }
        let radii = first.radius + second.radius;
        let origin = self.positions[a];
        let placed = [
            Placed { core: &first.core, rotation: &self.rotations[a], position: V3::ZERO },
            Placed { core: &second.core, rotation: &self.rotations[b], position: between },
        ];
        let (p, q, normal) = match (first.core.line(), second.core.line()) {
            (Some(half), Some(other)) => lines(&placed, half, other),
            _ => {
                let range = if range < 1e100 { (range + radii).max(0.0) } else { f64::MAX };
                let (simplex, polytope, hint) = (&mut self.simplex, &mut self.polytope, self.hints[pair]);
                match search(simplex, polytope, &placed, range, hint) {
                    Search::Found(p, q, normal) => (p, q, normal),
                    Search::Farther => return None,
                    Search::Lost => return Some(self.bound(model, pair)),
                }
            }
        };
        self.hints[pair] = normal;
        let points = [origin + p + normal * first.radius, origin + q - normal * second.radius];
        Some(Proximity {
            pair,
            distance: (q - p).dot(normal) - radii,
            points: points.map(|point| Point3::from(Vector3::from(point))),
            normal: Unit::new_unchecked(normal.into()),
            is_bound: false,
        })
    }

    /// Returns the distance of a solid from a half-space, determined by the solid's farthest point along the
    /// inward normal.
    fn measure_half_space(&self, model: &CollisionModel, pair: usize) -> Proximity {
        let [a, b] = model.pairs[pair];
        let first_is_plane = model.solids[a].is_half_space();
        let (plane, solid) = if first_is_plane { (a, b) } else { (b, a) };
        let (up, body) = (self.rotations[plane].z, &model.solids[solid]);
        let placed = Placed { core: &body.core, rotation: &self.rotations[solid], position: V3::ZERO };
        let lowest = self.positions[solid] + placed.farthest(-up) - up * body.radius;
        let distance = (lowest - self.positions[plane]).dot(up);
        let foot = lowest - up * distance;
        let (points, normal) = if first_is_plane { ([foot, lowest], up) } else { ([lowest, foot], -up) };
        Proximity {
            pair,
            distance,
            points: points.map(|point| Point3::from(Vector3::from(point))),
            normal: Unit::new_unchecked(normal.into()),
            is_bound: false,
        }
    }

    /// Returns the distance of a pair with a surface, by parry.
    fn measure_surfaces(&mut self, model: &CollisionModel, pair: usize, range: f64) -> Option<Proximity> {
        let [a, b] = model.pairs[pair];
        let (first, second) = (model.shape(a)?, model.shape(b)?);
        let placed = [a, b].map(|solid| pose(&self.rotations[solid], self.positions[solid]));
        let between = placed[0].inv_mul(&placed[1]);
        let range = range.max(0.0);
        let near = DefaultQueryDispatcher.closest_points(&between, &**first, &**second, range).ok()?;
        let (p, q, normal) = match near {
            ClosestPoints::Disjoint => return None,
            ClosestPoints::WithinMargin(p, q) if (placed[0] * p - placed[1] * q).length() > TOUCHING => {
                let (p, q) = (v3(placed[0] * p), v3(placed[1] * q));
                let way = q - p;
                (p, q, way * (1.0 / way.dot(way).sqrt()))
            }
            _ => {
                let contact =
                    DefaultQueryDispatcher.contact(&between, &**first, &**second, TOUCHING).ok()??;
                let normal = placed[0].rotation * contact.normal1;
                (v3(placed[0] * contact.point1), v3(placed[1] * contact.point2), v3(normal))
            }
        };
        let points = [p, q].map(|point| Point3::from(Vector3::from(point)));
        Some(Proximity {
            pair,
            distance: (q - p).dot(normal),
            points,
            normal: Unit::new_unchecked(normal.into()),
            is_bound: false,
        })
    }

    /// Returns a lower bound of the distance from bounding spheres.
    fn bound(&self, model: &CollisionModel, pair: usize) -> Proximity {
        let [a, b] = model.pairs[pair];
        let (first, second) = (model.solids[a].reach, model.solids[b].reach);
        let between = self.positions[b] - self.positions[a];
        let apart = between.dot(between).sqrt();
        let normal = if apart > TOUCHING { between * (1.0 / apart) } else { V3::new(1.0, 0.0, 0.0) };
        let points = [self.positions[a] + normal * first, self.positions[b] - normal * second];
        Proximity {
            pair,
            distance: apart - first - second,
            points: points.map(|point| Point3::from(Vector3::from(point))),
            normal: Unit::new_unchecked(normal.into()),
            is_bound: true,
        }
    }
}
