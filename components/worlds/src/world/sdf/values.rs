//! Elements of SDF and their values: numbers, booleans, poses.

use motorium_robots::ModelWarning;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use roxmltree::Node;

use super::super::WorldFileError;
use super::super::reading::{position, problem};
use super::reader::Reader;

/// The unit of angles in SDF.
const RADIANS: &str = "SDF angles are in radians without degrees=\"true\"";
/// Length below which a quaternion counts as zero.
const SHORTEST: f64 = 1e-9;

/// Returns `true` for an element in the namespace of another program.
pub(super) fn is_foreign(node: &Node<'_, '_>) -> bool {
    node.tag_name().namespace() != node.document().root_element().tag_name().namespace()
}

/// Returns the SDF elements directly inside an element.
pub(super) fn elements<'a, 'i>(node: Node<'a, 'i>) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(|child| child.is_element() && !is_foreign(child))
}

/// Returns the elements with a name directly inside an element.
pub(super) fn named<'a, 'i>(node: Node<'a, 'i>, name: &str) -> impl Iterator<Item = Node<'a, 'i>> {
    elements(node).filter(move |child| child.tag_name().name() == name)
}

/// Returns the first element with a name directly inside an element.
pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    named(node, name).next()
}

/// Returns the text of an element without comments.
pub(super) fn text(node: Node<'_, '_>) -> String {
    node.children().filter(|child| child.is_text()).filter_map(|child| child.text()).collect()
}

/// Returns `true` if the text is a true value; case does not matter, as in libsdformat.
pub(super) fn is_true(value: &str) -> bool {
    value.trim().eq_ignore_ascii_case("true") || value.trim() == "1"
}

/// Returns `true` if the text is a false value.
pub(super) fn is_false(value: &str) -> bool {
    value.trim().eq_ignore_ascii_case("false") || value.trim() == "0"
}

impl Reader<'_> {
    pub(super) fn numbers<const N: usize>(&self, node: Node<'_, '_>) -> Result<[f64; N], WorldFileError> {
        let text = text(node);
        let numbers: Vec<f64> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        let whole = numbers.len() == text.split_whitespace().count();
        match <[f64; N]>::try_from(numbers) {
            Ok(numbers) if whole && numbers.iter().all(|number| number.is_finite()) => Ok(numbers),
            _ => {
                let name = node.tag_name().name();
                let expected = if N == 1 { "a number".to_owned() } else { format!("{N} numbers") };
                let text = format!("<{name}> is \"{}\", expected {expected}", text.trim());
                Err(problem(self.path, node, text))
            }
        }
    }

    pub(super) fn number(&self, node: Node<'_, '_>, name: &str) -> Result<f64, WorldFileError> {
        let Some(inside) = child(node, name) else {
            return Err(problem(self.path, node, format!("<{}> has no <{name}>", node.tag_name().name())));
        };
        self.numbers::<1>(inside).map(|[number]| number)
    }

    pub(super) fn number_or(
        &self,
        node: Option<Node<'_, '_>>,
        name: &str,
        default: f64,
    ) -> Result<f64, WorldFileError> {
        match node.and_then(|node| child(node, name)) {
            Some(inside) => self.numbers::<1>(inside).map(|[number]| number),
            None => Ok(default),
        }
    }

    pub(super) fn boolean(&self, node: Node<'_, '_>) -> Result<bool, WorldFileError> {
        let text = text(node);
        if is_true(&text) {
            return Ok(true);
        }
        if is_false(&text) {
            return Ok(false);
        }
        let name = node.tag_name().name();
        Err(problem(self.path, node, format!("<{name}> is \"{}\", expected true or false", text.trim())))
    }

    /// Returns the pose of an element relative to the enclosing element, to which the file may refer as
    /// `around`.
    pub(super) fn pose(
        &self,
        node: Node<'_, '_>,
        around: Option<&str>,
    ) -> Result<Isometry3<f64>, WorldFileError> {
        let Some(pose) = child(node, "pose") else { return Ok(Isometry3::identity()) };
        // `frame` is the name of SDF 1.5 and 1.6 for the same
        for attribute in ["relative_to", "frame"] {
            let named = pose.attribute(attribute).filter(|frame| !frame.is_empty());
            if let Some(frame) = named.filter(|frame| around != Some(*frame)) {
                let text = format!(
                    "{attribute}=\"{frame}\" in <pose> is not supported; write the pose relative to the element that contains <{}>",
                    node.tag_name().name()
                );
                return Err(problem(self.path, pose, text));
            }
        }
        let degrees = pose.attribute("degrees").is_some_and(is_true);
        let quaternion = match pose.attribute("rotation_format") {
            None | Some("euler_rpy") => false,
            Some("quat_xyzw") if !degrees => true,
            Some("quat_xyzw") => {
                let text = "degrees=\"true\" does not apply to a quaternion; remove it";
                return Err(problem(self.path, pose, text));
            }
            Some(format) => {
                let text = format!(
                    "rotation_format=\"{format}\" is not supported, expected \"euler_rpy\" or \"quat_xyzw\""
                );
                return Err(problem(self.path, pose, text));
            }
        };
        if text(pose).trim().is_empty() {
            return Ok(Isometry3::identity());
        }
        if quaternion {
            let [x, y, z, i, j, k, w] = self.numbers(pose)?;
            let rotation =
                UnitQuaternion::try_new(Quaternion::new(w, i, j, k), SHORTEST).ok_or_else(|| {
                    problem(self.path, pose, "the quaternion is zero; write 0 0 0 1 for no rotation")
                })?;
            return Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation));
        }
        let [x, y, z, mut roll, mut pitch, mut yaw] = self.numbers(pose)?;
        if degrees {
            [roll, pitch, yaw] = [roll, pitch, yaw].map(f64::to_radians);
        } else {
            let owner = match node.attribute("name") {
                Some(name) => format!("{} name=\"{name}\"", node.tag_name().name()),
                None => node.tag_name().name().to_owned(),
            };
            let (what, at) = (format!("<pose> of <{owner}>"), position(pose));
            let doubt = ModelWarning::of_angles(&what, &[roll, pitch, yaw], RADIANS, Some(at));
            let mut warnings = self.warnings.borrow_mut();
            let doubt = doubt.filter(|doubt| !warnings.contains(doubt));
            warnings.extend(doubt);
        }
        Ok(Isometry3::from_parts(
            Translation3::new(x, y, z),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        ))
    }
}
