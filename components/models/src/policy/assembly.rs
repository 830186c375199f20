//! Assembly of a network's input from measured quantities, with bounds, factors and histories.

use super::{Observation, Policy};

/// A buffer that assembles the observation of a running policy. Only [`new`](Self::new) allocates.
///
/// ```
/// use motorium_models::policy::{Assembly, Policy};
///
/// let policy = Policy::parse(
///     r#"
///     network = "policy.onnx"
///     rate = 50.0
///     observations = [{ term = "command", scale = 2.0, clip = [-1.0, 1.0], history = 2 }]
///     action = { joints = ["hip"], default_pose = [0.0] }
///     "#,
/// )?;
/// let mut assembly = Assembly::new(&policy);
/// let mut input = [0.0; 6];
/// assembly.push(0, &[0.5, 0.0, -3.0]);
/// assembly.write(&mut input);
/// assert_eq!(input, [1.0, 0.0, -2.0, 1.0, 0.0, -2.0]); // the first value fills the history
/// assembly.push(0, &[0.0, 0.25, 0.0]);
/// assembly.write(&mut input);
/// assert_eq!(input, [1.0, 0.0, -2.0, 0.0, 0.5, 0.0]);
/// # Ok::<(), motorium_models::policy::PolicyError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Assembly {
    terms: Vec<Window>,
}

/// The last values of a term.
#[derive(Clone, Debug)]
struct Window {
    scale: Vec<f64>,
    clip: [f64; 2],
    /// Steps of `scale.len()` numbers, the newest last.
    values: Vec<f32>,
    is_filled: bool,
}

impl Assembly {
    /// Creates the empty observation of a policy.
    pub fn new(policy: &Policy) -> Self {
        let window = |observation: &Observation| {
            let width = policy.width(observation);
            Window {
                scale: (0..width).map(|index| observation.scale.get(index)).collect(),
                clip: observation.clip.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]),
                values: vec![0.0; width * observation.history],
                is_filled: false,
            }
        };
        Self { terms: policy.observations.iter().map(window).collect() }
    }

    /// Returns the number of values of a term in one step.
    ///
    /// # Panics
    ///
    /// If `term` is out of range.
    pub fn width(&self, term: usize) -> usize {
        self.terms[term].scale.len()
    }

    /// Clears all histories at the start of an episode. The next value of a term then fills its whole
    /// history.
    pub fn reset(&mut self) {
        self.terms.iter_mut().for_each(|term| term.is_filled = false);
    }

    /// Appends the values of a term in one step, clamped to its bounds and then scaled by its factors.
    ///
    /// # Panics
    ///
    /// If `term` is out of range, or `values` does not have the length of the term.
    pub fn push(&mut self, term: usize, values: &[f64]) {
        let Window { scale, clip: [low, high], values: window, is_filled } = &mut self.terms[term];
        assert_eq!(values.len(), scale.len(), "number of values of term {term}");
        let width = scale.len();
        let newest = window.len() - width;
        window.copy_within(width.., 0);
        for ((slot, value), scale) in window[newest..].iter_mut().zip(values).zip(&*scale) {
            *slot = (value.clamp(*low, *high) * scale) as f32;
        }
        if !*is_filled {
            (0..newest).step_by(width.max(1)).for_each(|first| window.copy_within(newest.., first));
            *is_filled = true;
        }
    }

    /// Writes the observation: all terms in order.
    ///
    /// # Panics
    ///
    /// If the length of `input` differs from the size of the observation.
    pub fn write(&self, input: &mut [f32]) {
        let mut rest = input;
        for Window { values, .. } in &self.terms {
            let (slot, behind) = rest.split_at_mut(values.len());
            slot.copy_from_slice(values);
            rest = behind;
        }
        assert!(rest.is_empty(), "{} numbers too many", rest.len());
    }
}
