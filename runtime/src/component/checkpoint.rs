//! Numbers that survive a crash of their component.

use std::rc::Rc;

use super::{ConfigureError, Setup};
use crate::context::Context;
use crate::region::CHECKPOINT_BYTES;

impl Setup {
    /// Opens a checkpoint: memory for `numbers` values of type `f64` that survives a crash of this component.
    ///
    /// # Errors
    /// `numbers` exceeds the capacity of a checkpoint (512).
    pub fn checkpoint(&self, numbers: usize) -> Result<Checkpoint, ConfigureError> {
        if numbers * 8 > CHECKPOINT_BYTES {
            return Err(ConfigureError::failed(format!(
                "the checkpoint has {numbers} numbers, expected at most {}",
                CHECKPOINT_BYTES / 8
            )));
        }
        Ok(Checkpoint { context: self.context().clone(), words: vec![0; numbers] })
    }
}

/// Numbers that survive a crash of their component. A step saves the numbers, and the restarted component
/// loads them.
///
/// ```
/// use motorium::prelude::*;
///
/// /// The angle of a motion, which continues after a crash.
/// fn resume(setup: &mut Setup) -> Result<(Checkpoint, f64), ConfigureError> {
///     let mut checkpoint = setup.checkpoint(1)?;
///     let angle = checkpoint.resume().map_or(0.0, |numbers| numbers[0]);
///     Ok((checkpoint, angle))
/// }
///
/// fn step(checkpoint: &mut Checkpoint, angle: &mut f64, tick: &Tick) {
///     *angle += tick.dt();
///     checkpoint.save([*angle]);
/// }
/// ```
#[derive(Debug)]
pub struct Checkpoint {
    context: Rc<Context>,
    words: Vec<u64>,
}

impl Checkpoint {
    /// Saves the numbers. Numbers beyond the count for which the checkpoint was opened are ignored, and
    /// missing numbers keep their previous values. If the process is killed during a save, the previous
    /// numbers remain.
    pub fn save(&mut self, numbers: impl IntoIterator<Item = f64>) {
        for (word, number) in self.words.iter_mut().zip(numbers) {
            *word = number.to_bits();
        }
        self.context.block().checkpoint.save(self.words.iter().copied());
    }

    /// Returns the numbers that were saved before the component restarted. Returns `None` at the first start,
    /// and if a saved number is not finite.
    pub fn resume(&mut self) -> Option<Vec<f64>> {
        if self.context.restart_count() == 0 || !self.context.block().checkpoint.load(&mut self.words) {
            return None;
        }
        let numbers: Vec<f64> = self.words.iter().map(|word| f64::from_bits(*word)).collect();
        numbers.iter().all(|number| number.is_finite()).then_some(numbers)
    }
}
