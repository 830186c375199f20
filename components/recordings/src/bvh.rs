//! Biovision hierarchies (`.bvh`): a skeleton and its motion in one file.

use nalgebra::{DMatrix, UnitQuaternion, Vector3};

use crate::acclaim::number;
use crate::error::Place;
use crate::skeleton::{Motion, Skeleton, SkeletonJoint};
use crate::{Recording, RecordingError};

/// Maximum number of joints of a skeleton and of values of a motion.
const MOST_JOINTS: usize = 1000;
const MOST_VALUES: usize = 50_000_000;

/// Words of a text with their line numbers.
struct Words<'a> {
    path: &'a str,
    words: Box<dyn Iterator<Item = (usize, &'a str)> + 'a>,
    line: usize,
}

impl<'a> Words<'a> {
    fn new(path: &'a str, text: &'a str) -> Self {
        let words = text
            .lines()
            .enumerate()
            .flat_map(|(index, line)| line.split_whitespace().map(move |word| (index + 1, word)));
        Self { path, words: Box::new(words), line: 1 }
    }

    fn wrong(&self, found: &str, expected: impl Into<String>) -> RecordingError {
        RecordingError::Malformed {
            place: Box::new(Place::line(self.path, self.line)),
            found: format!("{:?}", found.chars().take(60).collect::<String>()),
            expected: expected.into(),
            advice: None,
        }
    }

    fn next(&mut self, expected: &str) -> Result<&'a str, RecordingError> {
        match self.words.next() {
            Some((line, word)) => {
                self.line = line;
                Ok(word)
            }
            None => Err(self.wrong("the end of the file", expected)),
        }
    }

    fn expect(&mut self, expected: &str) -> Result<(), RecordingError> {
        let word = self.next(expected)?;
        if word.eq_ignore_ascii_case(expected) { Ok(()) } else { Err(self.wrong(word, expected)) }
    }

    fn number(&mut self) -> Result<f64, RecordingError> {
        let word = self.next("a finite number")?;
        number(self.path, self.line, word)
    }

    fn count(&mut self, expected: &str) -> Result<usize, RecordingError> {
        let word = self.next(expected)?;
        word.parse().map_err(|_| self.wrong(word, expected))
    }
}

/// Parses a channel name such as `Xposition` or `Zrotation`.
fn motion(words: &Words<'_>, word: &str) -> Result<Motion, RecordingError> {
    let axis = match word.as_bytes().first() {
        Some(b'X' | b'x') => Some(0),
        Some(b'Y' | b'y') => Some(1),
        Some(b'Z' | b'z') => Some(2),
        _ => None,
    };
    match (axis, word.get(1..).unwrap_or_default().to_ascii_lowercase().as_str()) {
        (Some(axis), "position") => Ok(Motion::Translate(axis)),
        (Some(axis), "rotation") => Ok(Motion::Rotate(axis)),
        _ => Err(words.wrong(word, "a channel, such as Xrotation")),
    }
}

impl Skeleton {
    /// Parses a skeleton and its motion in the `.bvh` format. `path` is used only in error messages. The end
    /// of a chain becomes a joint named `PARENT_end`.
    ///
    /// # Errors
    /// A word is invalid, or there are fewer than two samples.
    pub fn from_bvh(path: &str, text: &str) -> Result<(Self, Recording), RecordingError> {
        let mut words = Words::new(path, text);
        let mut made = Self { joints: vec![], channels: vec![] };
        words.expect("HIERARCHY")?;
        words.expect("ROOT")?;
        let name = words.next("a name")?.to_string();
        made.open(&mut words, name, None)?;
        let mut above = vec![0];
        while let Some(&parent) = above.last() {
            let word = words.next("JOINT, End or }")?;
            match word {
                "}" => {
                    above.pop();
                }
                "JOINT" => {
                    let name = words.next("a name")?.to_string();
                    above.push(made.joints.len());
                    made.open(&mut words, name, Some(parent))?;
                }
                "End" => {
                    words.expect("Site")?;
                    words.expect("{")?;
                    words.expect("OFFSET")?;
                    let before = Vector3::new(words.number()?, words.number()?, words.number()?);
                    words.expect("}")?;
                    let name = format!("{}_end", made.joints[parent].name);
                    made.push(name, Some(parent), before, vec![]);
                }
                _ => return Err(words.wrong(word, "JOINT, End or }")),
            }
            if made.joints.len() > MOST_JOINTS {
                return Err(words.wrong("more joints", format!("at most {MOST_JOINTS}")));
            }
        }
        words.expect("MOTION")?;
        words.expect("Frames:")?;
        let rows = words.count("the number of samples")?;
        words.expect("Frame")?;
        words.expect("Time:")?;
        let step = words.number()?;
        let columns = made.channels.len();
        if step <= 0.0 {
            return Err(words.wrong(&step.to_string(), "a positive time between two samples"));
        }
        if rows.saturating_mul(columns.max(1)) > MOST_VALUES {
            return Err(words.wrong(&rows.to_string(), format!("at most {MOST_VALUES} values")));
        }
        let mut values = vec![];
        for _ in 0..rows * columns {
            values.push(words.number()?);
        }
        if let Some((line, word)) = words.words.next() {
            words.line = line;
            return Err(words.wrong(word, format!("the end after {rows} samples")));
        }
        let times = (0..rows).map(|row| row as f64 * step).collect();
        let values = DMatrix::from_row_slice(rows, columns, &values);
        let recording = Recording::new(made.channels.clone(), times, values)?;
        Ok((made, recording))
    }

    /// Reads a joint up to its channels.
    fn open(
        &mut self,
        words: &mut Words<'_>,
        name: String,
        parent: Option<usize>,
    ) -> Result<(), RecordingError> {
        if self.joints.iter().any(|joint| joint.name == name) {
            return Err(words.wrong(&name, "a name that no other joint has"));
        }
        words.expect("{")?;
        words.expect("OFFSET")?;
        let before = Vector3::new(words.number()?, words.number()?, words.number()?);
        words.expect("CHANNELS")?;
        let count = words.count("the number of channels")?;
        if count > 6 {
            return Err(words.wrong(&count.to_string(), "at most 6 channels"));
        }
        let mut motions = vec![];
        for _ in 0..count {
            let word = words.next("a channel")?;
            motions.push(motion(words, word)?);
        }
        self.push(name, parent, before, motions);
        Ok(())
    }

    fn push(&mut self, name: String, parent: Option<usize>, before: Vector3<f64>, motions: Vec<Motion>) {
        let first = self.channels.len();
        self.channels.extend(motions.iter().map(|motion| {
            let (letter, axis) = match motion {
                Motion::Translate(axis) => ('t', axis),
                Motion::Rotate(axis) => ('r', axis),
            };
            format!("{name}_{letter}{}", ["x", "y", "z"][*axis])
        }));
        // rotations are multiplied in the order of the channels
        let motions = motions.into_iter().zip(first..).collect();
        let axes = UnitQuaternion::identity();
        self.joints.push(SkeletonJoint { name, parent, before, after: Vector3::zeros(), axes, motions });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skeleton::{Limb, Trunk};

    const FILE: &str = "HIERARCHY\nROOT hips\n{\n OFFSET 0 0 0\n CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation \
        Yrotation\n JOINT arm\n {\n  OFFSET 0 1 0\n  CHANNELS 3 Zrotation Xrotation Yrotation\n  End Site\n  {\n   OFFSET 0 2 \
        0\n  }\n }\n}\nMOTION\nFrames: 2\nFrame Time: 0.04\n1 2 3 0 0 0 0 0 0\n0 0 0 0 0 0 90 90 0\n";

    #[test]
    fn rotations_follow_the_channel_order() {
        let (skeleton, motion) = Skeleton::from_bvh("a.bvh", FILE).expect("a skeleton");
        assert_eq!(skeleton.joint_names().collect::<Vec<_>>(), ["hips", "arm", "arm_end"]);
        assert_eq!(motion.times(), [0.0, 0.04]);
        assert_eq!(motion.names()[6..], ["arm_rz", "arm_rx", "arm_ry"]);
        let trunk = Trunk { joint: "hips".into(), forward: Vector3::x(), up: Vector3::z() };
        let limb = Limb { name: "arm".into(), from: "arm".into(), to: "arm_end".into() };
        let found = skeleton.directions(&motion, &trunk, &[limb]).expect("directions");
        let row =
            |i: usize| found.values().row(i).iter().map(|v| (v * 1e9).round() / 1e9).collect::<Vec<_>>();
        assert_eq!(row(0), [0.0, 1.0, 0.0]);
        // Rz(90) Rx(90) y = Rz(90) z
        assert_eq!(row(1), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn errors_name_the_line() {
        let error = |text: &str| Skeleton::from_bvh("a.bvh", text).expect_err("an error").to_string();
        assert_eq!(
            error(&FILE.replace("OFFSET 0 1 0", "OFFSET 0 one 0")),
            "a.bvh, line 8: found \"one\", expected a finite number"
        );
        assert!(error(&FILE.replace("Frames: 2", "Frames: 3")).contains("the end of the file"));
        assert!(error(&FILE.replace("Frames: 2", "Frames: 1")).contains("the end after 1 samples"));
        assert!(error(&FILE.replace("JOINT arm", "JOINT hips")).contains("no other joint"));
        assert!(error(&FILE.replace("0.04", "0")).contains("a positive time"));
        assert!(error(&FILE.replace("Frames: 2", "Frames: 99999999999999")).contains("at most"));
    }
}
