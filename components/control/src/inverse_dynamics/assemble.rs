//! The constraints of one tick.

use super::control::InverseDynamics;
use super::{FrictionModel, MotionState, Unknowns};

impl InverseDynamics {
    /// Writes the equations of motion, contacts and limits at this state into the problem.
    pub(super) fn pose(&mut self, state: &MotionState<'_>, dt: f64) {
        let MotionState { model, kinematics, q, v } = *state;
        self.dynamics.crba(model, q, &mut self.mass);
        self.dynamics.bias(model, q, v, self.settings.gravity, self.bias.as_mut_slice());
        let share = self.settings.joint_damping;
        if share > 0.0 {
            for (joint, v) in model.joints_of_v(v).iter().enumerate() {
                self.bias[self.order.base + joint] += share * model.joint(joint).dynamics.damping * v;
            }
        }
        for place in &mut self.contacts {
            place.update(model, kinematics);
        }
        self.pose_motion();
        self.pose_contacts();
        self.pose_wrenches();
        self.clear_rows();
        let order = &self.order;
        let (first, end) = (order.base, order.velocities);
        self.settings.joints.write(
            model,
            (q, v),
            (self.acceleration_limit.as_slice(), dt),
            &mut self.problem.lower.as_mut_slice()[first..end],
            &mut self.problem.upper.as_mut_slice()[first..end],
        );
        self.leave_out();
    }

    /// Rows of the equation of motion: equalities for the base, torque limits for the joints.
    fn pose_motion(&mut self) {
        let Self { order, mass, bias, problem, contacts, torque_limit, .. } = self;
        let base = order.base;
        for (column, mass) in mass.column_iter().enumerate() {
            let (of_base, of_joints) = mass.as_slice().split_at(base);
            problem.equality_matrix.as_mut_slice()[column * order.equalities()..][..base]
                .copy_from_slice(of_base);
            problem.row_matrix.as_mut_slice()[column * order.rows()..][..order.joints]
                .copy_from_slice(of_joints);
        }
        for (value, bias) in problem.equality_value.iter_mut().zip(bias.iter()).take(base) {
            *value = -bias;
        }
        for joint in 0..order.joints {
            let (bias, limit) = (bias[base + joint], torque_limit[joint]);
            problem.row_lower[joint] = -limit - bias;
            problem.row_upper[joint] = limit - bias;
        }
        // - J' f, for forces in the axes of the contact
        for place in contacts.iter() {
            for point in 0..place.contact.points() {
                let arm = place.lever_arm(point);
                let first = order.velocities + 3 * (place.first_point + point);
                for axis in 0..3 {
                    let direction = place.axes.column(axis);
                    let turn = arm.cross(&direction);
                    let variable = first + axis;
                    for (row, jacobian) in place.jacobian.as_slice().chunks_exact(6).enumerate() {
                        let entry = jacobian[0] * direction[0]
                            + jacobian[1] * direction[1]
                            + jacobian[2] * direction[2]
                            + jacobian[3] * turn[0]
                            + jacobian[4] * turn[1]
                            + jacobian[5] * turn[2];
                        match row.checked_sub(base) {
                            None => problem.equality_matrix[(row, variable)] = -entry,
                            Some(joint) => problem.row_matrix[(joint, variable)] = -entry,
                        }
                    }
                }
            }
        }
    }

    /// Contact constraints: no motion, friction pyramids unless there are cones, and unilateral forces. An
    /// inactive contact has no force and constrains no motion.
    fn pose_contacts(&mut self) {
        let Self { order, problem, contacts, settings, .. } = self;
        for place in contacts.iter() {
            let rows = place.contact.rows();
            let first_row = order.base + place.first_row;
            for row in 0..rows {
                problem.equality_value[first_row + row] = if place.active {
                    -place.drift[row] - settings.contact_damping * place.velocity[row]
                } else {
                    0.0
                };
            }
            for (column, jacobian) in place.jacobian.as_slice().chunks_exact(6).enumerate() {
                let entries = &mut problem.equality_matrix.as_mut_slice()
                    [column * order.equalities() + first_row..][..rows];
                if place.active {
                    entries.copy_from_slice(&jacobian[..rows]);
                } else {
                    entries.fill(0.0);
                }
            }
            // an inner approximation of the cone
            let friction = place.contact.friction * std::f64::consts::FRAC_1_SQRT_2;
            for point in 0..place.contact.points() {
                let point = place.first_point + point;
                let first = order.velocities + 3 * point;
                let row = order.joints + 4 * point;
                for (face, (axis, sign)) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)].into_iter().enumerate()
                {
                    problem.row_matrix[(row + face, first + axis)] = sign;
                    problem.row_matrix[(row + face, first + 2)] = -friction;
                    let faces = settings.friction_model == FrictionModel::Pyramid
                        || settings.unknowns == Unknowns::Accelerations;
                    let bounds = place.active && faces;
                    problem.row_upper[row + face] = if bounds { 0.0 } else { f64::INFINITY };
                }
                let most = if place.active { f64::INFINITY } else { 0.0 };
                for axis in 0..2 {
                    problem.lower[first + axis] = -most;
                    problem.upper[first + axis] = most;
                }
                problem.lower[first + 2] = 0.0;
                problem.upper[first + 2] = if place.active { place.contact.max_force.max(0.0) } else { 0.0 };
            }
        }
    }
}

impl InverseDynamics {
    /// Removes the constraints that do not apply to a reduced formulation. With forces only, joints rest and
    /// contacts have no motion. With accelerations only, torques have no limits.
    pub(super) fn leave_out(&mut self) {
        let Self { order, problem, settings, .. } = self;
        match settings.unknowns {
            Unknowns::AccelerationsAndForces => {}
            Unknowns::Accelerations => {
                problem.row_lower.rows_mut(0, order.joints).fill(f64::NEG_INFINITY);
                problem.row_upper.rows_mut(0, order.joints).fill(f64::INFINITY);
            }
            Unknowns::Forces => {
                problem.equality_matrix.rows_mut(order.base, order.motions.len()).fill(0.0);
                problem.equality_value.rows_mut(order.base, order.motions.len()).fill(0.0);
                let joints = order.velocities - order.base;
                problem.lower.rows_mut(order.base, joints).fill(0.0);
                problem.upper.rows_mut(order.base, joints).fill(0.0);
            }
        }
        if let Some(reduced) = &mut self.reduced {
            reduced.update_map(&self.order, &self.mass, &self.problem);
        }
    }
}
