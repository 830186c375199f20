//! Minimum distances of links from each other and from obstacles.

use motorium::declare::ConfigError;
use motorium::state::MAX_OBJECTS;
use motorium_robots::{
    Attachment, CollisionModel, CollisionOptions, Collisions, Kinematics, Model, Profile, Proximity,
};
use motorium_worlds::{Object, World};
use nalgebra::Isometry3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{LimitRows, RowLimit};
use crate::RobotState;
use crate::checks::in_range;

with_defaults! {
    /// Settings of a [`CollisionLimit`].
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct CollisionSettings;

    /// Minimum distance of two solids \[m\]. Default 0.02.
    pub distance: f64 = 0.02;
    /// Distance within which pairs are considered \[m\]. Default 0.2.
    pub range: f64 = 0.2;
    /// Fraction of the remaining distance that may be covered per second \[1/s\]. Default 5.
    pub rate: f64 = 5.0;
    /// Maximum separation speed of pairs that are too close \[m/s\]. Default 0.01.
    pub recovery: f64 = 0.01;
    /// Maximum number of pairs; the nearest ones are used. Default 16.
    pub pairs: usize = 16;
}

/// Rows for the witnesses of the nearest pairs.
const WITNESSES: usize = 32;

/// Slows the approach of pairs of solids. A pair consists of two solids of the robot, or of a solid of the
/// robot and an obstacle:
///
/// ```text
/// dd/dq v  >=  -min(rate, 1/dt) (d - distance)                    m/s, at most recovery
/// ```
///
/// with the distance `d` of a pair and its gradient (Faverjon and Tournassoud, *A local based approach for
/// path planning of manipulators with a high number of degrees of freedom*, 1987). Pairs that are too close
/// separate at up to `recovery`, or stay if other limits prevent this. `dd/dq v` does not include the motion
/// of an obstacle: the robot does not approach the obstacle, and evades it at up to `recovery`.
///
/// For pairs with flat faces or edges, the gradient at the nearest points does not cover the corner that is
/// nearest after the next step. The nearest pairs therefore have an additional row per
/// [witness](Collisions::witnesses), 32 in total: enough for all witnesses of two pairs, and at least eight
/// of a third.
///
/// If only a [bound](Proximity::is_bound) on a distance is known, the solids may neither approach beyond this
/// bound nor separate.
///
/// ```
/// use motorium_control::limits::{CollisionLimit, CollisionSettings, RowLimit};
/// use motorium_robots::{CollisionModel, CollisionOptions, Geometry, MeshMode, load};
/// use nalgebra::Isometry3;
///
/// let panda = load("panda", std::path::Path::new("."))?.model;
/// let mut solids = CollisionModel::new(&panda, &CollisionOptions::default())?;
/// let at = Isometry3::translation(0.6, 0.0, 0.3);
/// let ball = solids.add_obstacle("ball", at, Geometry::Sphere { radius: 0.1 }, MeshMode::default())?;
/// // the ball is the first object of the world, and moves
/// let mut limit = CollisionLimit::new(&panda, solids, CollisionSettings::default())
///     .objects([(0, ball, Isometry3::identity())]);
/// limit.move_object(0, &Isometry3::translation(0.6, 0.2, 0.3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct CollisionLimit {
    settings: CollisionSettings,
    collisions: CollisionModel,
    workspace: Collisions,
    nearest: Vec<Proximity>,
    witnesses: Vec<Proximity>,
    row: Vec<f64>,
    /// Moving objects of the world, each with its solid.
    objects: Vec<(usize, usize, Isometry3<f64>)>,
}

impl CollisionLimit {
    /// Creates a limit for the pairs of `collisions`, which must have been built for `model`.
    pub fn new(model: &Model, collisions: CollisionModel, settings: CollisionSettings) -> Self {
        Self {
            settings,
            workspace: Collisions::new(&collisions),
            nearest: Vec::with_capacity(collisions.pairs().len()),
            witnesses: Vec::with_capacity(WITNESSES),
            row: vec![0.0; model.nv()],
            objects: Vec::new(),
            collisions,
        }
    }

    /// Adds obstacles that [`move_object`](RowLimit::move_object) can move. Each entry contains the index of
    /// the object in the world, the index of its solid in the collision model, and the frame of the solid in
    /// the object.
    #[must_use]
    pub fn objects(mut self, objects: impl IntoIterator<Item = (usize, usize, Isometry3<f64>)>) -> Self {
        self.objects = objects.into_iter().collect();
        self
    }
}

impl RowLimit for CollisionLimit {
    fn rows(&self) -> usize {
        self.settings.pairs + WITNESSES
    }

    fn write(&mut self, state: &RobotState<'_>, dt: f64, rows: &mut LimitRows<'_>) {
        let Self { settings, collisions, workspace, nearest, witnesses, row, .. } = self;
        workspace.update(collisions, state.kinematics);
        nearest.clear();
        nearest.extend_from_slice(workspace.within(collisions, settings.range));
        nearest.sort_unstable_by(|a, b| a.distance.total_cmp(&b.distance));
        let nearest = &nearest[..nearest.len().min(settings.pairs)];
        witnesses.clear();
        for pair in nearest {
            workspace.witnesses(collisions, pair, WITNESSES - witnesses.len(), witnesses);
        }
        let rate = settings.rate.min(dt.recip());
        for points in nearest.iter().chain(&*witnesses) {
            collisions.distance_jacobian(state.model, state.kinematics, points, row);
            let left = points.distance - settings.distance;
            // a bound may be far below the actual distance and does not justify a separation
            let left = if points.is_bound { left.max(0.0) } else { left };
            rows.push_barrier(row.iter().copied(), left, rate, settings.recovery);
        }
    }

    fn smallest_distance(&self) -> Option<f64> {
        self.nearest.iter().find(|pair| !pair.is_bound).map(|pair| pair.distance)
    }

    fn move_object(&mut self, object: usize, pose: &Isometry3<f64>) {
        for (_, solid, frame) in self.objects.iter().filter(|(moved, ..)| *moved == object) {
            self.workspace.move_obstacle(&self.collisions, *solid, &(pose * frame));
        }
    }
}

with_defaults! {
    /// Minimum distances of the robot's links from each other, from the ground and from objects of the world.
    /// Enforced at every level.
    ///
    /// ```toml
    /// distance = 0.03
    /// ground = "world"
    /// objects = ["table", "ball"]
    /// ignore = [["panda_link1", "table"]]
    /// ```
    #[derive(Debug, Clone, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct CollisionConfig;

    /// Minimum distance of two solids, m, at least 0. Default 0.02.
    pub distance: f64 = CollisionSettings::default().distance;
    /// Distance within which pairs are considered, m. Must be greater than `distance`. Default 0.2.
    pub range: f64 = CollisionSettings::default().range;
    /// Fraction of the remaining distance that may be covered per second, 1/s, at least 1e-3. Default 5.
    pub rate: f64 = CollisionSettings::default().rate;
    /// Maximum speed at which pairs nearer than `distance` separate, m/s, 0 to 1. Default 0.01.
    pub recovery: f64 = CollisionSettings::default().recovery;
    /// Maximum number of pairs of solids, 1 to 256; the nearest pairs are used. Default 16.
    pub pairs: usize = CollisionSettings::default().pairs;
    /// Level ground from which links keep their distance: its height, m, or "world" for the ground of the
    /// world. Default: no ground.
    pub ground: Option<LevelGround> = None;
    /// Objects of the world from which links keep their distance: a list of names, or "all". If one of them
    /// has a mass, the input `object_poses` is required. Default: no objects.
    pub objects: Option<WorldObjects> = None;
    /// Pairs of links, or of a link and "ground" or an object, to ignore. Pairs of links, and of links and
    /// the ground, that are nearer than `distance` at the home pose are always ignored, since the robot's
    /// design places them there.
    pub ignore: Vec<[String; 2]> = Vec::new();
}

/// Level ground for minimum distances.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected the height of the ground, m, or \"world\"")]
pub enum LevelGround {
    /// Height of the ground, m.
    Height(f64),
    /// "world": the ground of the world.
    World(OfWorld),
}

/// The string "world".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OfWorld {
    /// Ground of the world.
    World,
}

/// Selection of objects of the world.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a list of names of objects, or \"all\"")]
pub enum WorldObjects {
    /// Objects with these names.
    Named(Vec<String>),
    /// All objects, selected by the string "all".
    All(AllObjects),
}

/// The string "all".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AllObjects {
    /// Every object.
    All,
}

/// Name of the ground among the links.
const GROUND: &str = "ground";

impl CollisionConfig {
    /// Builds and checks the limit; `path` is the path of the table.
    pub(crate) fn build(
        &self,
        path: &str,
        model: &Model,
        profile: Option<&Profile>,
        world: &World,
    ) -> Result<CollisionLimit, ConfigError> {
        let key = |name: &str| format!("{path}.{name}");
        let distance = in_range(&key("distance"), self.distance, 0.0..=1e3)?;
        let range = in_range(&key("range"), self.range, distance..=1e3)?;
        let rate = in_range(&key("rate"), self.rate, 1e-3..=1e6)?;
        if !(1..=256).contains(&self.pairs) {
            return Err(ConfigError::key(key("pairs"), format!("{}, expected 1 to 256", self.pairs)));
        }
        let options = CollisionOptions { leave_out_defects: true, ..CollisionOptions::default() };
        let mut solids = CollisionModel::new(model, &options)
            .map_err(|error| ConfigError::key(path, error.to_string()))?;
        if let Some(ground) = &self.ground {
            let height = in_range(&key("ground"), ground.height(&key("ground"), world)?, -1e3..=1e3)?;
            solids.add_half_space(GROUND, Isometry3::translation(0.0, 0.0, height));
        }
        let objects = self.add_objects(&key("objects"), &mut solids, model, world)?;
        for [one, other] in &self.ignore {
            for name in [one, other] {
                let is_object = objects.iter().any(|(index, ..)| world.objects[*index].name == *name);
                if name == GROUND || is_object {
                    continue;
                }
                if let Err(unknown) = model.frame(name) {
                    let message = unknown.to_string();
                    return Err(ConfigError::key(key("ignore"), message)
                        .advise("name a link, \"ground\", or one of the `objects`"));
                }
            }
            solids.exclude(one, other);
        }
        // links fixed to the world do not move towards fixed objects
        let fixed: Vec<bool> = (0..solids.solid_count())
            .map(|solid| !model.base().floating && solids.attachment(solid) == Attachment::Base)
            .collect();
        let first = (0..fixed.len()).find(|solid| solids.is_obstacle(*solid)).unwrap_or(fixed.len());
        solids.retain_pairs(|[one, other]| !(fixed[*one] && *other >= first));
        leave_out_near(&mut solids, model, profile, distance, |link, object, found| {
            let message = format!(
                "link `{link}` is {} m from `{object}` in the home pose, expected at least {distance} m",
                (found * 1e4).round() / 1e4
            );
            ConfigError::key(key("objects"), message).advise(format!(
                "move `{object}`, or the robot by `start`; if they touch by design: ignore = [[\"{link}\", \"{object}\"]]"
            ))
        })?;
        if solids.pairs().is_empty() {
            return Err(ConfigError::key(
                path,
                format!("robot `{}` has no pair of solids to keep apart", model.name()),
            )
            .advise(
                "its links need <collision> shapes; `motorium robot check` names those that cannot be used",
            ));
        }
        let recovery = in_range(&key("recovery"), self.recovery, 0.0..=1.0)?;
        let settings = CollisionSettings { distance, range, rate, recovery, pairs: self.pairs };
        let moving = objects.into_iter().filter(|(index, ..)| world.objects[*index].is_dynamic());
        Ok(CollisionLimit::new(model, solids, settings).objects(moving))
    }

    /// Returns `true` if a named object moves.
    pub(crate) fn has_moving_objects(&self, world: &World) -> bool {
        let named = |object: &&Object| match &self.objects {
            None => false,
            Some(WorldObjects::All(_)) => true,
            Some(WorldObjects::Named(names)) => names.contains(&object.name),
        };
        world.objects.iter().filter(named).any(Object::is_dynamic)
    }

    /// Adds the objects as obstacles. Returns for each its index in the world, the index of its solid, and
    /// the solid's frame in the object.
    fn add_objects(
        &self,
        key: &str,
        solids: &mut CollisionModel,
        model: &Model,
        world: &World,
    ) -> Result<Vec<(usize, usize, Isometry3<f64>)>, ConfigError> {
        let Some(desired) = &self.objects else { return Ok(Vec::new()) };
        let mistaken = |error: String| ConfigError::key("world", error);
        let plain = World { objects: world.objects.clone(), ..World::default() };
        plain
            .check(model.frames().iter().map(|frame| frame.name.as_str()))
            .map_err(|error| mistaken(error.to_string()))?;
        let known = || world.objects.iter().map(|object| object.name.as_str());
        if known().next().is_none() {
            return Err(ConfigError::key(key, "the world has no objects")
                .advise("add objects to `[world]`: objects = [{ name = \"box\", shape = { box = { size = [0.1, 0.1, 0.1] } }, position = [0.5, 0.0, 0.05] }]"));
        }
        if let WorldObjects::Named(names) = desired
            && let Some(unknown) = names.iter().find(|name| !known().any(|known| known == *name))
        {
            return Err(ConfigError::key(key, format!("the world has no object `{unknown}`"))
                .advise(motorium::nearest::suggest(unknown, known(), "its objects are")));
        }
        let mut added = Vec::new();
        for (index, object) in world.objects.iter().enumerate() {
            if matches!(desired, WorldObjects::Named(names) if !names.contains(&object.name)) {
                continue;
            }
            if object.is_dynamic() && index >= MAX_OBJECTS {
                let message = format!(
                    "`{}` moves, but only the poses of the first {MAX_OBJECTS} objects are known",
                    object.name
                );
                return Err(mistaken(message).advise("list moving objects first in the world"));
            }
            let meshes = CollisionOptions::default().meshes;
            for (frame, shape) in object.shape.shapes() {
                let Some(shape) = shape.geometry() else { continue };
                let solid = solids
                    .add_obstacle(&object.name, object.pose() * frame, shape, meshes)
                    .map_err(|error| mistaken(error.to_string()))?;
                added.push((index, solid, frame));
            }
        }
        Ok(added)
    }
}

impl LevelGround {
    fn height(self, key: &str, world: &World) -> Result<f64, ConfigError> {
        match (self, &world.ground, &world.terrain) {
            (Self::Height(height), ..) => Ok(height),
            (Self::World(_), Some(ground), _) => Ok(ground.height),
            (Self::World(_), None, terrain) => {
                let found = if terrain.is_some() { "a terrain instead of level ground" } else { "no ground" };
                Err(ConfigError::key(key, format!("the world has {found}"))
                    .advise("give the height of a level ground instead, such as 0.0"))
            }
        }
    }
}

/// Removes the pairs of links, and of links and the ground, that are nearer than `distance` at the home pose.
/// A link that is this near to an object is an error, since its limit would be dropped silently.
fn leave_out_near(
    solids: &mut CollisionModel,
    model: &Model,
    profile: Option<&Profile>,
    distance: f64,
    refusal: impl Fn(&str, &str, f64) -> ConfigError,
) -> Result<(), ConfigError> {
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
    let found = workspace.within(solids, distance);
    for near in found {
        let [link, object] = solids.pair_links(near.pair);
        if solids.is_obstacle(solids.pairs()[near.pair][1]) && object != GROUND {
            return Err(refusal(link, object, near.distance));
        }
    }
    let near: Vec<usize> = found.iter().map(|found| found.pair).collect();
    let mut index = 0;
    solids.retain_pairs(|_| {
        index += 1;
        !near.contains(&(index - 1))
    });
    Ok(())
}
