//! Defects that real robots' files have and that do not keep them from loading.

use crate::Position;

/// A defect of a loaded model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelWarning {
    /// A link states a rotational inertia no rigid body has.
    #[error("link \"{link}\": rotational inertia is not positive definite (principal moments {}, {}, {} kg m2)",
        .principal[0], .principal[1], .principal[2])]
    NotPositiveDefinite {
        /// Link at fault.
        link: String,
        /// Principal moments, ascending \[kg m2\].
        principal: [f64; 3],
    },
    /// A link states a rotational inertia no distribution of mass can have.
    #[error("link \"{link}\": rotational inertia breaks the triangle inequality (principal moments {}, {}, {} kg m2: \
             the largest exceeds the sum of the others)",
        .principal[0], .principal[1], .principal[2])]
    TriangleInequality {
        /// Link at fault.
        link: String,
        /// Principal moments, ascending \[kg m2\].
        principal: [f64; 3],
    },
    /// A link states a rotational inertia but no mass.
    #[error("link \"{link}\": rotational inertia without mass")]
    InertiaWithoutMass {
        /// Link at fault.
        link: String,
    },
    /// No link beyond a joint has inertia, so the mass matrix is singular.
    #[error(
        "link \"{link}\" and all beyond it have no inertia: kinematics work, but forward dynamics of joint \
         \"{joint}\" is impossible; give the link an <inertial>"
    )]
    NoInertia {
        /// Link moved by the joint.
        link: String,
        /// The joint.
        joint: String,
    },
    /// A range of one point.
    #[error("joint \"{joint}\": lower and upper limit are both {value}; it cannot move")]
    EmptyRange {
        /// Joint at fault.
        joint: String,
        /// The one position \[rad or m\].
        value: f64,
    },
    /// A limit of zero, often meant as "unknown".
    #[error(
        "joint \"{joint}\": {what} limit is 0, taken literally; leave it out or raise it if it means unknown"
    )]
    ZeroLimit {
        /// Joint at fault.
        joint: String,
        /// `velocity` or `effort`.
        what: &'static str,
    },
    /// A limit without effort.
    #[error("joint \"{joint}\": <limit> gives no effort; taken as unlimited")]
    NoEffortLimit {
        /// Joint at fault.
        joint: String,
    },
    /// An axis of another length than one.
    #[error("joint \"{joint}\": axis has length {length}; normalised")]
    AxisLength {
        /// Joint at fault.
        joint: String,
        /// Length found.
        length: f64,
    },
    /// A transmission that names a joint nobody defines.
    #[error("transmission \"{transmission}\": its joint \"{joint}\" does not exist; ignored")]
    TransmissionJoint {
        /// The transmission.
        transmission: String,
        /// The name it gives.
        joint: String,
    },
    /// A transmission that joins several joints or motors.
    #[error(
        "transmission \"{transmission}\" couples {joints} joints and {actuators} actuators; ignored: only one of each is"
    )]
    CoupledTransmission {
        /// The transmission.
        transmission: String,
        /// Joints it names.
        joints: usize,
        /// Actuators it names.
        actuators: usize,
    },
    /// Something that changes the motion of an MJCF robot in MuJoCo and that no model contains.
    #[error("{what} ignored (line {}, column {}{}): {reason}", .at.line, .at.column, in_all(*.count))]
    Ignored {
        /// An attribute and its element, or an element and its section.
        what: String,
        /// Place in the file of the first.
        at: Position,
        /// Count in the file.
        count: usize,
        /// Reason for ignoring it.
        reason: &'static str,
    },
    /// A mesh file that is nowhere.
    #[error("link \"{link}\": mesh \"{uri}\" not found{}", searched(.tried))]
    MissingMesh {
        /// Link at fault.
        link: String,
        /// File name in the URDF.
        uri: String,
        /// Folders searched.
        tried: Vec<std::path::PathBuf>,
    },
}

impl ModelWarning {
    /// The warnings as texts, one for all meshes that are nowhere.
    ///
    /// ```
    /// use motorium_robots::ModelWarning;
    ///
    /// let missing = |link: &str| ModelWarning::MissingMesh {
    ///     link: link.into(), uri: format!("package://arm/{link}.stl"), tried: vec!["/opt/arm".into()],
    /// };
    /// let told = ModelWarning::told(&[missing("base"), missing("hand")]);
    /// assert!(told.len() == 1 && told[0].starts_with("the meshes of 2 links (base, hand) are not found"));
    /// ```
    pub fn told(warnings: &[Self]) -> Vec<String> {
        let missing = |warning: &&Self| matches!(warning, Self::MissingMesh { .. });
        let (missing, others): (Vec<&Self>, Vec<&Self>) = warnings.iter().partition(missing);
        let mut told: Vec<String> = others.iter().map(ToString::to_string).collect();
        match missing.as_slice() {
            [] => {}
            [one] => told.push(one.to_string()),
            [Self::MissingMesh { uri, tried, .. }, ..] => {
                let link = |warning: &&Self| match warning {
                    Self::MissingMesh { link, .. } => Some(link.clone()),
                    _ => None,
                };
                let mut links: Vec<String> = missing.iter().filter_map(link).collect();
                links.dedup();
                let (count, links) = (links.len(), links.join(", "));
                let of = if count == 1 { "link" } else { "links" };
                told.push(format!(
                    "the meshes of {count} {of} ({links}) are not found, the first, \"{uri}\",{}",
                    searched(tried)
                ));
            }
            _ => {}
        }
        told
    }
}

fn in_all(count: usize) -> String {
    if count == 1 { String::new() } else { format!(", {count} in all") }
}

fn searched(tried: &[std::path::PathBuf]) -> String {
    if tried.is_empty() {
        return String::new();
    }
    let folders: Vec<_> = tried.iter().map(|path| path.display().to_string()).collect();
    format!(
        " in {}; name the folder of its package by `package_path` of the robot in a graph, --package-path of `motorium \
         robot`, or ROS_PACKAGE_PATH",
        folders.join(", ")
    )
}
