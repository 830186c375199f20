//! Directions in which a surface pushes a cylinder or a hull. The first point of a rim to touch depends on
//! the direction.

use nalgebra::Vector3;

/// Largest number of distinct directions.
const MOST: usize = 8;

/// Directions within a degree count as equal: the cosine of a degree.
const ALIKE: f64 = 0.99985;

/// Distinct normals of a surface near a cylinder.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Normals {
    found: [Vector3<f64>; MOST],
    count: usize,
}

impl Normals {
    /// Adds a unit normal unless it is already present or there is no room.
    pub(super) fn add(&mut self, normal: &Vector3<f64>) {
        let known = self.all().iter().any(|other| other.dot(normal) > ALIKE);
        if !known && self.count < MOST {
            self.found[self.count] = *normal;
            self.count += 1;
        }
    }

    /// Returns all normals.
    pub(super) fn all(&self) -> &[Vector3<f64>] {
        &self.found[..self.count]
    }

    /// Returns `true` if a normal counts as the one with this number, because no other is closer.
    pub(super) fn is(&self, number: usize, normal: &Vector3<f64>) -> bool {
        let cosine = |index: &usize| self.found[*index].dot(normal);
        (0..self.count).max_by(|a, b| cosine(a).total_cmp(&cosine(b))) == Some(number)
    }

    /// Returns the feature number for the normal with this number.
    pub(super) fn feature(number: usize, feature: u32) -> u32 {
        (number as u32) << 12 | feature
    }
}
