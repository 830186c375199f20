//! Elementwise activation functions.

use pulp::{Arch, Simd, WithSimd};

use super::{Backward, Forward, Layer};
use crate::arithmetic::Real;

/// A differentiable function of one number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Function {
    /// `max(x, 0)`.
    Relu,
    /// `x` above 0, `alpha (exp(x) - 1)` below.
    Elu(f64),
    /// `x` above 0, `alpha x` below.
    LeakyRelu(f64),
    /// Hyperbolic tangent.
    Tanh,
    /// `1 / (1 + exp(-x))`.
    Sigmoid,
    /// `ln(1 + exp(x))`.
    Softplus,
    /// `x / (1 + |x|)`.
    Softsign,
}

impl Function {
    /// Replaces each number by its value, bit for bit as [`value`](Self::value), with the widest instructions
    /// of the machine.
    pub(crate) fn apply(self, values: &mut [f32]) {
        self.specialise(Values(values));
    }

    /// Multiplies each gradient by [`slope_at_value`](Self::slope_at_value) of its value, likewise.
    pub(crate) fn multiply_slopes(self, values: &[f32], gradients: &mut [f32]) {
        self.specialise(Slopes { values, gradients });
    }

    /// Runs `work` compiled for this function alone: a loop that chose the function at each number would not
    /// become vector instructions.
    fn specialise(self, work: impl Elementwise) {
        match self {
            Self::Relu => run(work, || Self::Relu),
            Self::Elu(alpha) => run(work, || Self::Elu(alpha)),
            Self::LeakyRelu(alpha) => run(work, || Self::LeakyRelu(alpha)),
            Self::Tanh => run(work, || Self::Tanh),
            Self::Sigmoid => run(work, || Self::Sigmoid),
            Self::Softplus => run(work, || Self::Softplus),
            Self::Softsign => run(work, || Self::Softsign),
        }
    }

    /// Returns the value at `x`.
    #[inline(always)]
    pub(crate) fn value<T: Real>(self, x: T) -> T {
        let (zero, one) = (T::default(), T::from_f64(1.0));
        match self {
            Self::Relu => x.larger(zero),
            Self::Elu(alpha) => {
                if x > zero {
                    x
                } else {
                    T::from_f64(alpha) * x.exp_m1()
                }
            }
            Self::LeakyRelu(alpha) => {
                if x > zero {
                    x
                } else {
                    T::from_f64(alpha) * x
                }
            }
            Self::Tanh => x.tanh(),
            Self::Sigmoid => x.sigmoid(),
            Self::Softplus => x.larger(zero) + (-x.magnitude()).exp().ln_1p(),
            Self::Softsign => x / (one + x.magnitude()),
        }
    }

    /// Returns the derivative where the value is `y`, which determines it.
    #[inline(always)]
    pub(crate) fn slope_at_value<T: Real>(self, y: T) -> T {
        let one = T::from_f64(1.0);
        match self {
            // the slope depends on the value, or on the sign of `x`, which the value has
            Self::Relu | Self::Elu(_) | Self::LeakyRelu(_) | Self::Tanh | Self::Sigmoid => self.slope(y, y),
            Self::Softplus => one - (-y).exp(),
            Self::Softsign => {
                let root = one - y.magnitude();
                root * root
            }
        }
    }

    /// Returns the derivative at `x`, where the value is `y`.
    #[inline(always)]
    fn slope<T: Real>(self, x: T, y: T) -> T {
        let (zero, one) = (T::default(), T::from_f64(1.0));
        match self {
            Self::Relu => {
                if x > zero {
                    one
                } else {
                    zero
                }
            }
            Self::Elu(alpha) => {
                if x > zero {
                    one
                } else {
                    y + T::from_f64(alpha)
                }
            }
            Self::LeakyRelu(alpha) => {
                if x > zero {
                    one
                } else {
                    T::from_f64(alpha)
                }
            }
            Self::Tanh => one - y * y,
            Self::Sigmoid => y * (one - y),
            Self::Softplus => x.sigmoid(),
            Self::Softsign => {
                let root = one / (one + x.magnitude());
                root * root
            }
        }
    }
}

/// A loop over numbers, compiled for one function.
trait Elementwise {
    fn run(self, function: impl Fn() -> Function);
}

/// Numbers to be replaced by their values.
struct Values<'a>(&'a mut [f32]);

impl Elementwise for Values<'_> {
    #[inline(always)]
    fn run(self, function: impl Fn() -> Function) {
        for x in self.0 {
            *x = function().value(*x);
        }
    }
}

/// Gradients to be multiplied by the slopes at these values.
struct Slopes<'a> {
    values: &'a [f32],
    gradients: &'a mut [f32],
}

impl Elementwise for Slopes<'_> {
    #[inline(always)]
    fn run(self, function: impl Fn() -> Function) {
        for (gradient, value) in self.gradients.iter_mut().zip(self.values) {
            *gradient *= function().slope_at_value(*value);
        }
    }
}

/// Runs a loop with the widest instructions of the machine.
fn run(work: impl Elementwise, function: impl Fn() -> Function) {
    Arch::new().dispatch(Wide { work, function });
}

struct Wide<W, F> {
    work: W,
    function: F,
}

impl<W: Elementwise, F: Fn() -> Function> WithSimd for Wide<W, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.work.run(self.function);
    }
}

/// A function of each number of rows of `width`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Activation {
    /// Numbers in a row.
    pub width: usize,
    /// The function.
    pub function: Function,
}

impl Layer for Activation {
    fn inputs(&self) -> usize {
        self.width
    }

    fn outputs(&self) -> usize {
        self.width
    }

    fn parameters(&self) -> usize {
        0
    }

    fn forward<T: Real>(&self, pass: Forward<'_, T>) {
        pass.output.iter_mut().zip(pass.input).for_each(|(y, x)| *y = self.function.value(*x));
    }

    fn backward<T: Real>(&self, pass: Backward<'_, T>) {
        let values = pass.input.iter().zip(pass.output).zip(pass.gradient);
        for (((x, y), g), out) in values.zip(pass.input_gradient) {
            *out = *g * self.function.slope(*x, *y);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_loops_give_the_bits_of_single_numbers() {
        let functions = [
            Function::Relu,
            Function::Elu(0.7),
            Function::LeakyRelu(0.01),
            Function::Tanh,
            Function::Sigmoid,
            Function::Softplus,
            Function::Softsign,
        ];
        let special = [0.0, -0.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 1e-38, -1e-38];
        let numbers: Vec<f32> =
            special.into_iter().chain((-1500..1500).map(|k| 0.01 * k as f32 + 1e-3)).collect();
        // The payload of a NaN is no result.
        let bits = |value: &f32| if value.is_nan() { f32::NAN.to_bits() } else { value.to_bits() };
        let bits = |values: &[f32]| values.iter().map(bits).collect::<Vec<_>>();
        for function in functions {
            for length in [0, 1, 7, 16, 31, numbers.len()] {
                let mut values = numbers[..length].to_vec();
                function.apply(&mut values);
                let expected: Vec<f32> = numbers[..length].iter().map(|x| function.value(*x)).collect();
                assert_eq!(bits(&values), bits(&expected), "{function:?}, {length} values");
                let mut gradients = numbers[..length].to_vec();
                function.multiply_slopes(&values, &mut gradients);
                let slopes = values.iter().zip(&numbers).map(|(y, g)| g * function.slope_at_value(*y));
                assert_eq!(
                    bits(&gradients),
                    bits(&slopes.collect::<Vec<_>>()),
                    "{function:?}, {length} slopes"
                );
            }
        }
    }
}
