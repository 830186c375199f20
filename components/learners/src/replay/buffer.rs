//! A ring buffer of steps, and n-step returns.

use crate::environment::{End, Step};
use crate::learner::{CheckpointError, CheckpointReader, CheckpointWriter};

/// A ring buffer of the latest steps of all worlds. Once the buffer is full, a new row replaces the oldest
/// row.
///
/// ```
/// use motorium_learners::environment::Step;
/// use motorium_learners::replay::ReplayBuffer;
///
/// // two rows of one world, with one number in an observation and one in an action
/// let mut buffer = ReplayBuffer::new(2, 1, (1, 1));
/// for reward in [1.0, 2.0, 3.0] {
///     buffer.push(&[0.0], &[0.5], &[Step { reward, end: None }], |_| &[1.0]);
/// }
/// assert_eq!(buffer.samples(), 2);
/// // the third step is in the row of the first: 2 + 0.5 * 3
/// let found = buffer.n_step(1, 2, 0.5);
/// assert_eq!((found.reward, found.discount), (3.5, 0.25));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ReplayBuffer {
    /// Rows of the ring; a row is a step of all worlds.
    capacity: usize,
    worlds: usize,
    inputs: usize,
    width: usize,
    /// Next row to write.
    head: usize,
    observations: Vec<f32>,
    actions: Vec<f32>,
    rewards: Vec<f32>,
    ends: Vec<Option<End>>,
    /// Observation after each step; the final observation if the episode ended.
    next: Vec<f32>,
}

/// An n-step return: the rewards over some steps of an episode, and the factor of the value that follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NStep {
    /// Sum of the discounted rewards.
    pub reward: f32,
    /// Factor of the value after the last step: the discount to the power of the number of steps, or 0 if the
    /// episode terminated.
    pub discount: f32,
    /// Sample index of the last step. The factor `discount` applies to the value of the observation after
    /// this step.
    pub last: usize,
}

impl ReplayBuffer {
    /// Creates an empty buffer of `capacity` rows for observations of length `inputs` and actions of length
    /// `width`. A row is a step of all worlds.
    ///
    /// # Panics
    ///
    /// If a size is 0.
    pub fn new(capacity: usize, worlds: usize, (inputs, width): (usize, usize)) -> Self {
        assert!(capacity > 0 && worlds > 0 && inputs > 0 && width > 0, "sizes of a buffer");
        Self {
            capacity,
            worlds,
            inputs,
            width,
            head: 0,
            observations: vec![],
            actions: vec![],
            rewards: vec![],
            ends: vec![],
            next: vec![],
        }
    }

    /// Returns the number of stored steps, summed over all worlds.
    pub fn samples(&self) -> usize {
        self.rewards.len()
    }

    /// Adds a step of all worlds: the observations before the step, the actions, the results, and each
    /// world's next observation.
    ///
    /// # Panics
    ///
    /// If a slice is too short.
    pub fn push<'a>(
        &mut self,
        observations: &[f32],
        actions: &[f32],
        steps: &[Step],
        next: impl Fn(usize) -> &'a [f32],
    ) {
        let (worlds, inputs, width) = (self.worlds, self.inputs, self.width);
        if self.samples() < self.capacity * worlds {
            self.resize(self.samples() / worlds + 1);
        }
        let first = self.head * worlds;
        self.observations[first * inputs..][..worlds * inputs]
            .copy_from_slice(&observations[..worlds * inputs]);
        self.actions[first * width..][..worlds * width].copy_from_slice(&actions[..worlds * width]);
        for (world, step) in steps[..worlds].iter().enumerate() {
            let sample = first + world;
            self.rewards[sample] = step.reward as f32;
            self.ends[sample] = step.end;
            self.next[sample * inputs..][..inputs].copy_from_slice(&next(world)[..inputs]);
        }
        self.head = (self.head + 1) % self.capacity;
    }

    /// Returns the observation before a step.
    pub fn observation(&self, sample: usize) -> &[f32] {
        &self.observations[sample * self.inputs..][..self.inputs]
    }

    /// Returns the action of a step.
    pub fn action(&self, sample: usize) -> &[f32] {
        &self.actions[sample * self.width..][..self.width]
    }

    /// Returns the observation after a step. If the episode ended in this step, the result is the final
    /// observation of the episode.
    pub fn next_observation(&self, sample: usize) -> &[f32] {
        &self.next[sample * self.inputs..][..self.inputs]
    }

    /// Returns the n-step return of `count` steps, the first of which is `sample`. The return has fewer steps
    /// if the episode or the stored data end earlier.
    ///
    /// # Panics
    ///
    /// If `count` is 0 or the sample does not exist.
    pub fn n_step(&self, sample: usize, count: usize, discount: f32) -> NStep {
        assert!(count > 0 && sample < self.samples(), "a sample of the buffer");
        let (mut reward, mut factor, mut last) = (0.0, 1.0, sample);
        for step in 1_usize.. {
            reward += factor * self.rewards[last];
            factor *= discount;
            let row = (last / self.worlds + 1) % self.capacity;
            // nothing follows the newest row
            if step == count || self.ends[last].is_some() || row == self.head {
                break;
            }
            last = row * self.worlds + last % self.worlds;
        }
        let is_terminal = self.ends[last].is_some_and(End::is_terminal);
        NStep { reward, discount: if is_terminal { 0.0 } else { factor }, last }
    }

    /// Sets the number of allocated rows.
    fn resize(&mut self, rows: usize) {
        let samples = rows * self.worlds;
        self.observations.resize(samples * self.inputs, 0.0);
        self.next.resize(samples * self.inputs, 0.0);
        self.actions.resize(samples * self.width, 0.0);
        self.rewards.resize(samples, 0.0);
        self.ends.resize(samples, None);
    }

    pub(crate) fn write(&self, writer: &mut CheckpointWriter) -> Result<(), CheckpointError> {
        writer.value("buffer_head", &self.head)?;
        writer.value("buffer_rows", &(self.samples() / self.worlds))?;
        writer.numbers("buffer.observations", self.observations.clone());
        writer.numbers("buffer.next", self.next.clone());
        writer.numbers("buffer.actions", self.actions.clone());
        writer.numbers("buffer.rewards", self.rewards.clone());
        writer.numbers("buffer.ends", self.ends.iter().map(|end| code(*end)).collect());
        Ok(())
    }

    pub(crate) fn read(&mut self, reader: &mut CheckpointReader) -> Result<(), CheckpointError> {
        let (head, rows): (usize, usize) = (reader.value("buffer_head")?, reader.value("buffer_rows")?);
        // a partially filled ring ends at its head
        if rows > self.capacity || head >= self.capacity || (rows < self.capacity && head != rows) {
            let expected = format!("at most {} rows", self.capacity);
            return Err(CheckpointError::mismatch(
                "buffer",
                format!("{rows} rows, {head} written"),
                expected,
            ));
        }
        self.head = head;
        self.resize(rows);
        let samples = rows * self.worlds;
        self.observations = reader.numbers("buffer.observations", samples * self.inputs)?;
        self.next = reader.numbers("buffer.next", samples * self.inputs)?;
        self.actions = reader.numbers("buffer.actions", samples * self.width)?;
        self.rewards = reader.numbers("buffer.rewards", samples)?;
        let ends = reader.numbers("buffer.ends", samples)?;
        self.ends = ends.iter().map(|code| ENDS[(*code).clamp(0.0, 3.0) as usize]).collect();
        Ok(())
    }
}

/// Ends in the order of their codes in a checkpoint.
const ENDS: [Option<End>; 4] = [None, Some(End::Truncated), Some(End::Failure), Some(End::Success)];

fn code(end: Option<End>) -> f32 {
    match end {
        None => 0.0,
        Some(End::Truncated) => 1.0,
        Some(End::Failure) => 2.0,
        Some(End::Success) => 3.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a ring of two worlds with rewards 1, 2, 3, ... in the first and 10, 20, 30, ... in the second.
    fn filled(capacity: usize, steps: usize, end: impl Fn(usize) -> Option<End>) -> ReplayBuffer {
        let mut buffer = ReplayBuffer::new(capacity, 2, (1, 1));
        for step in 0..steps {
            let reward = step as f64 + 1.0;
            let results = [Step { reward, end: end(step) }, Step { reward: 10.0 * reward, end: None }];
            let (before, after) = (step as f32, [step as f32 + 1.0]);
            buffer.push(&[before, before], &[0.0, 0.5], &results, |_| &after);
        }
        buffer
    }

    #[test]
    fn returns_equal_their_sums() {
        let buffer = filled(8, 5, |_| None);
        assert_eq!(buffer.samples(), 10);
        assert_eq!(buffer.n_step(0, 1, 0.5), NStep { reward: 1.0, discount: 0.5, last: 0 });
        let three = NStep { reward: 1.0 + 0.5 * 2.0 + 0.25 * 3.0, discount: 0.125, last: 4 };
        assert_eq!(buffer.n_step(0, 3, 0.5), three);
        let other = NStep { reward: 20.0 + 0.5 * 30.0, discount: 0.25, last: 5 };
        assert_eq!(buffer.n_step(3, 2, 0.5), other);
        assert_eq!(buffer.next_observation(5), [3.0]);
        // only two steps are left
        assert_eq!(buffer.n_step(6, 3, 0.5), NStep { reward: 4.0 + 0.5 * 5.0, discount: 0.25, last: 8 });
    }

    #[test]
    fn returns_stop_at_the_end_of_an_episode() {
        let buffer = filled(8, 5, |step| (step == 1).then_some(End::Failure));
        assert_eq!(buffer.n_step(0, 4, 0.5), NStep { reward: 2.0, discount: 0.0, last: 2 });
        let buffer = filled(8, 5, |step| (step == 1).then_some(End::Truncated));
        assert_eq!(buffer.n_step(0, 4, 0.5), NStep { reward: 2.0, discount: 0.25, last: 2 });
    }

    #[test]
    fn full_ring_replaces_its_oldest_row() {
        let buffer = filled(3, 5, |_| None);
        assert_eq!(buffer.samples(), 6);
        // the rows contain the steps 3, 4, 2, counted from 0
        let rewards: Vec<f32> = (0..3).map(|row| buffer.n_step(2 * row, 1, 0.5).reward).collect();
        assert_eq!(rewards, [4.0, 5.0, 3.0]);
        assert_eq!([0, 2, 4].map(|sample| buffer.observation(sample)[0]), [3.0, 4.0, 2.0]);
        // across the wrap-around, but not beyond the newest row
        assert_eq!(buffer.n_step(4, 2, 0.5), NStep { reward: 3.0 + 2.0, discount: 0.25, last: 0 });
        assert_eq!(buffer.n_step(2, 2, 0.5), NStep { reward: 5.0, discount: 0.5, last: 2 });
    }
}
