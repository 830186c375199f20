//! Selection of the controlled frame: a named frame, or the robot's only end effector.

use crate::{FrameId, Loaded, Model, Profile, UnknownFrame};

/// Minimum number of chains of joints at the palm of a hand.
const FINGERS: usize = 3;
/// Minimum number of joints between the base and a palm. The chest of a humanoid also carries several chains,
/// but has fewer joints between it and the pelvis.
const ARM_JOINTS: usize = 4;

/// Error of determining the frame to control.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EndEffectorError {
    /// No frame is named, and the profile has no end effector or does not exist.
    #[error("robot `{robot}` has no known end effector, and no `frame` is specified")]
    NoneKnown {
        /// Name of the robot in its file.
        robot: String,
        /// Frame suggested in the message: the tip of the longest chain of joints.
        example: String,
    },
    /// No frame is named, and the profile has more than one end effector.
    #[error("robot `{robot}` has several end effectors, and no `frame` is specified")]
    Several {
        /// Name of the robot in its file.
        robot: String,
        /// Frames of the end effectors.
        frames: Vec<String>,
    },
    /// No joint moves the named frame.
    #[error("`{frame}` of robot `{robot}` is fixed to the world, so no joint moves it")]
    Fixed {
        /// Name of the frame.
        frame: String,
        /// Name of the robot in its file.
        robot: String,
        /// Frame suggested in the message: the tip of the longest chain of joints.
        example: String,
    },
    /// The named frame does not exist.
    #[error(transparent)]
    UnknownFrame(#[from] UnknownFrame),
}

impl EndEffectorError {
    /// Returns the frame suggested in the message.
    pub fn example(&self) -> Option<&str> {
        match self {
            Self::NoneKnown { example, .. } | Self::Fixed { example, .. } => Some(example),
            Self::Several { frames, .. } => frames.first().map(String::as_str),
            Self::UnknownFrame(unknown) => unknown.nearest.as_deref(),
        }
    }
}

impl Model {
    /// Returns the frame to control: the frame named `frame` or, if `frame` is `None`, the only end effector
    /// of `profile`.
    ///
    /// # Errors
    ///
    /// [`EndEffectorError`] if the frame is unknown or immovable, or there is no unique end effector.
    ///
    /// ```
    /// # use std::path::Path;
    /// let panda = motorium_robots::load("panda", Path::new(".")).unwrap();
    /// let tool = panda.model.end_effector(panda.profile.as_ref(), None).unwrap();
    /// assert_eq!(panda.model.frames()[tool.index()].name, "panda_hand_tcp");
    /// ```
    pub fn end_effector(
        &self,
        profile: Option<&Profile>,
        frame: Option<&str>,
    ) -> Result<FrameId, EndEffectorError> {
        let tip = || self.tip().map(|tip| self.frames()[tip.index()].name.clone()).unwrap_or_default();
        if let Some(name) = frame {
            let id = self.frame(name)?;
            if !self.moves(id) {
                let (frame, robot) = (name.to_owned(), self.name().to_owned());
                return Err(EndEffectorError::Fixed { frame, robot, example: tip() });
            }
            return Ok(id);
        }
        let mut all = profile.into_iter().flat_map(|profile| profile.end_effectors.values());
        match (all.next(), all.next()) {
            (Some(only), None) => Ok(self.frame(&only.frame)?),
            (None, _) => Err(EndEffectorError::NoneKnown { robot: self.name().to_owned(), example: tip() }),
            (Some(first), Some(second)) => Err(EndEffectorError::Several {
                robot: self.name().to_owned(),
                frames: [first, second].into_iter().chain(all).map(|end| end.frame.clone()).collect(),
            }),
        }
    }
}

impl Model {
    /// Returns `true` if a joint or the floating base moves the frame.
    pub fn moves(&self, frame: FrameId) -> bool {
        let frame = &self.frames()[frame.index()];
        frame.body.is_some() || (self.base().floating && !frame.in_world)
    }

    /// Returns the tip of the robot: a frame of the last body in the longest chain of joints, not counting
    /// fingers. Fingers are identified by their name, or by a palm with at least three chains of joints. If
    /// the body has several frames, the tip is the last frame, which is usually the tool. Returns `None` if
    /// no joint moves any frame.
    ///
    /// ```
    /// # use std::path::Path;
    /// let arm = motorium_robots::load("ur5e", Path::new(".")).unwrap().model;
    /// let tip = arm.tip().unwrap();
    /// assert_eq!(arm.frames()[tip.index()].name, "tool0");
    /// ```
    pub fn tip(&self) -> Option<FrameId> {
        let mut depths: Vec<usize> = Vec::with_capacity(self.bodies().len());
        for body in self.bodies() {
            depths.push(1 + body.parent.map_or(0, |parent| depths[parent]));
        }
        let longest = depths.iter().copied().max()?;
        let mut ends = (0..depths.len()).filter(|body| depths[*body] == longest);
        let first = ends.next()?;
        // Several sibling bodies are the fingers of a hand; otherwise the first of several equally long
        // chains is used.
        let parent = self.bodies()[first].parent;
        let fingers = ends.clone().next().is_some() && ends.all(|body| self.bodies()[body].parent == parent);
        let end = parent.filter(|_| fingers).unwrap_or(first);
        let body = self.palm_before(end).unwrap_or_else(|| self.before_fingers(end));
        self.frames().iter().rposition(|frame| frame.body == Some(body)).map(FrameId)
    }

    /// Returns the palm of the hand to which `body` belongs: the nearest body towards the base that carries
    /// at least [`FINGERS`] chains of joints, and is itself at the end of an arm.
    fn palm_before(&self, body: usize) -> Option<usize> {
        let towards_base =
            |from: usize| std::iter::successors(Some(from), |&body| self.bodies()[body].parent);
        let carried = |palm: usize| self.bodies().iter().filter(|other| other.parent == Some(palm)).count();
        towards_base(body).find(|&palm| carried(palm) >= FINGERS && towards_base(palm).count() >= ARM_JOINTS)
    }

    /// Returns the nearest body towards the base, or `body` itself, that is not moved by a finger's joint.
    pub(crate) fn before_fingers(&self, body: usize) -> usize {
        let mut palm = body;
        while let Some(parent) =
            self.bodies()[palm].parent.filter(|_| moves_finger(&self.bodies()[palm].joint.name))
        {
            palm = parent;
        }
        palm
    }
}

impl Loaded {
    /// Returns the frame to control, like [`Model::end_effector`] with the profile of the loaded robot.
    ///
    /// # Errors
    ///
    /// See [`Model::end_effector`].
    pub fn end_effector(&self, frame: Option<&str>) -> Result<FrameId, EndEffectorError> {
        self.model.end_effector(self.profile.as_ref(), frame)
    }
}

/// Returns `true` if a joint's name indicates that it opens and closes a gripper. Names with an axis belong
/// to the wrist of a gripper.
fn moves_finger(joint: &str) -> bool {
    let joint = joint.to_ascii_lowercase();
    let parts = ["finger", "gripper", "jaw", "claw", "thumb"];
    let wrist = ["yaw", "pitch", "roll", "wrist", "_x", "_y", "_z"];
    parts.iter().any(|part| joint.contains(part)) && !wrist.iter().any(|part| joint.contains(part))
}

/// Returns the joints that move the tip, starting at the base, and the joints beyond it (its fingers).
pub(crate) fn tip_joints(model: &Model, tip: FrameId) -> (Vec<String>, Vec<String>) {
    let body = model.frames()[tip.index()].body;
    let parents = |mut body: Option<usize>| {
        let mut chain = Vec::new();
        while let Some(index) = body {
            chain.push(index);
            body = model.bodies()[index].parent;
        }
        chain
    };
    let chain = parents(body);
    let of = |test: &dyn Fn(usize) -> bool| -> Vec<String> {
        let joints = 0..model.joint_count();
        joints
            .filter(|&index| test(model.joint_body(index)))
            .map(|index| model.joint_names()[index].clone())
            .collect()
    };
    let moves = of(&|joint| chain.contains(&joint));
    let beyond =
        of(&|joint| !chain.contains(&joint) && body.is_some_and(|body| parents(Some(joint)).contains(&body)));
    (moves, beyond)
}
