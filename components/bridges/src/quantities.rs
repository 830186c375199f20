//! Units and entry names for the fields of built-in topic types.

use motorium::plan::Plan;

use crate::foxglove::joints_of_topic;

/// Unit and entry names of a field.
///
/// ```
/// use motorium_bridges::quantities::quantity;
///
/// let force = quantity("motorium.Wrench", "force").unwrap();
/// assert_eq!((force.unit, force.axes), ("N", &["x", "y", "z"][..]));
/// assert!(quantity("lab.Wrench", "force").is_none(), "types of others say nothing of their units");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quantity {
    /// Unit; empty for dimensionless numbers.
    pub unit: &'static str,
    /// Names of the entries of an array; empty if the entries have no names.
    pub axes: &'static [&'static str],
}

const XYZ: &[&str] = &["x", "y", "z"];
const XY: &[&str] = &["x", "y"];
const XYZW: &[&str] = &["x", "y", "z", "w"];
const EAST: &[&str] = &["east", "north", "up"];
const NONE: &[&str] = &[];

/// Name of a field, its unit, and the names of its entries.
type Row = (&'static str, &'static str, &'static [&'static str]);

/// Floating-point fields of each type.
const TABLE: &[(&str, &[Row])] = &[
    (
        "JointState",
        &[("position", "rad or m", NONE), ("velocity", "rad/s or m/s", NONE), ("effort", "N m or N", NONE)],
    ),
    (
        "JointCommand",
        &[
            ("position", "rad or m", NONE),
            ("velocity", "rad/s or m/s", NONE),
            ("effort", "N m or N", NONE),
            ("kp", "N m/rad or N/m", NONE),
            ("kd", "N m s/rad or N s/m", NONE),
        ],
    ),
    (
        "BaseState",
        &[
            ("position", "m", XYZ),
            ("orientation", "", XYZW),
            ("linear_velocity", "m/s", XYZ),
            ("angular_velocity", "rad/s", XYZ),
        ],
    ),
    (
        "BaseEstimate",
        &[
            ("position", "m", XYZ),
            ("orientation", "", XYZW),
            ("linear_velocity", "m/s", XYZ),
            ("angular_velocity", "rad/s", XYZ),
            ("gyroscope_bias", "rad/s", XYZ),
            ("accelerometer_bias", "m/s^2", XYZ),
            ("covariance", "", NONE),
            ("bias_deviation", "", NONE),
        ],
    ),
    (
        "PoseTarget",
        &[
            ("position", "m", XYZ),
            ("orientation", "", XYZW),
            ("linear_velocity", "m/s", XYZ),
            ("angular_velocity", "rad/s", XYZ),
        ],
    ),
    (
        "MotionGoal",
        &[
            ("position", "m", XYZ),
            ("orientation", "", XYZW),
            ("duration", "s", NONE),
            ("joint", "rad or m", NONE),
        ],
    ),
    ("GoalStatus", &[("progress", "", NONE), ("remaining", "s", NONE), ("error", "rad or m", NONE)]),
    ("TwistTarget", &[("linear", "m/s", XYZ), ("angular", "rad/s", XYZ)]),
    (
        "Odometry",
        &[
            ("position", "m", XY),
            ("yaw", "rad", NONE),
            ("velocity", "m/s", XY),
            ("yaw_rate", "rad/s", NONE),
            ("covariance", "", NONE),
            ("distance", "m", NONE),
        ],
    ),
    ("Wrench", &[("force", "N", XYZ), ("torque", "N m", XYZ)]),
    (
        "ImuSample",
        &[("specific_force", "m/s^2", XYZ), ("angular_velocity", "rad/s", XYZ), ("orientation", "", XYZW)],
    ),
    ("Phase", &[("phase", "rad or 1", NONE), ("rate", "rad/s or 1/s", NONE), ("amplitude", "", NONE)]),
    (
        "Contacts",
        &[
            ("position_x", "m", NONE),
            ("position_y", "m", NONE),
            ("position_z", "m", NONE),
            ("force_x", "N", NONE),
            ("force_y", "N", NONE),
            ("force_z", "N", NONE),
            ("depth", "m", NONE),
        ],
    ),
    (
        "ContactImpulses",
        &[
            ("impulse_x", "N s", NONE),
            ("impulse_y", "N s", NONE),
            ("impulse_z", "N s", NONE),
            ("moment_x", "N m s", NONE),
            ("moment_y", "N m s", NONE),
            ("moment_z", "N m s", NONE),
        ],
    ),
    ("FootContacts", &[("force", "N", NONE)]),
    ("ContactSchedule", &[("ground_normal", "", NONE), ("load", "", NONE)]),
    (
        "ObjectPoses",
        &[
            ("position_x", "m", NONE),
            ("position_y", "m", NONE),
            ("position_z", "m", NONE),
            ("orientation_x", "", NONE),
            ("orientation_y", "", NONE),
            ("orientation_z", "", NONE),
            ("orientation_w", "", NONE),
        ],
    ),
    ("Ranges", &[("least", "m", NONE), ("most", "m", NONE), ("range", "m", NONE)]),
    (
        "HeightScan",
        &[("spacing", "m", NONE), ("least", "m", NONE), ("most", "m", NONE), ("height", "m", NONE)],
    ),
    (
        "GeoFix",
        &[
            ("latitude", "degrees", NONE),
            ("longitude", "degrees", NONE),
            ("altitude", "m", NONE),
            ("velocity", "m/s", EAST),
            ("position_deviation", "m", EAST),
            ("velocity_deviation", "m/s", EAST),
        ],
    ),
    ("Altitude", &[("height", "m", NONE), ("rate", "m/s", NONE)]),
    ("MagneticField", &[("field", "T", XYZ)]),
    (
        "ControlDiagnostics",
        &[
            ("contact_slack", "m/s^2 or rad/s^2", NONE),
            ("joint_slack", "rad/s^2 or m/s^2", NONE),
            ("residual", "", NONE),
        ],
    ),
    ("ImageInfo", &[("focal_length", "pixels", XY), ("principal_point", "pixels", XY)]),
    ("CloudPoint", &[("x", "m", NONE), ("y", "m", NONE), ("z", "m", NONE), ("intensity", "", NONE)]),
    ("BusHealth", &[("load", "", NONE)]),
    ("Weights", &[("value", "", NONE)]),
    ("Observation", &[("value", "", NONE)]),
    ("Action", &[("value", "", NONE)]),
    ("ActionChunk", &[("value", "", NONE)]),
    ("Reward", &[("reward", "", NONE), ("total", "", NONE)]),
    ("Randomisation", &[("value", "", NONE)]),
    ("Controls", &[("axis", "", NONE)]),
    ("Event", &[("value", "", NONE)]),
];

/// Returns the unit and entry names of a field of a built-in type. Returns `None` for types that are not
/// built in, and for integer fields.
pub fn quantity(type_name: &str, field: &str) -> Option<Quantity> {
    let type_name = type_name.strip_prefix("motorium.")?;
    let (_, fields) = TABLE.iter().find(|(name, _)| *name == type_name)?;
    let (_, unit, axes) = fields.iter().find(|(name, ..)| *name == field)?;
    Some(Quantity { unit, axes })
}

/// Returns the names of the entries of a field: the joints of the topic's robot, or axes. Returns an empty
/// list if the entries have no names.
///
/// ```
/// # fn of(plan: &motorium::plan::Plan) {
/// for (entry, name) in motorium_bridges::quantities::entries(plan, 0, "position").iter().enumerate() {
///     println!("{entry}: {name}");
/// }
/// # }
/// ```
pub fn entries(plan: &Plan, topic: usize, field: &str) -> Vec<String> {
    let Some(type_name) = plan.topics.get(topic).map(|topic| topic.layout.type_name.as_str()) else {
        return Vec::new();
    };
    if type_name.starts_with("motorium.Joint") {
        return joints_of_topic(plan, topic).unwrap_or_default();
    }
    quantity(type_name, field)
        .map_or_else(Vec::new, |it| it.axes.iter().map(|axis| (*axis).to_string()).collect())
}

#[cfg(test)]
mod tests {
    use motorium::state::built_in;

    use super::*;

    /// Length of an array such as `[f64; 3]`.
    fn length(kind: &str) -> Option<usize> {
        kind.strip_suffix(']')?.rsplit_once("; ")?.1.parse().ok()
    }

    #[test]
    fn every_float_field_of_built_in_types_has_a_quantity() {
        for layout in built_in() {
            for field in
                layout.fields.iter().filter(|field| field.kind.contains("f64") || field.kind.contains("f32"))
            {
                let found = quantity(&layout.type_name, &field.name);
                let found =
                    found.unwrap_or_else(|| panic!("{}.{}: no quantity", layout.type_name, field.name));
                let wanted = length(&field.kind);
                assert!(
                    found.axes.is_empty() || wanted == Some(found.axes.len()),
                    "{}.{}: {:?} of {}",
                    layout.type_name,
                    field.name,
                    found.axes,
                    field.kind
                );
            }
        }
    }

    #[test]
    fn every_quantity_belongs_to_a_field() {
        for (type_name, fields) in TABLE {
            let layouts = built_in();
            let layout = layouts.iter().find(|layout| layout.type_name == format!("motorium.{type_name}"));
            let layout = layout.unwrap_or_else(|| panic!("no type {type_name}"));
            for (name, ..) in *fields {
                assert!(layout.fields.iter().any(|field| field.name == *name), "{type_name} has no {name}");
            }
        }
    }
}
