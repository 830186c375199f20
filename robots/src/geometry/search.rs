//! Searches for the nearest points of two cores: the algorithm of Gilbert, Johnson and Keerthi (parry's) with
//! restarts, the expanding polytope for overlaps, and a closed form for segments.

use super::depth::Polytope;
use super::support::Placed;
use crate::math::{V3, v3, vector};
use parry3d_f64::query::gjk::{CsoPoint, GJKResult, VoronoiSimplex, closest_points};

/// Distance below which the direction between two points is noise \[m\].
pub(super) const TOUCHING: f64 = 1e-9;

/// Acceptable gap between a distance and its proven lower bound \[m\], and the maximum number of restarts.
const SETTLED: f64 = 1e-9;
const AGAIN: usize = 4;

/// Maximum number of alternating projections between the cores.
const ALTERNATIONS: usize = 30;

/// The result of a search.
pub(super) enum Search {
    /// Points of both cores and the normal from the first to the second.
    Found(V3, V3, V3),
    /// The distance exceeds the range.
    Farther,
    /// The search does not converge from any start.
    Lost,
}

/// Finds the nearest (or deepest) points of two cores.
pub(super) fn search(
    simplex: &mut VoronoiSimplex,
    polytope: &mut Polytope,
    pair: &[Placed<'_>; 2],
    range: f64,
    hint: V3,
) -> Search {
    let still = parry3d_f64::math::Pose::IDENTITY;
    let [first, second] = pair;
    let (x, y) = (V3::new(1.0, 0.0, 0.0), V3::new(0.3, 1.0, -0.2));
    for start in [hint, second.position, x, y].into_iter().filter(|start| start.dot(*start) > 0.0) {
        let start = start * (1.0 / start.dot(start).sqrt());
        simplex.reset(CsoPoint::from_shapes(&still, first, second, vector(start)));
        match closest_points(&still, first, second, range, true, simplex) {
            GJKResult::ClosestPoints(p, q, along) => {
                let (p, q) = (v3(p), v3(q));
                let way = q - p;
                let gap = way.dot(way).sqrt();
                if gap <= TOUCHING {
                    return Search::Found(p, q, v3(along));
                }
                return settle(simplex, pair, (p, q, gap));
            }
            GJKResult::Intersection => {
                return polytope
                    .search(pair)
                    .map_or(Search::Lost, |(p, q, normal)| Search::Found(p, q, normal));
            }
            // Also returned if the search gives up; only a gap along the direction is a proof.
            GJKResult::NoIntersection(along) => {
                if -along.dot(CsoPoint::from_shapes(&still, first, second, along).point) > range {
                    return Search::Farther;
                }
            }
            GJKResult::Proximity(_) => {}
        }
    }
    Search::Lost
}

/// Continues a search that stopped early. On round cores the simplex shrinks until rounding stops the search
/// some micrometres short. A plane normal to the direction detects this; a restart without the old corners
/// continues.
fn settle(simplex: &mut VoronoiSimplex, pair: &[Placed<'_>; 2], found: (V3, V3, f64)) -> Search {
    let still = parry3d_f64::math::Pose::IDENTITY;
    let [first, second] = pair;
    let (mut p, mut q, mut gap) = found;
    // Alternating projections converge (Cheney and Goldstein 1959).
    for _ in 0..ALTERNATIONS {
        let Some(a) = first.project(q) else { break };
        let Some(b) = second.project(a) else { break };
        let nearer = (b - a).dot(b - a).sqrt();
        if nearer >= gap || nearer <= TOUCHING {
            break;
        }
        let gain = gap - nearer;
        (p, q, gap) = (a, b, nearer);
        if gain < 1e-13 {
            break;
        }
    }
    for _ in 0..AGAIN {
        let normal = (q - p) * (1.0 / gap);
        let outmost = CsoPoint::from_shapes(&still, first, second, vector(normal));
        if gap + v3(outmost.point).dot(normal) <= SETTLED {
            break;
        }
        simplex.reset(outmost);
        let GJKResult::ClosestPoints(a, b, _) =
            closest_points(&still, first, second, f64::MAX, true, simplex)
        else {
            break;
        };
        let (a, b) = (v3(a), v3(b));
        let nearer = (b - a).dot(b - a).sqrt();
        if nearer >= gap || nearer <= TOUCHING {
            break;
        }
        (p, q, gap) = (a, b, nearer);
    }
    Search::Found(p, q, (q - p) * (1.0 / gap))
}

/// Returns the nearest points of two segments along the z axes of their frames, or of points (Ericson 2005,
/// section 5.1.9).
pub(super) fn lines([first, second]: &[Placed<'_>; 2], half: f64, other: f64) -> (V3, V3, V3) {
    let (u, v) = (first.rotation.z, second.rotation.z);
    let r = first.position - second.position;
    let (b, c, f) = (u.dot(v), u.dot(r), v.dot(r));
    // Along unit directions, s in -half .. half and t in -other .. other.
    let denominator = 1.0 - b * b;
    let mut s = if denominator > 1e-12 { ((b * f - c) / denominator).clamp(-half, half) } else { 0.0 };
    let mut t = b * s + f;
    if t.abs() > other {
        t = t.clamp(-other, other);
        s = (b * t - c).clamp(-half, half);
    } else if denominator <= 1e-12 {
        // Parallel: any s that keeps t inside.
        s = (b * t - c).clamp(-half, half);
    }
    let (p, q) = (first.position + u * s, second.position + v * t);
    let way = q - p;
    let gap = way.dot(way).sqrt();
    if gap > 1e-12 {
        return (p, q, way * (1.0 / gap));
    }
    // The segments cross: separate along their common normal.
    let mut normal = u.cross(v);
    if normal.dot(normal) < 1e-12 {
        let least = if u.x.abs() < 0.6 { V3::new(1.0, 0.0, 0.0) } else { V3::new(0.0, 1.0, 0.0) };
        normal = u.cross(least);
    }
    (p, q, normal * (1.0 / normal.dot(normal).sqrt()))
}
