//! A robot in one pose as SVG or PNG.

use motorium_robots::{Kinematics, LinkColours, Loaded};
use nalgebra::Point3;

use super::camera::{Camera, View};
use super::film::floor_below;
use super::marks::Marks;
use super::raster::{self, SizeError};
use super::scene::{Forms, Scene};
use super::solid::Detail;
use super::svg;
use crate::animation;

/// A robot in one pose, in front of a camera that shows all of it.
#[derive(Debug, Clone)]
pub struct Portrait {
    name: String,
    scene: Scene,
    marks: Marks,
    camera: Camera,
}

impl Portrait {
    /// Creates the portrait of a robot at the poses in `kinematics`, in the colours of its links, with
    /// width and height in dots. Meshes that cannot be read are left out.
    pub fn new(
        robot: &Loaded,
        kinematics: &Kinematics,
        colours: &LinkColours,
        detail: Detail,
        marks: Marks,
        view: View,
        size: (f64, f64),
    ) -> Self {
        let scene = Scene::from_robot(robot, kinematics, colours, &mut Forms::new(detail));
        let origins = marks.frames.iter().map(|(_, pose)| Point3::from(pose.translation.vector));
        let camera = Camera::around(view, size, scene.points().chain(origins));
        Self { name: robot.model.name().to_string(), scene, marks, camera }
    }

    /// Draws the robot with its marks as an SVG file: flat faces, and with `ground` a grid and a shadow.
    pub fn svg(&self, ground: bool) -> String {
        svg::svg(&self.name, &self.scene, &self.marks, &self.camera, ground)
    }

    /// Paints the robot without its marks as a PNG file: shaded faces, and with `ground` a floor with
    /// shadows.
    ///
    /// # Errors
    ///
    /// [`SizeError`] for more than 4 million pixels.
    pub fn png(&self, ground: bool) -> Result<Vec<u8>, SizeError> {
        raster::check_size((self.camera.width, self.camera.height))?;
        let floor = floor_below(&self.scene).filter(|_| ground && self.camera.eye.z > 0.05);
        let pixels = raster::paint(&self.scene, &self.camera, floor.as_ref());
        let [width, height] = self.camera.dots();
        Ok(animation::encode(width, height, 0, &[pixels]))
    }
}
