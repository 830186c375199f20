//! Adam, a stochastic gradient method.

use pulp::{Arch, Simd, WithSimd};

/// Constant added to the root of the second moment.
const EPSILON: f32 = 1e-8;

/// Decay of the first and of the second moment.
const BETA: [f32; 2] = [0.9, 0.999];

/// State of the Adam optimiser for all parameters of a network.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    first: Vec<Vec<f32>>,
    second: Vec<Vec<f32>>,
    steps: i32,
    epsilon: f32,
}

/// One step of a slice of parameters.
struct Step<'a> {
    parameters: &'a mut [f32],
    gradients: &'a [f32],
    moments: [&'a mut [f32]; 2],
    correction: [f32; 2],
    epsilon: f32,
    rate: f32,
    decay: f32,
}

impl WithSimd for Step<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { parameters, gradients, moments: [first, second], correction, epsilon, rate, decay } = self;
        for (((p, g), m), v) in parameters.iter_mut().zip(gradients).zip(first).zip(second) {
            *m += (1.0 - BETA[0]) * (g - *m);
            *v += (1.0 - BETA[1]) * (g * g - *v);
            *p -= rate * ((*m / correction[0]) / ((*v / correction[1]).sqrt() + epsilon) + decay * *p);
        }
    }
}

impl Adam {
    /// Creates the initial state for parameter slices of these lengths.
    pub fn new(sizes: &[usize]) -> Self {
        let zeros = || sizes.iter().map(|size| vec![0.0; *size]).collect();
        Self { first: zeros(), second: zeros(), steps: 0, epsilon: EPSILON }
    }

    /// Sets the constant that is added to the square root of the second moment. Default: 1e-8 (Kingma, Ba
    /// 2015).
    #[must_use]
    pub fn with_epsilon(self, epsilon: f32) -> Self {
        Self { epsilon, ..self }
    }

    /// Moves the parameters by one step that decreases the loss, with the learning rate `rate`. `decay` is
    /// the rate at which the parameters decay towards 0 (AdamW).
    ///
    /// # Panics
    /// If the lengths of the slices differ from the lengths passed to [`new`](Self::new).
    pub fn step<'a>(
        &mut self,
        parameters: impl IntoIterator<Item = &'a mut [f32]>,
        gradients: impl IntoIterator<Item = &'a [f32]>,
        rate: f32,
        decay: f32,
    ) {
        self.steps += 1;
        let correction = BETA.map(|beta| 1.0 - beta.powi(self.steps));
        let state = self.first.iter_mut().zip(&mut self.second);
        for ((parameters, gradients), (first, second)) in parameters.into_iter().zip(gradients).zip(state) {
            assert_eq!((parameters.len(), gradients.len()), (first.len(), first.len()), "lengths of slices");
            let epsilon = self.epsilon;
            let moments = [&mut first[..], second];
            Arch::new().dispatch(Step { parameters, gradients, moments, correction, epsilon, rate, decay });
        }
    }

    /// Returns the number of steps performed.
    pub fn steps(&self) -> i32 {
        self.steps
    }

    /// Returns the first and second moments of the gradient for each slice of parameters.
    pub fn moments(&self) -> [&[Vec<f32>]; 2] {
        [&self.first, &self.second]
    }

    /// Restores the state after `steps` steps from [`moments`](Self::moments); `None` if the lengths of the
    /// moments differ.
    pub fn from_moments([first, second]: [Vec<Vec<f32>>; 2], steps: i32) -> Option<Self> {
        let lengths = |moments: &[Vec<f32>]| moments.iter().map(Vec::len).collect::<Vec<_>>();
        (steps >= 0 && lengths(&first) == lengths(&second)).then_some(Self {
            first,
            second,
            steps,
            epsilon: EPSILON,
        })
    }
}
