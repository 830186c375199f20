//! Robots and their worlds: portraits as SVG and PNG, and the pictures of films.
//!
//! The camera is a parallel projection that fits the robots into the picture. SVG pictures have flat faces,
//! painted back to front; PNG pictures are shaded, with shadows on a floor.
//!
//! ```
//! use std::path::Path;
//!
//! use motorium_pictures::robot::{Detail, Frames, Marks, OBLIQUE, Portrait};
//! use motorium_robots::{Kinematics, ShapeSource};
//!
//! let panda = motorium_robots::load("panda", Path::new("."))?;
//! let mut kinematics = Kinematics::new(&panda.model);
//! kinematics.update(&panda.model, &panda.model.neutral());
//! let colours = panda.link_colours(ShapeSource::Collision)?;
//! let marks = Marks::new(&panda, &kinematics, Frames::Ends, true, false);
//! let (detail, view, size) = (Detail::Hull, OBLIQUE.parse()?, (320.0, 240.0));
//! let svg = Portrait::new(&panda, &kinematics, &colours, detail, marks, view, size).svg(true);
//! assert!(svg.contains("panda_hand"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod backdrop;
mod camera;
mod film;
mod marks;
mod order;
mod portrait;
mod raster;
mod scene;
mod solid;
mod svg;
mod terrain;

pub use camera::{OBLIQUE, ParseViewError, View};
pub use film::{Film, FilmError, Pictures, Postures};
pub use marks::{Frames, Marks};
pub use portrait::Portrait;
pub use raster::SizeError;
pub use solid::Detail;
pub use terrain::terrain_mesh;
