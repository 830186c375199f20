//! Distribution of thrust and torque among the rotors.

use nalgebra::{DMatrix, Matrix4, Vector3, Vector4};

/// One rotor, in robot axes relative to the centre of mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Propeller {
    /// Position \[m\].
    pub position: Vector3<f64>,
    /// Unit vector along which the rotor pushes the robot.
    pub direction: Vector3<f64>,
    /// Maximum thrust \[N\].
    pub max_thrust: f64,
    /// Torque about `direction` per unit of thrust \[Nm/N\]. A positive value turns the robot
    /// counterclockwise.
    pub torque_per_thrust: f64,
}

/// The rotors cannot produce every thrust and torque.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MixerError {
    /// The robot has too few rotors.
    #[error("found {found} rotors, expected at least 4 to control the thrust and three torques")]
    Few {
        /// Number of rotors.
        found: usize,
    },
    /// Positions and spin directions leave some torque unavailable.
    #[error("the rotors cannot produce every torque, because of their positions and spin directions")]
    Dependent,
}

/// Distributes thrust and torque among rotors, with the minimum sum of squared thrusts.
#[derive(Clone, Debug)]
pub struct Mixer {
    /// 4 x rotors: thrust along z and torque about x, y and z per unit thrust of each rotor.
    effect: DMatrix<f64>,
    /// Rotors x 4: the pseudo-inverse.
    share: DMatrix<f64>,
    most: Vec<f64>,
}

impl Mixer {
    /// Creates a mixer for the rotors of a robot.
    ///
    /// # Errors
    /// [`MixerError`] if there are fewer than four rotors, or their arrangement leaves some torque
    /// unavailable.
    pub fn new(rotors: &[Propeller]) -> Result<Self, MixerError> {
        if rotors.len() < 4 {
            return Err(MixerError::Few { found: rotors.len() });
        }
        let column = |rotor: &Propeller| {
            let torque = rotor.position.cross(&rotor.direction) + rotor.torque_per_thrust * rotor.direction;
            [rotor.direction.z, torque.x, torque.y, torque.z]
        };
        let columns: Vec<[f64; 4]> = rotors.iter().map(column).collect();
        let effect = DMatrix::from_fn(4, rotors.len(), |row, rotor| columns[rotor][row]);
        // rows are compared relative to their norm: lever arms in millimetres must not count less than thrust
        let size: Vec<f64> = (0..4).map(|row| effect.row(row).norm()).collect();
        if size.iter().any(|size| *size < 1e-9) {
            return Err(MixerError::Dependent);
        }
        let scaled = DMatrix::from_fn(4, rotors.len(), |row, rotor| effect[(row, rotor)] / size[row]);
        let gram = &scaled * scaled.transpose();
        let gram = Matrix4::from_fn(|row, column| gram[(row, column)]);
        if gram.symmetric_eigenvalues().min() < 1e-6 {
            return Err(MixerError::Dependent);
        }
        let inverse = gram.try_inverse().ok_or(MixerError::Dependent)?;
        let scale = Matrix4::from_diagonal(&Vector4::from_fn(|row, _| size[row].recip()));
        let share = scaled.transpose() * DMatrix::from_iterator(4, 4, (inverse * scale).iter().copied());
        let most = rotors.iter().map(|rotor| rotor.max_thrust).collect();
        Ok(Self { effect, share, most })
    }

    /// Returns the number of rotors.
    pub fn rotors(&self) -> usize {
        self.most.len()
    }

    /// Returns the maximum total thrust of all rotors along z \[N\].
    pub fn max_thrust(&self) -> f64 {
        self.effect.row(0).iter().zip(&self.most).map(|(effect, most)| effect.max(0.0) * most).sum()
    }

    /// Returns the thrust along z \[N\] and the torque \[Nm\] that rotor thrusts \[N\] produce.
    pub fn effect(&self, thrusts: &[f64]) -> (f64, Vector3<f64>) {
        let row = |row: usize| {
            self.effect.row(row).iter().zip(thrusts).map(|(effect, thrust)| effect * thrust).sum()
        };
        (row(0), Vector3::new(row(1), row(2), row(3)))
    }

    /// Distributes a thrust \[N\] and a torque \[Nm\] among the rotors, each between zero and its maximum
    /// thrust. Writes one thrust per rotor to `thrusts` \[N\]. If the request is infeasible, the torque about
    /// z is reduced first, then the torques about x and y. The thrust is reduced only if it exceeds the
    /// rotors' total. Returns `true` if nothing was reduced.
    pub fn mix(&self, thrust: f64, torque: &Vector3<f64>, thrusts: &mut [f64]) -> bool {
        let mut whole = true;
        for (rotor, out) in thrusts.iter_mut().enumerate() {
            let desired = self.share[(rotor, 0)] * thrust;
            *out = desired.clamp(0.0, self.most[rotor]);
            whole &= *out == desired;
        }
        whole &= self.add(thrusts, |share| share[1] * torque.x + share[2] * torque.y);
        whole & self.add(thrusts, |share| share[3] * torque.z)
    }

    /// Adds the largest feasible fraction of a torque. Returns `true` if all of it was added.
    fn add(&self, thrusts: &mut [f64], of: impl Fn(&[f64; 4]) -> f64) -> bool {
        let part = |rotor: usize| of(&std::array::from_fn(|column| self.share[(rotor, column)]));
        let mut fits = 1.0_f64;
        for (rotor, thrust) in thrusts.iter().enumerate() {
            let (change, most) = (part(rotor), self.most[rotor]);
            let room = if change > 0.0 { most - thrust } else { *thrust };
            if change.abs() > room {
                fits = fits.min(room / change.abs());
            }
        }
        for (rotor, thrust) in thrusts.iter_mut().enumerate() {
            *thrust = (*thrust + fits * part(rotor)).clamp(0.0, self.most[rotor]);
        }
        fits == 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns rotors at the corners of a square; neighbours spin in opposite directions.
    fn square() -> Vec<Propeller> {
        [(1.0, 1.0, -1.0), (1.0, -1.0, 1.0), (-1.0, 1.0, 1.0), (-1.0, -1.0, -1.0)]
            .map(|(x, y, spin): (f64, f64, f64)| Propeller {
                position: Vector3::new(0.03 * x, 0.03 * y, 0.01),
                direction: Vector3::z(),
                max_thrust: 0.15,
                torque_per_thrust: 0.006 * spin,
            })
            .to_vec()
    }

    #[test]
    fn rotors_produce_the_requested_thrust_and_torque() {
        let mut rotors = square();
        // no longer a square, and tilted
        rotors[0].position.x = 0.05;
        rotors[1].direction = Vector3::new(0.1, 0.0, 1.0).normalize();
        let mixer = Mixer::new(&rotors).unwrap();
        let (thrust, torque) = (0.28, Vector3::new(4e-4, -7e-4, 1e-4));
        let mut thrusts = [0.0; 4];
        assert!(mixer.mix(thrust, &torque, &mut thrusts));
        let (found, turned) = mixer.effect(&thrusts);
        assert!((found - thrust).abs() < 1e-12 && (turned - torque).norm() < 1e-12, "{found} {turned}");
    }

    #[test]
    fn yaw_torque_is_reduced_first_and_thrust_last() {
        let mixer = Mixer::new(&square()).unwrap();
        let mut thrusts = [0.0; 4];
        let desired = Vector3::new(2e-3, 0.0, 9e-3);
        assert!(!mixer.mix(0.45, &desired, &mut thrusts));
        let (thrust, torque) = mixer.effect(&thrusts);
        assert!((thrust - 0.45).abs() < 1e-12 && (torque.x - desired.x).abs() < 1e-12, "{thrust} {torque}");
        assert!(torque.z > 0.0 && torque.z < 0.5 * desired.z, "{torque}");
        assert!(!mixer.mix(0.55, &Vector3::new(0.02, 0.01, 9e-3), &mut thrusts));
        let (thrust, torque) = mixer.effect(&thrusts);
        assert!(
            (thrust - 0.55).abs() < 1e-12 && (torque.x - 2.0 * torque.y).abs() < 1e-12,
            "{thrust} {torque}"
        );
        assert!(torque.x > 0.0 && torque.z.abs() < 1e-12, "{torque}");
        for (thrust, torque) in [(9.0, Vector3::x()), (-1.0, Vector3::z()), (0.0, Vector3::y())] {
            mixer.mix(thrust, &torque, &mut thrusts);
            assert!(thrusts.iter().all(|thrust| (0.0..=0.15).contains(thrust)), "{thrusts:?}");
        }
        assert!((mixer.max_thrust() - 0.6).abs() < 1e-12);
    }

    #[test]
    fn underactuated_rotor_layout_is_rejected() {
        let mut rotors = square();
        rotors.iter_mut().for_each(|rotor| rotor.torque_per_thrust = 0.0);
        assert_eq!(Mixer::new(&rotors).unwrap_err(), MixerError::Dependent);
        let mut rotors = square();
        rotors.iter_mut().for_each(|rotor| rotor.position.y = 0.0);
        assert_eq!(Mixer::new(&rotors).unwrap_err(), MixerError::Dependent);
        assert_eq!(Mixer::new(&square()[..3]).unwrap_err(), MixerError::Few { found: 3 });
    }
}
