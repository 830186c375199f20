//! Colours of a robot and of the surrounding world.

use std::collections::BTreeMap;

use motorium::declare::{ConfigError, RobotReference};
use motorium_robots::{Attachment, BaseMode, CollisionModel, ShapeSource};
use motorium_worlds::World;

use super::super::robot::load;
use crate::rendering::{Looks, Paint};

/// Returns the appearance of a scene: the solids of a robot, if given, followed by the world.
pub(super) fn looks(
    robot: &RobotReference,
    solids: Option<&CollisionModel>,
    world: &World,
) -> Result<Looks, ConfigError> {
    let mut paints = Vec::new();
    if let Some(solids) = solids {
        let robot = load(robot, BaseMode::AsFile)?;
        let colours = robot.link_colours(ShapeSource::Collision).unwrap_or_default();
        let mut used: BTreeMap<&str, usize> = BTreeMap::new();
        for index in 0..solids.solid_count() {
            let link = solids.link(index);
            let place = used.entry(link).or_default();
            let body = match solids.attachment(index) {
                Attachment::Body(body) => Some(body),
                Attachment::Base | Attachment::World => None,
            };
            paints.push(Paint::solid(colours.of_shape(link, *place, body)));
            *place += 1;
        }
    }
    let appearance = &world.appearance;
    paints.extend(world.objects.iter().map(|object| Paint::solid(appearance.object(object))));
    let ground = Paint { colour: appearance.ground(), checker: appearance.checker };
    let grounds = usize::from(world.ground.is_some()) + usize::from(world.terrain.is_some());
    paints.extend(std::iter::repeat_n(ground, grounds));
    Ok(Looks { paints: paints.into(), sky: appearance.sky, light: appearance.light })
}
