//! Joint positions of a goal: limits, reach and inverse kinematics.

use core::fmt;

use motorium::declare::{ConfigError, RobotReference};
use motorium::state::MotionGoal;
use motorium_robots::{FrameId, IkOptions, IkProgress, InverseKinematics, Kinematics, Loaded, Model};
use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};

use crate::reach::{Reach, moving_joints};
use crate::robot;

/// Starting points of the search for a pose: an unsuccessful search ends after eight hundred iterations.
const SEARCH: IkOptions =
    IkOptions { position_tolerance: 1e-7, rotation_tolerance: 1e-6, iterations: 100, seeds: 8, posture: 0.1 };

/// Computes the joint positions of a [`MotionGoal`] in several calls, each short enough for a step of a
/// control loop. Only [`new`](Self::new) allocates.
///
/// Limits of the joints and the reach of the end effector are checked first. The search for a pose starts
/// from the previous goal and does not check for collisions.
///
/// ```
/// use motorium::declare::RobotReference;
/// use motorium::state::MotionGoal;
/// use motorium_policies::trajectory::{GoalPlanner, Planned, Refusal};
///
/// let robot = RobotReference { name: "arm".into(), urdf: "panda".into(), ..RobotReference::default() };
/// let mut planner = GoalPlanner::new(&robot, None).unwrap();
/// let ready = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785, 0.035];
/// let mut goal = MotionGoal::new(1);
/// goal.set_position([0.4, 0.1, 0.5]);
/// planner.begin(&goal, &ready).unwrap();
/// assert_eq!(planner.advance(usize::MAX), Planned::Ready);
/// assert_eq!(planner.target()[7], 0.035, "the finger keeps its position");
///
/// goal.set_position([2.0, 0.0, 0.5]);
/// let refusal = planner.begin(&goal, &ready).unwrap_err();
/// assert!(matches!(refusal, Refusal::BeyondReach { distance, reach } if distance > reach));
/// ```
#[derive(Debug)]
pub struct GoalPlanner {
    model: Model,
    tool: Option<Tool>,
    target: Vec<f64>,
    is_searching: bool,
}

/// The end effector.
#[derive(Debug)]
struct Tool {
    frame: FrameId,
    reach: Option<Reach>,
    /// Joints that move it.
    moving: Vec<bool>,
    kinematics: Kinematics,
    search: InverseKinematics,
    pose: Isometry3<f64>,
    q: Vec<f64>,
}

/// State of the search for the joint positions of a goal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Planned {
    /// The search continues.
    Searching,
    /// The joint positions have been found; see [`GoalPlanner::target`].
    Ready,
    /// The goal cannot be reached.
    Refused(Refusal),
}

/// Reason for refusing a goal. [`GoalPlanner::explain`] formats the reason as a message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refusal {
    /// The goal has neither a pose nor joint positions.
    Empty,
    /// The duration is negative. Contains the duration, s.
    Duration(f64),
    /// The number of joints differs from the robot's.
    JointCount {
        /// Number of joints of the goal.
        found: usize,
        /// Number of joints of the robot.
        expected: usize,
    },
    /// A joint position is outside of the joint's range.
    OutsideRange {
        /// Index of the joint.
        joint: usize,
        /// Position of the joint in the goal, rad or m.
        position: f64,
    },
    /// The goal has a pose, but the robot has no unique end effector on a fixed base.
    NoEndEffector,
    /// The quaternion does not have length 1. Contains its length.
    Orientation(f64),
    /// The goal has a position for a joint whose position the pose determines. Contains the index of the
    /// joint.
    JointOfPose(usize),
    /// The position is farther from the first joint than the length of all links in one line.
    BeyondReach {
        /// Distance from the first joint, m.
        distance: f64,
        /// Length of all links in one line, m.
        reach: f64,
    },
    /// No joint positions within their limits reach the pose.
    NoSolution {
        /// Distance of the nearest pose found from the goal, m.
        position_error: f64,
        /// Angle between the nearest pose found and the goal, rad.
        rotation_error: f64,
    },
}

impl GoalPlanner {
    /// Creates a planner for a robot. `frame` is the frame to which poses refer; `None` selects the frame of
    /// the robot's only end effector.
    ///
    /// # Errors
    /// [`ConfigError`] if the robot cannot be loaded, or does not have this frame.
    pub fn new(reference: &RobotReference, frame: Option<&str>) -> Result<Self, ConfigError> {
        Self::of_loaded(robot::load(reference)?, frame)
    }

    /// Like [`new`](Self::new), for a loaded robot.
    pub(super) fn of_loaded(robot: Loaded, frame: Option<&str>) -> Result<Self, ConfigError> {
        let is_fixed = !robot.model.base().floating;
        let id = match frame {
            Some(_) if !is_fixed => {
                let message = "the base moves: joint positions alone do not determine the pose of a frame";
                return Err(ConfigError::key("frame", message).advise("remove `frame`"));
            }
            Some(_) => Some(robot::end_effector(&robot, frame, "frame")?),
            None => robot.end_effector(None).ok().filter(|_| is_fixed),
        };
        let model = robot.model;
        let tool = id.map(|frame| Tool {
            frame,
            reach: Reach::of_frame(&model, frame),
            moving: moving_joints(&model, frame),
            kinematics: Kinematics::new(&model),
            search: InverseKinematics::new(&model),
            pose: Isometry3::identity(),
            q: vec![0.0; model.joint_count()],
        });
        let target = vec![0.0; model.joint_count()];
        Ok(Self { model, tool, target, is_searching: false })
    }

    /// Returns the robot.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Returns `true` if a joint moves the end effector.
    pub(super) fn moves_end_effector(&self, joint: usize) -> bool {
        self.tool.as_ref().is_some_and(|tool| tool.moving[joint])
    }

    /// Begins the search for a goal. `previous` contains the joint positions of the previous goal, rad or m;
    /// joints without a position in `goal` keep these positions.
    ///
    /// # Errors
    /// [`Refusal`] if the goal is invalid, or certainly out of reach.
    ///
    /// # Panics
    /// If the length of `previous` differs from the number of joints.
    pub fn begin(&mut self, goal: &MotionGoal, previous: &[f64]) -> Result<(), Refusal> {
        self.is_searching = false;
        let expected = self.model.joint_count();
        let found = goal.count();
        if found > expected || (goal.joints == 0 && found != 0 && found != expected) {
            return Err(Refusal::JointCount { found, expected });
        }
        if goal.duration < 0.0 {
            return Err(Refusal::Duration(goal.duration));
        }
        let has_pose = goal.has_position != 0 || goal.has_orientation();
        let mut is_empty = !has_pose;
        self.target.copy_from_slice(previous);
        for joint in 0..found {
            let Some(position) = goal.joint_at(joint) else { continue };
            if !(self.model.lower()[joint]..=self.model.upper()[joint]).contains(&position) {
                return Err(Refusal::OutsideRange { joint, position });
            }
            if has_pose && self.moves_end_effector(joint) {
                return Err(Refusal::JointOfPose(joint));
            }
            self.target[joint] = position;
            is_empty = false;
        }
        if is_empty {
            return Err(Refusal::Empty);
        }
        if has_pose {
            let tool = self.tool.as_mut().ok_or(Refusal::NoEndEffector)?;
            tool.begin(&self.model, goal, &self.target)?;
            self.is_searching = true;
        }
        Ok(())
    }

    /// Continues with at most `steps` iterations of the search.
    pub fn advance(&mut self, steps: usize) -> Planned {
        let Some(tool) = self.tool.as_mut().filter(|_| self.is_searching) else { return Planned::Ready };
        let Tool { frame, pose, search, q, moving, .. } = tool;
        match search.search(&self.model, *frame, pose, &SEARCH, q, steps) {
            IkProgress::Searching => Planned::Searching,
            IkProgress::Found(_) => {
                self.is_searching = false;
                for (joint, _) in moving.iter().enumerate().filter(|(_, moves)| **moves) {
                    self.target[joint] = q[joint];
                }
                Planned::Ready
            }
            IkProgress::NotFound { position_error, rotation_error } => {
                self.is_searching = false;
                Planned::Refused(Refusal::NoSolution { position_error, rotation_error })
            }
        }
    }

    /// Returns the joint positions that were found, rad or m.
    pub fn target(&self) -> &[f64] {
        &self.target
    }

    /// Returns a displayable message that explains a refusal.
    pub fn explain<'a>(&'a self, refusal: &'a Refusal) -> impl fmt::Display + 'a {
        Explained { planner: self, refusal }
    }
}

impl Tool {
    fn begin(&mut self, model: &Model, goal: &MotionGoal, q: &[f64]) -> Result<(), Refusal> {
        self.kinematics.update(model, q);
        self.pose = self.kinematics.pose(model, self.frame);
        if goal.has_position != 0 {
            let position = Vector3::from(goal.position);
            if let Some(reach) = self.reach
                && let Some(distance) = reach.beyond(&position)
            {
                return Err(Refusal::BeyondReach { distance, reach: reach.length() });
            }
            self.pose.translation.vector = position;
        }
        if goal.has_orientation() {
            let [x, y, z, w] = goal.orientation;
            let quaternion = Quaternion::new(w, x, y, z);
            // printed digits are rounded, but by no more than this
            if (quaternion.norm() - 1.0).abs() > 1e-2 {
                return Err(Refusal::Orientation(quaternion.norm()));
            }
            self.pose.rotation = UnitQuaternion::new_normalize(quaternion);
        }
        self.q.copy_from_slice(q);
        self.search.restart();
        Ok(())
    }
}

/// A refusal with the names of the robot.
struct Explained<'a> {
    planner: &'a GoalPlanner,
    refusal: &'a Refusal,
}

impl fmt::Display for Explained<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let model = &self.planner.model;
        match self.refusal {
            Refusal::Empty => f.write_str("the goal has neither a pose nor joint positions"),
            Refusal::Duration(duration) => write!(f, "a duration of {duration} s, expected at least 0"),
            Refusal::JointCount { found, expected } => {
                write!(f, "{found} joint positions, expected {expected}")
            }
            Refusal::OutsideRange { joint, position } => write!(
                f,
                "joint `{}` at {position}, outside of its range {} to {}",
                model.joint_names()[*joint],
                model.lower()[*joint],
                model.upper()[*joint]
            ),
            Refusal::NoEndEffector => {
                f.write_str("the robot has no unique end effector on a fixed base: give joint positions")
            }
            Refusal::Orientation(length) => {
                write!(f, "the orientation has the length {length:.3}, expected 1; the order is x y z w")
            }
            Refusal::JointOfPose(joint) => {
                write!(
                    f,
                    "joint `{}` has a position, but the pose determines it",
                    model.joint_names()[*joint]
                )
            }
            Refusal::BeyondReach { distance, reach } => write!(
                f,
                "the position is {distance:.3} m from the first joint, and the links reach {reach:.3} m in one line"
            ),
            Refusal::NoSolution { position_error, rotation_error } => write!(
                f,
                "no joint positions within their limits reach the pose; the nearest is {position_error:.3} m and \
                 {rotation_error:.3} rad away"
            ),
        }
    }
}
