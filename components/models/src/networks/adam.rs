//! Adam, a stochastic gradient method.

/// The state of Adam for all parameters of a network, in their order.
#[derive(Clone, Debug)]
pub struct Adam {
    first: Vec<Vec<f32>>,
    second: Vec<Vec<f32>>,
    steps: i32,
}

impl Adam {
    pub(super) fn new(sizes: &[usize]) -> Self {
        let zeros = || sizes.iter().map(|size| vec![0.0; *size]).collect();
        Self { first: zeros(), second: zeros(), steps: 0 }
    }

    /// One step against the gradients; `decay` draws parameters to 0 beside it (AdamW).
    pub(super) fn step(
        &mut self,
        parameters: [&mut [f32]; 8],
        gradients: [&[f32]; 8],
        rate: f32,
        decay: f32,
    ) {
        const BETA: [f32; 2] = [0.9, 0.999];
        self.steps += 1;
        let correction = BETA.map(|beta| 1.0 - beta.powi(self.steps));
        let state = self.first.iter_mut().zip(&mut self.second);
        for ((parameters, gradients), (first, second)) in parameters.into_iter().zip(gradients).zip(state) {
            for (((p, g), m), v) in parameters.iter_mut().zip(gradients).zip(first).zip(second) {
                *m += (1.0 - BETA[0]) * (g - *m);
                *v += (1.0 - BETA[1]) * (g * g - *v);
                *p -= rate * ((*m / correction[0]) / ((*v / correction[1]).sqrt() + 1e-8) + decay * *p);
            }
        }
    }
}
