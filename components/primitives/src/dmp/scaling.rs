//! Scaling of a demonstration's forcing term to the displacement of a new movement.

use nalgebra::DVector;

use super::settings::Scaling;

/// A [`Scaling`] prepared for one movement. Only construction allocates.
#[derive(Clone, Debug)]
pub(super) struct ForcingScale {
    scaling: Scaling,
    factors: Vec<f64>,
    /// The rotation, as two reflections through the planes normal to these unit vectors.
    mirrors: [Vec<f64>; 2],
}

/// Displacements shorter than this (in the unit of the dimension) have neither a direction nor a usable
/// length.
const NO_DISPLACEMENT: f64 = 1e-9;

impl ForcingScale {
    pub(super) fn new(scaling: Scaling, dimensions: usize) -> Self {
        let zeros = vec![0.0; dimensions];
        Self { scaling, factors: vec![1.0; dimensions], mirrors: [zeros.clone(), zeros] }
    }

    /// Prepares a movement from `start` to `goal` for a model demonstrated with the displacement `shown`.
    pub(super) fn prepare(&mut self, shown: &DVector<f64>, start: &[f64], goal: &[f64]) {
        match self.scaling {
            Scaling::Fixed => {}
            Scaling::Displacement { limit } => {
                for (d, factor) in self.factors.iter_mut().enumerate() {
                    *factor = ratio(goal[d] - start[d], shown[d]).clamp(-limit, limit);
                }
            }
            Scaling::Similarity { limit } => self.prepare_similarity(shown, start, goal, limit),
        }
    }

    fn prepare_similarity(&mut self, shown: &DVector<f64>, start: &[f64], goal: &[f64], limit: f64) {
        let [first, second] = &mut self.mirrors;
        first.copy_from_slice(shown.as_slice());
        for (d, value) in second.iter_mut().enumerate() {
            *value = goal[d] - start[d];
        }
        let (shown_length, length) = (norm(first), norm(second));
        self.factors.fill(ratio(length, shown_length).min(limit));
        if shown_length < NO_DISPLACEMENT || length < NO_DISPLACEMENT {
            first.fill(0.0);
            second.fill(0.0);
            return;
        }
        // The mirror of u maps u to -u, the mirror of u + w maps -u to w: together they rotate u to w in
        // their plane.
        first.iter_mut().for_each(|value| *value /= shown_length);
        for (value, u) in second.iter_mut().zip(first.iter()) {
            *value = *value / length + u;
        }
        let mut bisector = norm(second);
        if bisector < NO_DISPLACEMENT {
            perpendicular(first, second);
            bisector = norm(second);
        }
        // one dimension has no perpendicular: the remaining mirror reverses the shape
        let inverse = if bisector > 0.0 { bisector.recip() } else { 0.0 };
        second.iter_mut().for_each(|value| *value *= inverse);
    }

    /// Returns the factor of one dimension, without the rotation.
    pub(super) fn factor(&self, dimension: usize) -> f64 {
        self.factors[dimension]
    }

    /// Undoes the rotation of a forcing vector in place; factors are kept.
    pub(super) fn unrotate(&self, forcing: &mut [f64]) {
        for mirror in self.mirrors.iter().rev() {
            reflect(mirror, forcing);
        }
    }

    /// Scales a forcing vector in place.
    pub(super) fn apply(&self, forcing: &mut [f64]) {
        match self.scaling {
            Scaling::Fixed => return,
            Scaling::Displacement { .. } => {}
            Scaling::Similarity { .. } => {
                self.mirrors.iter().for_each(|mirror| reflect(mirror, forcing));
            }
        }
        forcing.iter_mut().zip(&self.factors).for_each(|(f, factor)| *f *= factor);
    }
}

fn ratio(now: f64, shown: f64) -> f64 {
    if shown.abs() < NO_DISPLACEMENT { 1.0 } else { now / shown }
}

/// Mirrors a vector at the plane normal to a unit vector; a zero vector as `mirror` leaves it unchanged.
fn reflect(mirror: &[f64], vector: &mut [f64]) {
    let along: f64 = mirror.iter().zip(vector.iter()).map(|(m, f)| m * f).sum();
    vector.iter_mut().zip(mirror).for_each(|(f, m)| *f -= 2.0 * along * m);
}

fn norm(vector: &[f64]) -> f64 {
    vector.iter().map(|value| value * value).sum::<f64>().sqrt()
}

/// Writes a vector perpendicular to the unit vector `u`: the axis least aligned with `u`, minus its component
/// along `u`.
fn perpendicular(u: &[f64], out: &mut [f64]) {
    let least = (0..u.len()).min_by(|&i, &j| u[i].abs().total_cmp(&u[j].abs())).unwrap_or(0);
    for (d, value) in out.iter_mut().enumerate() {
        *value = f64::from(u8::from(d == least)) - u[least] * u[d];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scaled(scaling: Scaling, shown: &[f64], displacement: &[f64], forcing: &[f64]) -> Vec<f64> {
        let mut scale = ForcingScale::new(scaling, shown.len());
        scale.prepare(&DVector::from_row_slice(shown), &vec![0.0; shown.len()], displacement);
        let mut forcing = forcing.to_vec();
        scale.apply(&mut forcing);
        forcing
    }

    fn assert_close(found: &[f64], expected: &[f64]) {
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < 1e-12, "{found:?} instead of {expected:?}");
        }
    }

    #[test]
    fn similarity_agrees_with_the_rotation_between_two_vectors() {
        let (u, w) = (nalgebra::Vector3::new(1.0, 2.0, -0.5), nalgebra::Vector3::new(-0.3, 0.4, 2.0));
        let f = nalgebra::Vector3::new(0.2, -0.7, 1.1);
        let rotation = nalgebra::Rotation3::rotation_between(&u, &w).unwrap();
        let expected = rotation * f * (w.norm() / u.norm());
        let similarity = Scaling::Similarity { limit: 10.0 };
        assert_close(&scaled(similarity, u.as_slice(), w.as_slice(), f.as_slice()), expected.as_slice());
    }

    #[test]
    fn similarity_reverses_a_shape_for_an_opposite_goal() {
        let similarity = Scaling::Similarity { limit: 10.0 };
        let found = scaled(similarity, &[1.0, 0.0, 0.0], &[-2.0, 0.0, 0.0], &[1.0, 3.0, 4.0]);
        assert!((found[0] + 2.0).abs() < 1e-12);
        assert!((norm(&found) - 2.0 * 26.0_f64.sqrt()).abs() < 1e-12);
        assert_close(&scaled(similarity, &[1.0], &[-2.0], &[3.0]), &[-6.0]);
    }

    #[test]
    fn zero_length_movement_has_no_shape() {
        for scaling in [Scaling::Similarity { limit: 3.0 }, Scaling::Displacement { limit: 3.0 }] {
            assert_close(&scaled(scaling, &[1.0, 1.0], &[0.0, 0.0], &[5.0, 6.0]), &[0.0, 0.0]);
            assert_close(&scaled(scaling, &[0.0, 0.0], &[2.0, 0.0], &[5.0, 6.0]), &[5.0, 6.0]);
        }
    }

    #[test]
    fn unrotating_undoes_the_rotation() {
        let mut scale = ForcingScale::new(Scaling::Similarity { limit: 9.0 }, 3);
        scale.prepare(&DVector::from_row_slice(&[1.0, 2.0, 3.0]), &[0.0; 3], &[-2.0, 0.5, 0.1]);
        let mut forcing = [0.3, -0.4, 0.5];
        scale.apply(&mut forcing);
        forcing.iter_mut().for_each(|f| *f /= scale.factor(0));
        scale.unrotate(&mut forcing);
        assert_close(&forcing, &[0.3, -0.4, 0.5]);
    }

    #[test]
    fn limit_bounds_the_factor() {
        let displacement = Scaling::Displacement { limit: 3.0 };
        assert_close(&scaled(displacement, &[1e-3, 1.0], &[1.0, -9.0], &[1.0, 1.0]), &[3.0, -3.0]);
        assert_close(
            &scaled(Scaling::Similarity { limit: 3.0 }, &[1e-3, 0.0], &[1.0, 0.0], &[1.0, 1.0]),
            &[3.0, 3.0],
        );
    }
}
