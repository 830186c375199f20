//! Steering round obstacles.

use nalgebra::Vector3;

/// A coupling by which a movement through space avoids point obstacles (Hoffmann, Park, Pastor, Schaal,
/// *Biologically-inspired dynamical systems for movement generation*, ICRA 2009, equations 6 to 8).
///
/// `C = gamma R v phi exp(-beta phi)`, where `phi`, in \[0, pi\], is the angle between the velocity `v` and
/// the direction `o - y` to the obstacle. `R` is the rotation by 90 degrees about `(o - y) x v`, which
/// rotates `v` away from the obstacle. `C` is normal to `v`, so it changes the direction but not the speed.
/// As published, `C` does not depend on the distance. A finite `reach` multiplies `C` by
/// `exp(-(|o - y| / reach)^2)`, so that distant obstacles have no effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObstacleAvoidance {
    /// Strength, 1/s per rad. Published value 1000.
    pub gamma: f64,
    /// Rate at which the effect fades with the angle, 1/rad. Published value 20 / pi.
    pub beta: f64,
    /// Distance at which the effect has fallen to 1/e, m. The published law has an infinite reach.
    pub reach: f64,
}

impl Default for ObstacleAvoidance {
    fn default() -> Self {
        Self { gamma: 1000.0, beta: 20.0 / std::f64::consts::PI, reach: f64::INFINITY }
    }
}

impl ObstacleAvoidance {
    /// Returns the acceleration (m/s^2) away from one obstacle at `obstacle` (m), for an end effector at
    /// `position` (m) with `velocity` (m/s).
    ///
    /// The acceleration is zero at rest. It is also zero if the velocity points exactly at the obstacle,
    /// because no side is preferred; the next deviation, however small, determines the side.
    pub fn acceleration(
        &self,
        position: Vector3<f64>,
        velocity: Vector3<f64>,
        obstacle: Vector3<f64>,
    ) -> Vector3<f64> {
        let to = obstacle - position;
        let axis = to.cross(&velocity);
        let (sine, cosine) = (axis.norm(), to.dot(&velocity));
        if sine <= 1e-12 * to.norm() * velocity.norm() {
            return Vector3::zeros();
        }
        let phi = sine.atan2(cosine);
        let turned = (axis / sine).cross(&velocity);
        let near = (-to.norm_squared() / (self.reach * self.reach)).exp();
        self.gamma * phi * (-self.beta * phi).exp() * near * turned
    }

    /// Returns the sum of the accelerations (m/s^2) away from several obstacles.
    pub fn acceleration_from(
        &self,
        position: Vector3<f64>,
        velocity: Vector3<f64>,
        obstacles: &[Vector3<f64>],
    ) -> Vector3<f64> {
        obstacles.iter().map(|obstacle| self.acceleration(position, velocity, *obstacle)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn acceleration_is_normal_and_has_the_published_magnitude() {
        let avoidance = ObstacleAvoidance::default();
        let velocity = Vector3::new(0.5, 0.0, 0.0);
        // 45 degrees to the left of the direction of motion
        let c = avoidance.acceleration(Vector3::zeros(), velocity, Vector3::new(1.0, 1.0, 0.0));
        let phi = std::f64::consts::FRAC_PI_4;
        assert!(c.dot(&velocity).abs() < 1e-12 && c.y < 0.0 && c.z == 0.0);
        assert!((c.norm() - 1000.0 * 0.5 * phi * (-20.0 / std::f64::consts::PI * phi).exp()).abs() < 1e-10);
    }

    #[test]
    fn no_effect_at_rest_or_straight_ahead() {
        let avoidance = ObstacleAvoidance::default();
        let ahead = Vector3::new(1.0, 0.0, 0.0);
        assert_eq!(avoidance.acceleration(Vector3::zeros(), Vector3::zeros(), ahead), Vector3::zeros());
        assert_eq!(avoidance.acceleration(Vector3::zeros(), ahead, 2.0 * ahead), Vector3::zeros());
        let behind = avoidance.acceleration(Vector3::zeros(), ahead, Vector3::new(-1.0, 0.1, 0.0));
        assert!(behind.norm() < 1e-4);
    }

    #[test]
    fn finite_reach_fades_with_distance() {
        let avoidance = ObstacleAvoidance { reach: 0.2, ..ObstacleAvoidance::default() };
        let at =
            |d: f64| avoidance.acceleration(Vector3::zeros(), Vector3::x(), Vector3::new(d, d, 0.0)).norm();
        assert!((at(0.1) / at(0.2) - (0.06_f64 / 0.04).exp()).abs() < 1e-9);
    }
}
