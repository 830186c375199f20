//! Painting order of faces, so that nearer ones cover farther ones: a binary space partition. Faces that
//! cross the plane of another face are cut by it, so an order exists even for intersecting bodies (Fuchs,
//! Kedem, Naylor, "On Visible Surface Generation by a Priori Tree Structures", SIGGRAPH 1980).

use nalgebra::{Point3, Vector3};

use super::solid::Face;

/// Distance from a plane within which a point is treated as on it \[m\].
const THICKNESS: f64 = 1e-6;

/// Number of faces tried as dividing plane.
const CANDIDATES: usize = 8;

/// Returns the faces, cut if necessary, farthest first, for a distant camera in direction `eye`.
pub(super) fn back_to_front(faces: Vec<Face>, eye: &Vector3<f64>) -> Vec<Face> {
    let mut painted = Vec::with_capacity(2 * faces.len());
    paint(faces, eye, &mut painted);
    painted
}

/// The next task: divide faces, or emit the faces of a plane.
enum Step {
    Divide(Vec<Face>),
    Put(Vec<Face>),
}

fn paint(faces: Vec<Face>, eye: &Vector3<f64>, painted: &mut Vec<Face>) {
    let mut steps = vec![Step::Divide(faces)];
    while let Some(step) = steps.pop() {
        let mut faces = match step {
            Step::Put(faces) => {
                painted.extend(faces);
                continue;
            }
            Step::Divide(faces) if faces.len() < 2 => {
                painted.extend(faces);
                continue;
            }
            Step::Divide(faces) => faces,
        };
        let divider = faces.swap_remove(best_divider(&faces));
        let (origin, normal) = (divider.points[0], divider.normal);
        let (mut before, mut behind, mut within) = (Vec::new(), Vec::new(), vec![divider]);
        for face in faces {
            sort(face, &origin, &normal, &mut before, &mut behind, &mut within);
        }
        // The side of the camera is painted last, so it is pushed first.
        let (near, far) = if normal.dot(eye) >= 0.0 { (before, behind) } else { (behind, before) };
        steps.extend([Step::Divide(near), Step::Put(within), Step::Divide(far)]);
    }
}

/// Returns the candidate that cuts the fewest faces and divides them evenly.
fn best_divider(faces: &[Face]) -> usize {
    let stride = (faces.len() / CANDIDATES).max(1);
    let cost = |index: &usize| {
        let (origin, normal) = (&faces[*index].points[0], &faces[*index].normal);
        let (mut cuts, mut before, mut behind) = (0_i64, 0_i64, 0_i64);
        for face in faces {
            match sides(face, origin, normal) {
                (true, true) => cuts += 1,
                (true, false) => before += 1,
                (false, true) => behind += 1,
                (false, false) => {}
            }
        }
        8 * cuts + (before - behind).abs()
    };
    (0..faces.len()).step_by(stride).min_by_key(cost).unwrap_or(0)
}

/// Returns two flags: parts are in front of the plane, parts are behind it.
fn sides(face: &Face, origin: &Point3<f64>, normal: &Vector3<f64>) -> (bool, bool) {
    face.points
        .iter()
        .map(|point| normal.dot(&(point - origin)))
        .fold((false, false), |(before, behind), height| {
            (before || height > THICKNESS, behind || height < -THICKNESS)
        })
}

fn sort(
    face: Face,
    origin: &Point3<f64>,
    normal: &Vector3<f64>,
    before: &mut Vec<Face>,
    behind: &mut Vec<Face>,
    within: &mut Vec<Face>,
) {
    match sides(&face, origin, normal) {
        (false, false) => within.push(face),
        (true, false) => before.push(face),
        (false, true) => behind.push(face),
        (true, true) => {
            let (upper, lower) = cut(&face, origin, normal);
            before.extend(upper);
            behind.extend(lower);
        }
    }
}

/// Returns the parts of a convex face in front of and behind a plane.
fn cut(face: &Face, origin: &Point3<f64>, normal: &Vector3<f64>) -> (Option<Face>, Option<Face>) {
    let (mut upper, mut lower) = (Vec::new(), Vec::new());
    let height = |point: &Point3<f64>| normal.dot(&(point - origin));
    for (here, next) in face.points.iter().zip(face.points.iter().cycle().skip(1)) {
        let (from, to) = (height(here), height(next));
        if from >= -THICKNESS {
            upper.push(*here);
        }
        if from <= THICKNESS {
            lower.push(*here);
        }
        if from.abs() > THICKNESS && to.abs() > THICKNESS && (from > 0.0) != (to > 0.0) {
            let middle = here + (next - here) * (from / (from - to));
            upper.push(middle);
            lower.push(middle);
        }
    }
    let part = |points: Vec<Point3<f64>>| (points.len() > 2).then(|| Face { points, ..face.clone() });
    (part(upper), part(lower))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(centre: [f64; 3], normal: [f64; 3], half: f64) -> Face {
        let normal = Vector3::from(normal).normalize();
        let side = normal.cross(&if normal.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() }).normalize();
        let up = normal.cross(&side);
        let centre = Point3::from(centre);
        let corner = |a: f64, b: f64| centre + side * (a * half) + up * (b * half);
        let points = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        Face { points, normal, colour: [0.0; 3] }
    }

    fn area(face: &Face) -> f64 {
        let first = face.points[0];
        face.points.windows(2).map(|pair| (pair[0] - first).cross(&(pair[1] - first)).norm() / 2.0).sum()
    }

    /// Returns the distance towards the camera at which the ray through `(x, y)` on the screen meets the
    /// face.
    fn depth(face: &Face, eye: &Vector3<f64>, at: &Point3<f64>) -> Option<f64> {
        let slope = face.normal.dot(eye);
        if slope.abs() < 1e-9 {
            return None;
        }
        let t = face.normal.dot(&(face.points[0] - at)) / slope;
        let hit = at + eye * t;
        let inside = face
            .points
            .iter()
            .zip(face.points.iter().cycle().skip(1))
            .all(|(here, next)| (next - here).cross(&(hit - here)).dot(&face.normal) > 1e-9);
        inside.then_some(t)
    }

    #[test]
    fn crossing_faces_are_cut_and_painted_back_to_front() {
        let eye = Vector3::new(0.8, -0.5, 0.4).normalize();
        let mut faces = Vec::new();
        for index in 0..24 {
            let t = f64::from(index);
            let centre = [(1.3 * t).sin(), (2.1 * t).cos(), (0.7 * t).sin()];
            let normal = [(0.9 * t).cos() + 0.1, (1.7 * t).sin(), (2.3 * t).cos()];
            faces.push(square(centre, normal, 0.6));
        }
        let before: f64 = faces.iter().map(area).sum();
        let painted = back_to_front(faces, &eye);
        assert!(painted.len() > 40, "they cross each other");
        assert!((painted.iter().map(area).sum::<f64>() / before - 1.0).abs() < 1e-9, "nothing is lost");
        let (side, up) = (eye.cross(&Vector3::z()).normalize(), Vector3::z());
        let mut seen = 0;
        for step in 0..400 {
            let at = Point3::origin()
                + side * (0.1 * f64::from(step % 20) - 1.0)
                + up * (0.1 * f64::from(step / 20) - 1.0);
            let depths: Vec<f64> = painted.iter().filter_map(|face| depth(face, &eye, &at)).collect();
            if let Some(last) = depths.last() {
                seen += 1;
                let nearest = depths.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                assert!((last - nearest).abs() < 1e-6, "{depths:?}");
            }
        }
        assert!(seen > 100, "{seen} rays meet a face");
    }
}
