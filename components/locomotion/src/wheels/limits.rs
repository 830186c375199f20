//! Wheel limits that preserve the path.

/// Maximum speeds and accelerations of the wheels.
#[derive(Clone, Debug, PartialEq)]
pub struct WheelLimits {
    /// Maximum speed of each wheel \[rad/s, or m/s\].
    pub speed: Vec<f64>,
    /// Maximum acceleration of each wheel \[rad/s2, or m/s2\].
    pub acceleration: Vec<f64>,
}

impl WheelLimits {
    /// Returns the factor, at most 1, that scales all speeds to within their limits. A common factor
    /// preserves the ratios of the speeds and therefore the curvature.
    pub fn speed_factor(&self, desired: &[f64]) -> f64 {
        let factor =
            |(desired, limit): (&f64, &f64)| if desired.abs() > *limit { limit / desired.abs() } else { 1.0 };
        desired.iter().zip(&self.speed).map(factor).fold(1.0, f64::min)
    }

    /// Moves the wheel speeds from `speeds` towards `desired` within the acceleration limits for `dt`
    /// seconds. The speeds keep the desired curvature if possible, and otherwise move on a straight line
    /// between old and new speeds. Returns `true` if all speeds are reached.
    pub fn approach(&self, speeds: &mut [f64], desired: &[f64], dt: f64) -> bool {
        // factors of the desired speeds that every wheel can reach in this step
        let (mut least, mut most) = (0.0_f64, 1.0_f64);
        for ((now, desired), limit) in speeds.iter().zip(desired).zip(&self.acceleration) {
            let reach = limit * dt;
            if desired.abs() < 1e-12 {
                if now.abs() > reach {
                    most = -1.0;
                }
                continue;
            }
            let (one, other) = ((now - reach) / desired, (now + reach) / desired);
            least = least.max(one.min(other));
            most = most.min(one.max(other));
        }
        if least <= most {
            speeds.iter_mut().zip(desired).for_each(|(now, desired)| *now = most * desired);
            return most == 1.0;
        }
        let mut share = 1.0_f64;
        for ((now, desired), limit) in speeds.iter().zip(desired).zip(&self.acceleration) {
            share = share.min(limit * dt / (desired - now).abs());
        }
        speeds.iter_mut().zip(desired).for_each(|(now, desired)| *now += share * (desired - *now));
        share == 1.0
    }
}
