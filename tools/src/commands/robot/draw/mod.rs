//! `motorium robot draw`: a picture of a robot in a pose.

mod camera;
mod film;
mod marks;
mod order;
mod picture;
mod pose;
mod raster;
mod scene;
mod solid;
mod world;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use motorium_robots::{Kinematics, MimicMode, ShapeSource};

use super::check::warn_of_meshes;
use super::source::ProfiledArgs;
use crate::out::out;
use crate::output::format;
use camera::Camera;
pub(in crate::commands) use camera::{OBLIQUE, View};
pub(in crate::commands) use film::Pictures;
use marks::Frames;
pub(super) use pose::PoseArgs;
use scene::{Forms, Scene};
use solid::Detail;

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
        let scene = Scene::from_robot(&robot, &kinematics, &colours, &mut Forms::new(detail));
        let marks = marks::Marks {
            frames: marks::frames(&robot, &kinematics, self.frames.unwrap_or(Frames::Ends)),
            names: self.names,
            com: self.com.then(|| kinematics.centre_of_mass(model).position),
        };
        let camera = Camera::new(self.view, self.size, &scene, &marks);
        let picture = match png {
            true => self.shaded(&scene, &camera)?,
            false => picture::svg(model.name(), &scene, &marks, &camera, !self.no_ground).into_bytes(),
        };
        match &self.output {
            Some(path) => {
                if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
                    std::fs::create_dir_all(folder)
                        .with_context(|| format!("making {}", folder.display()))?;
                }
                std::fs::write(path, picture).with_context(|| format!("writing {}", path.display()))?;
            }
            None => out!("{}", String::from_utf8_lossy(&picture)),
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Returns the shaded picture as a PNG file.
    fn shaded(&self, scene: &Scene, camera: &Camera) -> anyhow::Result<Vec<u8>> {
        let marked = self.names || self.com || self.frames.is_some_and(|frames| frames != Frames::None);
        anyhow::ensure!(
            !marked,
            "frames, names and the centre of mass are drawn in .svg files only; leave out --frames, --names and --com, \
             or write an .svg file"
        );
        raster::check_size(self.size)?;
        let floor = film::floor_below(scene).filter(|_| !self.no_ground && camera.eye.z > 0.05);
        let pixels = raster::paint(scene, camera, floor.as_ref());
        let [width, height] = camera.dots();
        Ok(motorium_bridges::animation::encode(width, height, 0, &[pixels]))
    }
}
