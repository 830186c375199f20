//! Pictures of moving robots and their world.

use motorium_robots::{Kinematics, Loaded, ShapeSource};
use motorium_worlds::{Appearance, World};
use nalgebra::{Isometry3, Point3, Vector3};

use super::backdrop::Backdrop;
use super::camera::{Camera, View};
use super::raster::{self, Floor, SizeError};
use super::scene::{Forms, Scene};
use super::solid::{Detail, Solid};

/// A robot at the times of a film.
#[derive(Debug, Clone)]
pub struct Postures {
    /// Robot with its visual shapes; a fixed base is at its pose in the world.
    pub robot: Loaded,
    /// Configuration `q` at each time.
    pub configurations: Vec<Vec<f64>>,
}

/// Robots and their world at some times.
#[derive(Debug, Clone)]
pub struct Film {
    /// Times since the first sample \[s\].
    pub times_s: Vec<f64>,
    /// Robots of the film.
    pub robots: Vec<Postures>,
    /// World around the robots.
    pub world: Option<World>,
    /// Poses of the world's objects at each time.
    pub objects: Vec<Vec<Isometry3<f64>>>,
}

/// Error returned when a film cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum FilmError {
    /// The pictures are too large.
    #[error(transparent)]
    Size(#[from] SizeError),
    /// The file of a robot, with the colours of its links, can no longer be read.
    #[error(transparent)]
    Robot(#[from] std::io::Error),
    /// No robot has a shape.
    #[error("nothing to draw: no robot of the recording has a shape")]
    Empty,
}

/// Times before and after one over which the camera's motion is averaged.
const STEADY: usize = 6;

/// The pictures of a film. All pictures have the same scale, and the camera follows robots with floating
/// bases.
pub struct Pictures {
    scenes: Vec<Scene>,
    cameras: Vec<Camera>,
    floors: Vec<Option<Floor>>,
}

impl Pictures {
    /// Prepares the pictures of a film, seen from one side. `size` is width and height in dots.
    ///
    /// # Errors
    ///
    /// Returns an error if the size is too large, a robot's file can no longer be read, or no robot has a
    /// shape.
    pub fn new(film: &Film, view: View, size: (f64, f64)) -> Result<Self, FilmError> {
        raster::check_size(size)?;
        let mut forms = Forms::new(Detail::Full);
        let mut scenes: Vec<Scene> = film.times_s.iter().map(|_| Scene { solids: Vec::new() }).collect();
        for postures in &film.robots {
            let robot = &postures.robot;
            let colours = robot.link_colours(ShapeSource::Visual)?;
            let mut kinematics = Kinematics::new(&robot.model);
            for (scene, q) in scenes.iter_mut().zip(&postures.configurations) {
                kinematics.update(&robot.model, q);
                let own = Scene::from_robot(robot, &kinematics, &colours, &mut forms);
                scene.solids.extend(own.solids);
            }
        }
        let middles = middles(film);
        let world = film.world.as_ref().map(|world| (world, Backdrop::new(world)));
        let mut points: Vec<Point3<f64>> = Vec::new();
        for (scene, middle) in scenes.iter().zip(&middles) {
            let corners = scene.solids.iter().flat_map(|solid| solid.corners());
            points.extend(corners.map(|corner| corner - middle));
        }
        let follows = follows(film);
        for (scene, poses) in scenes.iter_mut().zip(&film.objects) {
            let Some((_, backdrop)) = &world else { break };
            if !follows {
                points.extend(backdrop.things(poses).iter().flat_map(|solid| solid.corners()));
            }
            scene.solids.extend(backdrop.solids(poses));
        }
        let (low, high) = bounds(points.iter());
        if points.is_empty() {
            return Err(FilmError::Empty);
        }
        let camera = Camera::around(view, size, points.into_iter());
        let floor = floor(film, &low, &high).filter(|_| camera.eye.z > 0.05);
        let centre = 0.5 * (low + high);
        let floors = middles.iter().map(|middle| {
            floor.map(|floor| {
                let at = centre + middle;
                Floor { middle: Point3::new(at.x, at.y, floor.height), ..floor }
            })
        });
        Ok(Self {
            floors: floors.collect(),
            cameras: middles.iter().map(|by| camera.moved(by)).collect(),
            scenes,
        })
    }

    /// Returns the width and height of each picture in dots.
    pub fn dots(&self) -> [usize; 2] {
        self.cameras.first().map_or([0; 2], Camera::dots)
    }

    /// Paints the picture at the time with this index, as rows of red, green and blue values.
    ///
    /// # Panics
    ///
    /// Panics if `index` is not the index of a time of the film.
    pub fn paint(&self, index: usize) -> Vec<u8> {
        raster::paint(&self.scenes[index], &self.cameras[index], self.floors[index].as_ref())
    }
}

/// Returns `true` if the camera moves with the robots: all of them have floating bases.
fn follows(film: &Film) -> bool {
    !film.robots.is_empty() && film.robots.iter().all(|robot| robot.robot.model.base().floating)
}

/// Returns the horizontal position of the robots that the camera follows, one per time; the origin if the
/// camera does not move.
fn middles(film: &Film) -> Vec<Vector3<f64>> {
    let count = film.times_s.len();
    if !follows(film) {
        return vec![Vector3::zeros(); count];
    }
    let place = |time: usize| {
        let bases = film.robots.iter().map(|robot| &robot.configurations[time]);
        let sum: Vector3<f64> = bases.map(|q| Vector3::new(q[0], q[1], 0.0)).sum();
        sum / film.robots.len() as f64
    };
    let steady = |time: usize| {
        // As many times before as after; otherwise the camera would run ahead at the start.
        let reach = STEADY.min(time).min(count - 1 - time);
        let around = time - reach..=time + reach;
        around.map(place).sum::<Vector3<f64>>() / (2 * reach + 1) as f64
    };
    (0..count).map(steady).collect()
}

/// Returns the lowest and the highest coordinates of points.
fn bounds<'a>(points: impl Iterator<Item = &'a Point3<f64>>) -> (Vector3<f64>, Vector3<f64>) {
    let none = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    points.fold(none, |(low, high), point| (low.inf(&point.coords), high.sup(&point.coords)))
}

/// Returns the plane of the world. Without a world, returns the plane z = 0 if robots stand on it.
fn floor(film: &Film, low: &Vector3<f64>, high: &Vector3<f64>) -> Option<Floor> {
    let appearance = film.world.as_ref().map(|world| world.appearance.clone()).unwrap_or_default();
    let checker = appearance.checker;
    let side = checker.map_or_else(|| round_step((high - low).max() / 6.0), |checker| checker.side);
    let height = match &film.world {
        Some(world) if world.terrain.is_some() => return None,
        Some(world) if world.ground.is_some() => world.ground?.height,
        _ => ground_below(low, high)?,
    };
    let checker = checker.map(|checker| checker.colour);
    Some(Floor { height, colour: appearance.ground(), side, checker, middle: Point3::origin() })
}

/// Returns the plane z = 0 below a scene, if the scene is near the plane.
pub(super) fn floor_below(scene: &Scene) -> Option<Floor> {
    let points: Vec<Point3<f64>> = scene.solids.iter().flat_map(Solid::corners).collect();
    let (low, high) = bounds(points.iter());
    let height = ground_below(&low, &high)?;
    let (side, middle) = (round_step((high - low).max() / 6.0), 0.5 * (low + high));
    let (colour, middle) = (Appearance::default().ground(), Point3::new(middle.x, middle.y, height));
    Some(Floor { height, colour, side, checker: None, middle })
}

/// Returns the height of the ground, 0, if the scene above the ground is near.
fn ground_below(low: &Vector3<f64>, high: &Vector3<f64>) -> Option<f64> {
    let extent = (high - low).max();
    (-0.02 * extent..0.5 * extent).contains(&low.z).then_some(0.0)
}

/// Returns a round number of metres that is at least `rough`.
fn round_step(rough: f64) -> f64 {
    let decade = 10_f64.powf(rough.log10().floor());
    decade * [1.0, 2.0, 5.0, 10.0].into_iter().find(|by| by * decade >= rough).unwrap_or(10.0)
}
