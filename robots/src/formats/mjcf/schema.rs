//! Classification of the attributes of each element.
//!
//! An attribute that is missing in its table is rejected, both in an element and in a `<default>` class. An
//! attribute whose effect is not supported is only an error if its value has an effect:
//! `shellinertia="false"` is accepted.

/// Treatment of an attribute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Use {
    /// Supported.
    Read,
    /// No effect on a model: names, appearance, solver and contact parameters, user data.
    NoEffect,
    /// Changes the motion in MuJoCo by an effect that models do not represent; ignored with a warning that
    /// states this reason.
    Ignored(&'static str),
    /// Changes the result of reading; an error with this reason.
    Refused(&'static str),
}

/// Classification of the attributes of an element, grouped by their treatment.
pub struct Schema {
    /// Element of `<default>` that provides its defaults, if any.
    pub(crate) kind: &'static str,
    groups: &'static [(Use, &'static [&'static str])],
}

impl Schema {
    pub(crate) fn contains(&self, attribute: &str) -> bool {
        self.groups.iter().any(|(_, names)| names.contains(&attribute))
    }

    /// Attributes that are ignored, or rejected if they have an effect.
    pub(crate) fn exceptions(&self) -> impl Iterator<Item = (Use, &'static str)> {
        let groups =
            self.groups.iter().filter(|(treatment, _)| !matches!(treatment, Use::Read | Use::NoEffect));
        groups.flat_map(|(treatment, names)| names.iter().map(|name| (*treatment, *name)))
    }

    /// Returns the table of an element of `<default>`; `Err` for an element that is not allowed there.
    pub(crate) fn of_default(element: &str) -> Result<Option<&'static Self>, ()> {
        Ok(Some(match element {
            "joint" => &JOINT,
            "geom" => &GEOM,
            "site" => &SITE,
            "mesh" => &MESH,
            "material" => &MATERIAL,
            "equality" => &EQUALITY,
            "tendon" => &TENDON,
            _ if ACTUATORS.contains(&element) => &ACTUATOR,
            // no quantity depends on them
            "camera" | "light" | "texture" | "pair" => return Ok(None),
            _ => return Err(()),
        }))
    }
}

/// Returns `true` if a value switches an attribute off: all zeros, "false", "auto" or "none".
pub fn is_off(value: &str) -> bool {
    let off = |word: &str| matches!(word, "false" | "auto" | "none") || word.parse() == Ok(0.0);
    value.split_whitespace().all(off)
}

/// Attributes that place an element; all after the first rotate it.
pub(crate) const POSE: [&str; 6] = ["pos", "quat", "axisangle", "xyaxes", "zaxis", "euler"];

/// Elements of `<actuator>`.
pub(crate) const ACTUATORS: [&str; 12] = [
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "orientation",
    "pid",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
    "dcmotor",
];

const CONTACT: &str = "this contact force is not supported";

/// Attributes of `<body>`.
pub const BODY: Schema = Schema {
    kind: "",
    groups: &[
        (Use::Read, &POSE),
        (Use::Read, &["name", "childclass"]),
        (Use::NoEffect, &["user", "sleep", "simple", "fuse"]),
        (Use::Refused("mocap bodies are not part of a robot"), &["mocap"]),
        (Use::Refused("gravity compensation is not supported; add it to the controller"), &["gravcomp"]),
    ],
};

/// Attributes of `<frame>`.
pub const FRAME: Schema =
    Schema { kind: "", groups: &[(Use::Read, &POSE), (Use::Read, &["name", "childclass"])] };

pub(crate) const INERTIAL: Schema =
    Schema { kind: "", groups: &[(Use::Read, &POSE), (Use::Read, &["mass", "diaginertia", "fullinertia"])] };

/// Attributes of `<freejoint>`.
pub const FREEJOINT: Schema =
    Schema { kind: "", groups: &[(Use::Read, &["name", "align"]), (Use::NoEffect, &["group"])] };

/// Attributes of `<joint>`.
pub const JOINT: Schema = Schema {
    kind: "joint",
    groups: &[
        (Use::Read, &["name", "class", "type", "pos", "axis", "ref", "range", "limited", "align"]),
        (Use::Read, &["actuatorfrcrange", "actuatorfrclimited"]),
        (Use::Read, &["damping", "frictionloss", "armature"]),
        (Use::Read, &["stiffness", "springdamper", "springref", "springyield"]),
        // affects soft limits, or gravity compensation, which is rejected
        (Use::NoEffect, &["margin", "actuatorgravcomp"]),
        (Use::NoEffect, &["solreflimit", "solimplimit", "solreffriction", "solimpfriction", "group", "user"]),
    ],
};

/// Attributes of `<geom>`.
pub const GEOM: Schema = Schema {
    kind: "geom",
    groups: &[
        (Use::Read, &POSE),
        (Use::Read, &["name", "class", "type", "size", "fromto", "mesh", "contype", "conaffinity"]),
        (Use::Read, &["mass", "density", "shellinertia", "group"]),
        // Contact parameters: each simulator has its own.
        (Use::NoEffect, &["condim", "priority", "friction", "solmix", "solref", "solimp", "margin", "gap"]),
        // Appearance, for viewers.
        (Use::Read, &["rgba", "material"]),
        (Use::NoEffect, &["castshadow", "user", "fluidcoef"]),
        // Affects primitives fitted to meshes and height fields, which are rejected.
        (Use::NoEffect, &["fitscale", "hfield"]),
        (Use::Ignored(CONTACT), &["adhesion", "surfacevel"]),
        (Use::Ignored("fluid forces on a robot are not supported"), &["fluidshape"]),
    ],
};

pub(crate) const SITE: Schema = Schema {
    kind: "site",
    groups: &[
        (Use::Read, &POSE),
        (Use::Read, &["name", "class", "fromto"]),
        (Use::NoEffect, &["type", "size", "mesh", "group", "material", "rgba", "user"]),
    ],
};

pub(crate) const MESH: Schema = Schema {
    kind: "mesh",
    groups: &[
        (Use::Read, &["name", "class", "file", "scale", "vertex", "face"]),
        (Use::NoEffect, &["normal", "texcoord"]),
        // Mesh inertia is rejected if a robot needs it, or if an object needs it and it differs from the
        // solid's.
        (Use::Read, &["inertia"]),
        (Use::NoEffect, &["smoothnormal", "maxhullvert", "content_type", "material"]),
        (Use::Refused("move the mesh in its file, or move the geom"), &["refpos", "refquat"]),
        (Use::Refused("write the mesh to a file"), &["builtin", "params"]),
    ],
};

pub(crate) const MATERIAL: Schema = Schema {
    kind: "material",
    groups: &[
        (Use::Read, &["name", "class", "rgba"]),
        (Use::NoEffect, &["texture", "texrepeat", "texuniform"]),
        (Use::NoEffect, &["emission", "specular", "shininess", "reflectance", "metallic", "roughness"]),
    ],
};

pub(crate) const EQUALITY: Schema = Schema {
    kind: "equality",
    groups: &[
        (Use::Read, &["name", "class", "active", "joint1", "joint2", "polycoef"]),
        (Use::NoEffect, &["solref", "solimp"]),
    ],
};

/// Attributes of `<connect>` and `<weld>` between bodies.
pub const HELD: Schema = Schema {
    kind: "equality",
    groups: &[
        (Use::Read, &["name", "class", "active", "body1", "body2", "anchor", "relpose"]),
        (Use::NoEffect, &["solref", "solimp", "torquescale"]),
        (Use::Refused("refer to bodies, with body1 and body2"), &["site1", "site2"]),
    ],
};

/// Attributes of `<hfield>`.
pub const HFIELD: Schema = Schema {
    kind: "",
    groups: &[
        (Use::Read, &["name", "file", "nrow", "ncol", "size", "elevation"]),
        (Use::NoEffect, &["content_type"]),
    ],
};

pub(crate) const TENDON: Schema = Schema {
    kind: "tendon",
    groups: &[
        (
            Use::NoEffect,
            &["name", "class", "group", "limited", "actuatorfrclimited", "margin", "springlength"],
        ),
        (Use::NoEffect, &["springyield", "solreflimit", "solimplimit", "solreffriction", "solimpfriction"]),
        (Use::NoEffect, &["material", "rgba", "width", "user"]),
        (
            Use::Ignored("tendons are not part of a model"),
            &["stiffness", "damping", "frictionloss", "range", "actuatorfrcrange"],
        ),
        (
            Use::Refused("it couples the joints in the mass matrix; give each joint an armature"),
            &["armature"],
        ),
    ],
};

pub(crate) const ACTUATOR: Schema = Schema {
    kind: "actuator",
    groups: &[
        (Use::Read, &["name", "class", "joint", "jointinparent", "gear", "armature", "damping"]),
        (Use::Read, &["kp", "kv", "dampratio", "gaintype", "gainprm", "biastype", "biasprm"]),
        (Use::Read, &["forcelimited", "forcerange"]),
        (Use::NoEffect, &["tendon", "site", "refsite", "body", "cranksite", "slidersite", "cranklength"]),
        (Use::NoEffect, &["group", "user", "ctrllimited", "ctrlrange"]),
        (Use::NoEffect, &["actlimited", "actrange", "actdim", "actearly", "inheritrange", "lengthrange"]),
        (Use::NoEffect, &["dyntype", "dynprm", "input"]),
        (Use::NoEffect, &["ki", "imax", "slewmax", "posrange", "velrange", "ffrange"]),
        (Use::NoEffect, &["timeconst", "delay", "nsample", "interp", "area", "diameter", "bias", "gain"]),
        (Use::NoEffect, &["range", "force", "scale", "lmin", "lmax", "vmax", "fpmax", "fvmax", "tausmooth"]),
        (Use::NoEffect, &["motorconst", "resistance", "inductance", "nominal", "saturation", "cogging"]),
        (Use::NoEffect, &["lugre", "thermal", "controller"]),
    ],
};

pub(crate) const EXCLUDE: Schema = Schema { kind: "", groups: &[(Use::Read, &["name", "body1", "body2"])] };

/// Attributes of `<option>`.
pub const OPTION: Schema = Schema {
    kind: "",
    groups: &[
        (Use::Read, &["gravity"]),
        (Use::NoEffect, &["timestep", "integrator", "impratio", "cone", "jacobian", "solver", "iterations"]),
        (
            Use::NoEffect,
            &["tolerance", "ls_iterations", "ls_tolerance", "noslip_iterations", "noslip_tolerance"],
        ),
        (Use::NoEffect, &["ccd_iterations", "ccd_tolerance", "mpr_iterations", "mpr_tolerance", "collision"]),
        (
            Use::NoEffect,
            &["sdf_iterations", "sdf_initpoints", "sleep_tolerance", "apirate", "magnetic", "wind"],
        ),
        (Use::NoEffect, &["o_margin", "o_solref", "o_solimp", "o_friction", "actuatorgroupdisable"]),
        (Use::Ignored("fluid forces on a robot are not supported"), &["density", "viscosity"]),
    ],
};
