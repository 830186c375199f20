//! The plane of an end effector, which maps degrees of freedom of a library to poses.

use motorium::declare::ConfigError;
use nalgebra::Vector3;

use super::config::EndEffectorConfig;
use motorium_library::{MotionLibrary, Superposition};

/// Placement of two-dimensional movements in space.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    origin: Vector3<f64>,
    axes: [Vector3<f64>; 2],
    pitch: f64,
    pub(super) lift: f64,
    /// Scale, m per unit of the library, and the point of the movement that is placed at the origin.
    scale: f64,
    centre: [f64; 2],
    /// For each movement of the library, made with all eigenforces: scale and centre.
    fits: Vec<[f64; 3]>,
}

impl Plane {
    pub(super) fn new(config: &EndEffectorConfig, library: &MotionLibrary) -> Result<Self, ConfigError> {
        let dofs = library.layout().dofs();
        if dofs != 2 {
            let message = format!(
                "the plane of an end effector requires two degrees of freedom, but the library has {dofs}"
            );
            return Err(ConfigError::key("end_effector", message)
                .advise("remove `end_effector`: the movements are then joint setpoints"));
        }
        for (key, value) in [
            ("end_effector.size", config.size),
            ("end_effector.lift", config.lift),
            ("end_effector.pitch", config.pitch),
        ] {
            if !value.is_finite() || (key == "end_effector.size" && value <= 0.0) {
                return Err(ConfigError::key(key, format!("{value} m is not a valid size")));
            }
        }
        let (x, y) = (Vector3::from(config.x_axis), Vector3::from(config.y_axis));
        let straight = x.norm() > 1e-6 && y.norm() > 1e-6;
        if !straight || x.normalize().dot(&y.normalize()).abs() > 1e-6 {
            return Err(ConfigError::key("end_effector.y_axis", "the axes are not perpendicular"));
        }
        let (origin, axes) = (Vector3::from(config.origin), [x.normalize(), y.normalize()]);
        let (pitch, lift) = (config.pitch, config.lift);
        let fits = (0..library.entries().len()).map(|entry| fit(library, entry, config.size)).collect();
        Ok(Self { origin, axes, pitch, lift, scale: 1.0, centre: [0.0; 2], fits })
    }

    /// Selects this movement of the library from now on.
    pub(super) fn fit(&mut self, entry: usize) {
        let [scale, x, y] = self.fits[entry];
        (self.scale, self.centre) = (scale, [x, y]);
    }

    /// Returns the scale of a movement, m per unit of the library.
    pub(super) fn scale_of(&self, entry: usize) -> f64 {
        self.fits[entry][0]
    }

    /// Returns the point of a position in the library, for movement number `place` from the origin.
    pub(super) fn point(&self, position: &[f64], place: usize) -> Vector3<f64> {
        let [x, y] = [0, 1].map(|d| self.scale * (position[d] - self.centre[d]));
        self.origin + self.axes[0] * (x + self.pitch * place as f64) + self.axes[1] * y
    }

    /// Converts a velocity in the library to a velocity in space.
    pub(super) fn velocity(&self, velocity: &[f64]) -> Vector3<f64> {
        (self.axes[0] * velocity[0] + self.axes[1] * velocity[1]) * self.scale
    }

    /// Returns the position in the library of a point: the inverse of [`point`](Self::point).
    pub(super) fn position(&self, point: &Vector3<f64>, place: usize) -> [f64; 2] {
        let from = point - self.origin - self.axes[0] * (self.pitch * place as f64);
        [0, 1].map(|d| from.dot(&self.axes[d]) / self.scale + self.centre[d])
    }

    /// Returns the normal of the plane.
    pub(super) fn normal(&self) -> Vector3<f64> {
        self.axes[0].cross(&self.axes[1])
    }
}

/// Returns scale and centre that fit a movement, made with all eigenforces, to a size.
fn fit(library: &MotionLibrary, entry: usize, size: f64) -> [f64; 3] {
    let path = Superposition::from_entry(library, entry, library.rank()).path(library);
    let range = |d: usize| (path.column(d).min(), path.column(d).max());
    let (x, y) = (range(0), range(1));
    let scale = size / (x.1 - x.0).max(y.1 - y.0).max(1e-9);
    [scale, 0.5 * (x.0 + x.1), 0.5 * (y.0 + y.1)]
}
