//! `motorium robot draw`: a picture of a robot in a pose.

mod camera;
mod marks;
mod order;
mod picture;
mod pose;
mod scene;
mod solid;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use motorium_robots::{Kinematics, Loaded, MimicMode, ShapeSource};

use super::source::ProfiledArgs;
use crate::out::out;
use camera::{Camera, OBLIQUE, View};
use marks::Frames;
pub(super) use pose::PoseArgs;

/// Draw a robot in a pose as an SVG picture: its shapes (meshes as hulls, bare links as sticks).
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
    /// Frames to draw (x red, y green, z blue); `ends`: root, end effectors, feet
    #[arg(long, value_enum, default_value_t = Frames::Ends)]
    frames: Frames,
    /// Label the frames with their names
    #[arg(long)]
    names: bool,
    /// Mark the centre of mass
    #[arg(long)]
    com: bool,
    /// Draw the visuals, with their meshes, instead of the collision geometry
    #[arg(long)]
    visual: bool,
    /// Leave out the ground and the shadow
    #[arg(long)]
    no_ground: bool,
    /// Width and height of the picture [default: 640x640]
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "640x640", hide_default_value = true, value_parser = size)]
    size: (f64, f64),
    /// File to write [default: standard output]
    #[arg(long, short)]
    output: Option<PathBuf>,
}

fn size(text: &str) -> Result<(f64, f64), String> {
    let wanted = || "expected WIDTHxHEIGHT such as 800x600, from 16 to 10000 each".to_string();
    let (width, height) = text.split_once('x').ok_or_else(wanted)?;
    let side = |side: &str| side.parse().ok().filter(|side| (16.0..=1e4).contains(side)).ok_or_else(wanted);
    Ok((side(width)?, side(height)?))
}

impl Draw {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
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
        let scene = scene::Scene::from_robot(&robot, &kinematics, robot.link_colours(shapes)?, self.visual);
        let marks = marks::Marks {
            frames: marks::frames(&robot, &kinematics, self.frames),
            names: self.names,
            com: self.com.then(|| kinematics.centre_of_mass(model).position),
        };
        let camera = Camera::new(self.view, self.size, &scene, &marks);
        let picture = picture::svg(model.name(), &scene, &marks, &camera, !self.no_ground);
        match &self.output {
            Some(path) => {
                if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
                    std::fs::create_dir_all(folder)
                        .with_context(|| format!("making {}", folder.display()))?;
                }
                std::fs::write(path, picture).with_context(|| format!("writing {}", path.display()))?;
            }
            None => out!("{picture}"),
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Width and height of a picture of a strip.
const FRAME: (f64, f64) = (220.0, 220.0);

/// A robot at some times, s, and configurations, as pictures side by side: on one scale and seen from one
/// place if its base is fixed, else each around the robot.
pub(in crate::commands) fn strip(
    robot: &Loaded,
    configurations: &[(f64, Vec<f64>)],
) -> anyhow::Result<String> {
    let model = &robot.model;
    let view: View = OBLIQUE.parse().map_err(anyhow::Error::msg)?;
    let none = marks::Marks { frames: Vec::new(), names: false, com: None };
    let mut kinematics = Kinematics::new(model);
    let mut scenes = Vec::new();
    for (_, q) in configurations {
        kinematics.update(model, q);
        let colours = robot.link_colours(ShapeSource::Collision)?;
        scenes.push(scene::Scene::from_robot(robot, &kinematics, colours, false));
    }
    let all = scene::Scene { solids: scenes.iter().flat_map(|scene| scene.solids.clone()).collect() };
    let camera = |scene| Camera::new(view, FRAME, if model.base().floating { scene } else { &all }, &none);
    let cameras: Vec<Camera> = scenes.iter().map(camera).collect();
    let pictures: Vec<_> = configurations
        .iter()
        .zip(&scenes)
        .zip(&cameras)
        .map(|(((time, _), scene), camera)| (format!("{time:.2} s"), scene, camera))
        .collect();
    Ok(picture::strip(model.name(), &pictures))
}
