//! Eigenvalues and eigenvectors of a diagonal matrix plus an outer product.

use nalgebra::DMatrix;

/// Eigenvalues, in ascending order, and orthonormal eigenvectors of `diag(d) + z z^T`.
#[derive(Clone, Debug)]
pub struct RankOne {
    /// Eigenvalues, in ascending order.
    pub values: Vec<f64>,
    /// Eigenvectors, one per column, in the order of the values.
    pub vectors: DMatrix<f64>,
}

/// Solves the eigenproblem of `diag(d) + z z^T`, with `d` in ascending order.
///
/// The eigenvalues are the roots of `1 + sum(z_j^2 / (d_j - x)) = 0`, one between each pair of neighbouring
/// entries of `d`. An entry `d_j` is itself an eigenvalue if `z_j` is negligible; among equal entries, all
/// but one are eigenvalues (deflation). The eigenvectors are computed from a slightly changed `z`, for which
/// the computed roots are exact (Gu and Eisenstat). They are therefore orthogonal to rounding even for very
/// close roots.
///
/// # Panics
/// If `d` and `z` differ in length.
pub fn eigen_of_rank_one_update(d: &[f64], z: &[f64]) -> RankOne {
    assert_eq!(d.len(), z.len(), "as many entries on the diagonal as in the vector");
    let n = d.len();
    let (mut d, mut z) = (d.to_vec(), z.to_vec());
    let size = d.iter().fold(0.0_f64, |m, x| m.max(x.abs())) + z.iter().map(|x| x * x).sum::<f64>();
    let tolerance = 4.0 * f64::EPSILON * size;
    let total = z.iter().map(|x| x * x).sum::<f64>().sqrt();
    // pairs of columns of the outer basis that deflation rotated
    let mut turns = Vec::new();
    let mut kept: Vec<usize> = Vec::with_capacity(n);
    let mut deflated = Vec::new();
    for i in 0..n {
        if total * z[i].abs() <= tolerance {
            deflated.push(i);
            continue;
        }
        if let Some(&last) = kept.last() {
            let (radius, gap) = (z[last].hypot(z[i]), d[i] - d[last]);
            let (c, s) = (z[i] / radius, z[last] / radius);
            if (gap * c * s).abs() <= tolerance {
                turns.push((last, i, c, s));
                (d[last], d[i]) = (c * c * d[last] + s * s * d[i], s * s * d[last] + c * c * d[i]);
                z[i] = radius;
                z[last] = 0.0;
                kept.pop();
                deflated.push(last);
            }
        }
        kept.push(i);
    }
    let poles: Vec<f64> = kept.iter().map(|&i| d[i]).collect();
    let weights: Vec<f64> = kept.iter().map(|&i| z[i]).collect();
    let (roots, inner) = solve(&poles, &weights);
    // roots and deflated values are sorted together
    let mut order: Vec<(f64, bool, usize)> =
        roots.iter().enumerate().map(|(k, &value)| (value, true, k)).collect();
    order.extend(deflated.iter().map(|&i| (d[i], false, i)));
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut vectors = DMatrix::zeros(n, n);
    for (column, &(_, is_root, index)) in order.iter().enumerate() {
        if is_root {
            for (row, &i) in kept.iter().enumerate() {
                vectors[(i, column)] = inner[(row, index)];
            }
        } else {
            vectors[(index, column)] = 1.0;
        }
    }
    for &(first, second, c, s) in turns.iter().rev() {
        for column in 0..n {
            let (x, y) = (vectors[(first, column)], vectors[(second, column)]);
            vectors[(first, column)] = c * x + s * y;
            vectors[(second, column)] = -s * x + c * y;
        }
    }
    RankOne { values: order.iter().map(|entry| entry.0).collect(), vectors }
}

/// Computes all roots and vectors, for distinct poles and non-negligible weights.
fn solve(d: &[f64], z: &[f64]) -> (Vec<f64>, DMatrix<f64>) {
    let k = d.len();
    let squares: Vec<f64> = z.iter().map(|x| x * x).collect();
    // column i: d_j - root_i, computed without cancellation
    let mut gaps = DMatrix::zeros(k, k);
    let mut roots = Vec::with_capacity(k);
    for (i, column) in gaps.as_mut_slice().chunks_exact_mut(k.max(1)).enumerate() {
        roots.push(root(i, d, &squares, column));
    }
    let mut refined = vec![1.0; k];
    for (i, column) in gaps.as_slice().chunks_exact(k.max(1)).enumerate() {
        for j in 0..k {
            refined[j] *= if i == j { -column[j] } else { column[j] / (d[j] - d[i]) };
        }
    }
    for (refined, z) in refined.iter_mut().zip(z) {
        *refined = refined.abs().sqrt().copysign(*z);
    }
    for column in gaps.as_mut_slice().chunks_exact_mut(k.max(1)) {
        let mut norm = 0.0;
        for (gap, z) in column.iter_mut().zip(&refined) {
            *gap = z / *gap;
            norm += *gap * *gap;
        }
        let scale = norm.sqrt().recip();
        column.iter_mut().for_each(|entry| *entry *= scale);
    }
    (roots, gaps)
}

/// Returns the `i`-th root and sets `gaps[j]` to `d_j - root`.
fn root(i: usize, d: &[f64], squares: &[f64], gaps: &mut [f64]) -> f64 {
    let k = d.len();
    let is_last = i + 1 == k;
    let width = if is_last { squares.iter().sum::<f64>() } else { d[i + 1] - d[i] };
    // Measured from the nearer pole, so the root has the relative accuracy of its distance to it.
    let middle = |j: usize| (d[j] - d[i]) - 0.5 * width;
    let at_middle = 1.0 + (0..k).map(|j| squares[j] / middle(j)).sum::<f64>();
    let origin = if is_last || at_middle >= 0.0 { i } else { i + 1 };
    let (mut low, mut high) = match (is_last, at_middle >= 0.0) {
        (true, true) => (0.0, 0.5 * width),
        (true, false) => (0.5 * width, width),
        (false, true) => (0.0, 0.5 * width),
        (false, false) => (-0.5 * width, 0.0),
    };
    for (gap, pole) in gaps.iter_mut().zip(d) {
        *gap = pole - d[origin];
    }
    let mut tau = 0.5 * (low + high);
    for _ in 0..80 {
        let [below, below_slope] = sums(&squares[..=i], &gaps[..=i], tau);
        let [above, above_slope] = sums(&squares[i + 1..], &gaps[i + 1..], tau);
        let value = 1.0 + below + above;
        if value == 0.0 {
            break;
        }
        if value < 0.0 {
            low = tau;
        } else {
            high = tau;
        }
        let error = f64::EPSILON * (1.0 + above - below) * 4.0;
        if value.abs() <= error || high - low <= f64::EPSILON * low.abs().max(high.abs()) {
            break;
        }
        let left = gaps[i] - tau;
        let step = if is_last {
            beyond_all(value, below_slope, left)
        } else {
            interpolate(value, [below_slope, above_slope], [left, gaps[i + 1] - tau])
        };
        let next = tau + step;
        let inside = next > low && next < high && step.is_finite();
        let next = if inside { next } else { 0.5 * (low + high) };
        if next == tau {
            break;
        }
        tau = next;
    }
    gaps.iter_mut().for_each(|gap| *gap -= tau);
    d[origin] + tau
}

/// Returns `sum(s / gap)` and `sum(s / gap^2)` at a distance `tau` from the origin.
fn sums(squares: &[f64], gaps: &[f64], tau: f64) -> [f64; 2] {
    let mut lanes = [[0.0; 4]; 2];
    let (mut squares, mut gaps) = (squares.chunks_exact(4), gaps.chunks_exact(4));
    for (s, g) in squares.by_ref().zip(gaps.by_ref()) {
        for lane in 0..4 {
            let inverse = 1.0 / (g[lane] - tau);
            let term = s[lane] * inverse;
            lanes[0][lane] += term;
            lanes[1][lane] += term * inverse;
        }
    }
    let mut out = lanes.map(|lane| lane.iter().sum());
    for (s, g) in squares.remainder().iter().zip(gaps.remainder()) {
        let inverse = 1.0 / (g - tau);
        out[0] += s * inverse;
        out[1] += s * inverse * inverse;
    }
    out
}

/// Returns the step to the root of a model with a constant and two poles that matches the value and slopes of
/// the function ("middle way").
fn interpolate(value: f64, slopes: [f64; 2], [left, right]: [f64; 2]) -> f64 {
    let c = value - left * slopes[0] - right * slopes[1];
    let a = (left + right) * value - left * right * (slopes[0] + slopes[1]);
    let b = left * right * value;
    let root = (a * a - 4.0 * b * c).max(0.0).sqrt();
    if a <= 0.0 { (a - root) / (2.0 * c) } else { 2.0 * b / (a + root) }
}

/// Returns the step, right of all poles, to the root of a model with a constant and one pole that matches
/// value and slope.
fn beyond_all(value: f64, slope: f64, left: f64) -> f64 {
    let constant = value - slope * left;
    left + slope * left * left / constant
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(d: &[f64], z: &[f64]) {
        let found = eigen_of_rank_one_update(d, z);
        let n = d.len();
        let z = nalgebra::DVector::from_column_slice(z);
        let full = DMatrix::from_diagonal(&nalgebra::DVector::from_column_slice(d)) + &z * z.transpose();
        let size = full.norm().max(f64::MIN_POSITIVE);
        let v = &found.vectors;
        let values = DMatrix::from_diagonal(&nalgebra::DVector::from_column_slice(&found.values));
        assert!((&full * v - v * values).norm() / size < 1e-13 * n as f64, "{d:?} {z:?}");
        assert!((v.transpose() * v - DMatrix::identity(n, n)).norm() < 1e-13 * n as f64, "{d:?} {z:?}");
        assert!(found.values.is_sorted());
    }

    #[test]
    fn eigenpairs_hold_for_spread_close_equal_and_missing_entries() {
        check(&[1.0], &[0.5]);
        check(&[0.0, 0.0], &[1.0, 0.0]);
        check(&[0.0, 1.0, 2.0, 5.0], &[0.3, 0.2, 1e-9, 0.7]);
        check(&[1.0, 1.0, 1.0 + 1e-15, 2.0], &[0.5, 0.5, 0.5, 0.5]);
        check(&[-1.0, 0.0, 1e-14, 3e-14, 4.0], &[0.1, 0.2, 0.3, 1e-3, 10.0]);
        check(&[0.0, 1e-8, 1.0, 1.0 + 1e-10], &[1e3, 1e-6, 1.0, 1.0]);
        let d: Vec<f64> = (0..51).map(|i| 0.8_f64.powi(51 - i)).collect();
        let z: Vec<f64> = (0..51).map(|i| 0.1 * (1.0 + f64::from(i)).sin()).collect();
        check(&d, &z);
    }
}
