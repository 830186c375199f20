//! Directions in which a surface pushes a cylinder or a hull: the point of a rim that touches first differs
//! by them.

use nalgebra::Vector3;

/// Distinguished directions.
const MOST: usize = 8;

/// Directions that differ by less are one: the cosine of a degree.
const ALIKE: f64 = 0.99985;

/// Different normals of a surface near a cylinder.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Normals {
    found: [Vector3<f64>; MOST],
    count: usize,
}

impl Normals {
    /// Adds a unit normal, unless it is there already or there is no room.
    pub(super) fn add(&mut self, normal: &Vector3<f64>) {
        let known = self.all().iter().any(|other| other.dot(normal) > ALIKE);
        if !known && self.count < MOST {
            self.found[self.count] = *normal;
            self.count += 1;
        }
    }

    /// All of them.
    pub(super) fn all(&self) -> &[Vector3<f64>] {
        &self.found[..self.count]
    }

    /// True where a normal counts as the one of this number: no other is nearer to it.
    pub(super) fn is(&self, number: usize, normal: &Vector3<f64>) -> bool {
        let cosine = |index: &usize| self.found[*index].dot(normal);
        (0..self.count).max_by(|a, b| cosine(a).total_cmp(&cosine(b))) == Some(number)
    }

    /// The number of a feature for the normal of this number.
    pub(super) fn feature(number: usize, feature: u32) -> u32 {
        (number as u32) << 12 | feature
    }
}
