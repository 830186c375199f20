//! Inner loops of the dense linear algebra, over rows padded to whole vectors of four numbers.
//!
//! All loops are inlined into one function compiled for the widest available instructions ([`pulp::Arch`]).
//! Closures are not inlined, so they contain no expensive code.

/// Numbers per vector. Leading dimensions are multiples of it.
pub(super) const LANES: usize = 4;

/// Rounds a count up to whole vectors.
#[inline(always)]
pub(super) fn padded(count: usize) -> usize {
    count.next_multiple_of(LANES)
}

/// Multiplication and addition, fused where the processor has an instruction for it.
pub(super) trait Arithmetic: Copy {
    /// `a b + c`.
    fn multiply_add(a: f64, b: f64, c: f64) -> f64;
}

/// One rounding, by a processor instruction.
#[derive(Clone, Copy)]
pub(super) struct Fused;

/// Two roundings.
#[derive(Clone, Copy)]
pub(super) struct Separate;

impl Arithmetic for Fused {
    #[inline(always)]
    fn multiply_add(a: f64, b: f64, c: f64) -> f64 {
        a.mul_add(b, c)
    }
}

impl Arithmetic for Separate {
    #[inline(always)]
    fn multiply_add(a: f64, b: f64, c: f64) -> f64 {
        a * b + c
    }
}

/// A vector of numbers.
pub(super) type Vector = [f64; LANES];

#[inline(always)]
fn vectors(numbers: &[f64]) -> &[Vector] {
    numbers.as_chunks::<LANES>().0
}

#[inline(always)]
fn vector(numbers: &[f64], first: usize) -> &Vector {
    &vectors(&numbers[first..first + LANES])[0]
}

#[inline(always)]
fn vectors_mut(numbers: &mut [f64]) -> &mut [Vector] {
    numbers.as_chunks_mut::<LANES>().0
}

#[inline(always)]
fn fma<F: Arithmetic>(a: &Vector, b: &Vector, c: &mut Vector) {
    for lane in 0..LANES {
        c[lane] = F::multiply_add(a[lane], b[lane], c[lane]);
    }
}

#[inline(always)]
fn sum(v: &Vector) -> f64 {
    (v[0] + v[2]) + (v[1] + v[3])
}

/// Sum of products of whole vectors.
#[inline(always)]
pub(super) fn dot<F: Arithmetic>(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (vectors(a), vectors(b));
    let (a2, a1) = a.as_chunks::<2>();
    let (b2, b1) = b.as_chunks::<2>();
    let (mut even, mut odd) = ([0.0; LANES], [0.0; LANES]);
    for (a, b) in a2.iter().zip(b2) {
        fma::<F>(&a[0], &b[0], &mut even);
        fma::<F>(&a[1], &b[1], &mut odd);
    }
    for (a, b) in a1.iter().zip(b1) {
        fma::<F>(a, b, &mut even);
    }
    for lane in 0..LANES {
        even[lane] += odd[lane];
    }
    sum(&even)
}

/// `y += factor x`, of whole vectors.
#[inline(always)]
pub(super) fn add_scaled<F: Arithmetic>(factor: f64, x: &[f64], y: &mut [f64]) {
    for (x, y) in vectors(x).iter().zip(vectors_mut(y)) {
        for lane in 0..LANES {
            y[lane] = F::multiply_add(factor, x[lane], y[lane]);
        }
    }
}

/// A lower triangular matrix stored by rows: entries below the diagonal, the diagonal and its reciprocals. To
/// the right of the diagonal the rows are zero and padded to whole vectors.
#[derive(Clone, Debug)]
pub(super) struct Lower {
    pub(super) size: usize,
    stride: usize,
    rows: Vec<f64>,
    diagonal: Vec<f64>,
    reciprocal: Vec<f64>,
}

impl Lower {
    pub(super) fn new(capacity: usize) -> Self {
        let stride = padded(capacity);
        Self {
            size: 0,
            stride,
            rows: vec![0.0; stride * capacity],
            diagonal: vec![0.0; capacity],
            reciprocal: vec![0.0; capacity],
        }
    }

    #[inline(always)]
    pub(super) fn row(&self, i: usize) -> &[f64] {
        &self.rows[i * self.stride..i * self.stride + padded(i)]
    }

    #[inline(always)]
    pub(super) fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.rows[i * self.stride..i * self.stride + padded(i)]
    }

    #[inline(always)]
    pub(super) fn set_diagonal(&mut self, i: usize, value: f64) {
        self.diagonal[i] = value;
        self.reciprocal[i] = 1.0 / value;
    }

    /// Returns the ratio of the smallest diagonal entry to the largest.
    pub(super) fn weakest(&self) -> f64 {
        let diagonal = &self.diagonal[..self.size];
        let (smallest, largest) =
            diagonal.iter().fold((f64::INFINITY, 0.0_f64), |(s, l), d| (s.min(*d), l.max(*d)));
        smallest / largest
    }

    /// Appends a row with the entries `below` to the left of the diagonal.
    #[inline(always)]
    pub(super) fn push(&mut self, below: &[f64], diagonal: f64) {
        let i = self.size;
        let row = self.row_mut(i);
        row[..i].copy_from_slice(&below[..i]);
        row[i..].fill(0.0);
        self.set_diagonal(i, diagonal);
        self.size = i + 1;
    }

    /// Overwrites the matrix, whose rows and diagonal hold a symmetric matrix, with its Cholesky factor, four
    /// rows at a time. Stops at a pivot that is not above `smallest` times its diagonal entry, and returns
    /// the number of rows factored before it.
    #[inline(always)]
    pub(super) fn factorize<F: Arithmetic>(&mut self, size: usize, smallest: f64) -> usize {
        self.size = size;
        let mut first = 0;
        while first < size {
            let block = (size - first).min(LANES);
            if block == LANES {
                self.solve_rows::<F>(first);
            }
            for i in first..first + block {
                let known = if block == LANES { first } else { 0 };
                let (above, rest) = self.rows.split_at_mut(i * self.stride);
                let row = &mut rest[..self.stride];
                for j in known..i {
                    let lower = &above[j * self.stride..j * self.stride + padded(j)];
                    let value = (row[j] - dot::<F>(lower, &row[..padded(j)])) * self.reciprocal[j];
                    row[j] = value;
                }
                let row = &row[..padded(i)];
                let pivot = self.diagonal[i] - dot::<F>(row, row);
                if pivot <= smallest * self.diagonal[i] || pivot.is_nan() {
                    return i;
                }
                self.set_diagonal(i, pivot.sqrt());
            }
            first += block;
        }
        size
    }

    /// Solves for the columns before `first` of the four rows that start at `first`.
    #[inline(always)]
    fn solve_rows<F: Arithmetic>(&mut self, first: usize) {
        let stride = self.stride;
        let (above, rest) = self.rows.split_at_mut(first * stride);
        let (r0, rest) = rest.split_at_mut(stride);
        let (r1, rest) = rest.split_at_mut(stride);
        let (r2, rest) = rest.split_at_mut(stride);
        let r3 = &mut rest[..stride];
        for j in 0..first {
            let whole = padded(j);
            let lower = vectors(&above[j * stride..j * stride + whole]);
            let (mut a0, mut a1, mut a2, mut a3) = ([0.0; 4], [0.0; 4], [0.0; 4], [0.0; 4]);
            let x0 = vectors(&r0[..whole]);
            let x1 = vectors(&r1[..whole]);
            let x2 = vectors(&r2[..whole]);
            let x3 = vectors(&r3[..whole]);
            for ((((l, x0), x1), x2), x3) in lower.iter().zip(x0).zip(x1).zip(x2).zip(x3) {
                fma::<F>(l, x0, &mut a0);
                fma::<F>(l, x1, &mut a1);
                fma::<F>(l, x2, &mut a2);
                fma::<F>(l, x3, &mut a3);
            }
            let reciprocal = self.reciprocal[j];
            r0[j] = (r0[j] - sum(&a0)) * reciprocal;
            r1[j] = (r1[j] - sum(&a1)) * reciprocal;
            r2[j] = (r2[j] - sum(&a2)) * reciprocal;
            r3[j] = (r3[j] - sum(&a3)) * reciprocal;
        }
    }

    /// Solves `L x = b` in place from row `first` on; previous rows are already solved. Entries of `b` beyond
    /// the size must be finite.
    #[inline(always)]
    pub(super) fn solve<F: Arithmetic>(&self, b: &mut [f64], first: usize) {
        for i in first..self.size {
            b[i] = (b[i] - dot::<F>(self.row(i), &b[..padded(i)])) * self.reciprocal[i];
        }
    }

    /// Solves `L' x = b` in place.
    #[inline(always)]
    pub(super) fn solve_transposed<F: Arithmetic>(&self, b: &mut [f64]) {
        for i in (0..self.size).rev() {
            let value = b[i] * self.reciprocal[i];
            add_scaled::<F>(-value, self.row(i), &mut b[..padded(i)]);
            b[i] = value;
        }
    }

    /// Removes row and column `j` of the product `L L'` by rotations.
    #[inline(always)]
    pub(super) fn remove(&mut self, j: usize) {
        let stride = self.stride;
        for i in j + 1..self.size {
            // row i moves up; its entry in column i - 1 is rotated into the diagonal
            let (above, below) = self.rows.split_at_mut(i * stride);
            let target = &mut above[(i - 1) * stride..];
            target[..i].copy_from_slice(&below[..i]);
            let (a, b) = (target[i - 1], self.diagonal[i]);
            target[i - 1] = 0.0;
            let radius = (a * a + b * b).sqrt();
            let (c, s) = (a / radius, b / radius);
            self.diagonal[i - 1] = radius;
            self.reciprocal[i - 1] = 1.0 / radius;
            for row in below.chunks_exact_mut(stride).skip(1).take(self.size - i - 1) {
                let (a, b) = (row[i - 1], row[i]);
                row[i - 1] = c * a + s * b;
                row[i] = c * b - s * a;
            }
        }
        self.size -= 1;
    }

    /// Solves `L B = N` in place for many right-hand sides. Row i of `b` holds component i of all of them;
    /// rows are `width` padded numbers apart.
    #[inline(always)]
    pub(super) fn solve_many<F: Arithmetic>(&self, b: &mut [f64], stride: usize, width: usize) {
        for i in 0..self.size {
            let (solved, rest) = b.split_at_mut(i * stride);
            let row = &mut rest[..stride];
            let factors = &self.rows[i * self.stride..i * self.stride + i];
            let mut column = 0;
            while width - column >= 8 * LANES {
                block::<F, 8>(factors, solved, stride, column, row, self.reciprocal[i]);
                column += 8 * LANES;
            }
            while width - column >= 4 * LANES {
                block::<F, 4>(factors, solved, stride, column, row, self.reciprocal[i]);
                column += 4 * LANES;
            }
            while width - column >= 2 * LANES {
                block::<F, 2>(factors, solved, stride, column, row, self.reciprocal[i]);
                column += 2 * LANES;
            }
            if width > column {
                block::<F, 1>(factors, solved, stride, column, row, self.reciprocal[i]);
            }
        }
    }
}

/// Computes `row = (row - factors solved) reciprocal` over `V` vectors from `column` on.
#[inline(always)]
fn block<F: Arithmetic, const V: usize>(
    factors: &[f64],
    solved: &[f64],
    stride: usize,
    column: usize,
    row: &mut [f64],
    reciprocal: f64,
) {
    let row: &mut [Vector; V] =
        vectors_mut(&mut row[column..column + V * LANES]).try_into().expect("V vectors");
    let mut sums = *row;
    for (factor, solved) in factors.iter().zip(solved.chunks_exact(stride)) {
        let solved: &[Vector; V] =
            vectors(&solved[column..column + V * LANES]).try_into().expect("V vectors");
        for v in 0..V {
            for lane in 0..LANES {
                sums[v][lane] = F::multiply_add(-*factor, solved[v][lane], sums[v][lane]);
            }
        }
    }
    for v in 0..V {
        for lane in 0..LANES {
            row[v][lane] = sums[v][lane] * reciprocal;
        }
    }
}

/// Writes `B' B` into the rows and the diagonal of `gram`. `b` has `rows` rows, `stride` apart, and `width`
/// columns.
#[inline(always)]
pub(super) fn gram<F: Arithmetic>(b: &[f64], stride: usize, width: usize, gram: &mut Lower) {
    let mut first = 0;
    while first < width {
        let mut column = 0;
        while column <= first {
            let mut sums = [[0.0; LANES]; LANES];
            for row in b.chunks_exact(stride) {
                let left: &Vector = vector(row, first);
                let right: &Vector = vector(row, column);
                for (left, sums) in left.iter().zip(&mut sums) {
                    for lane in 0..LANES {
                        sums[lane] = F::multiply_add(*left, right[lane], sums[lane]);
                    }
                }
            }
            for (r, sums) in sums.iter().enumerate() {
                let i = first + r;
                if i >= width {
                    break;
                }
                for (lane, sum) in sums.iter().enumerate() {
                    let j = column + lane;
                    if j < i {
                        gram.rows[i * gram.stride + j] = *sum;
                    } else if j == i {
                        gram.diagonal[i] = *sum;
                    }
                }
            }
            column += LANES;
        }
        first += LANES;
    }
    for i in 0..width {
        let stride = gram.stride;
        gram.rows[i * stride + i..i * stride + padded(i)].fill(0.0);
    }
}

/// Returns the largest magnitude.
#[inline(always)]
pub(super) fn largest(numbers: &[f64]) -> f64 {
    numbers.iter().fold(0.0, |largest, number| if number.abs() > largest { number.abs() } else { largest })
}
