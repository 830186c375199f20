//! Robots for viewers: URDF text and the colours of the links.

use std::io;
use std::sync::Arc;

use crate::catalogue::{shell, shells_in};
use crate::formats::urdf;
use crate::{
    DrawnRobot, LinkColours, LoadOptions, Loaded, MjcfRobot, PackagePath, ShapeSource, TriangleMesh,
    draw_as_urdf, is_mjcf, parse_mjcf,
};

impl Loaded {
    /// Returns the robot as URDF for viewers, or `None` if the robot was not loaded from a file. For a URDF
    /// file, this is the text of the file, in which [held](Self::held) joints are fixed. For an MJCF file,
    /// and if the joints cannot be fixed in the text, the model is [written](draw_as_urdf) as URDF, with
    /// visual shapes if they can be read. The meshes include the shells of the catalogue.
    ///
    /// # Errors
    ///
    /// The robot's file has been removed or cannot be read.
    pub fn drawn(&self) -> io::Result<Option<DrawnRobot>> {
        let Some(text) = self.text()? else { return Ok(None) };
        if !is_mjcf(&text) {
            let text = match &self.held[..] {
                [] => Some(text),
                held => urdf::hold_joints(&text, self.path.as_deref(), held),
            };
            let written = text.map(|text| DrawnRobot { meshes: self.shells(&text), text });
            return Ok(Some(written.unwrap_or_else(|| draw_as_urdf(&self.model))));
        }
        let held: Vec<(&str, f64)> = self.held.iter().map(|(name, held)| (name.as_str(), *held)).collect();
        let seen = self.with_shapes(&text, ShapeSource::Visual).and_then(|robot| {
            let model = robot.model.locked(&held).ok()?;
            (model.joint_names() == self.model.joint_names()).then_some((model, robot.colours))
        });
        Ok(Some(match seen {
            Some((model, colours)) => urdf::write(&model, colours),
            None => draw_as_urdf(&self.model),
        }))
    }

    /// Returns the shells of the catalogue that the URDF text refers to and that are not separate files.
    fn shells(&self, text: &str) -> Vec<(String, Arc<TriangleMesh>)> {
        let packages = PackagePath::from_env();
        let included = shells_in(text).filter(|uri| packages.resolve(uri, self.path.as_deref()).is_err());
        included.filter_map(|uri| Some((uri.to_owned(), shell(uri)?))).collect()
    }

    /// Returns the colours of the links' visuals in the robot's file; empty if the robot was not loaded from
    /// a file. For MJCF with [`ShapeSource::Collision`], these are the colours of the model's geoms or, if no
    /// geom of the model has a colour, the colours of visual geoms.
    ///
    /// ```
    /// use motorium_robots::{ShapeSource, load};
    ///
    /// let panda = load("panda", std::path::Path::new("."))?;
    /// let colours = panda.link_colours(ShapeSource::Collision)?;
    /// assert_eq!(colours.of_shape("panda_link0", 0, None).len(), 3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// The robot's file has been removed or cannot be read.
    pub fn link_colours(&self, shapes: ShapeSource) -> io::Result<LinkColours> {
        let Some(text) = self.text()? else { return Ok(LinkColours::default()) };
        if !is_mjcf(&text) {
            return Ok(LinkColours::of_urdf(&text));
        }
        let of = |shapes| self.with_shapes(&text, shapes).map(|robot| robot.colours).unwrap_or_default();
        let seen = of(ShapeSource::Visual);
        Ok(match shapes {
            ShapeSource::Visual => seen,
            ShapeSource::Collision => of(ShapeSource::Collision).or(seen),
        })
    }

    /// Parses the MJCF text of the robot with these shapes.
    fn with_shapes(&self, text: &str, shapes: ShapeSource) -> Option<MjcfRobot> {
        parse_mjcf(text, self.path.as_deref(), &LoadOptions { shapes, ..LoadOptions::default() }).ok()
    }

    /// Returns `true` if the robot's file is MJCF.
    ///
    /// # Errors
    ///
    /// The robot's file has been removed or cannot be read.
    pub fn is_mjcf(&self) -> io::Result<bool> {
        Ok(self.text()?.is_some_and(|text| is_mjcf(&text)))
    }
}
