//! A point that follows a moving target and slows down without a discontinuity.

/// Time for the pace to change from full speed to zero, s.
const CHANGE_OF_PACE: f64 = 0.2;

/// Critically damped motion of several coordinates towards targets, with time that can be slowed down.
///
/// `y'' = w^2 (target - y) - 2 w y'` with `w = 2 / time constant`, in closed form for a target that is
/// constant during a step. The pace `p`, 0 to 1, scales time: a step of `dt` advances the motion by `p dt`.
#[derive(Clone, Debug)]
pub(super) struct Follower {
    frequency: f64,
    pace: f64,
    position: Vec<f64>,
    /// Velocity per second of scaled time.
    velocity: Vec<f64>,
    /// Velocity per second.
    rate: Vec<f64>,
}

impl Follower {
    pub(super) fn new(coordinates: usize, time_constant: f64) -> Self {
        let zeros = vec![0.0; coordinates];
        Self {
            frequency: 2.0 / time_constant,
            pace: 0.0,
            position: zeros.clone(),
            velocity: zeros.clone(),
            rate: zeros,
        }
    }

    /// Starts at rest at a position.
    pub(super) fn start(&mut self, position: impl Iterator<Item = f64>) {
        self.position.iter_mut().zip(position).for_each(|(own, start)| *own = start);
        self.velocity.fill(0.0);
        self.rate.fill(0.0);
        self.pace = 0.0;
    }

    /// Advances by `dt`, s. The actual pace approaches `pace` smoothly, and no coordinate is faster than its
    /// `limit`.
    pub(super) fn step(&mut self, dt: f64, target: &[f64], pace: f64, limits: impl Iterator<Item = f64>) {
        let change = dt / CHANGE_OF_PACE;
        self.pace += (pace - self.pace).clamp(-change, change);
        let (h, w) = (self.pace * dt, self.frequency);
        if h <= 0.0 {
            self.rate.fill(0.0);
            return;
        }
        let decay = (-w * h).exp();
        let pace = self.pace;
        let coordinates = self.position.iter_mut().zip(&mut self.velocity).zip(&mut self.rate);
        for (((position, velocity), rate), (target, limit)) in coordinates.zip(target.iter().zip(limits)) {
            let error = *position - target;
            let slope = *velocity + w * error;
            let moved = ((error + slope * h) * decay - error).clamp(-limit * h, limit * h);
            *position += moved;
            *velocity = ((*velocity - slope * w * h) * decay).clamp(-limit, limit);
            *rate = pace * *velocity;
        }
    }

    pub(super) fn position(&self) -> &[f64] {
        &self.position
    }

    /// Returns the rates of the positions, per second.
    pub(super) fn rate(&self) -> &[f64] {
        &self.rate
    }

    /// Returns the current pace: 1 at full speed, 0 at rest.
    pub(super) fn pace(&self) -> f64 {
        self.pace
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 1e-3;

    fn run(follower: &mut Follower, steps: usize, target: f64, pace: f64, limit: f64) -> Vec<(f64, f64)> {
        (0..steps)
            .map(|_| {
                follower.step(DT, &[target], pace, std::iter::once(limit));
                (follower.position()[0], follower.rate()[0])
            })
            .collect()
    }

    #[test]
    fn follower_reaches_its_target_without_overshoot() {
        let mut follower = Follower::new(1, 0.1);
        follower.start(std::iter::once(0.5));
        let path = run(&mut follower, 2000, 1.0, 1.0, f64::INFINITY);
        assert!(path.iter().all(|(y, _)| (0.5..=1.0 + 1e-12).contains(y)));
        let (y, rate) = path[1999];
        assert!((y - 1.0).abs() < 1e-9 && rate.abs() < 1e-9, "{y} {rate}");
    }

    #[test]
    fn rates_are_the_slopes_of_positions_and_stay_below_the_limit() {
        let mut follower = Follower::new(1, 0.1);
        follower.start(std::iter::once(0.0));
        let path = run(&mut follower, 1500, 1.0, 1.0, 0.9);
        for pair in path.windows(2) {
            let slope = (pair[1].0 - pair[0].0) / DT;
            assert!(slope.abs() <= 0.9 + 1e-9, "{slope}");
            assert!((slope - 0.5 * (pair[0].1 + pair[1].1)).abs() < 0.02, "{slope} {pair:?}");
        }
    }

    #[test]
    fn pace_of_zero_comes_to_rest_and_holds() {
        let mut follower = Follower::new(1, 0.1);
        follower.start(std::iter::once(0.0));
        run(&mut follower, 300, 1.0, 1.0, f64::INFINITY);
        let path = run(&mut follower, 400, 5.0, 0.0, 3.0);
        assert!(path[399].1 == 0.0 && path[250..].iter().all(|(y, _)| *y == path[399].0), "{:?}", path[399]);
        let fastest = path.windows(2).map(|pair| (pair[1].1 - pair[0].1).abs()).fold(0.0, f64::max);
        assert!(fastest < 0.5, "the rate changes by {fastest} in one step");
        let on = run(&mut follower, 4000, 5.0, 1.0, 3.0);
        assert!((on[3999].0 - 5.0).abs() < 1e-6);
    }
}
