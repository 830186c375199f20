//! Working memory of impacts.

/// Impulses and velocities of the points of an island, three numbers each.
#[derive(Clone, Debug, Default)]
pub(super) struct Rebound {
    /// Impulses and velocities by Newton's law.
    pub(super) newton: [Vec<f64>; 2],
    /// Velocities of the plastic impact, whose impulses are the current ones.
    pub(super) plastic: Vec<f64>,
}

impl Rebound {
    /// Reserves space for this number of points.
    pub(super) fn make_room(&mut self, points: usize) {
        for numbers in self.newton.iter_mut().chain([&mut self.plastic]) {
            numbers.resize(3 * points, 0.0);
        }
    }
}
