//! `<compiler>`: how the numbers of the file are meant.

use std::path::PathBuf;

use roxmltree::Node;

use super::attributes::Attributes;
use super::error::{MjcfError, MjcfProblem};

/// When the inertia of a body comes from its geoms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FromGeoms {
    Never,
    Missing,
    Always,
}

#[derive(Clone, Debug)]
pub(super) struct Compiler {
    /// Radians per unit of angle.
    pub(super) angle: f64,
    /// Axes of `euler`, capital for those of the world.
    pub(super) sequence: [char; 3],
    pub(super) auto_limits: bool,
    pub(super) from_geoms: FromGeoms,
    pub(super) mesh_folder: PathBuf,
    /// What all bodies weigh together, if it is said \[kg\].
    pub(super) total_mass: Option<f64>,
}

impl Compiler {
    pub(super) fn read(root: Node<'_, '_>, attributes: &Attributes<'_, '_>) -> Result<Self, MjcfError> {
        let mut compiler = Self {
            angle: std::f64::consts::PI / 180.0,
            sequence: ['x', 'y', 'z'],
            auto_limits: true,
            from_geoms: FromGeoms::Missing,
            mesh_folder: PathBuf::new(),
            total_mass: None,
        };
        for node in root.children().filter(|node| node.has_tag_name("compiler")) {
            for attribute in node.attributes() {
                let (name, value) = (attribute.name(), attribute.value());
                let refused = |reason| Err(attributes.refused(node, name, value, reason));
                match (name, value) {
                    ("angle", "degree") => compiler.angle = std::f64::consts::PI / 180.0,
                    ("angle", "radian") => compiler.angle = 1.0,
                    ("autolimits", "true" | "false") => compiler.auto_limits = value == "true",
                    ("inertiafromgeom", "true") => compiler.from_geoms = FromGeoms::Always,
                    ("inertiafromgeom", "false") => compiler.from_geoms = FromGeoms::Never,
                    ("inertiafromgeom", "auto") => compiler.from_geoms = FromGeoms::Missing,
                    ("meshdir" | "assetdir", _) => compiler.mesh_folder = PathBuf::from(value),
                    ("eulerseq", _) => {
                        let letters: Vec<char> = value.chars().collect();
                        match <[char; 3]>::try_from(letters) {
                            Ok(letters) if letters.iter().all(|letter| "xyzXYZ".contains(*letter)) => {
                                compiler.sequence = letters;
                            }
                            _ => {
                                let problem = "eulerseq is three of the letters x, y, z, X, Y, Z".to_owned();
                                return Err(attributes.error(node, MjcfProblem::Other(problem)));
                            }
                        }
                    }
                    ("coordinate", "local") => {}
                    ("coordinate", _) => return refused("local coordinates alone are read"),
                    ("settotalmass", _) => {
                        let total = attributes.parse(node, name, value, 1)?[0];
                        compiler.total_mass = (total > 0.0).then_some(total);
                    }
                    ("boundmass" | "boundinertia", _) => {
                        if attributes.parse(node, name, value, 1)?[0] > 0.0 {
                            return refused("it changes inertias; write the changed ones out");
                        }
                    }
                    ("balanceinertia", "true") => {
                        return refused("it changes inertias; write the changed ones out");
                    }
                    ("inertiagrouprange", _) => return refused("give the bodies an <inertial>"),
                    ("strippath", "true") => return refused("write the paths as they are"),
                    (
                        "balanceinertia" | "strippath" | "fitaabb" | "texturedir" | "discardvisual"
                        | "usethread" | "fusestatic" | "alignfree" | "exactmeshinertia" | "convexhull"
                        | "saveinertial",
                        _,
                    ) => {}
                    _ => return refused(""),
                }
            }
        }
        Ok(compiler)
    }
}
