//! The impulses of the contacts of a step, added up.

use nalgebra::{Point3, Vector3};

use super::colliders::Collider;

/// The impulse on each collider during a step \[N s\], and its moment about the origin of the world \[N m s\].
pub(crate) struct ImpulseSums(Vec<[Vector3<f64>; 2]>);

impl ImpulseSums {
    /// Sums for these colliders.
    pub(crate) fn new(colliders: &[Collider]) -> Self {
        Self(vec![[Vector3::zeros(); 2]; colliders.len()])
    }

    /// Begins a step.
    pub(crate) fn clear(&mut self) {
        self.0.fill([Vector3::zeros(); 2]);
    }

    /// Adds an impulse at a point on the first of two colliders, which pushes the second the other way.
    pub(crate) fn add(&mut self, [first, second]: [usize; 2], point: &Point3<f64>, impulse: &Vector3<f64>) {
        self.add_to(first, point, impulse);
        self.add_to(second, point, &-impulse);
    }

    /// Adds an impulse at a point on a collider.
    pub(crate) fn add_to(&mut self, collider: usize, point: &Point3<f64>, impulse: &Vector3<f64>) {
        let [sum, moments] = &mut self.0[collider];
        *sum += impulse;
        *moments += point.coords.cross(impulse);
    }

    /// Adds a moment on a collider.
    pub(crate) fn add_moment_to(&mut self, collider: usize, moment: &Vector3<f64>) {
        self.0[collider][1] += moment;
    }

    /// Adds a moment on the first of two colliders, which turns the second the other way.
    pub(crate) fn add_moment(&mut self, [first, second]: [usize; 2], moment: &Vector3<f64>) {
        self.0[first][1] += moment;
        self.0[second][1] -= moment;
    }

    /// Passes name, impulse and moment of each collider with an impulse to `visit`.
    #[expect(clippy::type_complexity, reason = "a visitor of three values")]
    pub(crate) fn visit(
        &self,
        colliders: &[Collider],
        visit: &mut dyn FnMut(&str, &Vector3<f64>, &Vector3<f64>),
    ) {
        for (collider, [impulse, moment]) in colliders.iter().zip(&self.0) {
            if *impulse != Vector3::zeros() || *moment != Vector3::zeros() {
                visit(&collider.name, impulse, moment);
            }
        }
    }
}
