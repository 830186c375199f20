//! Drag of the surrounding air on objects.

use nalgebra::Vector3;

use crate::World;

/// The air of a world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Air {
    /// Wind velocity, world axes \[m/s\].
    wind: Vector3<f64>,
    /// Air density \[kg/m3\].
    density: f64,
}

impl Air {
    pub(crate) fn new(world: &World) -> Self {
        Self { wind: world.wind.into(), density: world.air_density }
    }

    /// Returns the velocity \[m/s\] after `h` \[s\] of a body that starts with `velocity` \[m/s\]. `drag` is
    /// its drag area \[m2\], `mass` its mass \[kg\].
    ///
    /// The drag is evaluated at the end of the step: the speed `s` relative to the air obeys
    /// `s + h k s^2 = s_0` with `k = density drag / (2 mass)`. This equation has one solution for any `h`,
    /// and its limit under gravity is exactly the terminal velocity.
    pub(crate) fn slowed(&self, (drag, mass): (f64, f64), velocity: Vector3<f64>, h: f64) -> Vector3<f64> {
        if drag == 0.0 {
            return velocity;
        }
        let relative = velocity - self.wind;
        let k = 0.5 * self.density * drag / mass;
        self.wind + relative * (2.0 / (1.0 + (1.0 + 4.0 * h * k * relative.norm()).sqrt()))
    }

    /// Returns the mean drag force \[N\] on the same body during a step of `h` \[s\] under `gravity`
    /// \[m/s2\].
    pub(crate) fn force(
        &self,
        (drag, mass): (f64, f64),
        velocity: Vector3<f64>,
        gravity: &Vector3<f64>,
        h: f64,
    ) -> Vector3<f64> {
        let falling = velocity + gravity * h;
        (self.slowed((drag, mass), falling, h) - falling) * (mass / h)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coasting_body_matches_the_closed_form() {
        let air = Air::new(&World::default());
        // v' = -k v^2 from v0: v = v0 / (1 + k v0 t).
        let (drag, mass, start) = (0.02, 0.5, 30.0);
        let k = 0.5 * 1.225 * drag / mass;
        let mut velocity = Vector3::new(0.0, start, 0.0);
        for _ in 0..20_000 {
            velocity = air.slowed((drag, mass), velocity, 1e-4);
        }
        let expected = start / (1.0 + k * start * 2.0);
        assert!((velocity.y - expected).abs() < 1e-4 * expected, "{velocity}, {expected}");
    }

    #[test]
    fn drag_is_stable_for_any_step_length() {
        let air = Air::new(&World { wind: [8.0, 0.0, 0.0], ..World::default() });
        let velocity = air.slowed((1e3, 1e-3), Vector3::new(-50.0, 3.0, 0.0), 0.1);
        assert!((velocity - Vector3::new(8.0, 0.0, 0.0)).norm() < 0.1, "{velocity}");
    }
}
