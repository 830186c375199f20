//! Movable objects, each a free rigid body.

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};

use motorium_worlds::ObjectMass;

use super::colliders::Owner;
use super::point::ContactPoint;
use crate::air::Air;
use crate::{Integrator, World};

/// A free rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FreeBody {
    pub(crate) pose: Isometry3<f64>,
    /// Velocity of the centre of mass \[m/s\], world axes.
    pub(crate) linear: Vector3<f64>,
    /// Angular velocity \[rad/s\], world axes.
    pub(crate) angular: Vector3<f64>,
    pub(crate) mass: f64,
    /// Drag area \[m2\].
    drag: f64,
    /// Principal moments of inertia, in body axes \[kg m2\].
    inertia: Vector3<f64>,
    /// Time for which the body has hardly moved \[s\].
    still: f64,
    /// True if the body is at rest and excluded from every computation until something wakes it.
    pub(crate) asleep: bool,
    /// True if the body touches nothing in the current step and uses the midpoint rule.
    free: bool,
    /// Pose, in the object, of the frame of the principal axes at the centre of mass; `None` if it coincides
    /// with the object's frame.
    pub(crate) axes: Option<Isometry3<f64>>,
}

/// Largest speeds of a body that hardly moves \[m/s, rad/s\].
const STILL: (f64, f64) = (1e-4, 1e-3);

/// Time without notable motion after which bodies may sleep \[s\].
const DROWSY: f64 = 0.5;

impl FreeBody {
    /// Returns the inverse inertia in world axes \[1/(kg m2)\].
    pub(crate) fn inverse_inertia(&self) -> Matrix3<f64> {
        let rotation = self.pose.rotation.to_rotation_matrix().into_inner();
        let mut scaled = rotation;
        for (mut column, inertia) in scaled.column_iter_mut().zip(&self.inertia) {
            column /= *inertia;
        }
        scaled * rotation.transpose()
    }

    /// Updates the time for which the body has hardly moved by `h` \[s\].
    fn count_rest(&mut self, h: f64) {
        let moves =
            self.linear.norm_squared() > STILL.0 * STILL.0 || self.angular.norm_squared() > STILL.1 * STILL.1;
        self.still = if moves { 0.0 } else { self.still + h };
    }

    /// Returns `true` if the body has hardly moved for long enough.
    pub(crate) fn is_drowsy(&self) -> bool {
        self.still >= DROWSY
    }

    /// Stops the body and excludes it from every computation.
    pub(crate) fn sleep(&mut self) {
        (self.linear, self.angular, self.asleep) = (Vector3::zeros(), Vector3::zeros(), true);
    }

    pub(crate) fn wake(&mut self) {
        (self.still, self.asleep) = (0.0, false);
    }

    /// Returns the pose of the object.
    pub(crate) fn object_pose(&self) -> Isometry3<f64> {
        self.axes.map_or(self.pose, |axes| self.pose * axes.inverse())
    }

    /// Moves the object to a pose, at rest.
    pub(crate) fn stop_at(&mut self, pose: Isometry3<f64>) {
        let pose = self.axes.map_or(pose, |axes| pose * axes);
        (self.pose, self.linear, self.angular) = (pose, Vector3::zeros(), Vector3::zeros());
    }

    /// Advances the velocity by `h` \[s\] under gravity and air drag.
    fn fall(&mut self, gravity: &Vector3<f64>, air: &Air, h: f64) {
        self.linear = air.slowed((self.drag, self.mass), self.linear + gravity * h, h);
        // One Newton step of the gyroscopic torque at the mean of both velocities, in body axes: second
        // order, for spins up to about 1000 rad/s at 1 ms. For a thin strip about its middle axis the slope
        // becomes singular at 2 / h = 2000 rad/s.
        let w = self.pose.rotation.inverse_transform_vector(&self.angular);
        let momentum = self.inertia.component_mul(&w);
        let error = w.cross(&momentum) * h;
        let slope = Matrix3::from_diagonal(&self.inertia)
            + (w.cross_matrix() * Matrix3::from_diagonal(&self.inertia) - momentum.cross_matrix())
                * (0.5 * h);
        if let Some(inverse) = slope.try_inverse() {
            self.angular = self.pose.rotation * (w - inverse * error);
        }
    }

    /// Integrates the whole motion over `h` \[s\] under gravity and air drag by the midpoint rule. The
    /// displacement uses the mean velocity, and the rotation conserves energy and the magnitude of the
    /// angular momentum.
    fn fly(&mut self, gravity: &Vector3<f64>, air: &Air, h: f64) {
        let before = self.linear;
        self.linear = air.slowed((self.drag, self.mass), before + gravity * h, h);
        // I (w+ - w) + h w_m x I w_m = 0 in body axes, by Newton's method.
        let start = self.pose.rotation.inverse_transform_vector(&self.angular);
        let inertia = Matrix3::from_diagonal(&self.inertia);
        let mut end = start;
        for _ in 0..NEWTON {
            let mean = 0.5 * (start + end);
            let momentum = self.inertia.component_mul(&mean);
            let error = self.inertia.component_mul(&(end - start)) + mean.cross(&momentum) * h;
            let slope = inertia + (mean.cross_matrix() * inertia - momentum.cross_matrix()) * (0.5 * h);
            let Some(inverse) = slope.try_inverse() else { break };
            end -= inverse * error;
        }
        let turn = UnitQuaternion::from_scaled_axis(0.5 * h * (start + end));
        self.pose = Isometry3::from_parts(
            Translation3::from(self.pose.translation.vector + (before + self.linear) * (0.5 * h)),
            UnitQuaternion::new_normalize((self.pose.rotation * turn).into_inner()),
        );
        self.angular = self.pose.rotation * end;
    }

    fn move_on(&mut self, h: f64) {
        let turn = UnitQuaternion::from_scaled_axis(self.angular * h);
        self.pose = Isometry3::from_parts(
            Translation3::from(self.pose.translation.vector + self.linear * h),
            UnitQuaternion::new_normalize((turn * self.pose.rotation).into_inner()),
        );
    }
}

/// Newton steps of the midpoint rule for a rotation. The second leaves only rounding errors at any speed that
/// a step can resolve.
const NEWTON: usize = 4;

/// All movable objects, with space for their next state.
#[derive(Clone, Debug)]
pub(crate) struct Objects {
    pub(crate) now: Vec<FreeBody>,
    pub(crate) next: Vec<FreeBody>,
    /// The next state before free fall.
    pub(crate) before: Vec<FreeBody>,
    /// Gravity in the last step \[m/s2\]; NaN before the first.
    pub(crate) gravity: Vector3<f64>,
    air: Air,
    /// Integration method of objects that touch nothing.
    pub(crate) method: Integrator,
    /// For each object of the world, its index among the movable objects.
    pub(crate) movable: Vec<Option<usize>>,
}

impl Objects {
    pub(crate) fn new(world: &World, method: Integrator) -> Self {
        let mut now = Vec::new();
        let movable = world.objects.iter().map(|object| {
            object.mass_properties().map(|ObjectMass { mass, frame: axes, moments: inertia }| {
                let (linear, angular) = (Vector3::zeros(), Vector3::zeros());
                let (pose, still, asleep) = (object.pose(), 0.0, false);
                let drag = object.drag;
                let free = false;
                let mut body =
                    FreeBody { pose, linear, angular, mass, drag, inertia, still, asleep, free, axes };
                body.stop_at(pose);
                now.push(body);
                now.len() - 1
            })
        });
        let movable = movable.collect();
        let gravity = Vector3::repeat(f64::NAN);
        Self { next: now.clone(), before: now.clone(), now, gravity, air: Air::new(world), method, movable }
    }

    pub(crate) fn begin(&mut self) {
        self.next.copy_from_slice(&self.now);
    }

    pub(crate) fn commit(&mut self) {
        std::mem::swap(&mut self.now, &mut self.next);
    }

    /// Copies the next state to `before`.
    pub(crate) fn before_fall(&mut self) {
        self.before.copy_from_slice(&self.next);
    }

    /// Finds objects without contacts in `points`.
    pub(crate) fn find_free(&mut self, points: &[ContactPoint]) {
        if self.method == Integrator::Euler {
            return;
        }
        self.next.iter_mut().for_each(|body| body.free = !body.asleep);
        for owner in points.iter().flat_map(|point| [point.owners.0, point.owners.1]) {
            if let Owner::Object(object) = owner {
                self.next[object].free = false;
            }
        }
    }

    /// Advances the velocities of the next state by free fall for the time of each object \[s\].
    pub(crate) fn fall(&mut self, gravity: &Vector3<f64>, lengths: &[f64]) {
        for (body, h) in self.next.iter_mut().zip(lengths).filter(|(body, h)| !body.asleep && **h > 0.0) {
            if !body.free {
                body.fall(gravity, &self.air, *h);
            }
        }
    }

    /// Returns `true` if the object with this index sleeps in the next state; `false` for `None`.
    pub(crate) fn is_asleep(&self, index: Option<usize>) -> bool {
        index.is_some_and(|index| self.next[index].asleep)
    }

    /// Wakes all objects if gravity differs from the last step.
    pub(crate) fn feel(&mut self, gravity: &Vector3<f64>) {
        if self.gravity != *gravity {
            self.next.iter_mut().for_each(FreeBody::wake);
        }
        self.gravity = *gravity;
    }

    /// Wakes all objects.
    pub(crate) fn wake(&mut self) {
        self.now.iter_mut().for_each(FreeBody::wake);
    }

    /// Advances the poses of the next state with its velocities.
    pub(crate) fn move_on(&mut self, lengths: &[f64]) {
        for (body, h) in self.next.iter_mut().zip(lengths).filter(|(body, h)| !body.asleep && **h > 0.0) {
            if body.free {
                body.fly(&self.gravity, &self.air, *h);
            } else {
                body.move_on(*h);
            }
            body.count_rest(*h);
        }
    }

    /// Returns the first object of the world whose next state is not finite or out of bounds.
    pub(crate) fn diverged(&self) -> Option<usize> {
        let sound = |body: &FreeBody| {
            let numbers = body.pose.translation.vector.iter().chain(&body.linear).chain(&body.angular);
            numbers.into_iter().all(|x| x.abs() < 1e9)
        };
        self.movable.iter().position(|movable| movable.is_some_and(|index| !sound(&self.next[index])))
    }
}
