//! Acclaim skeletons (`.asf`) and motions (`.amc`), the format of the CMU motion-capture database.
//!
//! The rotation of a bone is `C M C^-1`. `C` is the rotation of its `axis`, and `M` is the product of its
//! `dof` rotations, applied in the listed order.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, UnitQuaternion, Vector3};

use crate::error::Place;
use crate::skeleton::{Motion, Skeleton, SkeletonJoint};
use crate::{Recording, RecordingError};

/// Maximum number of bones of a skeleton and of values of a motion.
const MOST_BONES: usize = 1000;
const MOST_VALUES: usize = 50_000_000;

/// Splits a text into lines without comments, each with its number and its words.
fn lines(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    text.lines().enumerate().filter_map(|(index, line)| {
        let line = line.split('#').next().unwrap_or_default();
        let words: Vec<&str> = line.split_whitespace().collect();
        (!words.is_empty()).then_some((index + 1, words))
    })
}

fn wrong(path: &str, line: usize, found: &str, expected: impl Into<String>) -> RecordingError {
    RecordingError::Malformed {
        place: Box::new(Place::line(path, line)),
        found: format!("{:?}", found.chars().take(60).collect::<String>()),
        expected: expected.into(),
        advice: None,
    }
}

pub(crate) fn number(path: &str, line: usize, word: &str) -> Result<f64, RecordingError> {
    let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
    value.ok_or_else(|| wrong(path, line, word, "a finite number"))
}

fn vector(path: &str, line: usize, words: &[&str]) -> Result<Vector3<f64>, RecordingError> {
    let [x, y, z, ..] = words else {
        return Err(wrong(path, line, &words.join(" "), "three numbers"));
    };
    Ok(Vector3::new(number(path, line, x)?, number(path, line, y)?, number(path, line, z)?))
}

fn axis(letter: char) -> Option<usize> {
    match letter.to_ascii_lowercase() {
        'x' => Some(0),
        'y' => Some(1),
        'z' => Some(2),
        _ => None,
    }
}

/// Returns the rotation by angles in degrees about the axes named by `order`, applied in this order.
fn rotation(
    path: &str,
    line: usize,
    angles: Vector3<f64>,
    order: &str,
) -> Result<UnitQuaternion<f64>, RecordingError> {
    let mut made = UnitQuaternion::identity();
    let letters: Vec<usize> = order.chars().filter_map(axis).collect();
    if letters.len() != 3 || order.len() != 3 {
        return Err(wrong(path, line, order, "an order of axes, such as XYZ"));
    }
    for (angle, letter) in angles.iter().zip(letters) {
        let about = Vector3::ith(letter, angle.to_radians());
        made = UnitQuaternion::from_scaled_axis(about) * made;
    }
    Ok(made)
}

#[derive(Clone, Debug)]
struct Bone {
    name: String,
    along: Vector3<f64>,
    axes: UnitQuaternion<f64>,
    /// Values in the order of the file.
    motions: Vec<Motion>,
}

/// Parses a value name such as `rx` or `tz`.
fn motion(path: &str, line: usize, word: &str) -> Result<Motion, RecordingError> {
    let mut letters = word.chars();
    match (letters.next(), letters.next().and_then(axis), letters.next()) {
        (Some('r' | 'R'), Some(axis), None) => Ok(Motion::Rotate(axis)),
        (Some('t' | 'T'), Some(axis), None) => Ok(Motion::Translate(axis)),
        _ => Err(wrong(path, line, word, "a degree of freedom, such as rx")),
    }
}

fn channel(bone: &str, motion: Motion) -> String {
    let letter = |axis: usize| ["x", "y", "z"][axis];
    match motion {
        Motion::Translate(axis) => format!("{bone}_t{}", letter(axis)),
        Motion::Rotate(axis) => format!("{bone}_r{}", letter(axis)),
    }
}

impl Skeleton {
    /// Parses a skeleton in the `.asf` format. `path` is used only in error messages.
    ///
    /// Angles may be in degrees or rad; lengths keep the unit of the file.
    ///
    /// # Errors
    /// A line is invalid, a bone is missing from the hierarchy, or the hierarchy is not a tree.
    pub fn from_asf(path: &str, text: &str) -> Result<Self, RecordingError> {
        let mut section = String::new();
        let mut degrees = true;
        let mut root = Bone {
            name: "root".into(),
            along: Vector3::zeros(),
            axes: UnitQuaternion::identity(),
            motions: vec![],
        };
        let mut root_axis = ("XYZ".to_string(), Vector3::zeros(), 0);
        let mut bones: Vec<Bone> = vec![];
        let mut draft: Option<Draft> = None;
        let mut parents: BTreeMap<String, (String, usize)> = BTreeMap::new();
        let mut last = 1;
        for (line, words) in lines(text) {
            last = line;
            if let Some(name) = words[0].strip_prefix(':') {
                section = name.to_string();
                continue;
            }
            match (section.as_str(), words[0]) {
                ("units", "angle") => {
                    degrees = match words.get(1) {
                        Some(&"deg") => true,
                        Some(&"rad") => false,
                        other => return Err(wrong(path, line, other.unwrap_or(&""), "deg or rad")),
                    }
                }
                ("root", "order") => {
                    let found = words[1..].iter().map(|word| motion(path, line, &word.to_lowercase()));
                    root.motions = found.collect::<Result<_, _>>()?;
                }
                ("root", "axis") => root_axis.0 = words.get(1).unwrap_or(&"").to_string(),
                ("root", "orientation") => {
                    (root_axis.1, root_axis.2) = (vector(path, line, &words[1..])?, line);
                }
                ("bonedata", "begin") => draft = Some(Draft::default()),
                ("bonedata", "end") => {
                    let made = draft.take().ok_or_else(|| wrong(path, line, "end", "a preceding `begin`"))?;
                    bones.push(made.finish(path, line, degrees)?);
                    if bones.len() > MOST_BONES {
                        return Err(wrong(path, line, "more bones", format!("at most {MOST_BONES}")));
                    }
                }
                ("bonedata", key) => {
                    let draft = draft.as_mut().ok_or_else(|| wrong(path, line, key, "begin"))?;
                    draft.take(path, line, key, &words[1..])?;
                }
                ("hierarchy", "begin" | "end") => {}
                ("hierarchy", parent) => {
                    for child in &words[1..] {
                        let known = parents.insert(child.to_string(), (parent.to_string(), line));
                        if known.is_some() {
                            return Err(wrong(path, line, child, "a bone with one parent"));
                        }
                    }
                }
                _ => {}
            }
        }
        let angles = if degrees { root_axis.1 } else { root_axis.1.map(f64::to_degrees) };
        root.axes = rotation(path, root_axis.2.max(1), angles, &root_axis.0)?;
        assemble(path, last, root, &bones, &parents)
    }

    /// Parses a motion of this skeleton in the `.amc` format, at `rate` samples per second. `path` is used
    /// only in error messages.
    ///
    /// # Errors
    /// A line does not match the skeleton, the rate is not positive, or there are fewer than two samples.
    pub fn read_amc(&self, path: &str, text: &str, rate: f64) -> Result<Recording, RecordingError> {
        if !(rate > 0.0 && rate.is_finite()) {
            let expected = "a positive number of samples per second";
            return Err(RecordingError::OutOfRange { name: "rate", value: rate, expected });
        }
        let channels = self.channels.len();
        let mut radians = false;
        let mut samples: Vec<f64> = vec![];
        let (mut rows, mut last, mut before) = (0_usize, 1, None);
        let mut is_full = false;
        // Channels are NaN until their bone is read. If a file specifies all channels, a sample that lacks
        // one was cut off.
        let end = |samples: &mut [f64], rows: usize, line: usize, is_full: bool| {
            let values = samples.iter_mut().skip(rows.saturating_sub(1) * channels);
            for (value, name) in values.zip(&self.channels).filter(|(value, _)| value.is_nan()) {
                if is_full {
                    return Err(wrong(
                        path,
                        line,
                        "the end of a sample",
                        format!("a value of {name} before it"),
                    ));
                }
                *value = 0.0;
            }
            Ok(())
        };
        for (line, words) in lines(text) {
            last = line;
            match words[0] {
                word if word.starts_with(':') => {
                    radians |= words.contains(&":RADIANS");
                    is_full |= words.contains(&":FULLY-SPECIFIED");
                }
                word if words.len() == 1 && word.parse::<u64>().is_ok() => {
                    end(&mut samples, rows, line, is_full)?;
                    let count = word.parse::<u64>().ok();
                    let next = before.map(|before: u64| before.saturating_add(1));
                    if next.is_some() && count != next {
                        let expected = format!("sample {}", next.unwrap_or_default());
                        return Err(wrong(path, line, word, expected));
                    }
                    before = count;
                    rows += 1;
                    if rows * channels > MOST_VALUES {
                        return Err(wrong(path, line, word, format!("at most {MOST_VALUES} values")));
                    }
                    samples.resize(rows * channels, f64::NAN);
                }
                bone => {
                    let Some(joint) = self.joints.iter().find(|joint| joint.name == bone) else {
                        return Err(wrong(
                            path,
                            line,
                            bone,
                            "the number of a sample, or a bone of the skeleton",
                        ));
                    };
                    if rows == 0 {
                        return Err(wrong(path, line, bone, "the number of a sample before it"));
                    }
                    // in the order of the file, which is the order of the channels
                    let mut moved: Vec<(Motion, usize)> = joint.motions.clone();
                    moved.sort_by_key(|(_, channel)| *channel);
                    if words.len() != moved.len() + 1 {
                        let expected = format!("{} values of {bone}", moved.len());
                        return Err(wrong(path, line, &words.join(" "), expected));
                    }
                    for ((motion, channel), word) in moved.iter().zip(&words[1..]) {
                        let value = number(path, line, word)?;
                        let turns = radians && matches!(motion, Motion::Rotate(_));
                        let value = if turns { value.to_degrees() } else { value };
                        samples[(rows - 1) * channels + channel] = value;
                    }
                }
            }
        }
        end(&mut samples, rows, last, is_full)?;
        let times = (0..rows).map(|row| row as f64 / rate).collect();
        Recording::new(self.channels.clone(), times, DMatrix::from_row_slice(rows, channels, &samples))
    }
}

/// A bone while it is read.
#[derive(Debug, Default)]
struct Draft {
    name: Option<String>,
    direction: Option<Vector3<f64>>,
    length: Option<f64>,
    axis: Option<(Vector3<f64>, String)>,
    motions: Vec<Motion>,
}

impl Draft {
    fn take(&mut self, path: &str, line: usize, key: &str, words: &[&str]) -> Result<(), RecordingError> {
        let first = words.first().copied().unwrap_or_default();
        match key {
            "name" => self.name = Some(first.to_string()),
            "direction" => self.direction = Some(vector(path, line, words)?),
            "length" => self.length = Some(number(path, line, first)?),
            "axis" => {
                let order = words.get(3).copied().unwrap_or("XYZ").to_string();
                self.axis = Some((vector(path, line, words)?, order));
            }
            "dof" => {
                // a bone may change its length, `l`, which does not move the joints here
                let kept = words.iter().filter(|word| **word != "l");
                self.motions = kept.map(|word| motion(path, line, word)).collect::<Result<_, _>>()?;
            }
            // `id`, `limits` and their further lines, masses
            _ => {}
        }
        Ok(())
    }

    fn finish(self, path: &str, line: usize, degrees: bool) -> Result<Bone, RecordingError> {
        let missing = |what: &str| wrong(path, line, "end", format!("{what} of the bone before it"));
        let name = self.name.filter(|name| !name.is_empty()).ok_or_else(|| missing("name"))?;
        let direction = self.direction.ok_or_else(|| missing("direction"))?;
        let length = self.length.ok_or_else(|| missing("length"))?;
        let (angles, order) = self.axis.unwrap_or((Vector3::zeros(), "XYZ".to_string()));
        let angles = if degrees { angles } else { angles.map(f64::to_degrees) };
        let axes = rotation(path, line, angles, &order)?;
        Ok(Bone { name, along: direction * length, axes, motions: self.motions })
    }
}

/// Sorts the bones such that parents precede their children.
fn assemble(
    path: &str,
    last: usize,
    root: Bone,
    bones: &[Bone],
    parents: &BTreeMap<String, (String, usize)>,
) -> Result<Skeleton, RecordingError> {
    let mut made = Skeleton { joints: vec![], channels: vec![] };
    made.add(root, None);
    let mut left: Vec<&Bone> = bones.iter().collect();
    while !left.is_empty() {
        let before = left.len();
        left.retain(|bone| {
            let parent = parents.get(&bone.name).map(|(parent, _)| parent);
            let index = made.joints.iter().position(|joint| Some(&joint.name) == parent);
            match index {
                Some(parent) => {
                    made.add((*bone).clone(), Some(parent));
                    false
                }
                None => true,
            }
        });
        if left.len() == before {
            let line = parents.get(&left[0].name).map_or(last, |(_, line)| *line);
            return Err(wrong(path, line, &left[0].name, "a hierarchy that connects every bone to the root"));
        }
    }
    if let Some((child, (_, line))) =
        parents.iter().find(|(child, _)| made.joints.iter().all(|joint| joint.name != **child))
    {
        return Err(wrong(path, *line, child, "a bone of `:bonedata`"));
    }
    Ok(made)
}

impl Skeleton {
    fn add(&mut self, bone: Bone, parent: Option<usize>) {
        let first = self.channels.len();
        self.channels.extend(bone.motions.iter().map(|motion| channel(&bone.name, *motion)));
        let mut motions: Vec<(Motion, usize)> = bone.motions.into_iter().zip(first..).collect();
        // the first rotation is applied first, so it is multiplied last from the left
        motions.reverse();
        let (before, after) = (Vector3::zeros(), bone.along);
        self.joints.push(SkeletonJoint { name: bone.name, parent, before, after, axes: bone.axes, motions });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skeleton::{Limb, Trunk};

    const SKELETON: &str = ":version 1.10\n:units\n  angle deg\n:root\n order TX TY TZ RX RY RZ\n axis XYZ\n position 0 0 0\n \
        orientation 0 0 0\n:bonedata\n begin\n id 1\n name upper\n direction 1 0 0\n length 2\n axis 0 0 0 XYZ\n dof rz\n \
        limits (-90 90)\n end\n begin\n name lower\n direction 1 0 0\n length 1\n axis 0 0 90 XYZ\n dof rx rz\n limits (0 1)\n \
        (0 1)\n end\n:hierarchy\n begin\n root upper\n upper lower\n end\n";

    fn limb(name: &str, from: &str, to: &str) -> Limb {
        Limb { name: name.into(), from: from.into(), to: to.into() }
    }

    fn trunk() -> Trunk {
        Trunk { joint: "root".into(), forward: Vector3::x(), up: Vector3::z() }
    }

    #[test]
    fn rotations_follow_the_axes_of_each_bone() {
        let skeleton = Skeleton::from_asf("a.asf", SKELETON).expect("a skeleton");
        assert_eq!(
            skeleton.channels().join(" "),
            "root_tx root_ty root_tz root_rx root_ry root_rz upper_rz lower_rx lower_rz"
        );
        let motion = "#comment\n:DEGREES\n1\nroot 5 6 7 0 0 0\nupper 0\nlower 0 0\n2\nupper 90\nlower 90 0\n";
        let motion = skeleton.read_amc("a.amc", motion, 120.0).expect("a motion");
        assert_eq!(motion.times(), [0.0, 1.0 / 120.0]);
        let limbs = [limb("a", "root", "upper"), limb("b", "upper", "lower")];
        let found = skeleton.directions(&motion, &trunk(), &limbs).expect("directions");
        assert_eq!(found.names()[3..], ["b_x", "b_y", "b_z"]);
        let row =
            |i: usize| found.values().row(i).iter().map(|v| (v * 1e9).round() / 1e9).collect::<Vec<_>>();
        assert_eq!(row(0), [1.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
        // the lower bone rotates about its own x, which is y of its parent: (0, 0, -1), and the parent
        // rotates it about z
        assert_eq!(row(1), [0.0, 1.0, 0.0, 0.0, 0.0, -1.0]);
    }

    #[test]
    fn errors_name_the_line() {
        let error = |text: &str| Skeleton::from_asf("a.asf", text).expect_err("an error").to_string();
        assert_eq!(
            error(&SKELETON.replace("length 2", "length two")),
            "a.asf, line 14: found \"two\", expected a finite number"
        );
        assert!(error(&SKELETON.replace("upper lower", "lower upper")).contains("one parent"));
        assert!(
            error(&SKELETON.replace(" root upper\n", "")).contains("a hierarchy that connects every bone")
        );
        assert!(error(&SKELETON.replace(" name upper\n", "")).contains("name of the bone"));
        let skeleton = Skeleton::from_asf("a.asf", SKELETON).expect("a skeleton");
        let error = |text: &str| skeleton.read_amc("a.amc", text, 120.0).expect_err("an error").to_string();
        assert!(error("1\nupper 1 2\n").contains("expected 1 values of upper"));
        assert!(error("1\nhead 1\n").contains("a bone of the skeleton"));
        assert!(error("upper 1\n").contains("number of a sample"));
        assert!(error("1\nupper nan\n").contains("a finite number"));
        let full =
            ":FULLY-SPECIFIED\n1\nroot 5 6 7 0 0 0\nupper 0\nlower 0 0\n2\nroot 5 6 7 0 0 0\nupper 9\n";
        assert!(error(full).contains("line 8: found \"the end of a sample\", expected a value of lower_rx"));
        let whole = format!("{full}lower 1 1\n");
        assert!(skeleton.read_amc("a.amc", &whole, 120.0).is_ok());
        assert!(error(&whole.replace("\n2\n", "\n3\n")).contains("expected sample 2"));
    }

    #[test]
    fn recorded_arms_match_the_data_set() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
        let Ok(text) = std::fs::read_to_string(folder.join("cmu-mocap/02.asf")) else { return };
        let skeleton = Skeleton::from_asf("02.asf", &text).expect("a skeleton");
        let selection = crate::Selection { rate: Some(30.0), ..Default::default() };
        let take = crate::read(&folder.join("cmu-mocap/02_09.csv"), &selection).expect("a take");
        let trunk = Trunk { joint: "thorax".into(), forward: Vector3::z(), up: Vector3::y() };
        let limbs = ["l", "r"].map(|side| {
            let name = |bone: &str| format!("{side}{bone}");
            [
                limb(&name("upperarm"), &name("clavicle"), &name("humerus")),
                limb(&name("forearm"), &name("humerus"), &name("radius")),
                limb(&name("hand"), &name("wrist"), &name("hand")),
            ]
        });
        let found = skeleton.directions(&take, &trunk, limbs.as_flattened()).expect("directions");
        // `human.csv`: 02_09, frame 207
        let expected = [
            0.32139, 0.17274, -0.93106, 0.94871, 0.15899, 0.27327, 0.63804, 0.76590, -0.07935, -0.29049,
            -0.71824, -0.63225, -0.19524, -0.96334, -0.18403, -0.67092, -0.52160, 0.52707,
        ];
        for (value, expected) in found.values().row(207).iter().zip(expected) {
            assert!((value - expected).abs() < 2e-5, "{} and {expected:?}", found.values().row(207));
        }
    }
}
