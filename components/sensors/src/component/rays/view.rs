//! Robot and world as seen by a sensor.

use std::path::Path;

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium::state::{MAX_OBJECTS, ObjectPoses, Randomisation};
use motorium::telemetry::set_apart;
use motorium_worlds::{Terrain, World, WorldError};
use nalgebra::Isometry3;

use super::super::loads::Drawn;
use super::super::robot::{Mount, Needs, TrueMotion};
use super::looks::looks;
use crate::rendering::Looks;
use crate::scenery::{Scenery, solids};

/// Mount of a sensor, and the world that the sensor sees.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// Mount of the sensor on the robot.
    pub(super) mount: &'a Mount,
    /// The world.
    pub(super) world: &'a World,
    /// `true` if the sensor sees the carrying robot.
    pub(super) sees_robot: bool,
}

impl Seen<'_> {
    fn needs(&self) -> Needs {
        if self.sees_robot { Needs::AllLinks } else { Needs::AnyPlace }
    }

    fn moves(&self) -> bool {
        self.world.objects.iter().any(|object| object.is_dynamic())
    }
}

/// Pose of a sensor and the surrounding shapes, from the newest true state.
pub(super) struct View {
    motion: TrueMotion,
    objects: Option<Input<ObjectPoses>>,
    pub(super) scenery: Scenery,
    /// Appearance of the scene, for sensors that see colours.
    looks: Option<Looks>,
    /// Terrain of the graph, if any, and the values sampled for it by the simulation.
    terrain: Option<(Terrain, Drawn)>,
    /// Seed and scale with which the terrain of the scene was generated, if sampled.
    shaped: [Option<f64>; 2],
}

/// The state of the world as seen at one time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    /// Pose of the sensor in the world.
    pub(super) pose: Isometry3<f64>,
    /// Time of the state and its source time on the stamp clock, ns.
    pub(super) times: (u64, u64),
}

impl View {
    /// Declares the inputs required by the mount and the visible links, and `object_poses` if objects move.
    pub(super) fn declare(seen: Seen<'_>, declare: &mut Declare) -> Result<(), ConfigError> {
        let model = TrueMotion::declare(seen.mount, seen.needs(), declare)?;
        let links = model.frames().iter().map(|frame| frame.name.as_str());
        let world = located(seen.world, declare.folder())?;
        world.check(links).map_err(|error: WorldError| ConfigError::key("world", error.to_string()))?;
        let seen = Seen { world: &world, ..seen };
        let beyond = seen.world.objects.iter().skip(MAX_OBJECTS).find(|object| object.is_dynamic());
        if let Some(object) = beyond {
            let message = format!(
                "object `{}` moves, but only the poses of the first {MAX_OBJECTS} objects are published",
                object.name
            );
            return Err(ConfigError::key("world", message).advise("list moving objects before fixed ones"));
        }
        if seen.sees_robot {
            let solids = solids(&model);
            for defect in solids.left_out() {
                declare.warn(format!("rays cannot hit a link: {defect}"));
            }
        }
        if seen.world.terrain.is_some() {
            Drawn::declare(declare);
        }
        if seen.moves() {
            declare.input::<ObjectPoses>("object_poses", "true poses of the objects of the world");
        }
        Ok(())
    }

    /// Opens the inputs and, if requested, loads the colours of the scene.
    pub(super) fn open(
        seen: Seen<'_>,
        sees_colours: bool,
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError> {
        let world = located(seen.world, setup.folder())?;
        let seen = Seen { world: &world, ..seen };
        let motion = TrueMotion::open(seen.mount, seen.needs(), setup)?;
        let solids = seen.sees_robot.then(|| solids(motion.model()));
        let scenery = Scenery::new(motion.model(), solids.as_ref(), &world);
        let looks =
            if sees_colours { Some(looks(setup.robot()?, solids.as_ref(), seen.world)?) } else { None };
        let terrain = match &world.terrain {
            Some(terrain) => Some((terrain.clone(), Drawn::open(setup)?)),
            None => None,
        };
        let objects = if seen.moves() { Some(setup.input("object_poses")?) } else { None };
        let mut view = Self { motion, objects, scenery, looks, terrain, shaped: [None; 2] };
        view.place_links();
        Ok(view)
    }

    /// Returns the appearance of the scene, for sensors that see colours.
    pub(super) fn looks(&self) -> Option<&Looks> {
        self.looks.as_ref()
    }

    /// Reads the newest true state; `None` if it was seen before.
    pub(super) fn newest(&mut self, tick: &Tick, clock: &RunClock) -> Result<Option<Look>, StepError> {
        let times = if self.motion.is_still() {
            (tick.time_ns, clock.stamp_ns(tick.time_ns))
        } else {
            let Some(motion) = self.motion.newest()? else { return Ok(None) };
            (motion.times.state, motion.times.source)
        };
        if let Some(input) = &mut self.objects {
            let Some(poses) = input.latest() else { return Ok(None) };
            for index in 0..poses.count() {
                let object = poses.object()[index] as usize;
                if object >= self.scenery.objects() {
                    return Err(StepError::failed("the object poses are from another world"));
                }
                let position =
                    [poses.position_x()[index], poses.position_y()[index], poses.position_z()[index]];
                let orientation = [
                    poses.orientation_x()[index],
                    poses.orientation_y()[index],
                    poses.orientation_z()[index],
                    poses.orientation_w()[index],
                ];
                self.scenery.set_object(object, position, orientation);
            }
        }
        self.shape_terrain(tick)?;
        self.place_links();
        Ok(Some(Look { pose: self.motion.pose(), times }))
    }

    /// Generates the terrain sampled for the episode, once. The allocated memory is counted separately.
    fn shape_terrain(&mut self, tick: &Tick) -> Result<(), StepError> {
        let Some((terrain, drawn)) = &mut self.terrain else { return Ok(()) };
        let Some(drawn) = drawn.newest(tick) else { return Ok(()) };
        let properties = [Randomisation::TERRAIN_SEED, Randomisation::TERRAIN_SCALE];
        let found @ [seed, scale] = properties.map(|property| drawn.find(property, 0));
        // A repeated draw may describe the current terrain again.
        if found == self.shaped {
            return Ok(());
        }
        self.shaped = found;
        let scene = self.scenery.scene_mut();
        set_apart(|| {
            let mut shaped = terrain.clone();
            shaped.seed = seed.map_or(shaped.seed, |seed| seed as u64);
            shaped.scale *= scale.unwrap_or(1.0);
            let field = shaped.height_field().map_err(|error| StepError::failed(error.to_string()))?;
            scene.set_terrain(field);
            Ok(())
        })
    }

    fn place_links(&mut self) {
        self.scenery.place_links(self.motion.model(), self.motion.kinematics());
    }

    /// Resets to the initial state.
    pub(super) fn reset(&mut self) {
        self.motion.reset();
        if let Some((_, drawn)) = &mut self.terrain {
            drawn.reset();
        }
    }
}

/// Returns the world with its file paths resolved relative to `folder`.
fn located(world: &World, folder: &Path) -> Result<World, ConfigError> {
    let mut world = world.clone();
    world.locate(folder).map_err(|error| ConfigError::key("world", error.to_string()))?;
    Ok(world)
}
