//! Elementwise functions of one or two numbers.

use pulp::{Arch, Simd, WithSimd};

use crate::arithmetic::Real;

/// A function of one number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unary {
    /// `max(x, 0)`.
    Relu,
    /// `x` above 0, `alpha (exp(x) - 1)` below.
    Elu(f32),
    /// `x` above 0, `alpha x` below.
    LeakyRelu(f32),
    /// Hyperbolic tangent.
    Tanh,
    /// `1 / (1 + exp(-x))`.
    Sigmoid,
    /// `ln(1 + exp(x))`.
    Softplus,
    /// `x` limited to the range from the first to the second number.
    Clip(f32, f32),
    /// Square root.
    Sqrt,
    /// `x * x`.
    Square,
    /// `x / (1 + |x|)`.
    Softsign,
}

/// A function of two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binary {
    /// `a + b`.
    Add,
    /// `a - b`.
    Sub,
    /// `a * b`.
    Mul,
    /// `a / b`.
    Div,
    /// `a` to the power of `b`.
    Pow,
    /// The smaller of `a` and `b`; NaN if either is NaN.
    Min,
    /// The larger of `a` and `b`; NaN if either is NaN.
    Max,
}

struct Map<'a, T, F> {
    function: F,
    input: &'a [T],
    output: &'a mut [T],
}

impl<T: Real, F: Fn(T) -> T> WithSimd for Map<'_, T, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (output, input) in self.output.iter_mut().zip(self.input) {
            *output = (self.function)(*input);
        }
    }
}

impl Unary {
    /// Applies the function to each number of `input` and writes the results to `output`.
    pub fn apply<T: Real>(self, arch: Arch, input: &[T], output: &mut [T]) {
        /// Compiles one loop for the widest instructions.
        fn map<T: Real>(arch: Arch, input: &[T], output: &mut [T], function: impl Fn(T) -> T) {
            arch.dispatch(Map { function, input, output });
        }
        let (zero, one) = (T::default(), T::from_f32(1.0));
        match self {
            Self::Relu => map(arch, input, output, |x| if x <= zero { zero } else { x }),
            Self::Elu(alpha) => {
                let alpha = T::from_f32(alpha);
                map(arch, input, output, |x| if x > zero { x } else { alpha * x.exp_m1() });
            }
            Self::LeakyRelu(alpha) => {
                let alpha = T::from_f32(alpha);
                map(arch, input, output, |x| if x > zero { x } else { alpha * x });
            }
            Self::Tanh => map(arch, input, output, T::tanh),
            Self::Sigmoid => map(arch, input, output, T::sigmoid),
            Self::Softplus => {
                map(arch, input, output, |x| x.larger(zero) + (-x.magnitude()).exp().ln_1p());
            }
            Self::Clip(low, high) => {
                let (low, high) = (T::from_f32(low), T::from_f32(high));
                map(arch, input, output, |x| {
                    let x = if x < low { low } else { x };
                    if x > high { high } else { x }
                });
            }
            Self::Sqrt => map(arch, input, output, T::sqrt),
            Self::Square => map(arch, input, output, |x| x * x),
            Self::Softsign => map(arch, input, output, |x| x / (one + x.magnitude())),
        }
    }
}

/// Layout of an operand of a binary function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Operand {
    /// One number for each output, in the order of the outputs.
    Aligned,
    /// The same number for all outputs.
    Single,
    /// For each output, the number at this offset in the operand.
    At(Vec<u32>),
}

/// Numbers and their layout.
type Numbers<'a, T> = (&'a [T], &'a Operand);

struct Both<'a, T, F> {
    function: F,
    a: Numbers<'a, T>,
    b: Numbers<'a, T>,
    output: &'a mut [T],
}

impl<T: Real, F: Fn(T, T) -> T> WithSimd for Both<'_, T, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { function, a, b, output } = self;
        match (a.1, b.1) {
            (Operand::Aligned, Operand::Aligned) => {
                for ((output, a), b) in output.iter_mut().zip(a.0).zip(b.0) {
                    *output = function(*a, *b);
                }
            }
            (Operand::Aligned, Operand::Single) => {
                for (output, a) in output.iter_mut().zip(a.0) {
                    *output = function(*a, b.0[0]);
                }
            }
            _ => {
                let offset = |operand: &Operand, k: usize| match operand {
                    Operand::Aligned => k,
                    Operand::Single => 0,
                    Operand::At(offsets) => offsets[k] as usize,
                };
                for (k, output) in output.iter_mut().enumerate() {
                    *output = function(a.0[offset(a.1, k)], b.0[offset(b.1, k)]);
                }
            }
        }
    }
}

impl Binary {
    /// Applies the function to each pair of operands and writes the results to `output`.
    pub fn apply<T: Real>(self, arch: Arch, a: (&[T], &Operand), b: (&[T], &Operand), output: &mut [T]) {
        /// Compiles one loop for the widest instructions.
        fn map<T: Real>(
            arch: Arch,
            (a, b): (Numbers<'_, T>, Numbers<'_, T>),
            output: &mut [T],
            function: impl Fn(T, T) -> T,
        ) {
            arch.dispatch(Both { function, a, b, output });
        }
        match self {
            Self::Add => map(arch, (a, b), output, |a, b| a + b),
            Self::Sub => map(arch, (a, b), output, |a, b| a - b),
            Self::Mul => map(arch, (a, b), output, |a, b| a * b),
            Self::Div => map(arch, (a, b), output, |a, b| a / b),
            Self::Pow => map(arch, (a, b), output, T::powf),
            Self::Min => map(arch, (a, b), output, |a, b| if a < b || a.is_nan() { a } else { b }),
            Self::Max => map(arch, (a, b), output, |a, b| if a > b || a.is_nan() { a } else { b }),
        }
    }
}
