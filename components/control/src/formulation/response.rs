//! Responses to task errors: feedback gains, speed limits and damping.

use nalgebra::Vector3;

/// Feedback of a task: the acceleration `kp e + kd e'` for an error `e`.
///
/// ```
/// use motorium_control::tasks::Feedback;
///
/// // both eigenvalues of the error at -10 / s: kd = 2 sqrt(kp)
/// assert_eq!(Feedback::critical(10.0), Feedback { kp: 100.0, kd: 20.0 });
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback {
    /// Gain of the error `e` \[1/s^2\].
    pub kp: f64,
    /// Gain of the error rate `e'` \[1/s\].
    pub kd: f64,
}

impl Feedback {
    /// Creates critically damped feedback, with both eigenvalues of the error at `-rate` \[1/s\].
    pub fn critical(rate: f64) -> Self {
        Self { kp: rate * rate, kd: 2.0 * rate }
    }

    /// Returns the acceleration `kd (clip(kp / kd e) + e')` for a vector error `e` and its rate `e'`. The
    /// correction speed is limited to `max_speed`.
    pub fn acceleration(&self, error: &Vector3<f64>, rate: &Vector3<f64>, max_speed: f64) -> Vector3<f64> {
        let mut found = Vector3::zeros();
        self.write(error.as_slice(), rate.as_slice(), max_speed, found.as_mut_slice());
        found
    }

    /// Writes the acceleration for any number of rows.
    pub(super) fn write(&self, error: &[f64], rate: &[f64], max_speed: f64, acceleration: &mut [f64]) {
        let Self { kp, kd } = *self;
        for (out, error) in acceleration.iter_mut().zip(error) {
            *out = error * kp;
        }
        if max_speed < f64::INFINITY {
            let (length, most) = (length(acceleration.iter().copied()), kd * max_speed);
            if length > most {
                acceleration.iter_mut().for_each(|out| *out *= most / length);
            }
        }
        for (out, rate) in acceleration.iter_mut().zip(rate) {
            *out += rate * kd;
        }
    }
}

/// Requested response of a task to its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Rate at which the error decays under velocity control \[1/s\].
    pub gain: f64,
    /// Feedback that reduces the error under acceleration control.
    pub feedback: Feedback,
    /// Maximum correction speeds of rows 0 to 2 and of rows 3 to 5 \[units of `e` per second\]. Limiting
    /// preserves the direction. Default infinite.
    pub max_speeds: [f64; 2],
    /// Levenberg-Marquardt damping per unit of correction speed, for velocity control. Default 0.
    pub damping: f64,
}

impl Response {
    /// Creates a response with which the error decays at the rate `gain` \[1/s\]: exponentially under
    /// velocity control, critically damped under acceleration control.
    pub fn decay(gain: f64) -> Self {
        let (feedback, max_speeds) = (Feedback::critical(gain), [f64::INFINITY; 2]);
        Self { gain, feedback, max_speeds, damping: 0.0 }
    }

    /// Creates a response that tracks the velocity `nu` and ignores the position error. The velocity is
    /// reached immediately under velocity control, and at `rate` \[1/s\] under acceleration control.
    pub fn velocity(rate: f64) -> Self {
        Self { gain: 0.0, feedback: Feedback { kp: 0.0, kd: rate }, ..Self::decay(0.0) }
    }
}

/// Length of a vector.
pub(super) fn length(entries: impl Iterator<Item = f64>) -> f64 {
    entries.map(|entry| entry * entry).sum::<f64>().sqrt()
}
