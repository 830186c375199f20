//! Reference motion of a planner.

use std::f64::consts::PI;

use nalgebra::{Rotation2, Rotation3, Vector2, Vector3};

use super::GroundPlane;

/// A planar velocity in heading axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlanarVelocity {
    /// Velocity forwards and to the left \[m/s\].
    pub linear: Vector2<f64>,
    /// Angular velocity about the vertical \[rad/s\].
    pub yaw_rate: f64,
}

/// Reference motion of the centre of mass. It follows a velocity with limited acceleration, at a constant
/// height above the ground.
///
/// ```
/// use motorium_locomotion::mpc::{PlanarVelocity, Reference};
/// use nalgebra::{Vector2, Vector3};
///
/// let mut reference = Reference::new(0.25);
/// let quarter = PlanarVelocity { linear: Vector2::new(0.5, 0.0), yaw_rate: std::f64::consts::FRAC_PI_2 };
/// reference.follow(&quarter, 1e9, 0.01);
/// let (place, velocity, heading) = reference.after(1.0);
/// assert!((heading - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
/// assert!((velocity - Vector3::new(0.0, 0.5, 0.0)).norm() < 1e-12); // it has turned to the left
/// assert!(place.x > 0.0 && (place.x - place.y).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    place: Vector2<f64>,
    heading: f64,
    velocity: PlanarVelocity,
    height: f64,
    ground: GroundPlane,
}

impl Reference {
    /// Creates a reference at rest at the origin, at this height above the ground \[m\].
    pub fn new(height: f64) -> Self {
        let place = Vector2::zeros();
        Self {
            place,
            heading: 0.0,
            velocity: PlanarVelocity::default(),
            height,
            ground: GroundPlane::default(),
        }
    }

    /// Places the reference at rest at the horizontal position of `centre`, with this heading \[rad\].
    pub fn begin(&mut self, centre: &Vector3<f64>, heading: f64) {
        (self.place, self.heading) = (centre.xy(), heading);
        self.velocity = PlanarVelocity::default();
    }

    /// Sets the ground.
    pub fn set_ground(&mut self, ground: GroundPlane) {
        self.ground = ground;
    }

    /// Ramps the velocity towards `desired` for `dt` seconds, limited by `acceleration` \[m/s2, rad/s2\]. The
    /// position does not change; see [`advance`](Self::advance).
    pub fn follow(&mut self, desired: &PlanarVelocity, acceleration: f64, dt: f64) {
        let step = acceleration * dt;
        let change = desired.linear - self.velocity.linear;
        let size = change.norm();
        self.velocity.linear += if size > step { change * (step / size) } else { change };
        self.velocity.yaw_rate += (desired.yaw_rate - self.velocity.yaw_rate).clamp(-step, step);
    }

    /// Moves the reference by `dt` seconds. Its distance from the `measured` centre of mass is limited to
    /// `most` \[m\], and its angle from the measured heading `turned` \[rad\] to `most_turn` \[rad\].
    pub fn advance(
        &mut self,
        dt: f64,
        (measured, turned): (&Vector3<f64>, f64),
        (most, most_turn): (f64, f64),
    ) {
        let (place, _, heading) = self.after(dt);
        let (measured, mut lead) = (measured.xy(), place.xy() - measured.xy());
        let size = lead.norm();
        if size > most {
            lead *= most / size;
        }
        // the difference is wrapped to half a turn
        let ahead = (heading - turned + PI).rem_euclid(2.0 * PI) - PI;
        let beyond = ahead - ahead.clamp(-most_turn, most_turn);
        (self.place, self.heading) = (measured + lead, heading - beyond);
    }

    /// Returns the position \[m\], velocity \[m/s\] and heading \[rad\] that the reference will have in
    /// `time` seconds, moving along a circular arc at the current velocity.
    pub fn after(&self, time: f64) -> (Vector3<f64>, Vector3<f64>, f64) {
        let PlanarVelocity { linear, yaw_rate } = self.velocity;
        let turn = yaw_rate * time;
        // mean of R(s turn) over s from 0 to 1
        let (along, across) = if turn.abs() < 1e-6 {
            (1.0, 0.5 * turn)
        } else {
            (turn.sin() / turn, (1.0 - turn.cos()) / turn)
        };
        let way = Vector2::new(along * linear.x - across * linear.y, across * linear.x + along * linear.y);
        let place = self.place + Rotation2::new(self.heading) * way * time;
        let heading = self.heading + turn;
        let velocity = Rotation2::new(heading) * linear;
        let climb = self.ground.slope().dot(&velocity);
        (
            Vector3::new(place.x, place.y, self.ground.height(&place) + self.height),
            Vector3::new(velocity.x, velocity.y, climb),
            heading,
        )
    }

    /// Returns the heading \[rad\].
    pub fn heading(&self) -> f64 {
        self.heading
    }

    /// Returns the orientation that a base parallel to the ground will have in `time` seconds. Seen from
    /// above, the x axis of the base points along the heading.
    pub fn orientation(&self, time: f64) -> Rotation3<f64> {
        let (ahead, normal) = (self.ahead(time).normalize(), self.ground.normal());
        Rotation3::from_basis_unchecked(&[ahead, normal.cross(&ahead), normal])
    }

    /// Returns the angular velocity \[rad/s\] that a base parallel to the ground will have in `time` seconds.
    /// The base turns about the ground normal, at the speed that changes the heading at the yaw rate.
    pub fn angular_velocity(&self, time: f64) -> Vector3<f64> {
        // seen from above, a rotation by `t` about the normal changes the heading by `t normal_z |ahead|^2`
        let normal = self.ground.normal();
        normal * (self.velocity.yaw_rate / (normal.z * self.ahead(time).norm_squared()))
    }

    /// Returns the tangent of the ground along the heading after `time` seconds, with unit length seen from
    /// above.
    fn ahead(&self, time: f64) -> Vector3<f64> {
        let (y, x) = self.after(time).2.sin_cos();
        Vector3::new(x, y, self.ground.slope().dot(&Vector2::new(x, y)))
    }

    /// Returns the height of the centre of mass above the ground \[m\].
    pub fn height(&self) -> f64 {
        self.height
    }

    /// Returns the ground.
    pub fn ground(&self) -> &GroundPlane {
        &self.ground
    }

    /// Returns the current velocity.
    pub fn velocity(&self) -> &PlanarVelocity {
        &self.velocity
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arc_equals_the_sum_of_small_steps() {
        let mut reference = Reference::new(0.3);
        reference.begin(&Vector3::new(1.0, 2.0, 0.0), 0.7);
        let desired = PlanarVelocity { linear: Vector2::new(0.4, -0.2), yaw_rate: 0.9 };
        reference.follow(&desired, f64::INFINITY, 1.0);
        let (mut place, h) = (Vector2::new(1.0, 2.0), 1e-4);
        for step in 0..10_000 {
            let heading = 0.7 + 0.9 * h * (f64::from(step) + 0.5);
            place += Rotation2::new(heading) * desired.linear * h;
        }
        let (end, velocity, heading) = reference.after(1.0);
        assert!((end.xy() - place).norm() < 1e-8, "{end} {place}");
        assert!((heading - 1.6).abs() < 1e-12 && (velocity.norm() - desired.linear.norm()).abs() < 1e-12);
    }

    #[test]
    fn reference_limits_acceleration_and_lead() {
        let mut reference = Reference::new(0.3);
        let desired = PlanarVelocity { linear: Vector2::new(0.6, 0.8), yaw_rate: -2.0 };
        reference.follow(&desired, 2.0, 0.1);
        assert!((reference.velocity().linear - Vector2::new(0.12, 0.16)).norm() < 1e-12);
        assert!((reference.velocity().yaw_rate + 0.2).abs() < 1e-12);
        for _ in 0..100 {
            reference.follow(&desired, 2.0, 0.1);
            reference.advance(0.1, (&Vector3::zeros(), 7.0), (0.05, 0.3));
        }
        assert_eq!(reference.velocity(), &desired);
        assert!((reference.after(0.0).0.xy().norm() - 0.05).abs() < 1e-12);
        // a heading of 7 rad equals 7 - 2 pi rad; the reference stays 0.3 rad to its right
        assert!(((reference.heading() - 6.7) / (2.0 * PI)).fract().abs() < 1e-9, "{}", reference.heading());
    }
}
