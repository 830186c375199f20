//! The frame a task controls: the one that is named, or that of the robot's only end effector.

use crate::{FrameId, Loaded, Model, Profile, UnknownFrame};

/// A frame to control that cannot be chosen.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EndEffectorError {
    /// No frame is named, and the robot's profile, if there is one, has no end effector.
    #[error("robot `{robot}` has no known end effector, and no `frame` is given")]
    NoneKnown {
        /// Name of the robot in its file.
        robot: String,
        /// A link that could be named: the last of the robot.
        example: String,
    },
    /// No frame is named, and the profile has more than one end effector.
    #[error("robot `{robot}` has several end effectors, and no `frame` is given")]
    Several {
        /// Name of the robot in its file.
        robot: String,
        /// Frames of the end effectors.
        frames: Vec<String>,
    },
    /// The named frame does not exist.
    #[error(transparent)]
    UnknownFrame(#[from] UnknownFrame),
}

impl EndEffectorError {
    /// A frame that could be named instead, as an example for the user.
    pub fn example(&self) -> Option<&str> {
        match self {
            Self::NoneKnown { example, .. } => Some(example),
            Self::Several { frames, .. } => frames.first().map(String::as_str),
            Self::UnknownFrame(unknown) => unknown.nearest.as_deref(),
        }
    }
}

impl Model {
    /// The frame called `frame`; without a name that of the only end effector of `profile`.
    ///
    /// # Errors
    ///
    /// [`EndEffectorError`]: no such frame, or none or several to choose from.
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
        if let Some(frame) = frame {
            return Ok(self.frame(frame)?);
        }
        let mut all = profile.into_iter().flat_map(|profile| profile.end_effectors.values());
        match (all.next(), all.next()) {
            (Some(only), None) => Ok(self.frame(&only.frame)?),
            (None, _) => Err(EndEffectorError::NoneKnown {
                robot: self.name().to_owned(),
                example: self.frames().last().map(|frame| frame.name.clone()).unwrap_or_default(),
            }),
            (Some(first), Some(second)) => Err(EndEffectorError::Several {
                robot: self.name().to_owned(),
                frames: [first, second].into_iter().chain(all).map(|end| end.frame.clone()).collect(),
            }),
        }
    }
}

impl Loaded {
    /// [`Model::end_effector`] with the robot's own profile.
    ///
    /// # Errors
    ///
    /// As there.
    pub fn end_effector(&self, frame: Option<&str>) -> Result<FrameId, EndEffectorError> {
        self.model.end_effector(self.profile.as_ref(), frame)
    }
}
