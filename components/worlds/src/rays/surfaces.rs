//! Intersections of rays with shapes centred at the origin, for rays that start outside the shape.

use motorium_robots::V3;

/// Distance along the ray to the surface, and the outward normal there.
pub(super) type Meeting = Option<(f64, V3)>;

#[inline(always)]
pub(super) fn sphere(origin: V3, direction: V3, radius: f64) -> Meeting {
    // From the point nearest to the centre, which stays accurate at large distances.
    let along = -origin.dot(direction);
    let nearest = origin + direction * along;
    let square = radius * radius - nearest.dot(nearest);
    if square <= 0.0 {
        return None;
    }
    let distance = along - square.sqrt();
    (distance > 0.0).then(|| (distance, (origin + direction * distance) * (1.0 / radius)))
}

#[inline(always)]
pub(super) fn block(origin: V3, direction: V3, half: V3) -> Meeting {
    let slab = |origin: f64, direction: f64, half: f64| -> (f64, f64) {
        if direction == 0.0 {
            return if origin.abs() < half {
                (f64::NEG_INFINITY, f64::INFINITY)
            } else {
                (f64::INFINITY, f64::NEG_INFINITY)
            };
        }
        let inverse = 1.0 / direction;
        let (near, far) = (half.copysign(-direction) - origin, half.copysign(direction) - origin);
        (near * inverse, far * inverse)
    };
    let (x, y, z) = (
        slab(origin.x, direction.x, half.x),
        slab(origin.y, direction.y, half.y),
        slab(origin.z, direction.z, half.z),
    );
    let (enter, leave) = (x.0.max(y.0).max(z.0), x.1.min(y.1).min(z.1));
    if enter <= 0.0 || enter >= leave {
        return None;
    }
    let normal = if enter == x.0 {
        V3::new(-direction.x.signum(), 0.0, 0.0)
    } else if enter == y.0 {
        V3::new(0.0, -direction.y.signum(), 0.0)
    } else {
        V3::new(0.0, 0.0, -direction.z.signum())
    };
    Some((enter, normal))
}

/// Returns the distances at which the ray enters and leaves the infinite cylinder along z.
#[inline(always)]
fn tube(origin: V3, direction: V3, radius: f64) -> Option<(f64, f64)> {
    let slope = direction.x * direction.x + direction.y * direction.y;
    if slope < 1e-24 {
        let inside = origin.x * origin.x + origin.y * origin.y < radius * radius;
        return inside.then_some((f64::NEG_INFINITY, f64::INFINITY));
    }
    let along = -(origin.x * direction.x + origin.y * direction.y) / slope;
    let (x, y) = (origin.x + direction.x * along, origin.y + direction.y * along);
    let square = (radius * radius - x * x - y * y) / slope;
    if square <= 0.0 {
        return None;
    }
    let half = square.sqrt();
    Some((along - half, along + half))
}

#[inline(always)]
pub(super) fn cylinder(origin: V3, direction: V3, radius: f64, half: f64) -> Meeting {
    let (enter, leave) = tube(origin, direction, radius)?;
    let (low, high) = if direction.z == 0.0 {
        if origin.z.abs() >= half {
            return None;
        }
        (f64::NEG_INFINITY, f64::INFINITY)
    } else {
        let inverse = 1.0 / direction.z;
        let ends = (
            (half.copysign(-direction.z) - origin.z) * inverse,
            (half.copysign(direction.z) - origin.z) * inverse,
        );
        (ends.0, ends.1)
    };
    let distance = enter.max(low);
    if distance <= 0.0 || distance >= leave.min(high) {
        return None;
    }
    let normal = if enter > low {
        let point = origin + direction * distance;
        V3::new(point.x / radius, point.y / radius, 0.0)
    } else {
        V3::new(0.0, 0.0, -direction.z.signum())
    };
    Some((distance, normal))
}

#[inline(always)]
pub(super) fn capsule(origin: V3, direction: V3, radius: f64, half: f64) -> Meeting {
    let centre = V3::new(0.0, 0.0, origin.z.clamp(-half, half));
    let out = origin - centre;
    if out.dot(out) <= radius * radius {
        return None;
    }
    if let Some((enter, _)) = tube(origin, direction, radius).filter(|(enter, _)| *enter > 0.0) {
        let point = origin + direction * enter;
        if point.z.abs() <= half {
            return Some((enter, V3::new(point.x / radius, point.y / radius, 0.0)));
        }
    }
    let end = |z: f64| sphere(origin - V3::new(0.0, 0.0, z), direction, radius);
    match (end(-half), end(half)) {
        (Some(low), Some(high)) => Some(if low.0 < high.0 { low } else { high }),
        (low, high) => low.or(high),
    }
}

#[inline(always)]
pub(super) fn half_space(origin: V3, direction: V3) -> Meeting {
    if origin.z <= 0.0 || direction.z >= 0.0 {
        return None;
    }
    Some((-origin.z / direction.z, V3::new(0.0, 0.0, 1.0)))
}

/// Intersects the convex body below all planes, each given by its unit normal and the height along it.
#[inline(always)]
pub(super) fn polytope(origin: V3, direction: V3, planes: &[(V3, f64)]) -> Meeting {
    let (mut enter, mut leave) = (0.0, f64::INFINITY);
    let mut normal = None;
    for (outward, height) in planes {
        let (slope, above) = (outward.dot(direction), outward.dot(origin) - height);
        if slope < 0.0 {
            let distance = -above / slope;
            if distance > enter {
                (enter, normal) = (distance, Some(*outward));
            }
        } else if slope > 0.0 {
            leave = f64::min(leave, -above / slope);
        } else if above >= 0.0 {
            return None;
        }
        if enter >= leave {
            return None;
        }
    }
    Some((enter, normal?))
}
