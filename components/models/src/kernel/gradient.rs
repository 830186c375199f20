//! Gradients of weighted sums of covariances.

use super::stationary::{self, Profile};
use super::{Kernel, Points};

impl Kernel {
    /// Adds the gradients of `sum_b weights[b] k(x_a, x_b)` for point `a` and the points `b >= a`: by the
    /// logarithms of the parameters to `parameters`, and by the points to `by_points` (dimension by
    /// dimension) if given. `values` is the row of the covariances.
    ///
    /// # Panics
    /// If a slice is too short.
    pub fn add_gradient(
        &self,
        (a, points): (usize, &Points),
        values: &[f64],
        weights: &[f64],
        parameters: &mut [f64],
        mut by_points: Option<&mut [f64]>,
    ) {
        let mut query = [0.0; 64];
        let mut longer = vec![];
        let query = if points.dimensions() <= query.len() {
            &mut query[..points.dimensions()]
        } else {
            longer.resize(points.dimensions(), 0.0);
            &mut longer[..]
        };
        points.copy_point(a, query);
        let (count, dimensions) = (points.len(), points.dimensions());
        let stationary = |profile, s, parameters: &mut [f64], by_points: Option<&mut [f64]>| {
            let mut scratch = vec![0.0; weights.len()];
            stationary::gradient(
                profile,
                s,
                query,
                points,
                a,
                values,
                weights,
                parameters,
                by_points,
                &mut scratch,
            );
        };
        match self {
            Self::Rbf(s) => stationary(Profile::Rbf, s, parameters, by_points),
            Self::Matern32(s) => stationary(Profile::Matern32, s, parameters, by_points),
            Self::Matern52(s) => stationary(Profile::Matern52, s, parameters, by_points),
            Self::Periodic { scales, period } => {
                let last = parameters.len() - 1;
                for (b, (value, weight)) in values.iter().zip(weights).enumerate() {
                    let product = value * weight;
                    parameters[0] += product;
                    for d in 0..dimensions {
                        let length = scales.length(d);
                        let angle = std::f64::consts::PI / period * (query[d] - points.coordinate(d)[a + b]);
                        let (sine, cosine) = angle.sin_cos();
                        let index = if scales.lengths.len() == 1 { 1 } else { 1 + d };
                        parameters[index] += product * sine * sine / (length * length);
                        let slope = product * sine * cosine / (length * length);
                        parameters[last] += slope * angle;
                        if let Some(by_points) = by_points.as_deref_mut() {
                            let pull = slope * std::f64::consts::PI / period;
                            by_points[d * count + a] -= pull;
                            by_points[d * count + a + b] += pull;
                        }
                    }
                }
            }
            Self::Linear(variances) => {
                for (d, variance) in variances.iter().enumerate() {
                    let z = &points.coordinate(d)[a..];
                    for (b, (z, weight)) in z.iter().zip(weights).enumerate() {
                        parameters[d] += weight * variance * query[d] * z;
                        if let Some(by_points) = by_points.as_deref_mut() {
                            by_points[d * count + a] += weight * variance * z;
                            by_points[d * count + a + b] += weight * variance * query[d];
                        }
                    }
                }
            }
            Self::Bias(variance) => parameters[0] += variance * weights.iter().sum::<f64>(),
            Self::White(variance) => parameters[0] += variance * weights[0],
            Self::Sum(_) | Self::Product(_) => {
                self.add_parts((a, query), points, weights, parameters, by_points)
            }
        }
    }

    /// Propagates gradients to the parts of a kernel. Sums pass the weights on to their parts; a part of a
    /// product is weighted by the other parts.
    fn add_parts(
        &self,
        (a, query): (usize, &[f64]),
        points: &Points,
        weights: &[f64],
        parameters: &mut [f64],
        mut by_points: Option<&mut [f64]>,
    ) {
        let (Self::Sum(parts) | Self::Product(parts)) = self else { return };
        let product = matches!(self, Self::Product(_));
        let rows: Vec<Vec<f64>> = parts
            .iter()
            .map(|part| {
                let mut row = vec![0.0; weights.len()];
                let mut scratch = vec![0.0; part.scratch_rows() * weights.len()];
                part.row((query, Some(a)), (points, a), &mut row, &mut scratch);
                row
            })
            .collect();
        let mut first = 0;
        for (i, part) in parts.iter().enumerate() {
            let mut own = weights.to_vec();
            for (_, row) in rows.iter().enumerate().filter(|(j, _)| product && *j != i) {
                own.iter_mut().zip(row).for_each(|(own, value)| *own *= value);
            }
            let end = first + part.parameter_count();
            let parameters = &mut parameters[first..end];
            part.add_gradient((a, points), &rows[i], &own, parameters, by_points.as_deref_mut());
            first = end;
        }
    }
}
