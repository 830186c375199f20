//! Frame of a movement: its boundary conditions.

use serde::{Deserialize, Serialize};

use crate::{SampledSpring, Trajectory};

/// Boundary conditions of a movement, which determine the path for given forces.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Start, one number per degree of freedom.
    pub start: Vec<f64>,
    /// Goal, one number per degree of freedom.
    pub goal: Vec<f64>,
    /// Initial velocity per duration, one number per degree of freedom.
    pub velocity: Vec<f64>,
    /// Duration from start to end, s.
    pub duration: f64,
}

/// A movement represented by forces: `samples - 1` forces per DoF, stored one DoF after the other, in a
/// frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Movement {
    /// Boundary conditions of the movement.
    pub frame: Frame,
    /// Forces of the movement.
    pub forces: Vec<f64>,
}

impl Frame {
    /// Returns the number of DoFs.
    pub fn dofs(&self) -> usize {
        self.start.len()
    }

    /// Returns the interpolation `self + part * (other - self)` of every number.
    #[must_use]
    pub fn towards(&self, other: &Self, part: f64) -> Self {
        let mix = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + part * (b - a)).collect();
        Self {
            start: mix(&self.start, &other.start),
            goal: mix(&self.goal, &other.goal),
            velocity: mix(&self.velocity, &other.velocity),
            duration: self.duration + part * (other.duration - self.duration),
        }
    }
}

impl Movement {
    /// Computes the forces with which the spring follows a recording. The goal is the last sample; the
    /// initial velocity is the difference of the first two samples.
    pub fn from_trajectory(trajectory: &Trajectory, spring: &SampledSpring) -> Self {
        let path = trajectory.sampled(spring);
        let (forces_each, dofs) = (spring.forces(), path.ncols());
        let mut frame = Frame { duration: trajectory.duration, ..Frame::default() };
        let mut forces = vec![0.0; forces_each * dofs];
        for (column, forces) in path.column_iter().zip(forces.chunks_exact_mut(forces_each)) {
            let path = column.as_slice();
            let velocity = (path[1] - path[0]) / spring.step();
            let goal = path[path.len() - 1];
            spring.forces_of(path, velocity, goal, forces);
            frame.start.push(path[0]);
            frame.goal.push(goal);
            frame.velocity.push(velocity);
        }
        Self { frame, forces }
    }

    /// Returns the path, samples x DoFs.
    pub fn path(&self, spring: &SampledSpring) -> nalgebra::DMatrix<f64> {
        path(&self.frame, &self.forces, spring)
    }
}

/// Returns the path of forces in a frame: samples x DoFs.
pub(super) fn path(frame: &Frame, forces: &[f64], spring: &SampledSpring) -> nalgebra::DMatrix<f64> {
    let mut path = nalgebra::DMatrix::zeros(spring.samples(), frame.dofs());
    let columns = path.as_mut_slice().chunks_exact_mut(spring.samples());
    for (d, (column, forces)) in columns.zip(forces.chunks_exact(spring.forces())).enumerate() {
        spring.path_of(forces, [frame.start[d], frame.velocity[d], frame.goal[d]], column);
    }
    path
}
