//! Removal of discontinuities from movements: angles are unwrapped, and signs of quaternions are aligned.

use std::f64::consts::TAU;

use crate::Recording;

/// A discontinuity that was removed from a recording.
#[derive(Clone, Debug, PartialEq)]
pub enum Removed {
    /// An angle that changed by a full turn between two samples.
    Turns {
        /// Name of the channel.
        name: String,
        /// Number of full-turn changes.
        count: usize,
        /// Full turn in the unit of the channel: 2 pi or 360.
        turn: f64,
    },
    /// A quaternion whose sign changed, although the rotation it represents did not.
    Signs {
        /// Names of its four channels.
        names: [String; 4],
        /// Number of sign changes.
        count: usize,
    },
}

/// Maximum deviation of the norm of a quaternion from 1.
const NORM: f64 = 1e-2;
/// Tolerance of the range of an angle \[turns\].
const SLACK: f64 = 1e-3;
/// Largest change between the samples next to a full-turn change \[turns\].
const LARGEST_STEP: f64 = 0.25;

impl Recording {
    /// Makes angles and quaternions of a movement continuous. Returns the movement and the removed
    /// discontinuities.
    ///
    /// A channel is an angle if all its values are within one turn and it changes by almost a full turn
    /// between two samples. The range of one turn is -pi to pi or 0 to 2 pi, or the equivalent range in
    /// degrees.
    ///
    /// Four channels are a quaternion if all samples have the norm 1 and the channels have matching names.
    /// Names match if they differ only in one letter `x`, `y`, `z` or `w`, such as `qx`, `qy`, `qz` and `qw`,
    /// or `orientation.x` to `orientation.w`. Names with four consecutive numbers, such as `q0` to `q3`, also
    /// match.
    #[must_use]
    pub fn continuous(mut self) -> (Self, Vec<Removed>) {
        let mut removed = Vec::new();
        let quaternions = self.quaternions();
        for channels in &quaternions {
            let count = self.align(channels);
            if count > 0 {
                let names = channels.map(|channel| self.names[channel].clone());
                removed.push(Removed::Signs { names, count });
            }
        }
        for channel in
            (0..self.names.len()).filter(|channel| !quaternions.iter().flatten().any(|it| it == channel))
        {
            for turn in [TAU, 360.0] {
                let count = self.unwrap(channel, turn);
                if count > 0 {
                    removed.push(Removed::Turns { name: self.names[channel].clone(), count, turn });
                    break;
                }
            }
        }
        (self, removed)
    }

    /// Returns groups of four channels that contain a unit quaternion.
    fn quaternions(&self) -> Vec<[usize; 4]> {
        let mut found = Vec::new();
        for (x, name) in self.names.iter().enumerate() {
            for (at, _) in name.match_indices('x') {
                let sibling = |letter: &str| {
                    let wanted = format!("{}{letter}{}", &name[..at], &name[at + 1..]);
                    self.names.iter().position(|name| *name == wanted)
                };
                let (Some(y), Some(z), Some(w)) = (sibling("y"), sibling("z"), sibling("w")) else {
                    continue;
                };
                let is_unit = |row: usize| {
                    let norm =
                        [x, y, z, w].map(|channel| self.values[(row, channel)].powi(2)).iter().sum::<f64>();
                    (norm.sqrt() - 1.0).abs() < NORM
                };
                if (0..self.samples()).all(is_unit) {
                    found.push([x, y, z, w]);
                    break;
                }
            }
        }
        found.extend(self.quaternion_entries());
        found.extend(self.numbered_quaternions(&found));
        found
    }

    /// Returns groups of four consecutive numbered channels, such as `3` to `6` of a pose with seven numbers,
    /// that contain a rotation: a unit quaternion with at least two changing entries.
    fn numbered_quaternions(&self, known: &[[usize; 4]]) -> Vec<[usize; 4]> {
        let mut found: Vec<[usize; 4]> = Vec::new();
        let entry = |stem: &str, end: &str, number: u32| {
            self.names.iter().position(|name| *name == format!("{stem}{number}{end}"))
        };
        for (first, name) in self.names.iter().enumerate() {
            let end = if name.ends_with(']') { "]" } else { "" };
            let digits = &name[..name.len() - end.len()];
            let stem = digits.trim_end_matches(|letter: char| letter.is_ascii_digit());
            let Ok(number) = digits[stem.len()..].parse::<u32>() else { continue };
            let next = |k: u32| entry(stem, end, number.checked_add(k)?);
            let (Some(a), Some(b), Some(c)) = (next(1), next(2), next(3)) else { continue };
            let channels = [first, a, b, c];
            let is_taken = |channel: &usize| known.iter().chain(&found).flatten().any(|it| it == channel);
            let is_unit = |row: usize| {
                let squares = channels.map(|channel| self.values[(row, channel)].powi(2));
                (squares.iter().sum::<f64>().sqrt() - 1.0).abs() < NORM
            };
            let changes = |channel: &&usize| {
                let column = self.values.column(**channel);
                column.max() - column.min() > NORM
            };
            let turns = channels.iter().filter(changes).count() >= 2;
            if turns && !channels.iter().any(is_taken) && (0..self.samples()).all(is_unit) {
                found.push(channels);
            }
        }
        found
    }

    /// Returns the four entries of each field such as `orientation[0]` that contain a unit quaternion.
    fn quaternion_entries(&self) -> Vec<[usize; 4]> {
        let mut found = Vec::new();
        for (first, name) in self.names.iter().enumerate() {
            let Some(beginning) = name.strip_suffix("[0]") else { continue };
            let field = beginning.rsplit(['.', '/', '_']).next().unwrap_or_default();
            if !["orientation", "rotation", "quaternion"].contains(&field) {
                continue;
            }
            let entry = |k: usize| self.names.iter().position(|name| *name == format!("{beginning}[{k}]"));
            let (Some(a), Some(b), Some(c)) = (entry(1), entry(2), entry(3)) else { continue };
            let is_unit = |row: usize| {
                let norm =
                    [first, a, b, c].map(|channel| self.values[(row, channel)].powi(2)).iter().sum::<f64>();
                (norm.sqrt() - 1.0).abs() < NORM
            };
            if entry(4).is_none() && (0..self.samples()).all(is_unit) {
                found.push([first, a, b, c]);
            }
        }
        found
    }

    /// Aligns the sign of each sample of a quaternion with the previous sample. Returns the number of sign
    /// changes.
    fn align(&mut self, channels: &[usize; 4]) -> usize {
        let (mut sign, mut count) = (1.0, 0);
        for row in 1..self.samples() {
            let product =
                |channel: usize| self.values[(row - 1, channel)] * self.values[(row, channel)] * sign;
            if channels.map(product).iter().sum::<f64>() < 0.0 {
                (sign, count) = (-sign, count + 1);
            }
            for channel in channels {
                self.values[(row, *channel)] *= sign;
            }
        }
        count
    }

    /// Adds full turns to an angle to make it continuous. Returns the number of full-turn changes.
    fn unwrap(&mut self, channel: usize, turn: f64) -> usize {
        let column = self.values.column(channel);
        let (lowest, highest) = (column.min() / turn, column.max() / turn);
        let is_within = |from: f64, to: f64| lowest >= from - SLACK && highest <= to + SLACK;
        if !is_within(-0.5, 0.5) && !is_within(0.0, 1.0) {
            return 0;
        }
        let changes: Vec<f64> =
            (1..self.samples()).map(|row| (column[row] - column[row - 1]) / turn).collect();
        let turns: Vec<f64> = changes.iter().map(|change| change.round()).collect();
        // Other steps of a sampled angle are short; otherwise the channel is not known to be an angle.
        let is_short = |(change, turns): (&f64, &f64)| (change - turns).abs() <= LARGEST_STEP;
        let count = turns.iter().filter(|turns| **turns != 0.0).count();
        if count == 0 || !changes.iter().zip(&turns).all(is_short) {
            return 0;
        }
        let mut sum = 0.0;
        for row in 1..self.samples() {
            sum += turns[row - 1];
            self.values[(row, channel)] -= sum * turn;
        }
        count
    }
}

impl std::fmt::Display for Removed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Turns { name, count, turn } => {
                let unit = if *turn > 7.0 { "degrees" } else { "rad" };
                write!(
                    f,
                    "`{name}` changed by a whole turn {count} times and was unwrapped, as an angle in {unit}"
                )
            }
            Self::Signs { names, count } => {
                write!(
                    f,
                    "the quaternion `{}` changed its sign {count} times and was aligned",
                    names.join("`, `")
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    fn recording(names: &[&str], rows: &[Vec<f64>]) -> Recording {
        let times = (0..rows.len()).map(|k| 0.01 * k as f64).collect();
        let values = DMatrix::from_fn(rows.len(), names.len(), |k, c| rows[k][c]);
        Recording::new(names.iter().map(ToString::to_string).collect(), times, values).unwrap()
    }

    #[test]
    fn continuously_turning_angle_is_unwrapped() {
        for turn in [TAU, 360.0] {
            for (from, count) in [(-0.5, 2), (0.0, 2)] {
                let angle = |k: usize| (0.3 + 0.01 * k as f64) * turn;
                let wrapped = |k: usize| (angle(k) / turn - from).rem_euclid(1.0) + from;
                let rows: Vec<Vec<f64>> = (0..200).map(|k| vec![wrapped(k) * turn]).collect();
                let (continuous, removed) = recording(&["yaw"], &rows).continuous();
                assert_eq!(removed, [Removed::Turns { name: "yaw".into(), count, turn }]);
                for k in 0..200 {
                    assert!((continuous.values()[(k, 0)] - angle(k)).abs() < 1e-9 * turn, "{k}");
                }
            }
        }
    }

    #[test]
    fn channels_with_long_steps_or_large_range_are_unchanged() {
        let stairs: Vec<Vec<f64>> = (0..50).map(|k| vec![if k < 25 { 0.0 } else { 3.0 }]).collect();
        let far: Vec<Vec<f64>> = (0..50).map(|k| vec![if k < 25 { 0.0 } else { 7.0 }]).collect();
        for rows in [stairs, far] {
            let original = recording(&["x"], &rows);
            assert_eq!(original.clone().continuous(), (original, Vec::new()));
        }
    }

    #[test]
    fn flags_are_not_quaternions() {
        let sign = |k: usize| if k < 25 { 1.0 } else { -1.0 };
        let rows: Vec<Vec<f64>> = (0..50).map(|k| vec![0.0, 0.0, 0.0, sign(k)]).collect();
        let original = recording(&["d0", "d1", "d2", "d3"], &rows);
        assert_eq!(original.clone().continuous(), (original, Vec::new()));
    }

    #[test]
    fn quaternion_keeps_its_sign() {
        for names in [
            ["qx", "qy", "qz", "qw"],
            ["orientation[0]", "orientation[1]", "orientation[2]", "orientation[3]"],
            ["pose[3]", "pose[4]", "pose[5]", "pose[6]"],
            ["3", "4", "5", "6"],
        ] {
            let rotation = |k: usize| (0.02 * k as f64).sin_cos();
            let rows: Vec<Vec<f64>> = (0..100)
                .map(|k| {
                    let ((sin, cos), sign) = (rotation(k), if (30..60).contains(&k) { -1.0 } else { 1.0 });
                    vec![0.0, sign * sin, 0.0, sign * cos]
                })
                .collect();
            let (continuous, removed) = recording(&names, &rows).continuous();
            assert!(matches!(&removed[..], [Removed::Signs { count: 2, .. }]), "{removed:?}");
            assert!((0..100).all(|k| continuous.values()[(k, 3)] == rotation(k).1));
        }
    }
}
