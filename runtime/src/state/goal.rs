//! Goals of a motion, and the reply of the policy that executes them.

#![allow(unsafe_code)] // `Field` implementations that look only at the used part of their arrays

use core::fmt::{Display, Write};

use super::MAX_JOINTS;
use super::counted::counted_buffer;

/// Maximum length of the text in a [`GoalStatus`], bytes.
pub const MAX_GOAL_TEXT: usize = 256;

counted_buffer! {
    /// A goal for a robot: a pose of its end effector, joint positions, or both. Joints without a new
    /// position keep their previous goal.
    ///
    /// ```
    /// use motorium::state::MotionGoal;
    ///
    /// // the end effector to a position, and joint 7 (a finger) to 0.02 m
    /// let mut goal = MotionGoal::new(1);
    /// goal.set_position([0.4, 0.0, 0.5]);
    /// goal.set_joint(7, 0.02);
    /// assert_eq!((goal.count(), goal.joint_at(7), goal.joint_at(0)), (8, Some(0.02), None));
    /// ```
    pub struct MotionGoal as "motorium.MotionGoal", at most MAX_JOINTS {
        plain {
            /// Number assigned by the sender of the goal and repeated in [`GoalStatus`]. Sending an unchanged
            /// goal again has no effect.
            number: u64;
            /// 1 if `position` is set, else 0.
            has_position: u64;
            /// Position of the end effector in the world, m.
            position: [f64; 3];
            /// Orientation of the end effector in the world as a unit quaternion, x y z w. All zero keeps the
            /// orientation of the previous goal.
            orientation: [f64; 4];
            /// Bit mask of the joints whose positions are set: bit `k` stands for joint `k`. 0 means that the
            /// positions of all `count` joints are set.
            joints: u64;
            /// Duration of the motion, s; extended if the limits require it. 0 requests the shortest
            /// duration.
            duration: f64;
        }
        counted {
            /// Joint positions in the order of the model's `q`, rad or m.
            joint, joint_mut: f64;
        }
    }
}

impl MotionGoal {
    /// Creates a goal with this number and without any position.
    pub fn new(number: u64) -> Self {
        Self { number, ..Self::default() }
    }

    /// Sets the position of the end effector in the world, m.
    pub fn set_position(&mut self, position: [f64; 3]) {
        (self.has_position, self.position) = (1, position);
    }

    /// Sets the position of one joint, rad or m.
    ///
    /// # Panics
    /// If `index` is not below [`MAX_JOINTS`].
    pub fn set_joint(&mut self, index: usize, position: f64) {
        self.set_count(self.count().max(index + 1));
        self.joint_mut()[index] = position;
        self.joints |= 1 << index;
    }

    /// Returns the position of a joint, rad or m; `None` if the goal does not set it.
    pub fn joint_at(&self, index: usize) -> Option<f64> {
        self.joint().get(index).copied().filter(|_| self.joints == 0 || self.joints >> index & 1 == 1)
    }

    /// Returns `true` if the goal has an orientation.
    pub fn has_orientation(&self) -> bool {
        self.orientation != [0.0; 4]
    }
}

counted_buffer! {
    /// Progress of the policy towards its newest [`MotionGoal`].
    ///
    /// ```
    /// use motorium::state::{GoalState, GoalStatus};
    ///
    /// let mut status = GoalStatus::new(7, GoalState::Refused);
    /// status.set_text(format_args!("{:.2} m away", 1.5));
    /// assert_eq!((status.goal_state(), status.as_str()), (Some(GoalState::Refused), "1.50 m away"));
    /// ```
    pub struct GoalStatus as "motorium.GoalStatus", at most MAX_GOAL_TEXT {
        plain {
            /// Number of the goal, as in [`MotionGoal`].
            goal: u64;
            /// State of the goal: the number of a [`GoalState`].
            state: u64;
            /// Completed fraction of the motion's duration, 0 to 1.
            progress: f64;
            /// Remaining duration of the motion, s.
            remaining: f64;
            /// Largest distance between a measured joint position and the joint's goal at the end of the
            /// motion, rad or m.
            error: f64;
        }
        counted {
            /// Reason why the goal was refused or missed, in UTF-8.
            text, text_mut: u8;
        }
    }
}

/// State of a [`MotionGoal`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub enum GoalState {
    /// No goal has arrived.
    Idle = 0,
    /// The policy searches for joint positions that reach the pose; the previous motion continues.
    Planning = 1,
    /// The joints move to the goal, or brake before the motion to the goal starts.
    Moving = 2,
    /// Every joint is within the tolerance around its goal.
    Reached = 3,
    /// The goal is invalid or out of reach; the previous motion continues.
    Refused = 4,
    /// The motion is complete, but at least one joint is farther from its goal than the tolerance.
    Missed = 5,
}

impl GoalStatus {
    /// Creates the status of the goal with this number, without progress and text.
    pub fn new(goal: u64, state: GoalState) -> Self {
        Self { goal, state: state as u64, ..Self::default() }
    }

    /// Returns the state of the goal; `None` if `state` is not the number of a [`GoalState`].
    pub fn goal_state(&self) -> Option<GoalState> {
        use GoalState::{Idle, Missed, Moving, Planning, Reached, Refused};
        [Idle, Planning, Moving, Reached, Refused, Missed]
            .into_iter()
            .find(|state| *state as u64 == self.state)
    }

    /// Sets the text, truncated after the last character that fits. Does not allocate.
    pub fn set_text(&mut self, text: impl Display) {
        self.set_count(0);
        // the only error is that the text was cut
        let _ = write!(Tail(self), "{text}");
    }

    /// Returns the text up to the first byte that is not valid UTF-8.
    pub fn as_str(&self) -> &str {
        super::people::valid(self.text())
    }
}

/// Appends to the text of a status.
struct Tail<'a>(&'a mut GoalStatus);

impl Write for Tail<'_> {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        let begin = self.0.count();
        let fits = text.floor_char_boundary(MAX_GOAL_TEXT - begin);
        self.0.set_count(begin + fits);
        self.0.text_mut()[begin..].copy_from_slice(&text.as_bytes()[..fits]);
        if fits == text.len() { Ok(()) } else { Err(core::fmt::Error) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn status_text_is_cut_at_a_character() {
        let mut status = GoalStatus::default();
        status.set_text("é".repeat(200));
        assert_eq!((status.count(), status.as_str()), (256, "é".repeat(128).as_str()));
        status.set_text(format_args!("{}{}", "x".repeat(255), "é"));
        assert_eq!(status.as_str(), "x".repeat(255));
        status.set_text("short");
        assert_eq!(status.as_str(), "short");
    }

    #[test]
    fn joints_of_a_goal_are_all_or_the_selected_ones() {
        let mut goal = MotionGoal::default();
        goal.set_count(2);
        goal.joint_mut().copy_from_slice(&[0.5, 0.25]);
        assert_eq!([goal.joint_at(0), goal.joint_at(1), goal.joint_at(2)], [Some(0.5), Some(0.25), None]);
        goal.joints = 0b10;
        assert_eq!([goal.joint_at(0), goal.joint_at(1)], [None, Some(0.25)]);
        assert!(!goal.has_orientation());
    }
}
