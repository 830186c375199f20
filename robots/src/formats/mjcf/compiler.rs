//! `<compiler>`: units, conventions and rules for the rest of the file.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use roxmltree::Node;

use super::attributes::Attributes;
use super::error::{MjcfError, MjcfProblem};

/// Selection of the bodies whose inertia is computed from their geoms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FromGeoms {
    Never,
    Missing,
    Always,
}

/// The unit of angles in files with `angle="radian"`.
pub(super) const RADIANS: &str = "the file has angle=\"radian\"";

/// Settings of `<compiler>`.
#[derive(Clone, Debug)]
pub struct Compiler {
    /// Size of the unit of angle \[rad\].
    pub(crate) angle: f64,
    /// Axes of `euler`; upper case means world axes.
    pub(crate) sequence: [char; 3],
    pub(crate) auto_limits: bool,
    pub(crate) from_geoms: FromGeoms,
    /// Groups of the geoms used for inertias.
    pub(crate) groups: RangeInclusive<f64>,
    /// `true` if base frames of free bodies without children move to their centre of mass.
    pub(crate) align_free: bool,
    /// Folder of mesh files, relative to the file.
    pub mesh_folder: PathBuf,
    /// `true` if only the last part of a mesh's path is used (`strippath`).
    pub strip_path: bool,
    /// Total mass that the file sets for all moving and static bodies together \[kg\]; `None` if the file
    /// does not set it.
    pub total_mass: Option<f64>,
}

impl Compiler {
    /// Reads the settings from the children of the root element.
    ///
    /// # Errors
    /// An attribute is not supported, or a value is malformed.
    pub fn read(root: Node<'_, '_>, attributes: &Attributes<'_, '_>) -> Result<Self, MjcfError> {
        let mut compiler = Self {
            angle: std::f64::consts::PI / 180.0,
            sequence: ['x', 'y', 'z'],
            auto_limits: true,
            from_geoms: FromGeoms::Missing,
            groups: 0.0..=5.0,
            align_free: false,
            mesh_folder: PathBuf::new(),
            strip_path: false,
            total_mass: None,
        };
        let mut mesh_folder = None;
        for node in root.children().filter(|node| node.has_tag_name("compiler")) {
            if let Some(inside) =
                node.children().find(|child| child.is_element() && !child.has_tag_name("lengthrange"))
            {
                let problem = MjcfProblem::Element(format!("{}> of <compiler", inside.tag_name().name()));
                return Err(attributes.error(inside, problem));
            }
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
                    ("assetdir", _) => compiler.mesh_folder = PathBuf::from(value),
                    ("meshdir", _) => mesh_folder = Some(PathBuf::from(value)),
                    ("strippath", "true" | "false") => compiler.strip_path = value == "true",
                    ("alignfree", "true" | "false") => compiler.align_free = value == "true",
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
                    ("coordinate", _) => return refused("only local coordinates are supported"),
                    ("settotalmass", _) => {
                        let total = attributes.parse(node, name, value, 1..=1)?[0];
                        compiler.total_mass = (total > 0.0).then_some(total);
                    }
                    ("boundmass" | "boundinertia", _) => {
                        if attributes.parse(node, name, value, 1..=1)?[0] > 0.0 {
                            return refused("it changes inertias; write the resulting inertias to the file");
                        }
                    }
                    ("balanceinertia", "true") => {
                        return refused("it changes inertias; write the resulting inertias to the file");
                    }
                    ("inertiagrouprange", _) => {
                        let range = attributes.parse(node, name, value, 2..=2)?;
                        compiler.groups = range[0]..=range[1];
                    }
                    // affects mesh inertia (which is rejected), appearance, speed or MuJoCo's output
                    (
                        "balanceinertia" | "fitaabb" | "texturedir" | "discardvisual" | "usethread"
                        | "fusestatic" | "exactmeshinertia" | "convexhull" | "saveinertial" | "savecompiled"
                        | "savecanonical" | "conflict" | "passthrough",
                        _,
                    ) => {}
                    _ => return refused(""),
                }
            }
        }
        compiler.mesh_folder = mesh_folder.unwrap_or(compiler.mesh_folder);
        Ok(compiler)
    }
}
