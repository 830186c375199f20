//! Geoms: shapes and their contribution to inertias.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::path::PathBuf;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Translation3, Vector3};
use roxmltree::Node;

use super::attributes::{Attributes, Element, named};
use super::compiler::Compiler;
use super::error::{MjcfError, MjcfProblem};
use super::pose::{between, pose};
use super::schema::GEOM;
use crate::nearest::nearest;
use crate::{Colour, Geometry, Inertia, ModelWarning, Shape, ShapeSource, TriangleMesh};

/// Side length and thickness of the box that represents an infinite plane of the world \[m\].
const PLANE: [f64; 2] = [100.0, 1.0];

/// Default density of geoms, the density of water \[kg/m3\].
pub const WATER: f64 = 1000.0;

/// Last geom group that is visible by default in MuJoCo's viewer.
const LAST_SEEN: f64 = 2.0;

/// Default red, green, blue and opacity of a geom. A geom with exactly this colour uses the colour of its
/// material.
const GREY: [f64; 4] = [0.5, 0.5, 0.5, 1.0];

const SHELL: &str = "shells are not supported; give the body an <inertial>";

/// A mesh of `<asset>`.
pub(crate) struct MeshAsset {
    pub(crate) uri: String,
    pub(crate) path: Option<PathBuf>,
    /// Folder searched for its file.
    pub(crate) folder: PathBuf,
    /// Mesh data contained in the file itself.
    pub(crate) inline: Option<Arc<TriangleMesh>>,
    pub(crate) scale: Vector3<f64>,
    /// Deferred error of an unsupported `inertia` attribute, reported if needed.
    pub(crate) not_solid: Option<MjcfError>,
}

/// A `<geom>` of an MJCF file.
pub struct Geom {
    /// Pose in the frame of its body.
    pub placement: Isometry3<f64>,
    /// Shape of the geom. A plane is represented by a box.
    pub geometry: Geometry,
    /// `contype` and `conaffinity`.
    pub masks: [i32; 2],
    /// `true` if the geom becomes a shape of the model.
    pub kept: bool,
    /// Colour of the geom or its material; `None` if neither sets a colour.
    pub colour: Option<Colour>,
    /// `true` if MuJoCo's viewer shows the geom by default.
    pub is_seen: bool,
    /// Inertia in the frame of the geom, or an error that is reported only if the inertia is used.
    pub inertia: Result<Inertia, MjcfError>,
}

/// A reader of geoms, with the meshes and materials that they refer to.
pub struct Geoms<'b, 'a, 'i> {
    /// Attributes of the file.
    pub attributes: &'b Attributes<'a, 'i>,
    /// Settings of the file.
    pub compiler: &'b Compiler,
    pub(crate) shapes: ShapeSource,
    pub(crate) meshes: HashMap<&'a str, MeshAsset>,
    /// Red, green, blue and opacity of the materials; `None` for texture-only materials.
    pub(crate) materials: HashMap<&'a str, Option<[f64; 4]>>,
}

impl<'b, 'a, 'i> Geoms<'b, 'a, 'i> {
    /// Creates a reader without meshes and materials; [`read_assets`](super::read_assets) adds them.
    pub fn new(attributes: &'b Attributes<'a, 'i>, compiler: &'b Compiler, shapes: ShapeSource) -> Self {
        Self { attributes, compiler, shapes, meshes: HashMap::new(), materials: HashMap::new() }
    }
}

impl<'a, 'i> Geoms<'_, 'a, 'i> {
    /// Reads a geom. `in_world` is `true` if its body does not move. `around` is the default class that the
    /// surrounding bodies set.
    ///
    /// # Errors
    /// A class, mesh or material is unknown, a shape is not supported, or a value is malformed.
    pub fn read(&self, node: Node<'a, 'i>, around: &'a str, in_world: bool) -> Result<Geom, MjcfError> {
        let geom = self.attributes.element(node, around, &GEOM)?;
        if let Some(inside) = node.children().find(Node::is_element) {
            let problem = MjcfProblem::Element(format!("{}> of <geom", inside.tag_name().name()));
            return Err(self.attributes.error(inside, problem));
        }
        let kind = geom.get("type").unwrap_or("sphere");
        let mut size = geom.first_numbers("size", [0.0; 3])?;
        let mut placement = match between(&geom)? {
            Some((placement, half)) => {
                match kind {
                    "capsule" | "cylinder" => size[1] = half,
                    "box" => size = [size[0], size[0], half],
                    _ => {
                        return Err(geom.refused("fromto", "only capsules, cylinders and boxes support it"));
                    }
                }
                placement
            }
            None => pose(&geom, self.compiler)?,
        };
        if geom.get("mesh").is_some() && kind != "mesh" {
            return Err(geom.refused("mesh", "primitives fitted to meshes are not supported"));
        }
        let wanted = match kind {
            "sphere" => 1,
            "capsule" | "cylinder" => 2,
            "box" => 3,
            _ => 0,
        };
        if size[..wanted].iter().any(|x| *x <= 0.0) {
            let (attribute, value) = ("size".to_owned(), geom.get("size").unwrap_or("").to_owned());
            let expected = format!("{wanted} numbers above 0 for a {kind}");
            return Err(geom.error(MjcfProblem::Number { element: named(node), attribute, value, expected }));
        }
        let geometry = match kind {
            "sphere" => Geometry::Sphere { radius: size[0] },
            "capsule" => Geometry::Capsule { radius: size[0], length: 2.0 * size[1] },
            "cylinder" => Geometry::Cylinder { radius: size[0], length: 2.0 * size[1] },
            "box" => Geometry::Box { size: Vector3::from(size) * 2.0 },
            "mesh" => self.mesh(&geom)?,
            "plane" if in_world => {
                let [x, y] = [size[0], size[1]].map(|half| if half > 0.0 { 2.0 * half } else { PLANE[0] });
                placement *= Translation3::new(0.0, 0.0, -0.5 * PLANE[1]);
                Geometry::Box { size: Vector3::new(x, y, PLANE[1]) }
            }
            "plane" => return Err(geom.refused("type", "planes are supported only in the world")),
            _ => return Err(geom.refused("type", "use a sphere, capsule, cylinder, box or mesh")),
        };
        let bits = |name| geom.number(name, 1.0).map(|bits| bits as i64 as i32);
        let masks = [bits("contype")?, bits("conaffinity")?];
        let group = geom.number("group", 0.0)?;
        let inertia = match self.compiler.groups.contains(&group) {
            true => self.inertia(&geom, kind, &geometry, &placement)?,
            false => Ok(Inertia::zero()),
        };
        let (colour, is_seen) = self.look(&geom)?;
        let kept = match self.shapes {
            ShapeSource::Collision => masks != [0, 0],
            ShapeSource::Visual => is_seen && kind != "plane",
        };
        Ok(Geom { placement, geometry, masks, kept, colour, is_seen, inertia })
    }

    /// Returns the colour of a geom or its material, and `true` if MuJoCo's viewer shows the geom by default.
    ///
    /// # Errors
    /// The material is unknown, or a value is malformed.
    pub fn look(&self, geom: &Element<'_, 'a, 'i>) -> Result<(Option<Colour>, bool), MjcfError> {
        let rgba = self.rgba(geom)?;
        let is_opaque = rgba.is_none_or(|[_, _, _, opacity]| opacity > 0.0);
        let is_seen = is_opaque && geom.number("group", 0.0)? <= LAST_SEEN;
        let colour = rgba.map(|[red, green, blue, _]| [red, green, blue].map(|part| part.clamp(0.0, 1.0)));
        Ok((colour, is_seen))
    }

    /// Returns red, green, blue and opacity as specified by the geom or its material.
    fn rgba(&self, geom: &Element<'_, 'a, 'i>) -> Result<Option<[f64; 4]>, MjcfError> {
        let own = geom.numbers::<4>("rgba")?;
        let Some(name) = geom.get("material") else { return Ok(own) };
        let Some(material) = self.materials.get(name) else {
            let nearest = nearest(name, self.materials.keys().copied()).map(str::to_owned);
            let (element, name) = (named(geom.node), name.to_owned());
            return Err(geom.error(MjcfProblem::Unknown { element, what: "material", name, nearest }));
        };
        Ok(own.filter(|own| *own != GREY).or(*material))
    }

    /// Returns the inertia of a geom. The inner error is reported only if the inertia is needed.
    fn inertia(
        &self,
        geom: &Element<'_, 'a, 'i>,
        kind: &str,
        geometry: &Geometry,
        placement: &Isometry3<f64>,
    ) -> Result<Result<Inertia, MjcfError>, MjcfError> {
        let density = geom.number("density", WATER)?;
        let mass = geom.numbers::<1>("mass")?.map(|[mass]| mass);
        for (name, value) in [("density", Some(density)), ("mass", mass)] {
            if value.is_some_and(|value| value < 0.0) {
                return Err(geom.refused(name, "it cannot be negative"));
            }
        }
        let shell = geom.flag("shellinertia", false)?;
        if kind == "plane" || mass.unwrap_or(density) == 0.0 {
            return Ok(Ok(Inertia::zero()));
        }
        if shell {
            return Ok(Err(geom.refused("shellinertia", SHELL)));
        }
        Ok(match solid(geometry) {
            Some((volume, per_mass)) => {
                let mass = mass.unwrap_or(density * volume);
                let rotational = Matrix3::from_diagonal(&(per_mass * mass));
                Ok(Inertia { mass, com: Vector3::zeros(), rotational }.moved(placement))
            }
            None => {
                let reason = "the inertia of meshes is not supported; give the body an <inertial>, or the geom mass=\"0\"";
                Err(geom.refused("type", reason))
            }
        })
    }

    /// Adds a warning for each mesh among these shapes whose file was not found.
    pub(crate) fn warn_of_missing_meshes<'s>(
        &self,
        shapes: impl Iterator<Item = &'s Shape>,
        warnings: &mut Vec<ModelWarning>,
    ) {
        for Shape { link, geometry, .. } in shapes {
            let Geometry::Mesh { uri, path: None, inline: None, .. } = geometry else { continue };
            let asset = self.meshes.values().find(|asset| asset.uri == *uri);
            let tried = asset.map(|asset| asset.folder.clone()).into_iter().collect();
            let (link, uri) = (link.clone(), uri.clone());
            let warning = ModelWarning::MissingMesh { link, uri, tried, at: None };
            if !warnings.contains(&warning) {
                warnings.push(warning);
            }
        }
    }

    /// Checks that the inertia of a geom is computed for a solid.
    ///
    /// # Errors
    /// The file requests that the inertia of the geom or its mesh is not computed for a solid, but for
    /// example for a shell.
    pub fn check_solid(&self, geom: &Element<'_, 'a, 'i>) -> Result<(), MjcfError> {
        if geom.flag("shellinertia", false)? {
            return Err(geom.refused("shellinertia", SHELL));
        }
        let asset = geom.get("mesh").and_then(|name| self.meshes.get(name));
        asset.and_then(|asset| asset.not_solid.clone()).map_or(Ok(()), Err)
    }

    fn mesh(&self, geom: &Element<'_, 'a, 'i>) -> Result<Geometry, MjcfError> {
        let name = geom.get("mesh").ok_or_else(|| geom.missing("mesh"))?;
        match self.meshes.get(name) {
            Some(MeshAsset { uri, path, inline, scale, .. }) => Ok(Geometry::Mesh {
                uri: uri.clone(),
                path: path.clone(),
                inline: inline.clone(),
                scale: *scale,
            }),
            None => {
                let nearest = nearest(name, self.meshes.keys().copied()).map(str::to_owned);
                let (element, name) = (named(geom.node), name.to_owned());
                Err(geom.error(MjcfProblem::Unknown { element, what: "mesh", name, nearest }))
            }
        }
    }
}

/// Returns the volume \[m3\] and the principal moments per mass \[m2\] of a solid primitive.
fn solid(geometry: &Geometry) -> Option<(f64, Vector3<f64>)> {
    Some(match *geometry {
        Geometry::Sphere { radius: r } => (4.0 / 3.0 * PI * r.powi(3), Vector3::repeat(0.4 * r * r)),
        Geometry::Box { size: s } => {
            let squares = s.component_mul(&s);
            (s.product(), (Vector3::repeat(squares.sum()) - squares) / 12.0)
        }
        Geometry::Cylinder { radius: r, length: h } => {
            let across = (3.0 * r * r + h * h) / 12.0;
            (PI * r * r * h, Vector3::new(across, across, 0.5 * r * r))
        }
        Geometry::Capsule { radius: r, length: h } => {
            let (tube, caps) = (PI * r * r * h, 4.0 / 3.0 * PI * r.powi(3));
            let volume = tube + caps;
            let (tube, caps) = (tube / volume, caps / volume);
            // two half spheres, each with its centre of mass 3/8 r beyond the end of the tube
            let across =
                tube * (3.0 * r * r + h * h) / 12.0 + caps * (0.4 * r * r + 0.25 * h * h + 0.375 * r * h);
            (volume, Vector3::new(across, across, tube * 0.5 * r * r + caps * 0.4 * r * r))
        }
        Geometry::Mesh { .. } => return None,
    })
}
