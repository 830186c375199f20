//! SDF elements that a world cannot contain, and their treatment. Elements without an entry are rejected.

/// Treatment of an unread element.
#[derive(Clone, Copy, Debug)]
pub(super) enum Treatment {
    /// No effect on a world.
    NoEffect,
    /// Changes the motion elsewhere: a warning with this reason.
    Ignored(&'static str),
    /// Required for the motion: rejected with this reason.
    Refused(&'static str),
}

use Treatment::{Ignored, NoEffect, Refused};

type Table = &'static [(Treatment, &'static [&'static str])];

const WORLD: Table = &[
    (NoEffect, &["scene", "light", "gui", "plugin", "audio", "spherical_coordinates", "magnetic_field"]),
    (NoEffect, &["atmosphere"]),
    (Refused("it moves models; write the poses into the models"), &["state"]),
    (Refused("an actor follows a trajectory, and objects move freely"), &["actor"]),
];

const MODEL: Table = &[
    (NoEffect, &["plugin", "enable_wind", "allow_auto_disable"]),
    (Ignored("an object of one link does not touch itself"), &["self_collide"]),
];

const LINK: Table = &[
    (NoEffect, &["visual", "sensor", "light", "enable_wind", "audio_sink", "audio_source", "battery"]),
    (NoEffect, &["self_collide", "must_be_base_link"]),
    (Ignored("no such damping acts on an object"), &["velocity_decay"]),
];

const COLLISION: Table = &[
    (NoEffect, &["max_contacts", "laser_retro"]),
    (Ignored("the mass of a mesh is not computed here"), &["auto_inertia_params"]),
];

/// Elements at any depth below `<surface>`. Elements that are read, and defaults, are handled before.
const SURFACE: Table = &[
    (NoEffect, &["friction", "contact", "bounce", "ode", "bullet", "mu", "restitution_coefficient"]),
    (NoEffect, &["dart", "soft_contact", "min_depth", "max_vel", "soft_cfm", "soft_erp"]),
    (Ignored("any approach rebounds"), &["threshold"]),
    (Ignored("friction is the same in all directions; `mu` is read"), &["mu2", "fdir1"]),
    (Ignored("contacts here do not slip in proportion to a force"), &["slip", "slip1", "slip2"]),
    (Ignored("the friction of <ode> is read"), &["friction2", "rolling_friction"]),
    (Ignored("friction acts against turning by the contact points alone"), &["torsional"]),
    (NoEffect, &["coefficient", "use_patch_radius", "patch_radius", "surface_radius"]),
    (Ignored("contacts are rigid"), &["kp", "kd", "split_impulse", "split_impulse_penetration_threshold"]),
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
    (NoEffect, &["poissons_ratio", "elastic_modulus"]),
];

/// The treatment of an element of a section; `None` for an unknown one.
pub(super) fn treatment(section: &str, element: &str) -> Option<Treatment> {
    let table = match section {
        "world" => WORLD,
        "model" => MODEL,
        "link" => LINK,
        "collision" => COLLISION,
        _ => SURFACE,
    };
    let group = table.iter().find(|(_, elements)| elements.contains(&element));
    group.map(|(treatment, _)| *treatment)
}
