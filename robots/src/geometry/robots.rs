//! Several robots in one collision model.

use std::ops::Range;

use super::distance::Collisions;
use super::pairs::{CollisionError, CollisionModel, CollisionOptions};
use crate::model::flat::FlatModel;
use crate::{Kinematics, Model};

impl CollisionModel {
    /// Adds a further robot with its own base, and returns the index of this robot. `options` and their rules
    /// apply to the links of the new robot. Each of these links is also checked against every link of the
    /// previous robots, unless both links are fixed in the world next to floating bases.
    ///
    /// ```
    /// use motorium_robots::{CollisionModel, CollisionOptions, load};
    ///
    /// let arm = load("panda", std::path::Path::new("."))?.model;
    /// let mut both = CollisionModel::new(&arm.prefixed("left/"), &CollisionOptions::default())?;
    /// let (solids, pairs) = (both.solid_count(), both.pairs().len());
    /// let right = both.add_robot(&arm.prefixed("right/"), &CollisionOptions::default())?;
    /// assert_eq!((right, both.robot(solids)), (1, Some(1)));
    /// assert_eq!(both.pairs().len(), 2 * pairs + solids * solids);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`CollisionError`], as for [`new`](Self::new).
    ///
    /// # Panics
    ///
    /// If an obstacle has already been added.
    pub fn add_robot(&mut self, model: &Model, options: &CollisionOptions) -> Result<usize, CollisionError> {
        assert!(self.solids.len() == self.robot_solids, "robots are added before obstacles");
        let own = Self::new(model, options)?;
        let first = self.solids.len();
        self.pairs.extend(own.pairs.iter().map(|pair| pair.map(|solid| first + solid)));
        for other in 0..first {
            let fixed = self.slots[other] == FlatModel::WORLD;
            let checked =
                (0..own.solids.len()).filter(|solid| !fixed || own.slots[*solid] != FlatModel::WORLD);
            self.pairs.extend(checked.map(|solid| [other, first + solid]));
        }
        self.solids.extend(own.solids);
        self.slots.extend(own.slots);
        self.left_out.extend(own.left_out);
        self.robots.push(first);
        self.robot_solids = self.solids.len();
        self.share_surfaces();
        Ok(self.robots.len() - 1)
    }

    /// Returns the index of the robot to which solid `index` belongs; `None` for an obstacle.
    pub fn robot(&self, index: usize) -> Option<usize> {
        (index < self.robot_solids).then(|| self.robots.partition_point(|first| *first <= index) - 1)
    }

    /// Range of the solids of a robot.
    pub(super) fn solids_of(&self, robot: usize) -> Range<usize> {
        self.robots[robot]..self.robots.get(robot + 1).copied().unwrap_or(self.robot_solids)
    }
}

impl Collisions {
    /// Places the solids of the robot with index `robot` according to its `kinematics`.
    pub fn update_robot(&mut self, model: &CollisionModel, robot: usize, kinematics: &Kinematics) {
        for index in model.solids_of(robot) {
            let (rotation, position) = kinematics.slot_pose(model.slots[index]);
            let solid = &model.solids[index];
            self.rotations[index] = rotation * solid.rotation;
            self.positions[index] = position + rotation * solid.position;
        }
    }
}
