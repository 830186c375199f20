//! Reduced models: joints locked at positions, with their bodies welded to the carrying bodies.

use nalgebra::Isometry3;

use super::{Body, Coordinate, Model, weld};
use crate::nearest::{nearest, suggestion};

/// Error of locking joints.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LockError {
    /// No independent joint has this name.
    #[error("robot \"{robot}\" has no independent joint \"{joint}\" to lock{}", suggestion(.nearest.as_deref()))]
    UnknownJoint {
        /// Name of the robot.
        robot: String,
        /// The requested name.
        joint: String,
        /// The closest existing joint.
        nearest: Option<String>,
    },
    /// The position is not finite.
    #[error("joint \"{joint}\" cannot be locked at {position}, expected a finite position")]
    Position {
        /// Name of the joint.
        joint: String,
        /// The requested position \[rad or m\].
        position: f64,
    },
}

impl Model {
    /// Returns the robot with some joints locked at positions \[rad or m\]. Locked joints are removed from
    /// `q` and `v`, and joints that mimic a locked joint are locked with it. The inertias, shapes and frames
    /// of the locked bodies are moved to the bodies that carry them. Positions may exceed joint limits. The
    /// remaining joints keep their order.
    ///
    /// # Errors
    ///
    /// [`LockError`] for an unknown joint or a position that is not finite.
    pub fn locked(&self, joints: &[(&str, f64)]) -> Result<Self, LockError> {
        let mut held: Vec<Option<f64>> = vec![None; self.joint_count()];
        for &(joint, position) in joints {
            let index = self.joint_index(joint).ok_or_else(|| LockError::UnknownJoint {
                robot: self.name.clone(),
                joint: joint.to_owned(),
                nearest: nearest(joint, self.joint_names.iter().map(String::as_str)).map(str::to_owned),
            })?;
            if !position.is_finite() {
                return Err(LockError::Position { joint: joint.to_owned(), position });
            }
            held[index] = Some(position);
        }
        let mut next = 0;
        let columns: Vec<usize> = held
            .iter()
            .map(|held| {
                next += usize::from(held.is_none());
                next - usize::from(held.is_none())
            })
            .collect();

        let mut base = self.base.clone();
        let mut bodies: Vec<Body> = Vec::new();
        // for each body, its new body and its old frame there
        let mut places: Vec<(Option<usize>, Isometry3<f64>)> = Vec::with_capacity(self.bodies.len());
        for body in &self.bodies {
            let (carrier, within) =
                body.parent.map_or((None, Isometry3::identity()), |parent| places[parent]);
            let coordinate = &body.joint.coordinate;
            if let Some(position) = held[coordinate.index()] {
                let pose = within * body.joint.pose(coordinate.multiplier() * position + coordinate.offset());
                let shapes = body.shapes.iter().map(|shape| shape.moved(&pose));
                weld(&mut base, &mut bodies, carrier, &body.inertia.moved(&pose), shapes);
                places.push((carrier, pose));
            } else {
                let mut body = body.clone();
                body.parent = carrier;
                body.joint.placement = within * body.joint.placement;
                body.joint.coordinate = match body.joint.coordinate {
                    Coordinate::Independent(index) => Coordinate::Independent(columns[index]),
                    Coordinate::Mimic { of, multiplier, offset } => {
                        Coordinate::Mimic { of: columns[of], multiplier, offset }
                    }
                };
                bodies.push(body);
                places.push((Some(bodies.len() - 1), Isometry3::identity()));
            }
        }
        let frames = self
            .frames
            .iter()
            .map(|frame| {
                let mut frame = frame.clone();
                if let Some(body) = frame.body {
                    let (carrier, pose) = places[body];
                    (frame.body, frame.placement) = (carrier, pose * frame.placement);
                }
                frame
            })
            .collect();
        Ok(Self::new(self.name.clone(), base, bodies, frames))
    }
}
