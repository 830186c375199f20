//! Sums of the contact impulses of a step.

use nalgebra::{Point3, Vector3};

use super::colliders::Collider;
use crate::robot::Articulation;

/// The impulse on each collider during a step \[N s\], and its moment about the world origin \[N m s\].
///
/// Connections act on links, which may have no collider: the sums of links follow the sums of colliders.
pub(crate) struct ImpulseSums {
    sums: Vec<[Vector3<f64>; 2]>,
    /// Names of the links of all articulations.
    links: Vec<String>,
}

impl ImpulseSums {
    /// Creates sums for these colliders and for the links of these articulations.
    pub(crate) fn new(colliders: &[Collider], articulations: &[Articulation]) -> Self {
        let frames = articulations.iter().flat_map(|own| own.model().frames());
        let links: Vec<_> = frames.map(|frame| frame.name.clone()).collect();
        Self { sums: vec![[Vector3::zeros(); 2]; colliders.len() + links.len()], links }
    }

    /// Returns the index of a link's sums, from its articulation and its index there; `colliders` is the
    /// number of colliders.
    pub(crate) fn link(
        colliders: usize,
        articulations: &[Articulation],
        (of, link): (usize, usize),
    ) -> usize {
        let before = articulations[..of].iter().map(|own| own.model().frames().len());
        colliders + before.sum::<usize>() + link
    }

    /// Begins a step.
    pub(crate) fn clear(&mut self) {
        self.sums.fill([Vector3::zeros(); 2]);
    }

    /// Adds an impulse at a point on the first of two colliders, and the opposite impulse on the second.
    pub(crate) fn add(&mut self, [first, second]: [usize; 2], point: &Point3<f64>, impulse: &Vector3<f64>) {
        self.add_to(first, point, impulse);
        self.add_to(second, point, &-impulse);
    }

    /// Adds an impulse at a point on a collider or a link.
    pub(crate) fn add_to(&mut self, collider: usize, point: &Point3<f64>, impulse: &Vector3<f64>) {
        let [sum, moments] = &mut self.sums[collider];
        *sum += impulse;
        *moments += point.coords.cross(impulse);
    }

    /// Adds a moment on a collider or a link.
    pub(crate) fn add_moment_to(&mut self, collider: usize, moment: &Vector3<f64>) {
        self.sums[collider][1] += moment;
    }

    /// Adds a moment on the first of two colliders, and the opposite moment on the second.
    pub(crate) fn add_moment(&mut self, [first, second]: [usize; 2], moment: &Vector3<f64>) {
        self.sums[first][1] += moment;
        self.sums[second][1] -= moment;
    }

    /// Passes name, impulse and moment of each collider and link with a nonzero impulse to `visit`.
    #[expect(clippy::type_complexity, reason = "a visitor of three values")]
    pub(crate) fn visit(
        &self,
        colliders: &[Collider],
        visit: &mut dyn FnMut(&str, &Vector3<f64>, &Vector3<f64>),
    ) {
        let names = colliders.iter().map(|collider| &collider.name).chain(&self.links);
        for (name, [impulse, moment]) in names.zip(&self.sums) {
            if *impulse != Vector3::zeros() || *moment != Vector3::zeros() {
                visit(name, impulse, moment);
            }
        }
    }
}
