//! Elementwise activation functions.

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
    /// Returns the value at `x`.
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
