//! SDF elements that a world cannot contain, and the treatment of each element. Elements without an entry are
//! rejected.

use roxmltree::Node;

use super::values::{child, is_false, is_true, text};

/// Treatment of an unread element.
#[derive(Clone, Copy, Debug)]
pub(super) enum Treatment {
    /// No effect on a world.
    NoEffect,
    /// Affects the motion in other simulators: ignored with a warning that states this reason.
    Ignored(&'static str),
    /// Essential to the motion: rejected with this reason.
    Refused(&'static str),
}

use Treatment::{Ignored, NoEffect, Refused};

type Table = &'static [(Treatment, &'static [&'static str])];

const PLUGIN: (Treatment, &[&str]) = (Ignored("plugins of Gazebo are not run"), &["plugin"]);
const WIND: (Treatment, &[&str]) =
    (Ignored("wind acts only on objects with a `drag`, a key of TOML worlds"), &["enable_wind"]);

const WORLD: Table = &[
    (NoEffect, &["scene", "light", "gui", "audio", "spherical_coordinates", "magnetic_field"]),
    (NoEffect, &["atmosphere"]),
    PLUGIN,
    (Refused("it moves models; write the poses into the models"), &["state"]),
    (Refused("an actor follows a trajectory, but objects move freely"), &["actor"]),
];

const MODEL: Table = &[(NoEffect, &["allow_auto_disable", "self_collide"]), PLUGIN, WIND];

const LINK: Table = &[
    (NoEffect, &["visual", "sensor", "light", "audio_sink", "audio_source", "battery"]),
    (NoEffect, &["self_collide", "must_be_base_link"]),
    WIND,
    (Ignored("objects have no velocity damping"), &["velocity_decay"]),
];

const INERTIAL: Table = &[
    (NoEffect, &["mass", "pose", "inertia", "density"]),
    (Ignored("objects have no added mass"), &["fluid_added_mass"]),
    AUTO_PARAMETERS,
];

const COLLISION: Table = &[(NoEffect, &["max_contacts", "laser_retro"]), AUTO_PARAMETERS];

const AUTO_PARAMETERS: (Treatment, &[&str]) =
    (Ignored("a mesh has the inertia of its volume"), &["auto_inertia_params"]);

/// Elements at any depth below `<surface>`.
const SURFACE: Table = &[
    (NoEffect, &["contact", "bounce", "ode", "bullet", "mu", "restitution_coefficient"]),
    (NoEffect, &["dart", "soft_contact", "max_vel", "soft_erp"]),
    (Ignored("the `mu` of <ode> is used instead"), &["friction"]),
    (Ignored("any approach rebounds"), &["threshold"]),
    (Ignored("friction is the same in all directions; only `mu` is used"), &["mu2", "fdir1"]),
    (Ignored("contacts have no slip in proportion to the force"), &["slip", "slip1", "slip2"]),
    (Ignored("the friction of <ode> is used instead"), &["friction2", "rolling_friction"]),
    (Ignored("resistance to spinning comes only from friction at the contact points"), &["torsional"]),
    (NoEffect, &["coefficient", "use_patch_radius", "patch_radius", "surface_radius"]),
    (Ignored("contacts are rigid"), &["kp", "kd", "soft_cfm", "min_depth", "elastic_modulus"]),
    (Ignored("contacts are rigid"), &["split_impulse", "split_impulse_penetration_threshold"]),
    (Ignored("objects are rigid"), &["bone_attachment", "stiffness", "damping", "flesh_mass_fraction"]),
    (
        Refused("all objects of a world touch; leave the model out"),
        &[
            "collide_without_contact",
            "collide_without_contact_bitmask",
            "collide_bitmask",
            "category_bitmask",
        ],
    ),
    (NoEffect, &["poissons_ratio"]),
];

/// The treatment of an element of a section; `None` for an unknown one.
pub(super) fn treatment(section: &str, element: &str) -> Option<Treatment> {
    let table = match section {
        "world" => WORLD,
        "model" => MODEL,
        "link" => LINK,
        "inertial" => INERTIAL,
        "collision" => COLLISION,
        _ => SURFACE,
    };
    let group = table.iter().find(|(_, elements)| elements.contains(&element));
    group.map(|(treatment, _)| *treatment)
}

/// Elements that occur once in the element around them.
pub(super) const ONCE: &[&str] = &[
    "gravity",
    "wind",
    "linear_velocity",
    "static",
    "pose",
    "inertial",
    "mass",
    "density",
    "inertia",
    "ixx",
    "iyy",
    "izz",
    "ixy",
    "ixz",
    "iyz",
    "geometry",
    "size",
    "radius",
    "length",
    "normal",
    "uri",
    "scale",
    "surface",
    "friction",
    "ode",
    "mu",
    "mu2",
    "bounce",
    "restitution_coefficient",
    "threshold",
    "contact",
];

/// Elements whose contents are not read.
pub(super) const ANY: &[&str] = &["plugin", "gui", "scene", "light", "sensor", "visual", "actor", "state"];

/// The plugins of Gazebo that run a world, not the motion of its models.
const SYSTEMS: [&str; 7] = [
    "physics-system",
    "user-commands",
    "scene-broadcaster",
    "sensors-system",
    "contact-system",
    "imu-system",
    "gazebo_ros",
];

/// Returns `true` for an element at its default, or with the value that objects have.
pub(super) fn has_no_effect(node: Node<'_, '_>) -> bool {
    let value = text(node);
    let (value, number) = (value.trim(), value.trim().parse::<f64>().ok());
    let parent = node.parent();
    let sibling = |name: &str| parent.and_then(|parent| child(parent, name)).map(text);
    match node.tag_name().name() {
        "plugin" => {
            let file = node.attribute("filename").unwrap_or_default();
            parent.is_some_and(|parent| parent.tag_name().name() == "world")
                && SYSTEMS.iter().any(|system| file.contains(system))
        }
        "enable_wind" => is_false(value),
        "velocity_decay" => {
            node.children().filter(Node::is_element).all(|part| text(part).trim().parse() == Ok(0.0))
        }
        "collide_without_contact" => is_false(value),
        "collide_without_contact_bitmask" => is_true(value),
        "collide_bitmask" | "category_bitmask" => value == "65535" || value.eq_ignore_ascii_case("0xffff"),
        "mu2" => number.is_some() && number == sibling("mu").map_or(Some(1.0), |mu| mu.trim().parse().ok()),
        "fdir1" => value.split_whitespace().all(|part| part.parse() == Ok(0.0)),
        "slip1" | "slip2" | "slip" | "threshold" | "soft_cfm" | "min_depth" => number == Some(0.0),
        "kp" => number.is_some_and(|kp| kp >= 1e12),
        "kd" => number == Some(0.0) || number == Some(1.0),
        "elastic_modulus" => number.is_some_and(|modulus| modulus <= 0.0),
        // the group of coefficients of a surface, not the coefficient of Bullet
        "friction" => parent.is_some_and(|parent| parent.tag_name().name() == "surface"),
        _ => false,
    }
}

/// Returns what a user can do instead of an unsupported element.
pub(super) fn advice(element: &str) -> &'static str {
    match element {
        "include" => "copy the model into this file",
        "heightmap" => "write the world in TOML, where `terrain` reads an image",
        "cone" | "ellipsoid" | "polyline" | "image" => "use a <mesh> or another primitive",
        "frame" => "write each <pose> relative to the enclosing element",
        "model" => "make it a separate model, or make the outer model <static>",
        "population" => "write out the models",
        "empty" => "remove the <collision>",
        _ => "remove it, or write the world in TOML",
    }
}
