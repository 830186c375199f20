//! A robot at some times of a recording, as a strip of pictures.

use motorium_bridges::recording::Postures;

use crate::commands::robot::strip_of_pictures;
use crate::draw::escape;

/// Pictures of a strip.
pub(super) const FRAMES: usize = 5;

/// The strip of a robot. World and objects are left out.
pub(super) fn strip(postures: &Postures) -> anyhow::Result<String> {
    let Postures { robot, configurations } = postures;
    let picture = strip_of_pictures(robot, configurations)?;
    Ok(format!("<h2>{}</h2>\n{picture}", escape(robot.model.name())))
}
