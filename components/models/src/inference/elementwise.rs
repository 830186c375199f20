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
    /// `x` within `[low, high]`.
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

struct Map<'a, F> {
    function: F,
    input: &'a [f32],
    output: &'a mut [f32],
}

impl<F: Fn(f32) -> f32> WithSimd for Map<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (output, input) in self.output.iter_mut().zip(self.input) {
            *output = (self.function)(*input);
        }
    }
}

impl Unary {
    /// Writes the function of each input into `output`.
    pub fn apply(self, arch: Arch, input: &[f32], output: &mut [f32]) {
        /// Compiles one loop for the widest instructions.
        fn map(arch: Arch, input: &[f32], output: &mut [f32], function: impl Fn(f32) -> f32) {
            arch.dispatch(Map { function, input, output });
        }
        match self {
            Self::Relu => map(arch, input, output, |x| if x <= 0.0 { 0.0 } else { x }),
            Self::Elu(alpha) => {
                map(arch, input, output, |x| if x > 0.0 { x } else { alpha * Real::exp_m1(x) });
            }
            Self::LeakyRelu(alpha) => map(arch, input, output, |x| if x > 0.0 { x } else { alpha * x }),
            Self::Tanh => map(arch, input, output, Real::tanh),
            Self::Sigmoid => map(arch, input, output, Real::sigmoid),
            Self::Softplus => {
                map(arch, input, output, |x| x.larger(0.0) + Real::ln_1p(Real::exp(-x.magnitude())));
            }
            Self::Clip(low, high) => {
                map(arch, input, output, |x| {
                    let x = if x < low { low } else { x };
                    if x > high { high } else { x }
                });
            }
            Self::Sqrt => map(arch, input, output, |x: f32| x.sqrt()),
            Self::Square => map(arch, input, output, |x| x * x),
            Self::Softsign => map(arch, input, output, |x| x / (1.0 + x.magnitude())),
        }
    }
}

/// Layout of an operand of a binary function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Operand {
    /// One number for each output, in the same order.
    Aligned,
    /// The same number for all outputs.
    Single,
    /// Numbers at these offsets.
    At(Vec<u32>),
}

struct Both<'a, F> {
    function: F,
    a: (&'a [f32], &'a Operand),
    b: (&'a [f32], &'a Operand),
    output: &'a mut [f32],
}

impl<F: Fn(f32, f32) -> f32> WithSimd for Both<'_, F> {
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
    /// Writes the function of each pair of operands into `output`.
    pub fn apply(self, arch: Arch, a: (&[f32], &Operand), b: (&[f32], &Operand), output: &mut [f32]) {
        match self {
            Self::Add => arch.dispatch(Both { function: |a, b| a + b, a, b, output }),
            Self::Sub => arch.dispatch(Both { function: |a, b| a - b, a, b, output }),
            Self::Mul => arch.dispatch(Both { function: |a, b| a * b, a, b, output }),
            Self::Div => arch.dispatch(Both { function: |a, b| a / b, a, b, output }),
            Self::Pow => arch.dispatch(Both { function: |a: f32, b: f32| a.powf(b), a, b, output }),
            Self::Min => {
                let function = |a: f32, b: f32| if a < b || a.is_nan() { a } else { b };
                arch.dispatch(Both { function, a, b, output });
            }
            Self::Max => {
                let function = |a: f32, b: f32| if a > b || a.is_nan() { a } else { b };
                arch.dispatch(Both { function, a, b, output });
            }
        }
    }
}
