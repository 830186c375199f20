//! Defects of real robots' files that do not prevent loading.

use crate::{FilePosition, MeshError, MeshProblem, Position};

/// A warning about a defect of a robot file that does not prevent loading.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelWarning {
    /// The rotational inertia of a link is not positive definite.
    #[error("link \"{link}\": rotational inertia is not positive definite (principal moments {}, {}, {} kg m2)",
        moment(.principal[0]), moment(.principal[1]), moment(.principal[2]))]
    NotPositiveDefinite {
        /// Name of the link.
        link: String,
        /// Principal moments, ascending \[kg m2\].
        principal: [f64; 3],
    },
    /// The rotational inertia of a link is impossible for any distribution of mass.
    #[error("link \"{link}\": rotational inertia breaks the triangle inequality (principal moments {}, {}, {} kg m2: \
             the largest exceeds the sum of the others)",
        moment(.principal[0]), moment(.principal[1]), moment(.principal[2]))]
    TriangleInequality {
        /// Name of the link.
        link: String,
        /// Principal moments, ascending \[kg m2\].
        principal: [f64; 3],
    },
    /// A link has a rotational inertia but no mass.
    #[error("link \"{link}\": rotational inertia is set, but the mass is zero")]
    InertiaWithoutMass {
        /// Name of the link.
        link: String,
    },
    /// No link beyond a joint has inertia, so the mass matrix is singular.
    #[error(
        "link \"{link}\" and all beyond it have no inertia: kinematics work, but forward dynamics of joint \
         \"{joint}\" is impossible; give the link an <inertial>"
    )]
    NoInertia {
        /// Name of the link moved by the joint.
        link: String,
        /// Name of the joint.
        joint: String,
    },
    /// The range of a joint is a single point.
    #[error("joint \"{joint}\": lower and upper limit are both {value}; it cannot move")]
    EmptyRange {
        /// Name of the joint.
        joint: String,
        /// The only position \[rad or m\].
        value: f64,
    },
    /// The range of a revolute joint spans several revolutions, as if given in degrees.
    #[error(
        "joint \"{joint}\": limits {lower} to {upper} rad are {:.0} turns; {format}: if these are degrees, write {:.4} \
         to {:.4}", (.upper - .lower) / core::f64::consts::TAU, .lower.to_radians(), .upper.to_radians()
    )]
    ManyTurns {
        /// Name of the joint.
        joint: String,
        /// Unit rule of the file format, such as `URDF has radians`.
        format: &'static str,
        /// Lower limit \[rad\].
        lower: f64,
        /// Upper limit \[rad\].
        upper: f64,
    },
    /// A continuous joint has a range of less than a full revolution.
    #[error(
        "joint \"{joint}\": limits {lower} to {upper} have no effect on a continuous joint; if it must not turn further, \
         write type=\"revolute\""
    )]
    ContinuousRange {
        /// Name of the joint.
        joint: String,
        /// Lower limit \[rad\].
        lower: f64,
        /// Upper limit \[rad\].
        upper: f64,
    },
    /// A limit is zero, which often means "unknown".
    #[error(
        "joint \"{joint}\": {what} limit is 0, taken literally; leave it out or raise it if it means unknown"
    )]
    ZeroLimit {
        /// Name of the joint.
        joint: String,
        /// Type of the limit: `velocity` or `effort`.
        what: &'static str,
    },
    /// The `<limit>` of a joint has no effort.
    #[error("joint \"{joint}\": <limit> has no effort; treated as unlimited")]
    NoEffortLimit {
        /// Name of the joint.
        joint: String,
    },
    /// An axis is not a unit vector.
    #[error("joint \"{joint}\": axis has length {length}; normalised")]
    AxisLength {
        /// Name of the joint.
        joint: String,
        /// Length of the axis.
        length: f64,
    },
    /// The transmission refers to an undefined joint.
    #[error("transmission \"{transmission}\": its joint \"{joint}\" does not exist; ignored")]
    TransmissionJoint {
        /// Name of the transmission.
        transmission: String,
        /// Name of the unknown joint.
        joint: String,
    },
    /// A transmission couples several joints or motors.
    #[error(
        "transmission \"{transmission}\" couples {joints} joints and {actuators} actuators; ignored: only \
         transmissions of one joint and one actuator are supported"
    )]
    CoupledTransmission {
        /// Name of the transmission.
        transmission: String,
        /// Number of joints of the transmission.
        joints: usize,
        /// Number of actuators of the transmission.
        actuators: usize,
    },
    /// An element of the file that affects the motion is ignored.
    #[error("{what} ignored (line {}, column {}{}): {reason}", .at.line, .at.column, in_all(*.count))]
    Ignored {
        /// Description: an attribute and its element, or an element and its section.
        what: String,
        /// Position of the first occurrence in the file.
        at: Position,
        /// Number of occurrences in the file.
        count: usize,
        /// Reason why the element is ignored.
        reason: &'static str,
    },
    /// A mimic joint (follower) restricts the range of the joint that it follows.
    #[error(
        "joint \"{joint}\": its follower \"{follower}\" limits its range to {lower} to {upper}; the file has {} to {}",
        .file[0], .file[1]
    )]
    FollowerRange {
        /// Name of the followed joint.
        joint: String,
        /// Name of the follower.
        follower: String,
        /// Lowest position of the followed joint at which the follower is within its own limits \[rad or m\].
        lower: f64,
        /// Highest position of the followed joint at which the follower is within its own limits \[rad or
        /// m\].
        upper: f64,
        /// Lower and upper limit of the followed joint in the file \[rad or m\].
        file: [f64; 2],
    },
    /// A mimic joint (follower) restricts the velocity of the joint that it follows.
    #[error(
        "joint \"{joint}\": its follower \"{follower}\" limits its velocity to {velocity}; the file has {file}"
    )]
    FollowerVelocity {
        /// Name of the followed joint.
        joint: String,
        /// Name of the follower.
        follower: String,
        /// Velocity of the followed joint at which the follower reaches its own velocity limit \[rad/s or
        /// m/s\].
        velocity: f64,
        /// Velocity limit of the followed joint in the file \[rad/s or m/s\].
        file: f64,
    },
    /// A mimic joint (follower) is outside its own range at every position of the joint that it follows (its
    /// leader).
    #[error(
        "joint \"{joint}\": its limits {lower} to {upper} exclude every position it has as a follower of \"{leader}\"; \
         ignored"
    )]
    FollowerOutside {
        /// Name of the following joint.
        joint: String,
        /// Name of the leader.
        leader: String,
        /// Lower limit of the following joint \[rad or m\].
        lower: f64,
        /// Upper limit of the following joint \[rad or m\].
        upper: f64,
    },
    /// A moving link has an implausible size, as if lengths were in millimetres.
    #[error(
        "link \"{link}\": {what} of {metres:.1} m; if lengths in the file are millimetres, divide them by 1000 and inertias \
         by 1e6"
    )]
    Oversized {
        /// Name of the link.
        link: String,
        /// Description of the length: `collision shape`, `mesh`, `radius of gyration` or `distance from its
        /// parent`.
        what: &'static str,
        /// Implausible length \[m\].
        metres: f64,
    },
    /// An object has an implausible size, as if lengths were in millimetres.
    #[error(
        "object \"{object}\": {what} of {metres:.1} m, expected at most {most} m; if lengths are in millimetres, divide \
         them by 1000"
    )]
    OversizedObject {
        /// Name of the object.
        object: String,
        /// Description of the length: `longest side` of a moving object, or `shortest side` of a fixed
        /// object.
        what: &'static str,
        /// Implausible length \[m\].
        metres: f64,
        /// Maximum plausible length \[m\].
        most: f64,
    },
    /// A value is implausible, as if in another unit.
    #[error("{what} is {value} {unit}, expected {expected}; {advice}")]
    Implausible {
        /// Name of the value, and the object or world that it belongs to.
        what: String,
        /// The value found.
        value: f64,
        /// Unit of the value.
        unit: &'static str,
        /// The plausible values, with their unit.
        expected: &'static str,
        /// The probable mistake and its correction.
        advice: &'static str,
    },
    /// The rotational inertia of a link is too small for its mass.
    #[error(
        "link \"{link}\": largest principal moment of {} kg m2 for {mass} kg, expected at least {least:.1e}, as for \
         a ball of osmium; give the <inertia> in kg m2", moment(*.largest)
    )]
    TinyInertia {
        /// Name of the link.
        link: String,
        /// Largest principal moment of the link \[kg m2\].
        largest: f64,
        /// Mass of the link \[kg\].
        mass: f64,
        /// Minimum plausible moment of inertia: the moment of the smallest plausible ball of this mass \[kg
        /// m2\].
        least: f64,
    },
    /// The range of a prismatic joint is implausibly long, as if in millimetres.
    #[error(
        "joint \"{joint}\": limits {lower} to {upper} m, expected a range of at most {most} m; if these are millimetres, \
         divide them by 1000"
    )]
    LongSlide {
        /// Name of the joint.
        joint: String,
        /// Lower limit \[m\].
        lower: f64,
        /// Upper limit \[m\].
        upper: f64,
        /// Maximum plausible range \[m\].
        most: f64,
    },
    /// The velocity limit of a prismatic joint is implausibly high, as if in millimetres per second.
    #[error(
        "joint \"{joint}\": velocity limit of {velocity} m/s, expected at most {most} m/s; if it is in mm/s, divide it by \
         1000"
    )]
    FastSlide {
        /// Name of the joint.
        joint: String,
        /// Velocity limit \[m/s\].
        velocity: f64,
        /// Maximum plausible velocity \[m/s\].
        most: f64,
    },
    /// An unknown name is similar to a known name and probably misspelt. The attribute or element with the
    /// known name has its default value.
    #[error(
        "\"{found}\" of <{element}> is unknown and has no effect (line {}, column {}); did you mean \"{expected}\"?",
        .at.line, .at.column
    )]
    Misspelt {
        /// Description of the element, and the link or joint that it belongs to.
        element: String,
        /// The unknown name of the attribute or element.
        found: String,
        /// The similar known name.
        expected: String,
        /// Position of the element.
        at: Position,
    },
    /// An element has no effect, because it is in the wrong parent element.
    #[error(
        "<{found}> in <{element}> has no effect (line {}, column {}); expected it in <{expected}>",
        .at.line, .at.column
    )]
    Misplaced {
        /// Description of the parent element, and of the link or joint that it belongs to.
        element: String,
        /// Name of the element.
        found: String,
        /// Name of the parent element in which the element has an effect.
        expected: &'static str,
        /// Position of the element.
        at: Position,
    },
    /// An angle exceeds a full revolution, as if given in degrees.
    #[error(
        "{what} has an angle of {angle} rad{}; {format}: if these are degrees, write {:.4}",
        line(*.at), .angle.to_radians()
    )]
    Degrees {
        /// Description of the value, and the element, object or robot that it belongs to.
        what: String,
        /// Unit rule of the file format, such as `URDF has radians`.
        format: &'static str,
        /// The angle \[rad\].
        angle: f64,
        /// Position of the element, if known.
        at: Option<Position>,
    },
    /// The size of a collision shape is not positive.
    #[error(
        "{what} of <{element}> is {value} (line {}, column {}), which distances and contacts reject; set it to a size above 0",
        .at.line, .at.column
    )]
    NoSize {
        /// Description of the element, and the link that it belongs to.
        element: String,
        /// Name of the size.
        what: String,
        /// Value of the size \[m\].
        value: f64,
        /// Position of the element.
        at: Position,
    },
    /// A mesh file was not found.
    #[error("link \"{link}\": mesh \"{uri}\" not found{}", searched(.uri, .tried, .at))]
    MissingMesh {
        /// Name of the link.
        link: String,
        /// File name in the robot's file.
        uri: String,
        /// Folders that were searched.
        tried: Vec<std::path::PathBuf>,
        /// Position of the reference.
        at: Option<FilePosition>,
    },
    /// A mesh file cannot be read.
    #[error("link \"{link}\": mesh \"{uri}\"{}: {error}{}", reference(.at), advice(.error))]
    UnreadableMesh {
        /// Name of the link.
        link: String,
        /// File name in the robot's file.
        uri: String,
        /// Position of the reference.
        at: Option<FilePosition>,
        /// Error of the mesh file.
        error: MeshError,
    },
}

/// A defect that several links or joints may share.
struct Shared<'w> {
    /// `link` or `joint`.
    part: &'static str,
    name: &'w str,
    /// Text of the defect; equal defects have equal texts.
    defect: String,
    /// Text of the defect if several share it.
    of_several: String,
}

impl ModelWarning {
    /// Summarises the warnings, one text per defect: links or joints with the same defect share a text.
    ///
    /// ```
    /// use motorium_robots::ModelWarning;
    ///
    /// let effort = |joint: &str| ModelWarning::ZeroLimit { joint: joint.into(), what: "effort" };
    /// let several = ModelWarning::summarise(&[effort("hip"), effort("knee"), effort("ankle")]);
    /// assert!(several.len() == 1 && several[0].starts_with("joints \"hip\", \"knee\", \"ankle\": effort limit is 0"));
    /// ```
    pub fn summarise(warnings: &[Self]) -> Vec<String> {
        let mut groups: Vec<(Option<Shared<'_>>, Vec<&str>, Vec<&Self>)> = Vec::new();
        for warning in warnings {
            let shared = warning.shared();
            let same = shared.as_ref().and_then(|shared| {
                groups.iter_mut().find(|(known, ..)| {
                    let known = known.as_ref();
                    known.is_some_and(|known| (known.part, &known.defect) == (shared.part, &shared.defect))
                })
            });
            match (same, &shared) {
                (Some((_, names, members)), Some(shared)) => {
                    if !names.contains(&shared.name) {
                        names.push(shared.name);
                    }
                    members.push(warning);
                }
                _ => {
                    let names = shared.iter().map(|shared| shared.name).collect();
                    groups.push((shared, names, vec![warning]));
                }
            }
        }
        let text = |(shared, names, members): (Option<Shared<'_>>, Vec<&str>, Vec<&Self>)| match shared {
            Some(Shared { part, of_several, .. }) if names.len() > 1 => {
                let of_several = missing_meshes(&members).unwrap_or(of_several);
                format!("{part}s \"{}\": {of_several}", names.join("\", \""))
            }
            Some(Shared { part, name, .. }) => match missing_meshes(&members) {
                Some(several) => format!("{part} \"{name}\": {several}"),
                None => members[0].to_string(),
            },
            None => members[0].to_string(),
        };
        groups.into_iter().map(text).collect()
    }

    fn shared(&self) -> Option<Shared<'_>> {
        let (part, name) = match self {
            Self::NotPositiveDefinite { link, .. }
            | Self::TriangleInequality { link, .. }
            | Self::InertiaWithoutMass { link }
            | Self::Oversized { link, .. }
            | Self::TinyInertia { link, .. }
            | Self::MissingMesh { link, .. } => ("link", link),
            Self::NoInertia { joint, .. }
            | Self::EmptyRange { joint, .. }
            | Self::FollowerRange { joint, .. }
            | Self::FollowerVelocity { joint, .. }
            | Self::FollowerOutside { joint, .. }
            | Self::ManyTurns { joint, .. }
            | Self::ContinuousRange { joint, .. }
            | Self::LongSlide { joint, .. }
            | Self::FastSlide { joint, .. }
            | Self::ZeroLimit { joint, .. }
            | Self::NoEffortLimit { joint }
            | Self::AxisLength { joint, .. } => ("joint", joint),
            Self::TransmissionJoint { .. }
            | Self::CoupledTransmission { .. }
            | Self::Misspelt { .. }
            | Self::Misplaced { .. }
            | Self::Degrees { .. }
            | Self::Implausible { .. }
            | Self::NoSize { .. }
            | Self::OversizedObject { .. }
            | Self::UnreadableMesh { .. }
            | Self::Ignored { .. } => return None,
        };
        let (defect, of_several) = match self {
            Self::MissingMesh { .. } => ("meshes not found".to_owned(), "meshes not found".to_owned()),
            Self::NoInertia { .. } => {
                let several = "nothing beyond has inertia: kinematics work, but their forward dynamics is impossible; \
                            give the links an <inertial>";
                (several.to_owned(), several.to_owned())
            }
            Self::Oversized { .. } => {
                let several = "lengths of more than 20 m; if those in the file are millimetres, divide them by 1000 and \
                              inertias by 1e6";
                (several.to_owned(), several.to_owned())
            }
            Self::TinyInertia { .. } => {
                let several = "rotational inertias are too small for their masses, even for balls of osmium; give each \
                              <inertia> in kg m2";
                (several.to_owned(), several.to_owned())
            }
            Self::NotPositiveDefinite { .. } => {
                let several = "rotational inertias are not positive definite";
                (several.to_owned(), several.to_owned())
            }
            Self::TriangleInequality { .. } => {
                let several = "rotational inertias break the triangle inequality: the largest exceeds the sum of the others";
                (several.to_owned(), several.to_owned())
            }
            other => {
                let text = other.to_string();
                let several = text.split_once("\": ")?.1.to_owned();
                (several.clone(), several)
            }
        };
        Some(Shared { part, name, defect, of_several })
    }
}

/// Formats a moment of inertia with readable digits.
fn moment(value: f64) -> String {
    let readable = value == 0.0 || (1e-6..1e9).contains(&value.abs());
    if readable { value.to_string() } else { format!("{value:.1e}") }
}

/// Formats the position of an element in the file at hand.
fn line(at: Option<Position>) -> String {
    at.map_or_else(String::new, |at| format!(" (line {}, column {})", at.line, at.column))
}

/// Formats the position of a reference.
fn reference(at: &Option<FilePosition>) -> String {
    at.as_ref().map_or_else(String::new, |at| format!(" ({at})"))
}

/// Returns the remedy for a mesh file that cannot be read; empty if the fault itself has it.
fn advice(error: &MeshError) -> &'static str {
    match error.problem {
        MeshProblem::Format => "",
        _ => "; expected a complete .stl, .obj or .dae file; export it again",
    }
}

fn in_all(count: usize) -> String {
    if count == 1 { String::new() } else { format!(", {count} in all") }
}

/// Largest number of missing meshes that one message names.
const NAMED_MESHES: usize = 3;

/// Names several missing meshes with their places; `None` for fewer than two files.
fn missing_meshes(warnings: &[&ModelWarning]) -> Option<String> {
    let mut missing: Vec<(&str, &[std::path::PathBuf], &Option<FilePosition>)> = Vec::new();
    for warning in warnings {
        if let ModelWarning::MissingMesh { uri, tried, at, .. } = warning
            && !missing.iter().any(|(known, ..)| known == uri)
        {
            missing.push((uri, tried, at));
        }
    }
    let [(uri, tried, _), _, ..] = missing[..] else { return None };
    let named: Vec<String> =
        missing.iter().take(NAMED_MESHES).map(|(uri, _, at)| format!("\"{uri}\"{}", reference(at))).collect();
    let others = match missing.len() - named.len() {
        0 => String::new(),
        others => format!(" and {others} more"),
    };
    Some(format!("meshes {}{others} not found{}", named.join(", "), searched(uri, tried, &None)))
}

fn searched(uri: &str, tried: &[std::path::PathBuf], at: &Option<FilePosition>) -> String {
    let at = reference(at);
    if tried.is_empty() {
        return at;
    }
    // without a name, a path means the working directory
    let shown = |path: &std::path::PathBuf| match path.display().to_string() {
        path if path.is_empty() => ".".to_owned(),
        path => path,
    };
    let folders = tried.iter().map(shown).collect::<Vec<_>>().join(", ");
    if !["package://", "model://"].iter().any(|package| uri.starts_with(package)) {
        return format!(" in {folders}{at}");
    }
    format!(
        " in {folders}{at}; name the folder of its package by `package_path` of the robot in a graph, --package-path of `motorium \
         robot`, or ROS_PACKAGE_PATH"
    )
}
