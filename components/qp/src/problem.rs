//! The numbers of one quadratic program.

use nalgebra::{DMatrix, DVector};

use super::{Constraint, Side, Sides, Structure, UpdateError};

/// Negative curvature of a Hessian, relative to its largest entry, that counts as rounding.
pub(crate) const ROUNDING: f64 = 1e-9;

/// The data of one quadratic program, overwritten in place each tick.
///
/// The problem has `n` unknowns, `m` equalities and `p` rows. An absent bound is `-inf` or `+inf`. As in most
/// solvers, any magnitude of at least [`Problem::INFINITE`] also counts as infinite.
#[derive(Clone, Debug)]
pub struct Problem {
    /// Cost matrix `P`, n x n, symmetric positive semi-definite. Only the upper triangle is read.
    pub hessian: DMatrix<f64>,
    /// Cost vector `q`, n entries.
    pub gradient: DVector<f64>,
    /// Equality matrix `A`, m x n.
    pub equality_matrix: DMatrix<f64>,
    /// Right-hand side `b` of the equalities, m entries.
    pub equality_value: DVector<f64>,
    /// Row matrix `G` of the two-sided inequalities, p x n.
    pub row_matrix: DMatrix<f64>,
    /// Lower bounds `lg` of the rows, p entries.
    pub row_lower: DVector<f64>,
    /// Upper bounds `ug` of the rows, p entries.
    pub row_upper: DVector<f64>,
    /// Lower bounds `lb` of the variables, n entries.
    pub lower: DVector<f64>,
    /// Upper bounds `ub` of the variables, n entries.
    pub upper: DVector<f64>,
}

impl Problem {
    /// Magnitude from which a bound counts as infinite.
    pub const INFINITE: f64 = 1e20;

    /// Creates a problem of this structure with all numbers zero and no bounds.
    pub fn new(structure: &Structure) -> Self {
        let n = structure.variables();
        let m = structure.equality_count();
        let p = structure.row_sides().len();
        Self {
            hessian: DMatrix::zeros(n, n),
            gradient: DVector::zeros(n),
            equality_matrix: DMatrix::zeros(m, n),
            equality_value: DVector::zeros(m),
            row_matrix: DMatrix::zeros(p, n),
            row_lower: DVector::repeat(p, f64::NEG_INFINITY),
            row_upper: DVector::repeat(p, f64::INFINITY),
            lower: DVector::repeat(n, f64::NEG_INFINITY),
            upper: DVector::repeat(n, f64::INFINITY),
        }
    }

    /// Copies the numbers of a problem of the same structure.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.hessian.copy_from(&other.hessian);
        self.gradient.copy_from(&other.gradient);
        self.equality_matrix.copy_from(&other.equality_matrix);
        self.equality_value.copy_from(&other.equality_value);
        self.row_matrix.copy_from(&other.row_matrix);
        self.row_lower.copy_from(&other.row_lower);
        self.row_upper.copy_from(&other.row_upper);
        self.lower.copy_from(&other.lower);
        self.upper.copy_from(&other.upper);
    }

    /// Checks that the problem matches `structure` and that its data are valid.
    ///
    /// # Errors
    /// [`UpdateError`] describes the first defect.
    pub fn check(&self, structure: &Structure) -> Result<(), UpdateError> {
        let n = structure.variables();
        let m = structure.equality_count();
        let p = structure.row_sides().len();
        shape("P", self.hessian.shape(), (n, n))?;
        shape("q", self.gradient.shape(), (n, 1))?;
        shape("A", self.equality_matrix.shape(), (m, n))?;
        shape("b", self.equality_value.shape(), (m, 1))?;
        shape("G", self.row_matrix.shape(), (p, n))?;
        shape("lg", self.row_lower.shape(), (p, 1))?;
        shape("ug", self.row_upper.shape(), (p, 1))?;
        shape("lb", self.lower.shape(), (n, 1))?;
        shape("ub", self.upper.shape(), (n, 1))?;
        finite("P", &self.hessian)?;
        finite("q", &self.gradient)?;
        finite("A", &self.equality_matrix)?;
        finite("b", &self.equality_value)?;
        finite("G", &self.row_matrix)?;
        pairs(&self.row_lower, &self.row_upper, structure.row_sides(), Constraint::Row)?;
        pairs(&self.lower, &self.upper, structure.bound_sides(), Constraint::Bound)
    }
}

fn shape(what: &'static str, found: (usize, usize), expected: (usize, usize)) -> Result<(), UpdateError> {
    if found == expected { Ok(()) } else { Err(UpdateError::Shape { what, found, expected }) }
}

fn finite<C: nalgebra::Dim>(
    what: &'static str,
    numbers: &nalgebra::OMatrix<f64, nalgebra::Dyn, C>,
) -> Result<(), UpdateError>
where
    nalgebra::DefaultAllocator: nalgebra::allocator::Allocator<nalgebra::Dyn, C>,
{
    // Zero times a finite number is zero, zero times infinity is NaN, so eight branch-free sums find invalid
    // numbers.
    let (blocks, rest) = numbers.as_slice().as_chunks::<8>();
    let mut sums = [0.0; 8];
    for block in blocks {
        for (sum, value) in sums.iter_mut().zip(block) {
            *sum += value * 0.0;
        }
    }
    let sum: f64 = sums.iter().chain(rest).map(|value| value * 0.0).sum();
    if sum == 0.0 {
        return Ok(());
    }
    for column in 0..numbers.ncols() {
        for row in 0..numbers.nrows() {
            let value = numbers[(row, column)];
            if !value.is_finite() {
                return Err(UpdateError::NotFinite { what, row, column, value });
            }
        }
    }
    Ok(())
}

fn pairs(
    lower: &DVector<f64>,
    upper: &DVector<f64>,
    sides: &[Sides],
    name: fn(usize, Side) -> Constraint,
) -> Result<(), UpdateError> {
    for (index, sides) in sides.iter().enumerate() {
        let (l, u) = (lower[index], upper[index]);
        if l.is_nan() || u.is_nan() || l >= Problem::INFINITE || u <= -Problem::INFINITE || l > u {
            return Err(UpdateError::Crossed { constraint: name(index, Side::Lower), lower: l, upper: u });
        }
        if l > -Problem::INFINITE && !sides.has(Side::Lower) {
            return Err(UpdateError::Undeclared { constraint: name(index, Side::Lower), value: l });
        }
        if u < Problem::INFINITE && !sides.has(Side::Upper) {
            return Err(UpdateError::Undeclared { constraint: name(index, Side::Upper), value: u });
        }
    }
    Ok(())
}
