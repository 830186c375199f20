//! Gradients of weighted sums of covariances.

use super::{Kernel, Points, stationary};

impl Kernel {
    /// Adds the gradients of `sum_b weights[b] k(x_a, x_b)` over the points `b >= a`. The gradient with
    /// respect to the logarithms of the parameters is added to `parameters`. The gradient with respect to the
    /// points is added to `by_points` (dimension by dimension), if given. `values` and `slopes` are the row
    /// of covariances and the row of their derivatives, written by
    /// [`row_with_slopes`](Self::row_with_slopes).
    ///
    /// # Panics
    /// If a slice is too short.
    pub fn add_gradient(
        &self,
        (a, points): (usize, &Points),
        (values, slopes): (&[f64], &[f64]),
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
        match self {
            Self::Rbf(s) | Self::Matern32(s) | Self::Matern52(s) => {
                stationary::gradient(s, query, points, a, values, slopes, weights, parameters, by_points);
            }
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

    /// Propagates gradients to the parts of a kernel. Parts of a sum have the weights of the sum; a part of a
    /// product is also weighted by the other parts.
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
        let n = weights.len();
        let rows: Vec<(Vec<f64>, Vec<f64>)> = parts
            .iter()
            .map(|part| {
                let (mut row, mut slopes) = (vec![0.0; n], vec![0.0; n]);
                let mut scratch = vec![0.0; part.scratch_rows() * n];
                part.row_with_slopes((query, Some(a)), (points, a), (&mut row, &mut slopes), &mut scratch);
                (row, slopes)
            })
            .collect();
        let mut first = 0;
        for (i, part) in parts.iter().enumerate() {
            let mut own = weights.to_vec();
            for (_, (row, _)) in rows.iter().enumerate().filter(|(j, _)| product && *j != i) {
                own.iter_mut().zip(row).for_each(|(own, value)| *own *= value);
            }
            let end = first + part.parameter_count();
            let parameters = &mut parameters[first..end];
            let row = (&rows[i].0[..], &rows[i].1[..]);
            part.add_gradient((a, points), row, &own, parameters, by_points.as_deref_mut());
            first = end;
        }
    }
}
