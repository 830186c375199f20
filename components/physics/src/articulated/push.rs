//! External forces that act on links of the robot for one step.

use motorium_robots::{FrameId, Reference};
use nalgebra::{Point3, Vector3};

use super::{Articulated, Part};
use crate::Simulator;
use crate::robot::Articulation;
use crate::simulation::Simulation;

impl Simulation<Articulated> {
    /// Applies `force` \[N, world axes\] at `point` \[m, link axes\] of a link during the next step, in
    /// addition to forces already applied. A link that is fixed to the world does not move.
    ///
    /// ```
    /// use motorium_physics::{ArticulatedSimulator, Options, Simulator, World};
    /// use motorium_robots::load;
    /// use nalgebra::{Point3, Vector3};
    ///
    /// let robot = load("quadruped", std::path::Path::new("."))?.model;
    /// let (base, mass, mut q) = (robot.frames()[0].name.clone(), robot.mass(), robot.neutral());
    /// q[2] = 1.0;
    /// let mut simulation = ArticulatedSimulator::new(robot, World::default(), &q, Options::default())?;
    /// let base = simulation.model().frame(&base)?;
    /// simulation.set_gravity(Vector3::zeros());
    /// let along_x = |simulation: &ArticulatedSimulator| {
    ///     let mut dynamics = motorium_robots::Dynamics::new(simulation.model());
    ///     dynamics.momentum(simulation.model(), simulation.configuration(), simulation.velocity()).linear.x
    /// };
    /// for step in 0..100 {
    ///     if step < 50 {
    ///         simulation.apply_force(base, Point3::origin(), Vector3::new(2.0 * mass, 0.0, 0.0));
    ///     }
    ///     simulation.step(1e-3)?;
    /// }
    /// // 2 N for each kilogram, for 50 ms
    /// assert!((along_x(&simulation) - 0.1 * mass).abs() < 1e-3 * mass);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn apply_force(&mut self, link: FrameId, point: Point3<f64>, force: Vector3<f64>) {
        self.apply_wrench(link, point, force, Vector3::zeros());
    }
}

impl Part {
    /// Adds the generalized force of a wrench at a point of a link to the external force of the next step.
    pub(super) fn add_wrench(
        &mut self,
        own: &Articulation,
        link: FrameId,
        point: &Point3<f64>,
        [force, torque]: [Vector3<f64>; 2],
    ) {
        let jacobian = &mut self.frame_jacobian;
        own.kinematics.jacobian(&own.model, link, Reference::LocalWorldAligned, jacobian);
        let arm = own.kinematics.pose(&own.model, link).rotation * point.coords;
        let torque = torque + arm.cross(&force);
        for (external, column) in self.external.iter_mut().zip(jacobian.column_iter()) {
            for axis in 0..3 {
                *external += column[axis] * force[axis] + column[axis + 3] * torque[axis];
            }
        }
    }
}
