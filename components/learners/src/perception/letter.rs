//! Letters as curves: normalisation of size and speed, augmentation, and distance.

use nalgebra::{DMatrix, Matrix2, RowVector2};
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

/// Returns the path centred at 0 and scaled so that the larger side of its bounding box is 1.
pub fn unit_extent(path: &DMatrix<f64>) -> DMatrix<f64> {
    let bounds = |d: usize| (path.column(d).min(), path.column(d).max());
    let ([x, y], mut out) = ([bounds(0), bounds(1)], path.clone());
    let size = (x.1 - x.0).max(y.1 - y.0).max(f64::MIN_POSITIVE);
    for (d, bounds) in [x, y].into_iter().enumerate() {
        let middle = 0.5 * (bounds.0 + bounds.1);
        out.column_mut(d).iter_mut().for_each(|value| *value = (*value - middle) / size);
    }
    out
}

/// Returns the path shifted to start at 0, because a picture does not show the position on the paper.
pub fn begun_at_zero(path: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = path.clone();
    for (d, mut column) in out.column_iter_mut().enumerate() {
        column.add_scalar_mut(-path[(0, d)]);
    }
    out
}

/// Returns the curve resampled at `samples` points that are evenly spaced along its length.
pub fn even_speed(path: &DMatrix<f64>, samples: usize) -> DMatrix<f64> {
    let mut lengths = vec![0.0];
    for k in 1..path.nrows() {
        lengths.push(lengths[k - 1] + (path.row(k) - path.row(k - 1)).norm());
    }
    let total = lengths[lengths.len() - 1];
    let mut at = 0;
    let mut out = DMatrix::zeros(samples, path.ncols());
    for k in 0..samples {
        let length = total * k as f64 / (samples - 1).max(1) as f64;
        while at + 2 < lengths.len() && lengths[at + 1] < length {
            at += 1;
        }
        let step = lengths[at + 1] - lengths[at];
        let part = if step > 0.0 { ((length - lengths[at]) / step).clamp(0.0, 1.0) } else { 0.0 };
        out.set_row(k, &(path.row(at) + (path.row(at + 1) - path.row(at)) * part));
    }
    out
}

/// Returns the path randomly rotated, slanted, stretched and bent by about `amount`, and scaled to extent 1.
pub fn augmented(path: &DMatrix<f64>, amount: f64, random: &mut Pcg64) -> DMatrix<f64> {
    let mut normal = || {
        let normal: f64 = StandardNormal.sample(random);
        amount * normal
    };
    let [turn, slant, wide] = [0; 3].map(|_| normal());
    let (sin, cos) = turn.sin_cos();
    let change = Matrix2::new(cos, -sin, sin, cos) * Matrix2::new(wide.exp(), slant, 0.0, 1.0);
    // a smooth displacement field: one wave in each direction, about as long as a letter
    let waves =
        [0; 2].map(|_| [0.2 * normal(), 0.2 * normal(), 40.0 * normal(), 40.0 * normal(), 100.0 * normal()]);
    let rows: Vec<RowVector2<f64>> = path
        .row_iter()
        .map(|row| {
            let mut point = nalgebra::Vector2::new(row[0], row[1]);
            for [dx, dy, kx, ky, phase] in waves {
                let wave = (kx * row[0] + ky * row[1] + phase).sin();
                point += nalgebra::Vector2::new(dx, dy) * wave;
            }
            (change * point).transpose()
        })
        .collect();
    unit_extent(&DMatrix::from_fn(rows.len(), 2, |k, d| rows[k][d]))
}

/// Returns the symmetric Chamfer distance of two curves: the mean distance of the points of each curve from
/// the other curve, averaged over both directions.
pub fn chamfer(a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
    let one_way = |a: &DMatrix<f64>, b: &DMatrix<f64>| {
        let nearest = |row: usize| {
            let squared = |k: usize| (a[(row, 0)] - b[(k, 0)]).powi(2) + (a[(row, 1)] - b[(k, 1)]).powi(2);
            (0..b.nrows()).map(squared).fold(f64::INFINITY, f64::min).sqrt()
        };
        (0..a.nrows()).map(nearest).sum::<f64>() / a.nrows() as f64
    };
    0.5 * (one_way(a, b) + one_way(b, a))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parallel_lines_keep_their_distance_until_they_meet() {
        let line = |y: f64| DMatrix::from_fn(50, 2, |k, d| if d == 0 { k as f64 / 49.0 } else { y });
        assert!((chamfer(&line(0.0), &line(0.04)) - 0.04).abs() < 1e-12);
        assert!(chamfer(&begun_at_zero(&line(0.0)), &begun_at_zero(&line(0.04))) < 1e-12);
    }

    #[test]
    fn distance_is_the_mean_of_both_directions() {
        let point = DMatrix::from_row_slice(1, 2, &[0.0, 0.0]);
        let pair = DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 1.0, 0.0]);
        assert!(
            (chamfer(&point, &pair) - 0.25).abs() < 1e-12 && (chamfer(&pair, &point) - 0.25).abs() < 1e-12
        );
    }
}
