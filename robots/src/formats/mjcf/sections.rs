//! Sections other than the body tree: options, meshes, and excluded pairs.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::Vector3;
use roxmltree::Node;

use super::attributes::{Attributes, Element, MAIN, named};
use super::error::{MjcfError, MjcfProblem};
use super::geoms::{Geoms, MeshAsset};
use super::schema::{EXCLUDE, MATERIAL, MESH, OPTION};
use crate::{Srdf, TriangleMesh};

pub(crate) fn check_options<'a, 'i>(
    section: Node<'a, 'i>,
    attributes: &Attributes<'a, 'i>,
) -> Result<(), MjcfError> {
    let option = attributes.element(section, MAIN, &OPTION)?;
    if option.numbers::<3>("gravity")?.is_some_and(|gravity| gravity != [0.0, 0.0, -9.81]) {
        option.ignore("gravity", "gravity is set by the simulation or the caller");
    }
    for node in section.children().filter(Node::is_element) {
        if !node.has_tag_name("flag") {
            let problem = MjcfProblem::Element(format!("{}> of <option", node.tag_name().name()));
            return Err(attributes.error(node, problem));
        }
        for attribute in node.attributes().filter(|attribute| attribute.value() == "disable") {
            match attribute.name() {
                name @ ("constraint" | "equality" | "limit" | "damper" | "frictionloss") => {
                    let reason = "it disables other parts of the file: remove those parts instead";
                    return Err(attributes.refused(node, name, "disable", reason));
                }
                name @ ("gravity" | "contact") => {
                    let reason = "it is a setting of the simulation";
                    attributes.ignored(node, format!("{name} of <flag>"), reason);
                }
                _ => {}
            }
        }
    }
    Ok(())
}

/// Reads the meshes and materials of an `<asset>` section. Relative paths of meshes refer to the folder of
/// `file`, the MJCF file.
///
/// # Errors
/// An element or attribute is not supported, or a value is malformed.
pub fn read_assets<'a, 'i>(
    section: Node<'a, 'i>,
    geoms: &mut Geoms<'_, 'a, 'i>,
    file: Option<&Path>,
) -> Result<(), MjcfError> {
    for node in section.children().filter(Node::is_element) {
        match node.tag_name().name() {
            "mesh" => {}
            "material" => {
                let material = geoms.attributes.element(node, MAIN, &MATERIAL)?;
                let name = node.attribute("name").ok_or_else(|| material.missing("name"))?;
                let plain = material.get("texture").is_none().then_some([1.0; 4]);
                let rgba = material.numbers::<4>("rgba")?.or(plain);
                geoms.materials.insert(name, rgba);
                continue;
            }
            "texture" | "hfield" | "skin" | "model" => continue,
            name => {
                let problem = MjcfProblem::Element(format!("{name}> of <asset"));
                return Err(geoms.attributes.error(node, problem));
            }
        }
        let asset = geoms.attributes.element(node, MAIN, &MESH)?;
        let scale = asset.numbers::<3>("scale")?.unwrap_or([1.0; 3]);
        let not_solid = matches!(asset.get("inertia"), Some("shell" | "convex")).then(|| {
            asset.refused(
                "inertia",
                "an object has the inertia of its mesh as a solid; remove the attribute, or write \"exact\"",
            )
        });
        if let Some(vertices) = asset.get("vertex") {
            let name = node.attribute("name").ok_or_else(|| asset.missing("name"))?;
            let inline = Arc::new(inline_mesh(&asset, vertices)?);
            let mesh = MeshAsset {
                uri: name.to_owned(),
                path: None,
                folder: PathBuf::new(),
                inline: Some(inline),
                scale: Vector3::from(scale),
                not_solid,
            };
            geoms.meshes.insert(name, mesh);
            continue;
        }
        let uri = asset.get("file").ok_or_else(|| asset.missing("file"))?;
        let stem = Path::new(uri).file_stem().and_then(|stem| stem.to_str()).unwrap_or(uri);
        let folder = file.and_then(Path::parent).unwrap_or(Path::new(""));
        let mut within = Path::new(uri);
        if geoms.compiler.strip_path {
            within = within.file_name().map_or(within, Path::new);
        }
        let folder = folder.join(&geoms.compiler.mesh_folder);
        let path = folder.join(within);
        let path = path.is_file().then_some(path);
        let (uri, scale) = (uri.to_owned(), Vector3::from(scale));
        let mesh = MeshAsset { uri, path, folder, inline: None, scale, not_solid };
        geoms.meshes.insert(node.attribute("name").unwrap_or(stem), mesh);
    }
    Ok(())
}

/// Returns the volume of a closed mesh.
fn volume(mesh: &TriangleMesh) -> f64 {
    let corner = |index: u32| mesh.points[index as usize];
    let under = mesh.triangles.iter().map(|[a, b, c]| corner(*a).dot(&corner(*b).cross(&corner(*c))));
    under.sum::<f64>() / 6.0
}

/// Builds a mesh from corners, three numbers each, and triangles of corner indices. Without triangles it is
/// the convex hull of the corners.
fn inline_mesh(asset: &Element<'_, '_, '_>, vertices: &str) -> Result<TriangleMesh, MjcfError> {
    let (attributes, node) = (asset.attributes, asset.node);
    let wrong = |attribute: &str, expected: &str| {
        let (element, value) = (named(node), asset.get(attribute).unwrap_or_default());
        let value = value.chars().take(40).collect();
        let (attribute, expected) = (attribute.to_owned(), expected.to_owned());
        Err(attributes.error(node, MjcfProblem::Number { element, attribute, value, expected }))
    };
    let numbers = attributes.parse(node, "vertex", vertices, 1..=usize::MAX)?;
    if numbers.len() % 3 != 0 || numbers.len() < 12 {
        return wrong("vertex", "three numbers for each of at least 4 corners");
    }
    let points: Vec<_> = numbers.chunks_exact(3).map(Vector3::from_column_slice).collect();
    let Some(faces) = asset.get("face") else {
        // A hull consists of the corners used by triangles: here, all of them.
        let triangles = (2..points.len() as u32).map(|last| [last - 2, last - 1, last]).collect();
        let size = points.iter().map(|point| (point - points[0]).norm()).fold(0.0, f64::max);
        let hull = TriangleMesh { points, triangles }.hull(usize::MAX);
        let hull = hull.filter(|hull| volume(hull) > 1e-9 * size.powi(3));
        return hull.map_or_else(|| wrong("vertex", "corners that do not lie in one plane"), Ok);
    };
    let corners = attributes.parse(node, "face", faces, 1..=usize::MAX)?;
    let known = |corner: &f64| corner.fract() == 0.0 && (0.0..points.len() as f64).contains(corner);
    if corners.len() % 3 != 0 || !corners.iter().all(known) {
        return wrong("face", "three numbers of corners, counted from 0, for each triangle");
    }
    let triangles = corners.chunks_exact(3).map(|three| [three[0] as u32, three[1] as u32, three[2] as u32]);
    Ok(TriangleMesh { triangles: triangles.collect(), points })
}

pub(crate) fn read_exclusions<'a, 'i>(
    section: Node<'a, 'i>,
    attributes: &Attributes<'a, 'i>,
    exclusions: &mut Srdf,
) -> Result<(), MjcfError> {
    for node in section.children().filter(Node::is_element) {
        match node.tag_name().name() {
            "exclude" => {
                let rule = attributes.element(node, MAIN, &EXCLUDE)?;
                let body = |name| rule.get(name).map(str::to_owned).ok_or_else(|| rule.missing(name));
                exclusions.disabled.push((body("body1")?, body("body2")?));
            }
            "pair" => {
                let reason = "shapes of different bodies are checked for collision unless excluded";
                attributes.ignored(node, "<pair> of <contact>".to_owned(), reason);
            }
            name => return Err(attributes.error(node, MjcfProblem::Element(format!("{name}> of <contact")))),
        }
    }
    Ok(())
}
