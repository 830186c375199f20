//! `motorium robot draw`: a picture of a robot in a pose.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_pictures::robot::{self, Detail, Marks, OBLIQUE, Portrait, View};
use motorium_robots::{Kinematics, MimicMode, ShapeSource};

use super::check::warn_of_meshes;
use super::pose::PoseArgs;
use super::source::ProfiledArgs;
use crate::out::out;
use crate::output::{format, refuse_existing, write_file};

/// Draw a robot in a pose as an SVG picture: its shapes (meshes as hulls, bare links as sticks).
///
/// A file `.png` is a shaded picture with shadows, without frames, names and centre of mass. Meshes that are
/// missing or cannot be read are left out with a warning.
///
/// Example: motorium robot draw panda --view 30,20 --output out/panda.svg
#[derive(Debug, clap::Args)]
pub(super) struct Draw {
    #[command(flatten)]
    robot: ProfiledArgs,
    #[command(flatten)]
    pose: PoseArgs,
    /// View: front, back, left, right, top, or AZIMUTH,ELEVATION in degrees
    #[arg(long, default_value = OBLIQUE, allow_hyphen_values = true)]
    view: View,
    /// Frames (x red, y green, z blue); `ends`: root, end effectors, feet [default: ends; in .png none]
    #[arg(long, value_enum)]
    frames: Option<Frames>,
    /// Label the frames with their names
    #[arg(long)]
    names: bool,
    /// Mark the centre of mass
    #[arg(long)]
    com: bool,
    /// Draw the visuals, with their meshes, instead of the collision geometry
    #[arg(long)]
    visual: bool,
    /// Omit the ground and the shadow
    #[arg(long)]
    no_ground: bool,
    /// Width and height of the picture [default: 640x640]
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "640x640", hide_default_value = true, value_parser = size)]
    size: (f64, f64),
    /// File to write: .svg or .png [default: standard output]
    #[arg(long, short)]
    output: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long, requires = "output")]
    overwrite: bool,
}

// Without doc comments, the possible values stay on the line of the option.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Frames {
    Ends,
    Joints,
    All,
    None,
}

impl From<Frames> for robot::Frames {
    fn from(frames: Frames) -> Self {
        match frames {
            Frames::Ends => Self::Ends,
            Frames::Joints => Self::Joints,
            Frames::All => Self::All,
            Frames::None => Self::None,
        }
    }
}

pub(in crate::commands) fn size(text: &str) -> Result<(f64, f64), String> {
    let wanted = || "expected WIDTHxHEIGHT such as 800x600, from 16 to 10000 each".to_string();
    let (width, height) = text.split_once('x').ok_or_else(wanted)?;
    let side = |side: &str| side.parse().ok().filter(|side| (16.0..=1e4).contains(side)).ok_or_else(wanted);
    Ok((side(width)?, side(height)?))
}

impl Draw {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let kind = self.output.as_ref().map(|output| format(output, &["svg", "png"])).transpose()?;
        self.output.iter().try_for_each(|output| refuse_existing(output, self.overwrite))?;
        let opened = match self.visual {
            true => self.robot.open_visual(MimicMode::Follow),
            false => self.robot.open(MimicMode::Follow),
        };
        let robot = match opened {
            Ok(robot) => robot,
            Err(code) => return Ok(code),
        };
        let model = &robot.model;
        let q = self.pose.configuration(&robot)?;
        let mut kinematics = Kinematics::new(model);
        kinematics.update(model, &q);
        let shapes = if self.visual { ShapeSource::Visual } else { ShapeSource::Collision };
        warn_of_meshes(&robot, shapes);
        let png = kind == Some("png");
        let detail = match (self.visual, png) {
            (false, _) => Detail::Hull,
            (true, false) => Detail::Coarse,
            (true, true) => Detail::Full,
        };
        let colours = robot.link_colours(shapes)?;
        let frames = self.frames.unwrap_or(Frames::Ends).into();
        let marks = Marks::new(&robot, &kinematics, frames, self.names, self.com);
        let portrait = Portrait::new(&robot, &kinematics, &colours, detail, marks, self.view, self.size);
        let picture = match png {
            true => self.shaded(&portrait)?,
            false => portrait.svg(!self.no_ground).into_bytes(),
        };
        match &self.output {
            Some(path) => write_file(path, picture)?,
            None => out!("{}", String::from_utf8_lossy(&picture)),
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Returns the shaded picture as a PNG file.
    fn shaded(&self, portrait: &Portrait) -> anyhow::Result<Vec<u8>> {
        let marked = self.names || self.com || self.frames.is_some_and(|frames| frames != Frames::None);
        anyhow::ensure!(
            !marked,
            "frames, names and the centre of mass are drawn in .svg files only; leave out --frames, --names and --com, \
             or write an .svg file"
        );
        Ok(portrait.png(!self.no_ground)?)
    }
}
