//! The table `limits.collision` of `control.qp`: distances that links keep.

use motorium::prelude::*;
use motorium_robots::{CollisionModel, CollisionOptions, Collisions, Kinematics, Model, Profile};
use nalgebra::Isometry3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::checks::in_range;
use crate::limits::{CollisionLimit, CollisionSettings};

/// Distances that the links of the robot keep from one another and from the ground, in all levels.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CollisionConfig {
    /// Distance that is kept, m, at least 0. Default 0.02.
    pub distance: f64,
    /// Distance within which pairs are considered, m, more than `distance`. Default 0.2.
    pub range: f64,
    /// Share of what is left of a distance that may be covered per second, 1/s, at least 1e-3. Default 5.
    pub rate: f64,
    /// Largest number of pairs of solids, the nearest ones, 1 to 256. Default 16.
    pub pairs: usize,
    /// Height of a level ground that links keep away from, m. Default: no ground.
    pub ground: Option<f64>,
    /// Pairs of links that do not count. Pairs that are nearer than `distance` at home never count: they are so by the build of the
    /// robot.
    pub ignore: Vec<[String; 2]>,
}

impl Default for CollisionConfig {
    fn default() -> Self {
        let CollisionSettings { distance, range, rate, pairs } = CollisionSettings::default();
        Self { distance, range, rate, pairs, ground: None, ignore: Vec::new() }
    }
}

/// Name of the ground among the links.
const GROUND: &str = "ground";

impl CollisionConfig {
    /// The limit, checked; `path` is that of the table.
    pub(super) fn build(
        &self,
        path: &str,
        model: &Model,
        profile: Option<&Profile>,
    ) -> Result<CollisionLimit, ConfigError> {
        let key = |name: &str| format!("{path}.{name}");
        let distance = in_range(&key("distance"), self.distance, 0.0..=1e3)?;
        let range = in_range(&key("range"), self.range, distance..=1e3)?;
        let rate = in_range(&key("rate"), self.rate, 1e-3..=1e6)?;
        if !(1..=256).contains(&self.pairs) {
            return Err(ConfigError::key(key("pairs"), format!("{}, expected from 1 to 256", self.pairs)));
        }
        let options = CollisionOptions { leave_out_defects: true, ..CollisionOptions::default() };
        let mut solids = CollisionModel::new(model, &options)
            .map_err(|error| ConfigError::key(path, error.to_string()))?;
        if let Some(height) = self.ground {
            let height = in_range(&key("ground"), height, -1e3..=1e3)?;
            solids.add_half_space(GROUND, Isometry3::translation(0.0, 0.0, height));
        }
        for [one, other] in &self.ignore {
            for link in [one, other] {
                if link != GROUND && model.frame(link).is_err() {
                    let message = model.frame(link).expect_err("it is unknown").to_string();
                    return Err(ConfigError::key(key("ignore"), message));
                }
            }
            solids.exclude(one, other);
        }
        leave_out_near(&mut solids, model, profile, distance);
        if solids.pairs().is_empty() {
            return Err(ConfigError::key(
                path,
                format!("robot `{}` has no pair of solids to keep apart", model.name()),
            )
            .advise(
                "its links need <collision> shapes; `motorium robot check` names those that cannot be used",
            ));
        }
        Ok(CollisionLimit::new(model, solids, CollisionSettings { distance, range, rate, pairs: self.pairs }))
    }
}

/// Leaves out the pairs that are nearer than `distance` at home.
fn leave_out_near(solids: &mut CollisionModel, model: &Model, profile: Option<&Profile>, distance: f64) {
    let mut q = model.neutral();
    let joints = q.len() - model.joint_count();
    if let Some(profile) = profile {
        if let Ok(home) = profile.home(model) {
            q[joints..].copy_from_slice(home.as_slice());
        }
        if let Some(base) = profile.base_poses.get(&profile.home).filter(|_| model.base().floating) {
            q[..3].copy_from_slice(&base.position);
        }
    }
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, &q);
    let mut workspace = Collisions::new(solids);
    workspace.update(solids, &kinematics);
    let near: Vec<usize> = workspace.within(solids, distance).iter().map(|found| found.pair).collect();
    let mut index = 0;
    solids.retain_pairs(|_| {
        index += 1;
        !near.contains(&(index - 1))
    });
}
