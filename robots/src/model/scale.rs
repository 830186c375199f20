//! Variants of a robot: scaled in size, or with scaled masses, friction and limits.

use nalgebra::Isometry3;

use super::{Geometry, Inertia, JointKind, Model, Shape};

/// Error of a scale that is not a positive number.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("a robot cannot be scaled by {0}, expected a number above 0")]
pub struct ScaleError(pub f64);

/// Scale factors of the physical properties of a body and its joint. The default changes nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyFactors {
    /// Scales mass and rotational inertia, as if the density of the body changed.
    pub mass: f64,
    /// Scales the viscous damping of the body's joint.
    pub damping: f64,
    /// Scales the Coulomb friction of the body's joint.
    pub friction: f64,
    /// Scales the effort limit of the body's joint.
    pub effort_limit: f64,
}

impl Default for BodyFactors {
    fn default() -> Self {
        Self { mass: 1.0, damping: 1.0, friction: 1.0, effort_limit: 1.0 }
    }
}

impl BodyFactors {
    /// Returns `true` if every factor is finite and at least 0.
    fn is_valid(&self) -> bool {
        let factors = [self.mass, self.damping, self.friction, self.effort_limit];
        factors.iter().all(|factor| factor.is_finite() && *factor >= 0.0)
    }
}

impl Model {
    /// Returns the robot with scaled masses, joint friction and efforts. `base` scales the mass of the base;
    /// `bodies` has one set of factors for each of the [`bodies`](Self::bodies). Shapes, centres of mass and
    /// ranges of motion are unchanged.
    ///
    /// ```
    /// use motorium_robots::BodyFactors;
    ///
    /// let arm = motorium_robots::load("planar-3r", std::path::Path::new("."))?.model;
    /// let heavy = arm.with_factors(1.0, &[BodyFactors { mass: 2.0, ..BodyFactors::default() }; 3]);
    /// assert_eq!(heavy.mass(), 2.0 * arm.mass());
    /// assert_eq!(heavy.effort_limit(), arm.effort_limit());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Panics
    ///
    /// If the number of factors differs from the number of bodies, or a factor is negative or not finite.
    #[must_use]
    pub fn with_factors(&self, base: f64, bodies: &[BodyFactors]) -> Self {
        assert_eq!(bodies.len(), self.bodies.len(), "one set of factors per body");
        let valid = base.is_finite() && base >= 0.0 && bodies.iter().all(BodyFactors::is_valid);
        assert!(valid, "factors are numbers from zero up");
        let (mut new_base, mut new_bodies, mut frames) =
            (self.base.clone(), self.bodies.clone(), self.frames.clone());
        new_base.inertia = new_base.inertia.times(base);
        for (body, factors) in new_bodies.iter_mut().zip(bodies) {
            body.inertia = body.inertia.times(factors.mass);
            body.joint.dynamics.damping *= factors.damping;
            body.joint.dynamics.friction *= factors.friction;
            let effort = &mut body.joint.limits.effort;
            // infinity times zero would be NaN
            *effort = if factors.effort_limit == 0.0 { 0.0 } else { *effort * factors.effort_limit };
        }
        for frame in &mut frames {
            frame.inertia = frame.inertia.times(frame.body.map_or(base, |body| bodies[body].mass));
        }
        Self::new(self.name.clone(), new_base, new_bodies, frames)
    }

    /// Returns the robot `scale` times as large, made of the same material: lengths are multiplied by
    /// `scale`, masses by its third power, rotational inertias by its fifth power. Position and velocity
    /// limits of prismatic joints scale like lengths. Efforts, rotational speeds, damping, friction,
    /// stiffness and rotors are unchanged.
    ///
    /// # Errors
    ///
    /// [`ScaleError`] if `scale` is not a number above zero.
    pub fn scaled(&self, scale: f64) -> Result<Self, ScaleError> {
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(ScaleError(scale));
        }
        let pose = |pose: &Isometry3<f64>| {
            Isometry3::from_parts((pose.translation.vector * scale).into(), pose.rotation)
        };
        let inertia = |inertia: &Inertia| Inertia {
            mass: inertia.mass * scale.powi(3),
            com: inertia.com * scale,
            rotational: inertia.rotational * scale.powi(5),
        };
        let shapes = |shapes: &[Shape]| -> Vec<Shape> {
            let scaled = |shape: &Shape| Shape {
                link: shape.link.clone(),
                placement: pose(&shape.placement),
                geometry: match &shape.geometry {
                    Geometry::Box { size } => Geometry::Box { size: size * scale },
                    Geometry::Cylinder { radius, length } => {
                        Geometry::Cylinder { radius: radius * scale, length: length * scale }
                    }
                    Geometry::Sphere { radius } => Geometry::Sphere { radius: radius * scale },
                    Geometry::Capsule { radius, length } => {
                        Geometry::Capsule { radius: radius * scale, length: length * scale }
                    }
                    Geometry::Mesh { uri, path, inline, scale: own } => Geometry::Mesh {
                        uri: uri.clone(),
                        path: path.clone(),
                        inline: inline.clone(),
                        scale: own * scale,
                    },
                },
            };
            shapes.iter().map(scaled).collect()
        };
        let mut base = self.base.clone();
        base.neutral = pose(&base.neutral);
        base.inertia = inertia(&base.inertia);
        (base.shapes, base.world_shapes) = (shapes(&base.shapes), shapes(&base.world_shapes));
        let (mut bodies, mut frames) = (self.bodies.clone(), self.frames.clone());
        // a rotating mimic of a slide (or the reverse) has a ratio per metre
        let slides: Vec<bool> =
            (0..self.joint_count()).map(|index| self.joint(index).kind == JointKind::Prismatic).collect();
        for body in &mut bodies {
            body.inertia = inertia(&body.inertia);
            body.shapes = shapes(&body.shapes);
            let joint = &mut body.joint;
            joint.placement = pose(&joint.placement);
            let slides_itself = joint.kind == JointKind::Prismatic;
            if slides_itself {
                joint.limits.lower *= scale;
                joint.limits.upper *= scale;
                joint.limits.velocity *= scale;
                joint.dynamics.rest *= scale;
                if let Some(safety) = &mut joint.safety {
                    safety.soft_lower *= scale;
                    safety.soft_upper *= scale;
                }
            }
            if let super::Coordinate::Mimic { of, multiplier, offset } = &mut joint.coordinate {
                match (slides_itself, slides[*of]) {
                    (true, false) => *multiplier *= scale,
                    (false, true) => *multiplier /= scale,
                    _ => {}
                }
                if slides_itself {
                    *offset *= scale;
                }
            }
        }
        for frame in &mut frames {
            frame.placement = pose(&frame.placement);
            frame.inertia = inertia(&frame.inertia);
        }
        Ok(Self::new(self.name.clone(), base, bodies, frames))
    }

    /// Returns the robot with its velocity limits reduced to at most `limits` \[rad/s or m/s\], one per
    /// independent joint.
    ///
    /// ```
    /// let arm = motorium_robots::load("planar-3r", std::path::Path::new("."))?.model;
    /// let slow = arm.with_velocity_limits(&[0.5, f64::INFINITY, 0.5]);
    /// assert_eq!(slow.velocity_limit()[0], 0.5);
    /// assert_eq!(slow.velocity_limit()[1], arm.velocity_limit()[1]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Panics
    ///
    /// If the length of `limits` differs from the number of joints.
    #[must_use]
    pub fn with_velocity_limits(&self, limits: &[f64]) -> Self {
        assert_eq!(limits.len(), self.joint_count(), "length of the limits");
        let mut bodies = self.bodies.clone();
        for body in &mut bodies {
            if let super::Coordinate::Independent(index) = body.joint.coordinate {
                let own = &mut body.joint.limits.velocity;
                *own = own.min(limits[index]);
            }
        }
        Self::new(self.name.clone(), self.base.clone(), bodies, self.frames.clone())
    }
}
