//! Messages between learners and environments: weights, observations, actions, rewards.

#![allow(unsafe_code)] // `Field` implementations that look only at the used part of their arrays

use super::counted::counted_buffer;

/// Maximum number of values in a block of [`Weights`].
pub const MAX_WEIGHTS: usize = 4096;
/// Maximum number of values in an [`Observation`].
pub const MAX_OBSERVATION: usize = 512;
/// Maximum number of values in an [`Action`].
pub const MAX_ACTION: usize = 64;
/// Maximum number of values in an [`ActionChunk`].
pub const MAX_CHUNK: usize = 4096;
/// Maximum number of sampled values in a [`Randomisation`].
pub const MAX_DRAWN: usize = 512;

counted_buffer! {
    /// A block of model parameters, such as network weights. A large model is split into several blocks.
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
            /// Version of the weights, which increases with each change. Blocks with the same version form
            /// one set of weights.
            version: u64;
            /// Index of this block, counted from 0.
            block: u32;
            /// Number of blocks of the model.
            blocks: u32;
        }
        counted {
            /// Weights, in the order and units of their model.
            value, value_mut: f64;
        }
    }
}

counted_buffer! {
    /// Observation of a learning agent at one step.
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
            /// Observed values, in the order and units of the task.
            value, value_mut: f64;
        }
    }
}

counted_buffer! {
    /// Action of a learning agent at one step.
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
            /// Index of the episode, copied from the observation that this action answers.
            episode: u64;
            /// Index of the step, copied from the observation that this action answers.
            step: u64;
        }
        counted {
            /// Action values, in the order and units of the task.
            value, value_mut: f64;
        }
    }
}

counted_buffer! {
    /// Consecutive actions of an agent that plans ahead, such as a diffusion policy.
    ///
    /// Action `k` applies at the time `time + k * period`. Its values are `value[k * width..][..width]`.
    ///
    /// ```
    /// use motorium::state::ActionChunk;
    ///
    /// // two actions for two joints, 20 ms apart
    /// let mut chunk = ActionChunk::default();
    /// (chunk.width, chunk.period) = (2, 20_000_000);
    /// chunk.set_count(4);
    /// chunk.value_mut().copy_from_slice(&[0.1, 0.2, 0.3, 0.4]);
    /// assert_eq!(chunk.value().chunks_exact(2).nth(1), Some(&[0.3, 0.4][..]));
    /// ```
    pub struct ActionChunk as "motorium.ActionChunk", at most MAX_CHUNK {
        plain {
            /// Time of the first action, ns on the clock of [`Stamp`](super::Stamp)s: usually the
            /// `state_time` of the observation that the chunk answers. 0 stands for the time at which the
            /// chunk is published.
            time: u64;
            /// Time between two actions, ns. Must be above 0.
            period: u64;
            /// Number of values per action, above 0. `count` is a multiple of `width`.
            width: u64;
            /// Sequence number of the chunk, assigned by its producer. A chunk that is published repeatedly
            /// keeps its number.
            sequence: u64;
        }
        counted {
            /// Values of all actions, one action after another, in the order and units of the policy.
            value, value_mut: f64;
        }
    }
}

crate::state_buffer! {
    /// Reward of one step, with flags for the end of the episode.
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
        /// Sum of all rewards of the episode so far, in the unit of the task.
        pub total: f64,
        /// 1 if the task reached a terminal state, from which no further reward is possible; else 0.
        pub terminal: u64,
        /// 1 if the episode was cut off, for example by a time limit; else 0.
        pub truncated: u64,
    }
}

impl Reward {
    /// Returns `true` if this is the last step of its episode: terminal or truncated.
    pub fn is_last(&self) -> bool {
        self.terminal != 0 || self.truncated != 0
    }
}

counted_buffer! {
    /// Properties that a simulation or a sensor randomised at the start of an episode or during the episode.
    ///
    /// Each entry names the property, the body, joint or object with this property, and the sampled value.
    ///
    /// ```
    /// use motorium::state::Randomisation;
    ///
    /// let mut drawn = Randomisation::default();
    /// drawn.set_count(1);
    /// drawn.property_mut()[0] = Randomisation::BODY_MASS;
    /// (drawn.part_mut()[0], drawn.value_mut()[0]) = (6, 1.04);
    /// assert_eq!(drawn.find(Randomisation::BODY_MASS, 6), Some(1.04));
    /// assert_eq!(drawn.find(Randomisation::GRAVITY, 0), None);
    /// ```
    pub struct Randomisation as "motorium.Randomisation", at most MAX_DRAWN {
        plain {
            /// Index of the episode.
            episode: u64;
            /// Seed of the component in this episode. Equal seeds sample equal values.
            seed: u64;
        }
        counted {
            /// Randomised property: one of the constants of this type.
            property, property_mut: u32;
            /// Index of the body, joint or object with this property, in the robot or the world; 0 if the
            /// property belongs to no particular one.
            part, part_mut: u32;
            /// Sampled value: a scale factor, a coefficient, a displacement in m or rad, a time in s, or a
            /// seed.
            value, value_mut: f64;
        }
    }
}

impl Randomisation {
    /// Scale factor of the gravitational acceleration.
    pub const GRAVITY: u32 = 1;
    /// Friction coefficient of the ground or the terrain.
    pub const GROUND_FRICTION: u32 = 2;
    /// Coefficient of restitution of the ground or the terrain.
    pub const GROUND_RESTITUTION: u32 = 3;
    /// Scale factor of the mass and inertia of one body of the robot, or of the base if the part is
    /// [`BASE`](Self::BASE).
    pub const BODY_MASS: u32 = 4;
    /// Friction coefficient of the robot's surface.
    pub const FRICTION: u32 = 5;
    /// Coefficient of restitution of the robot's surface.
    pub const RESTITUTION: u32 = 6;
    /// Scale factor of a joint's viscous damping.
    pub const DAMPING: u32 = 7;
    /// Scale factor of a joint's Coulomb friction.
    pub const JOINT_FRICTION: u32 = 8;
    /// Scale factor of a joint's effort limit.
    pub const EFFORT_LIMIT: u32 = 9;
    /// Offset of a joint's initial position, rad or m.
    pub const START: u32 = 10;
    /// Initial displacement of a floating base along the world's x axis, m.
    pub const BASE_X: u32 = 11;
    /// Initial displacement of a floating base along the world's y axis, m.
    pub const BASE_Y: u32 = 12;
    /// Initial displacement of a floating base along the world's z axis, m.
    pub const BASE_Z: u32 = 13;
    /// Initial rotation of a floating base about the world's z axis, rad.
    pub const BASE_YAW: u32 = 14;
    /// Scale factor of an object's mass and inertia.
    pub const OBJECT_MASS: u32 = 15;
    /// Friction coefficient of an object.
    pub const OBJECT_FRICTION: u32 = 16;
    /// Coefficient of restitution of an object.
    pub const OBJECT_RESTITUTION: u32 = 17;
    /// Initial displacement of an object along the world's x axis, m.
    pub const OBJECT_X: u32 = 18;
    /// Initial displacement of an object along the world's y axis, m.
    pub const OBJECT_Y: u32 = 19;
    /// Initial displacement of an object along the world's z axis, m.
    pub const OBJECT_Z: u32 = 20;
    /// Initial rotation of an object about the world's z axis, rad.
    pub const OBJECT_YAW: u32 = 21;
    /// Scale factor of a sensor's noise.
    pub const SENSOR_NOISE: u32 = 22;
    /// Scale factor of a sensor's bias.
    pub const SENSOR_BIAS: u32 = 23;
    /// Latency of a sensor, s.
    pub const SENSOR_LATENCY: u32 = 24;
    /// Seed of the terrain.
    pub const TERRAIN_SEED: u32 = 25;
    /// Scale factor of the terrain's heights.
    pub const TERRAIN_SCALE: u32 = 26;
    /// Scale factor of a joint's commanded stiffness and damping.
    pub const ACTUATOR_GAIN: u32 = 27;
    /// Scale factor of all efforts of a joint's drive.
    pub const ACTUATOR_STRENGTH: u32 = 28;
    /// Scale factor of the delay of a joint's actuator.
    pub const ACTUATOR_DELAY: u32 = 29;
    /// Scale factor of the lag of a joint's actuator.
    pub const ACTUATOR_LAG: u32 = 30;
    /// Scale factor of the effort rate limit of a joint's actuator.
    pub const ACTUATOR_RATE_LIMIT: u32 = 31;
    /// Scale factor of the backlash of a joint's drivetrain.
    pub const ACTUATOR_BACKLASH: u32 = 32;
    /// Scale factor of the stiffness of a joint's drivetrain.
    pub const ACTUATOR_STIFFNESS: u32 = 33;

    /// Value of `part` for properties of the robot's base.
    pub const BASE: u32 = u32::MAX;

    /// Returns the value sampled for a property of a part; `None` if there is no such entry.
    pub fn find(&self, property: u32, part: u32) -> Option<f64> {
        let mut entries = self.property().iter().zip(self.part()).zip(self.value());
        entries.find(|((p, q), _)| (**p, **q) == (property, part)).map(|(_, value)| *value)
    }
}
