//! A contact point as part of the impulse problem.

use nalgebra::{Matrix3, Vector3};

use super::answer::PointAnswer;
use super::axes::axes;
use super::colliders::Owner;
use super::objects::FreeBody;
use super::point::{ContactPoint, Held};
use super::surface::SurfaceLaw;

/// The bodies that meet at a contact point, and their motion there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Site {
    /// The normal, and two tangents, which are shorter than 1 along and across a [grain](SurfaceLaw::axes).
    pub(super) axes: [Vector3<f64>; 3],
    /// Squared lengths of the axes.
    pub(super) squares: [f64; 3],
    /// Sides of the two colliders. Impulses act on the first, and in the opposite direction on the second.
    pub(super) sides: [Side; 2],
    /// Velocity along the axes due to the objects' fall alone, and velocity without impulses.
    pub(super) falling: [f64; 3],
    pub(super) free: [f64; 3],
    /// Target velocity along the normal.
    pub(super) target: f64,
    /// Coefficient of restitution of an impact, and the speed of rebound by Newton's law \[m/s\]; zero
    /// otherwise.
    pub(super) restitution: f64,
    pub(super) bounce: f64,
    /// True if the surfaces overlap, so that the target is a fraction of the recovery speed.
    pub(super) overlapping: bool,
    pub(super) recovery: f64,
    pub(super) friction: f64,
    /// Approach speed per unit of impulse of a compliant surface \[1/kg\].
    pub(super) soft: f64,
    /// Velocity of the first surface relative to the second due to conveyors, along the axes.
    pub(super) conveyed: [f64; 3],
    /// Set for the torques at a contact point: impulses are moments, velocities angular.
    pub(super) couple: Option<Couple>,
    /// True if no impulse moves the point.
    pub(super) immovable: bool,
    /// Response to impulses in an island that is solved body by body.
    pub(super) answer: PointAnswer,
}

/// Friction at a contact point against spinning about its normal and rolling about its tangents.
#[derive(Clone, Copy, Debug)]
pub(super) struct Couple {
    /// True for a connection, which is bilateral and unbounded.
    pub(super) holds: bool,
    /// Index of the contact point whose normal impulse bounds the moments.
    pub(super) point: usize,
    /// Largest moments per unit of normal impulse \[m\].
    pub(super) torsional: f64,
    pub(super) rolling: f64,
}

/// The part of the world on one side of a contact point.
#[derive(Clone, Copy, Debug)]
pub(super) enum Side {
    /// A part that impulses do not move.
    World,
    /// The articulation with this index.
    Articulation(usize),
    /// A free object: its index, and the arm from its centre to the point, world axes \[m\].
    Object(usize, Vector3<f64>),
    /// A free object rotated by moments.
    Turned(usize),
}

impl Side {
    /// Returns the free object on this side.
    #[inline]
    pub(super) fn object(self) -> Option<usize> {
        match self {
            Self::Object(object, _) | Self::Turned(object) => Some(object),
            Self::World | Self::Articulation(_) => None,
        }
    }
}

/// The response of a free object to impulses.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mobility {
    pub(super) inverse_mass: f64,
    /// Inverse inertia, world axes \[1/(kg m2)\].
    pub(super) inverse_inertia: Matrix3<f64>,
    /// Velocity of the centre \[m/s\] and angular velocity \[rad/s\], with the current impulses.
    pub(super) linear: Vector3<f64>,
    pub(super) angular: Vector3<f64>,
    /// Both velocities before a sweep, and their parts of the extrapolation direction.
    pub(super) before: [Vector3<f64>; 2],
    pub(super) along: [Vector3<f64>; 2],
    /// True once the object is listed in its island.
    pub(super) listed: bool,
}

/// Row of the Jacobian over the velocity of a free object, and the row times the object's inverse inertia.
#[derive(Clone, Copy, Debug)]
pub(super) struct ObjectRow {
    pub(super) object: usize,
    pub(super) linear: Vector3<f64>,
    pub(super) angular: Vector3<f64>,
    pub(super) response: (Vector3<f64>, Vector3<f64>),
}

impl Mobility {
    pub(super) fn new(body: &FreeBody) -> Self {
        Self {
            inverse_mass: 1.0 / body.mass,
            inverse_inertia: body.inverse_inertia(),
            linear: body.linear,
            angular: body.angular,
            before: [Vector3::zeros(); 2],
            along: [Vector3::zeros(); 2],
            listed: false,
        }
    }

    /// Returns the velocity at `arm` from the centre.
    #[inline]
    pub(super) fn velocity_at(&self, arm: &Vector3<f64>) -> Vector3<f64> {
        self.linear + self.angular.cross(arm)
    }

    /// Applies an impulse on one side of a contact point.
    #[inline]
    pub(super) fn take(&mut self, side: &Side, impulse: &Vector3<f64>) {
        match side {
            Side::Object(_, arm) => self.push(arm, impulse),
            Side::Turned(_) => self.angular += self.inverse_inertia * impulse,
            Side::World | Side::Articulation(_) => {}
        }
    }

    /// Applies an impulse at `arm` from the centre.
    #[inline]
    pub(super) fn push(&mut self, arm: &Vector3<f64>, impulse: &Vector3<f64>) {
        self.linear += impulse * self.inverse_mass;
        self.angular += self.inverse_inertia * arm.cross(impulse);
    }
}

impl Site {
    /// A point between parts that do not move.
    pub(super) const KEPT: Self = Self {
        axes: [Vector3::new(0.0, 0.0, 0.0); 3],
        squares: [1.0; 3],
        sides: [Side::World; 2],
        falling: [0.0; 3],
        free: [0.0; 3],
        target: 0.0,
        restitution: 0.0,
        bounce: 0.0,
        overlapping: false,
        recovery: 0.0,
        friction: 0.0,
        soft: 0.0,
        conveyed: [0.0; 3],
        couple: None,
        immovable: true,
        answer: PointAnswer::NONE,
    };

    /// Creates the site of a point between moving bodies in the poses of `bodies`. Velocities and targets are
    /// set later.
    pub(super) fn new(point: &ContactPoint, bodies: &[FreeBody]) -> Self {
        let side = |owner: Owner| match owner {
            Owner::World => Side::World,
            Owner::Base(of) | Owner::Body(of, _) => Side::Articulation(of),
            Owner::Object(object) => {
                Side::Object(object, point.point.coords - bodies[object].pose.translation.vector)
            }
        };
        let axes = point.law.axes(&point.normal);
        let squares = point.law.grain.map_or([1.0; 3], |_| axes.map(|axis| axis.norm_squared()));
        Self {
            axes,
            squares,
            sides: [side(point.owners.0), side(point.owners.1)],
            friction: point.law.friction,
            // A conveyor velocity along the normal has no effect.
            conveyed: [0.0, axes[1].dot(&point.law.conveyed), axes[2].dot(&point.law.conveyed)],
            immovable: false,
            ..Self::KEPT
        }
    }

    /// Creates the site of a bilateral point in a step of `h` \[s\]. Velocities are set later.
    pub(super) fn held(point: &ContactPoint, held: &Held, h: f64, bodies: &[FreeBody]) -> Self {
        let side = |owner: Owner| match owner {
            Owner::World => Side::World,
            Owner::Base(of) | Owner::Body(of, _) => Side::Articulation(of),
            Owner::Object(object) if held.turning => Side::Turned(object),
            Owner::Object(object) => {
                Side::Object(object, point.point.coords - bodies[object].pose.translation.vector)
            }
        };
        let (axes, wanted) = (axes(&point.normal), held.velocity(h));
        Self {
            axes,
            sides: [side(point.owners.0), side(point.owners.1)],
            couple: Some(Couple { holds: true, point: 0, torsional: 0.0, rolling: 0.0 }),
            conveyed: axes.map(|axis| -axis.dot(&wanted)),
            immovable: false,
            ..Self::KEPT
        }
    }

    /// Creates the site of the torques at the contact point with this index. Velocities are set later.
    pub(super) fn couple(index: usize, point: &ContactPoint) -> Self {
        let side = |owner: Owner| match owner {
            Owner::World => Side::World,
            Owner::Base(of) | Owner::Body(of, _) => Side::Articulation(of),
            Owner::Object(object) => Side::Turned(object),
        };
        let SurfaceLaw { torsional, rolling, .. } = point.law;
        Self {
            axes: axes(&point.normal),
            sides: [side(point.owners.0), side(point.owners.1)],
            couple: Some(Couple { holds: false, point: index, torsional, rolling }),
            immovable: false,
            ..Self::KEPT
        }
    }

    /// Returns the articulations at this point, each once.
    pub(super) fn articulations(&self) -> impl Iterator<Item = usize> + use<> {
        let of = self.sides.map(|side| if let Side::Articulation(of) = side { Some(of) } else { None });
        let second = if of[0] == of[1] { None } else { of[1] };
        of[0].into_iter().chain(second)
    }

    /// Returns the velocity along an axis due to the motion of the objects alone.
    pub(super) fn speed(&self, axis: usize, bodies: &[FreeBody]) -> f64 {
        let mut sum = 0.0;
        for (side, sign) in self.sides.iter().zip([1.0, -1.0]) {
            let along = self.axes[axis] * sign;
            match side {
                Side::Object(object, arm) => {
                    let body = &bodies[*object];
                    sum += along.dot(&body.linear) + arm.cross(&along).dot(&body.angular);
                }
                Side::Turned(object) => sum += along.dot(&bodies[*object].angular),
                Side::World | Side::Articulation(_) => {}
            }
        }
        sum
    }

    /// Returns the rows of the Jacobian over the objects on both sides, along an axis.
    pub(super) fn rows(&self, axis: usize, bodies: &[Mobility]) -> [Option<ObjectRow>; 2] {
        let row = |side: Side, sign: f64| {
            let along = self.axes[axis] * sign;
            let (object, linear, angular) = match side {
                Side::Object(object, arm) => (object, along, arm.cross(&along)),
                Side::Turned(object) => (object, Vector3::zeros(), along),
                Side::World | Side::Articulation(_) => return None,
            };
            let body = &bodies[object];
            let response = (linear * body.inverse_mass, body.inverse_inertia * angular);
            Some(ObjectRow { object, linear, angular, response })
        };
        [row(self.sides[0], 1.0), row(self.sides[1], -1.0)]
    }

    /// Returns the impulse on the first side, world axes.
    #[inline]
    pub(super) fn vector(&self, lambda: &[f64]) -> Vector3<f64> {
        self.axes[0] * lambda[0] + self.axes[1] * lambda[1] + self.axes[2] * lambda[2]
    }
}
