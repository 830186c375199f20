//! Blocks of weights: model parameters that arrive on a topic while the component runs.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{ConfigureError, Declare, Setup, Tick};
use crate::state::{MAX_WEIGHTS, Weights};
use crate::transport::Input;

/// Time at which received weights take effect.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TakeWeights {
    /// Before the next step. After a reset, the episode begins with the weights of the configuration.
    #[default]
    Step,
    /// Before the first step of an episode, in real time and in lockstep. Weights that arrive during an
    /// episode wait for the next episode. In a run without episodes, they have no effect. Weights persist
    /// through resets.
    Episode,
}

/// An input that receives the weights of a model, for example a neural network. It validates received blocks
/// of [`Weights`], assembles them, and passes complete versions to the component.
///
/// The weights of a model arrive in blocks; all blocks except the last are full ([`MAX_WEIGHTS`] numbers). A
/// block is rejected and counted if its position or length is wrong, a number is not finite, or its version
/// is older than the newest received version. Blocks of an incomplete, superseded version are dropped. A
/// topic keeps only its newest value, so a writer of several blocks publishes one block per step, in turn.
///
/// ```
/// use motorium::component::{TakeWeights, WeightsInput};
/// use motorium::prelude::*;
///
/// /// A force that is linear in two features.
/// struct Linear { weights: WeightsInput, model: [f64; 2], wrench: Output<Wrench> }
///
/// impl Linear {
///     fn configure(setup: &mut Setup) -> Result<Self, ConfigureError> {
///         let weights = setup.weights("weights", 2, TakeWeights::Step)?;
///         Ok(Self { weights, model: [0.0; 2], wrench: setup.output("wrench")? })
///     }
///
///     fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
///         if let Some(weights) = self.weights.take(tick) {
///             self.model.copy_from_slice(weights);
///         }
///         let force = self.model[0] + self.model[1] * tick.time();
///         self.wrench.send(&Wrench { force: [force, 0.0, 0.0], ..Wrench::default() })
///     }
///
///     fn reset(&mut self) {
///         self.weights.begin_episode();
///         self.model = [0.0; 2];
///     }
/// }
///
/// fn declare(declare: &mut Declare) {
///     declare.weights("weights", "weights of the two features");
///     declare.output::<Wrench>("wrench", "the force");
/// }
/// ```
#[derive(Debug)]
pub struct WeightsInput {
    input: Input<Weights>,
    store: Store,
}

impl Declare {
    /// Declares an input of [`Weights`], which the component opens with [`Setup::weights`].
    pub fn weights(&mut self, name: &str, doc: &str) {
        self.input::<Weights>(name, doc);
    }
}

impl Setup {
    /// Opens a declared input of weights for a model with `count` weights.
    ///
    /// # Errors
    /// The port is not declared, or `count` is zero.
    pub fn weights(
        &mut self,
        port: &str,
        count: usize,
        take: TakeWeights,
    ) -> Result<WeightsInput, ConfigureError> {
        if count == 0 {
            return Err(ConfigureError::failed(format!(
                "the model of input `{port}` has 0 weights, expected at least 1"
            )));
        }
        Ok(WeightsInput { input: self.input(port)?, store: Store::new(count, take) })
    }
}

impl WeightsInput {
    /// Returns all weights of the model if new weights must be applied before this step, or `None` to keep
    /// the current weights. Call this function once per step, before using the weights.
    pub fn take(&mut self, tick: &Tick) -> Option<&[f64]> {
        if let Some(block) = self.input.next_unread() {
            self.store.offer(&block);
        }
        self.store.take(tick.begins_episode)
    }

    /// Begins an episode of simulated time. Call this function in the component's `reset`, and restore the
    /// weights of the configuration there. [`Component::begin_episode`](super::Component::begin_episode) need
    /// not call this function, because an episode of real time resets nothing.
    pub fn begin_episode(&mut self) {
        self.store.begin_episode();
    }

    /// Returns the version of the applied weights; 0 if none have been applied.
    pub fn version(&self) -> u64 {
        self.store.taken
    }

    /// Returns the statistics for the component's result: the applied `version`, the number of versions
    /// `taken`, and the number of blocks `refused` by reason.
    pub fn result(&self) -> serde_json::Value {
        let Refusals { place, count, version, not_finite } = self.store.refusals;
        json!({
            "version": self.store.taken,
            "taken": self.store.changes,
            "refused": { "place": place, "count": count, "version": version, "not_finite": not_finite },
        })
    }
}

/// Number of rejected blocks by reason.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Refusals {
    place: u64,
    count: u64,
    version: u64,
    not_finite: u64,
}

/// Received weights, complete and incomplete.
#[derive(Debug)]
struct Store {
    take: TakeWeights,
    /// Weights of the version being received.
    arriving: Vec<f64>,
    arriving_version: u64,
    there: Vec<bool>,
    /// Newest complete weights, applied or pending.
    complete: Vec<f64>,
    complete_version: u64,
    /// Version applied last.
    taken: u64,
    changes: u64,
    refusals: Refusals,
}

impl Store {
    fn new(count: usize, take: TakeWeights) -> Self {
        Self {
            take,
            arriving: vec![0.0; count],
            arriving_version: 0,
            there: vec![false; count.div_ceil(MAX_WEIGHTS)],
            complete: vec![0.0; count],
            complete_version: 0,
            taken: 0,
            changes: 0,
            refusals: Refusals::default(),
        }
    }

    /// Adds a block or rejects it.
    fn offer(&mut self, block: &Weights) {
        let (index, version) = (block.block as usize, block.version);
        if block.blocks as usize != self.there.len() || index >= self.there.len() {
            self.refusals.place += 1;
            return;
        }
        let start = index * MAX_WEIGHTS;
        let end = (start + MAX_WEIGHTS).min(self.arriving.len());
        if block.count() != end - start {
            self.refusals.count += 1;
            return;
        }
        if version == self.complete_version && version > 0 {
            return; // duplicate
        }
        if version <= self.complete_version || version < self.arriving_version {
            self.refusals.version += 1;
            return;
        }
        if block.value().iter().any(|value| !value.is_finite()) {
            self.refusals.not_finite += 1;
            return;
        }
        if version > self.arriving_version {
            self.arriving_version = version;
            self.there.fill(false);
        }
        self.arriving[start..end].copy_from_slice(block.value());
        self.there[index] = true;
        if self.there.iter().all(|there| *there) {
            core::mem::swap(&mut self.arriving, &mut self.complete);
            self.complete_version = version;
        }
    }

    /// Returns the weights to apply now.
    fn take(&mut self, begins_episode: bool) -> Option<&[f64]> {
        let is_new = self.complete_version > self.taken;
        let is_due = match self.take {
            TakeWeights::Step => is_new,
            // also applies to weights applied before the reset
            TakeWeights::Episode => begins_episode && self.complete_version > 0,
        };
        if !is_due {
            return None;
        }
        self.changes += u64::from(is_new);
        self.taken = self.complete_version;
        Some(&self.complete)
    }

    fn begin_episode(&mut self) {
        if self.take == TakeWeights::Step {
            self.there.fill(false);
            (self.arriving_version, self.complete_version, self.taken) = (0, 0, 0);
            (self.changes, self.refusals) = (0, Refusals::default());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(version: u64, [block, blocks]: [u32; 2], values: &[f64]) -> Box<Weights> {
        let mut weights = Box::new(Weights::default());
        (weights.version, weights.block, weights.blocks) = (version, block, blocks);
        weights.set_count(values.len());
        weights.value_mut().copy_from_slice(values);
        weights
    }

    fn store(count: usize, take: TakeWeights) -> Store {
        Store::new(count, take)
    }

    #[test]
    fn weights_apply_once_for_increasing_versions() {
        let mut store = store(2, TakeWeights::Step);
        assert_eq!(store.take(true), None);
        store.offer(&block(3, [0, 1], &[1.0, 2.0]));
        assert_eq!(store.take(false), Some(&[1.0, 2.0][..]));
        assert_eq!(store.take(false), None);
        store.offer(&block(3, [0, 1], &[1.0, 2.0]));
        assert_eq!(store.take(false), None, "sent again");
        assert_eq!(store.refusals, Refusals::default());
        store.offer(&block(2, [0, 1], &[5.0, 6.0]));
        store.offer(&block(0, [0, 1], &[5.0, 6.0]));
        assert_eq!(store.take(false), None);
        assert_eq!(store.refusals.version, 2);
        store.offer(&block(4, [0, 1], &[7.0, 8.0]));
        assert_eq!(store.take(false), Some(&[7.0, 8.0][..]));
        assert_eq!((store.taken, store.changes), (4, 2));
    }

    #[test]
    fn invalid_blocks_are_rejected_and_counted_by_reason() {
        let mut store = store(2, TakeWeights::Step);
        store.offer(&block(1, [0, 2], &[1.0, 2.0]));
        store.offer(&block(1, [1, 1], &[1.0, 2.0]));
        store.offer(&block(1, [0, 1], &[1.0]));
        store.offer(&block(1, [0, 1], &[1.0, f64::INFINITY]));
        assert_eq!(store.take(true), None);
        assert_eq!(store.refusals, Refusals { place: 2, count: 1, version: 0, not_finite: 1 });
    }

    #[test]
    fn blocks_are_assembled_in_any_order() {
        let count = MAX_WEIGHTS + 1;
        let mut store = store(count, TakeWeights::Step);
        let first = |version, value| block(version, [0, 2], &[value; MAX_WEIGHTS]);
        store.offer(&block(1, [1, 2], &[1.0]));
        store.offer(&first(2, 2.0));
        assert_eq!(store.take(false), None, "no version is complete");
        store.offer(&block(1, [1, 2], &[1.0]));
        assert_eq!(store.refusals.version, 1, "superseded");
        store.offer(&block(2, [1, 2], &[2.5]));
        let taken = store.take(false).expect("complete");
        assert_eq!((taken.len(), taken[0], taken[count - 1]), (count, 2.0, 2.5));
    }

    #[test]
    fn episode_weights_apply_at_its_first_step_and_persist() {
        let mut store = store(1, TakeWeights::Episode);
        store.offer(&block(1, [0, 1], &[1.0]));
        assert_eq!(store.take(true), Some(&[1.0][..]));
        store.offer(&block(2, [0, 1], &[2.0]));
        store.offer(&block(3, [0, 1], &[3.0]));
        assert_eq!(store.take(false), None);
        store.begin_episode();
        assert_eq!(store.take(true), Some(&[3.0][..]), "the newest");
        store.begin_episode();
        assert_eq!(store.take(true), Some(&[3.0][..]), "again after a reset of the component");
        assert_eq!((store.taken, store.changes), (3, 2));
    }

    #[test]
    fn episode_starts_with_configured_weights() {
        let mut store = store(1, TakeWeights::Step);
        store.offer(&block(9, [0, 1], &[1.0]));
        assert_eq!(store.take(true), Some(&[1.0][..]));
        store.begin_episode();
        assert_eq!(store.take(true), None);
        store.offer(&block(1, [0, 1], &[2.0]));
        assert_eq!(store.take(false), Some(&[2.0][..]), "versions start over");
    }
}
