//! Recent poses of a camera.

use std::time::Duration;

use nalgebra::Isometry3;

/// Maximum number of stored poses.
const MOST: usize = 1 << 14;

/// Ring of camera poses with their times.
#[derive(Debug)]
pub(super) struct PoseHistory {
    poses: Vec<(u64, Isometry3<f64>)>,
    newest: usize,
    count: usize,
}

impl PoseHistory {
    /// Creates a history that covers `span`, with one pose per `period`.
    pub(super) fn new(span: Duration, period: Duration) -> Self {
        let count = span.as_nanos() / period.as_nanos().max(1) + 2;
        let room = usize::try_from(count).unwrap_or(MOST).min(MOST);
        Self { poses: vec![(0, Isometry3::identity()); room], newest: 0, count: 0 }
    }

    /// Adds the pose at a time \[ns\] that is not before the newest one; an equal time replaces it. An
    /// earlier time clears the history.
    pub(super) fn push(&mut self, time_ns: u64, pose: Isometry3<f64>) {
        let last = (self.count > 0).then(|| self.poses[self.newest].0);
        if last == Some(time_ns) {
            self.poses[self.newest].1 = pose;
            return;
        }
        if last.is_some_and(|last| time_ns < last) {
            self.clear();
        }
        self.newest = (self.newest + 1) % self.poses.len();
        self.poses[self.newest] = (time_ns, pose);
        self.count = (self.count + 1).min(self.poses.len());
    }

    /// Returns the pose at a time, interpolated between neighbours, or the newest one for later times. `None`
    /// before the oldest.
    pub(super) fn pose_at(&self, time_ns: u64) -> Option<Isometry3<f64>> {
        let room = self.poses.len();
        let mut after: Option<(u64, Isometry3<f64>)> = None;
        for age in 0..self.count {
            let (time, pose) = self.poses[(self.newest + room - age) % room];
            if time <= time_ns {
                let Some((next, later)) = after else { return Some(pose) };
                let share = (time_ns - time) as f64 / (next - time) as f64;
                return Some(pose.try_lerp_slerp(&later, share, 1e-9).unwrap_or(later));
            }
            after = Some((time, pose));
        }
        None
    }

    /// Removes all poses.
    pub(super) fn clear(&mut self) {
        self.count = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_interpolated_and_unknown_before_the_oldest() {
        let mut history = PoseHistory::new(Duration::from_millis(3), Duration::from_millis(1));
        assert!(history.pose_at(5).is_none());
        for time in 1..20_u64 {
            history.push(1000 * time, Isometry3::translation(time as f64, 0.0, 0.0));
        }
        let x = |time| history.pose_at(time).map(|pose| pose.translation.x);
        assert_eq!((x(17_250), x(18_000), x(50_000)), (Some(17.25), Some(18.0), Some(19.0)));
        assert_eq!(x(14_999), None, "the oldest of 5 poses has the time 15");
        assert_eq!(x(15_000), Some(15.0));
        history.push(10, Isometry3::identity());
        assert_eq!((history.pose_at(9), history.pose_at(18_000)), (None, Some(Isometry3::identity())));
    }
}
