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

/// Runs a loop with the function as a constant, so that the compiler vectorises it.
macro_rules! with_constant {
    ($function:expr, $constant:ident => $body:expr) => {
        match $function {
            Function::Relu => {
                let $constant = Function::Relu;
                $body
            }
            Function::Elu(alpha) => {
                let $constant = Function::Elu(alpha);
                $body
            }
            Function::LeakyRelu(alpha) => {
                let $constant = Function::LeakyRelu(alpha);
                $body
            }
            Function::Tanh => {
                let $constant = Function::Tanh;
                $body
            }
            Function::Sigmoid => {
                let $constant = Function::Sigmoid;
                $body
            }
            Function::Softplus => {
                let $constant = Function::Softplus;
                $body
            }
            Function::Softsign => {
                let $constant = Function::Softsign;
                $body
            }
        }
    };
}

/// The loop of [`Function::apply`].
struct Values<'a>(Function, &'a mut [f32]);

impl WithSimd for Values<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self(function, numbers) = self;
        with_constant!(function, f => numbers.iter_mut().for_each(|x| *x = f.value(*x)));
    }
}

/// The loop of [`Function::scale_by_slopes`].
struct Slopes<'a>(Function, &'a mut [f32], &'a [f32]);

impl WithSimd for Slopes<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self(function, gradients, values) = self;
        with_constant!(function, f => {
            gradients.iter_mut().zip(values).for_each(|(g, y)| *g *= f.slope_at_value(*y));
        });
    }
}

impl Function {
    /// Replaces each number `x` by the value at `x`.
    pub(crate) fn apply(self, numbers: &mut [f32]) {
        Arch::new().dispatch(Values(self, numbers));
    }

    /// Multiplies each gradient by the derivative at the corresponding value in `values`.
    pub(crate) fn scale_by_slopes(self, gradients: &mut [f32], values: &[f32]) {
        Arch::new().dispatch(Slopes(self, gradients, values));
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

    /// Returns the derivative at the value `y`, which determines it.
    #[inline(always)]
    pub(crate) fn slope_at_value<T: Real>(self, y: T) -> T {
        let one = T::from_f64(1.0);
        match self {
            // the slope depends on the value, or on the sign of `x`, which equals the value's sign
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

/// A layer that applies a function to each number. Each row has `width` numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Activation {
    /// Number of values per row.
    pub width: usize,
    /// Function applied to each number.
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
    use super::Function;

    #[test]
    fn vector_loops_match_single_numbers_bit_for_bit() {
        use Function::{Elu, LeakyRelu, Relu, Sigmoid, Softplus, Softsign, Tanh};
        let numbers: Vec<f32> = (-200..=200).map(|k| 0.03 * k as f32).collect();
        for function in [Relu, Elu(0.7), LeakyRelu(0.1), Tanh, Sigmoid, Softplus, Softsign] {
            let mut values = numbers.clone();
            function.apply(&mut values);
            let mut gradients = numbers.clone();
            function.scale_by_slopes(&mut gradients, &values);
            for ((x, y), g) in numbers.iter().zip(&values).zip(&gradients) {
                assert_eq!(y.to_bits(), function.value(*x).to_bits(), "{function:?} at {x}");
                assert_eq!(g.to_bits(), (x * function.slope_at_value(*y)).to_bits(), "{function:?} at {x}");
            }
        }
    }
}
