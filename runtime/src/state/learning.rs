//! Messages between learners and environments: weights, observations, actions, rewards.

#![allow(unsafe_code)] // `Field` implementations that look only at the used part of their arrays

use super::counted::counted_buffer;

/// The most numbers of one block of [`Weights`].
pub const MAX_WEIGHTS: usize = 4096;
/// The most numbers of one [`Observation`].
pub const MAX_OBSERVATION: usize = 512;
/// The most numbers of one [`Action`].
pub const MAX_ACTION: usize = 64;

counted_buffer! {
    /// A block of parameters of a model: all of them, or one of several blocks.
    ///
    /// ```
    /// use motorium::state::Weights;
    ///
    /// let mut weights = Weights::default();
    /// (weights.version, weights.blocks) = (3, 1);
    /// weights.set_count(2);
    /// weights.value_mut().copy_from_slice(&[0.1, -0.2]);
    /// assert_eq!(weights.value(), [0.1, -0.2]);
    /// ```
    pub struct Weights as "motorium.Weights", at most MAX_WEIGHTS {
        plain {
            /// Grows with each change: all blocks of one version belong together.
            version: u64;
            /// Index of this block.
            block: u32;
            /// Number of blocks.
            blocks: u32;
        }
        counted {
            /// The numbers, in the order and units of the model that they belong to.
            value, value_mut: f64;
        }
    }
}

counted_buffer! {
    /// Observation of an agent at one step.
    ///
    /// ```
    /// use motorium::state::Observation;
    ///
    /// let mut observation = Observation::default();
    /// observation.episode = 2;
    /// observation.set_count(1);
    /// assert_eq!(observation.value(), [0.0]);
    /// ```
    pub struct Observation as "motorium.Observation", at most MAX_OBSERVATION {
        plain {
            /// Index of the episode.
            episode: u64;
            /// Index of the step within the episode.
            step: u64;
        }
        counted {
            /// The numbers, in the order and units of the task.
            value, value_mut: f64;
        }
    }
}

counted_buffer! {
    /// Action of an agent at one step.
    ///
    /// ```
    /// use motorium::state::Action;
    ///
    /// let mut action = Action::default();
    /// (action.episode, action.step) = (2, 7);
    /// action.set_count(1);
    /// action.value_mut()[0] = 0.5;
    /// assert_eq!(action.value(), [0.5]);
    /// ```
    pub struct Action as "motorium.Action", at most MAX_ACTION {
        plain {
            /// Index of the episode of the observation that it answers.
            episode: u64;
            /// Index of the step of that observation.
            step: u64;
        }
        counted {
            /// The numbers, in the order and units of the task.
            value, value_mut: f64;
        }
    }
}

crate::state_buffer! {
    /// The reward of one step, and the end of an episode.
    ///
    /// ```
    /// use motorium::state::Reward;
    ///
    /// assert!(Reward { terminal: 1, ..Reward::default() }.is_last());
    /// ```
    pub struct Reward as "motorium.Reward" {
        /// Index of the episode.
        pub episode: u64,
        /// Index of the step within the episode.
        pub step: u64,
        /// Reward of this step, in the unit of the task.
        pub reward: f64,
        /// Sum of the rewards of the episode so far.
        pub total: f64,
        /// 1 when the task ended by itself: nothing is to be gained any more.
        pub terminal: u64,
        /// 1 when the episode was cut off, as by a limit of time: it would have gone on.
        pub truncated: u64,
    }
}

impl Reward {
    /// True if this is the last step of its episode.
    pub fn is_last(&self) -> bool {
        self.terminal != 0 || self.truncated != 0
    }
}
