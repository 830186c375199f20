//! Ray-cast images of a scene: matt surfaces in sunlight, with shadows, and the errors of an image sensor.

use std::sync::Arc;

use motorium_robots::Colour;
use motorium_worlds::{Checker, Light, Ray, RayHit, RayScene};
use nalgebra::{Isometry3, Point3, Unit, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::channel::SettingError;
use crate::noise::Noise;
use crate::pinhole::Pinhole;

/// Channel number, within a seed, of the noise of pixels.
const PIXELS: u64 = 1 << 22;

/// Distance from a surface at which the ray to the light starts \[m\], larger than the rounding of the point.
const OFF: f64 = 1e-6;

/// Surface colour, optionally with a checker pattern.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paint {
    /// Red, green and blue, 0 to 1.
    pub colour: Colour,
    /// Second colour of a checkerboard pattern in the xy plane of the world; `None` for a single colour.
    pub checker: Option<Checker>,
}

impl Paint {
    /// Returns a paint of a single colour.
    pub fn solid(colour: Colour) -> Self {
        Self { colour, checker: None }
    }

    /// Returns the colour at a point of the world.
    fn colour_at(&self, point: &Point3<f64>) -> Colour {
        match self.checker {
            Some(Checker { side, colour })
                if ((point.x / side).floor() + (point.y / side).floor()) % 2.0 != 0.0 =>
            {
                colour
            }
            _ => self.colour,
        }
    }
}

/// Appearance of a scene to a camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Looks {
    /// Paint of each shape, by its index in the scene.
    pub paints: Arc<[Paint]>,
    /// Background colour.
    pub sky: Colour,
    /// The light.
    pub light: Light,
}

/// Renders images with one ray through the centre of each pixel and one shadow ray from each hit.
///
/// Only construction allocates.
///
/// ```
/// use motorium_robots::ConvexShape;
/// use motorium_worlds::{Light, RayScene, RayShape};
/// use motorium_sensors::pinhole::Pinhole;
/// use motorium_sensors::rendering::{Looks, Paint, Renderer};
/// use nalgebra::Isometry3;
///
/// let mut scene = RayScene::default();
/// let ball = RayShape::new(&ConvexShape::Sphere { radius: 0.2 });
/// scene.add(ball, &Isometry3::translation(2.0, 0.0, 0.0));
/// let light = Light { direction: [1.0, 0.0, 0.0], ambient: 0.0, shadows: true };
/// let looks = Looks { paints: [Paint::solid([1.0, 0.5, 0.0])].into(), sky: [0.0, 0.0, 1.0], light };
///
/// let mut renderer = Renderer::new(Pinhole::new(3, 1, 1.0), 100.0);
/// let mut picture = [[0.0; 3]; 3];
/// renderer.render(&Isometry3::identity(), &mut scene, &looks, &mut picture);
/// assert_eq!([picture[0], picture[2]], [looks.sky; 2]);
/// assert!(picture[1].iter().zip([1.0, 0.5, 0.0]).all(|(seen, paint)| (seen - paint).abs() < 1e-12));
/// ```
#[derive(Clone, Debug)]
pub struct Renderer {
    pinhole: Pinhole,
    range: f64,
    directions: Vec<Unit<Vector3<f64>>>,
    rays: Vec<Ray>,
    hits: Vec<Option<RayHit>>,
    /// Shadow rays to the light.
    feelers: Vec<Ray>,
    /// Per hit: pixel, fraction of direct light by Lambert's law, and colour of the surface.
    lit: Vec<(usize, f64, Colour)>,
}

impl Renderer {
    /// Creates a renderer for a camera with the maximum visible distance `range` \[m\].
    pub fn new(pinhole: Pinhole, range: f64) -> Self {
        let directions: Vec<_> = pinhole.directions().collect();
        let count = directions.len();
        let ray = Ray { origin: Point3::origin(), direction: Vector3::x_axis() };
        Self {
            pinhole,
            range,
            directions,
            rays: vec![ray; count],
            hits: vec![None; count],
            feelers: Vec::with_capacity(count),
            lit: Vec::with_capacity(count),
        }
    }

    /// Returns the camera.
    pub fn pinhole(&self) -> &Pinhole {
        &self.pinhole
    }

    /// Returns the number of pixels of an image.
    pub fn pixels(&self) -> usize {
        self.directions.len()
    }

    /// Renders an image from the camera pose `pose`, row by row from the top left corner.
    ///
    /// # Panics
    /// If the size of the image differs from the camera's number of pixels, or a shape of the scene has no
    /// paint.
    pub fn render(
        &mut self,
        pose: &Isometry3<f64>,
        scene: &mut RayScene,
        looks: &Looks,
        picture: &mut [Colour],
    ) {
        assert_eq!(picture.len(), self.directions.len(), "pixels of the picture");
        let Self { range, directions, rays, hits, feelers, lit, .. } = self;
        let origin = Point3::from(pose.translation.vector);
        let turn = pose.rotation.to_rotation_matrix();
        for (ray, direction) in rays.iter_mut().zip(directions.iter()) {
            *ray = Ray { origin, direction: turn * direction };
        }
        scene.cast_all(rays, *range, hits);
        let to_light = -Unit::new_normalize(Vector3::from(looks.light.direction));
        let ambient = looks.light.ambient;
        feelers.clear();
        lit.clear();
        for (index, (hit, pixel)) in hits.iter().zip(picture.iter_mut()).enumerate() {
            let Some(hit) = hit else {
                *pixel = looks.sky;
                continue;
            };
            let point = rays[index].point(hit.distance);
            let colour = looks.paints[hit.target].colour_at(&point);
            *pixel = colour.map(|part| part * ambient);
            let share = (1.0 - ambient) * hit.normal.dot(&to_light);
            if share > 0.0 {
                feelers.push(Ray { origin: point + hit.normal * OFF, direction: to_light });
                lit.push((index, share, colour));
            }
        }
        // the hits are already evaluated, so their memory serves the shadow rays
        let shaded = &mut hits[..feelers.len()];
        if looks.light.shadows {
            scene.cast_all(feelers, *range, shaded);
        } else {
            shaded.fill(None);
        }
        for ((index, share, colour), shade) in lit.iter().zip(shaded.iter()) {
            if shade.is_none() {
                let pixel = &mut picture[*index];
                pixel.iter_mut().zip(colour).for_each(|(sum, part)| *sum += part * share);
            }
        }
    }
}

/// Errors of the pixels of an image. The default is an ideal sensor that only rounds the levels.
///
/// A channel with level `l` (0 to 255) is read as `round(l + sqrt(l 255 / full_well + read_noise^2) n)` with
/// independent standard normal `n`. The first term under the root is shot noise: the standard deviation of
/// the number of electrons is the square root of this number. The second term is amplifier noise.
///
/// ```toml
/// full_well  = 10000.0
/// read_noise = 1.0
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PixelNoise {
    /// Full-well capacity: number of electrons of a pixel at level 255. Default: no shot noise.
    pub full_well: Option<f64>,
    /// Standard deviation of the noise in the dark, levels. Default 0.
    #[schemars(range(min = 0.0))]
    pub read_noise: f64,
}

impl PixelNoise {
    /// Returns the noise with all deviations multiplied by `factor`. For shot noise this divides the number
    /// of electrons by the square of `factor`.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        let electrons = |well: f64| (well / (factor * factor)).max(1.0);
        Self {
            // with enough electrons there is no shot noise
            full_well: self.full_well.filter(|_| factor > 0.0).map(|well| electrons(well).min(1e9)),
            read_noise: (factor * self.read_noise).min(255.0),
        }
    }
}

/// An image sensor with noise sampled from a seed.
#[derive(Clone, Debug)]
pub struct PixelSensor {
    /// Variance per level, and variance in the dark.
    variance: [f64; 2],
    draws: Noise,
}

impl PixelSensor {
    /// Creates the sensor with noise from a seed.
    ///
    /// # Errors
    /// [`SettingError`] if a number is out of range.
    pub fn new(noise: &PixelNoise, seed: u64) -> Result<Self, SettingError> {
        let PixelNoise { full_well, read_noise } = *noise;
        if let Some(electrons) = full_well.filter(|electrons| !(1.0..=1e9).contains(electrons)) {
            return Err(SettingError::new("full_well", electrons, "a number of electrons from 1 to 1e9"));
        }
        if !(0.0..=255.0).contains(&read_noise) {
            return Err(SettingError::new("read_noise", read_noise, "a number of levels from 0 to 255"));
        }
        let variance = [full_well.map_or(0.0, |electrons| 255.0 / electrons), read_noise * read_noise];
        Ok(Self { variance, draws: Noise::new(seed, PIXELS) })
    }

    /// Converts a colour to levels, 0 to 255, with noise.
    pub fn expose(&mut self, colour: &Colour) -> [u8; 3] {
        let [per_level, dark] = self.variance;
        colour.map(|part| {
            let mut level = 255.0 * part;
            if per_level + dark > 0.0 {
                level += (level * per_level + dark).sqrt() * self.draws.normal();
            }
            // rounds, and saturates at both ends
            (level + 0.5) as u8
        })
    }
}
