//! The sections beside the tree of bodies: options, meshes, and pairs that do not collide.

use std::path::Path;

use nalgebra::Vector3;
use roxmltree::Node;

use super::attributes::{Attributes, MAIN};
use super::error::{MjcfError, MjcfProblem};
use super::geoms::{Geoms, MeshAsset};
use super::schema::{EXCLUDE, MESH, OPTION};
use crate::Srdf;

pub(super) fn check_options<'a, 'i>(
    section: Node<'a, 'i>,
    attributes: &Attributes<'a, 'i>,
) -> Result<(), MjcfError> {
    let option = attributes.element(section, MAIN, &OPTION)?;
    if option.numbers::<3>("gravity")?.is_some_and(|gravity| gravity != [0.0, 0.0, -9.81]) {
        option.ignore("gravity", "the simulation or the caller says what gravity is");
    }
    for node in section.children().filter(Node::is_element) {
        if !node.has_tag_name("flag") {
            let problem = MjcfProblem::Element(format!("{}> of <option", node.tag_name().name()));
            return Err(attributes.error(node, problem));
        }
        for attribute in node.attributes().filter(|attribute| attribute.value() == "disable") {
            match attribute.name() {
                name @ ("constraint" | "equality" | "limit" | "damper" | "frictionloss") => {
                    let reason = "it takes back what the rest of the file says: leave that out";
                    return Err(attributes.refused(node, name, "disable", reason));
                }
                name @ ("gravity" | "contact") => {
                    let reason = "the simulation says whether there is any";
                    attributes.ignored(node, format!("{name} of <flag>"), reason);
                }
                _ => {}
            }
        }
    }
    Ok(())
}

pub(super) fn read_assets<'a, 'i>(
    section: Node<'a, 'i>,
    geoms: &mut Geoms<'_, 'a, 'i>,
    file: Option<&Path>,
) -> Result<(), MjcfError> {
    for node in section.children().filter(Node::is_element) {
        match node.tag_name().name() {
            "mesh" => {}
            "texture" | "material" | "hfield" | "skin" | "model" => continue,
            name => {
                let problem = MjcfProblem::Element(format!("{name}> of <asset"));
                return Err(geoms.attributes.error(node, problem));
            }
        }
        let asset = geoms.attributes.element(node, MAIN, &MESH)?;
        let uri = asset.get("file").ok_or_else(|| asset.missing("file"))?;
        let stem = Path::new(uri).file_stem().and_then(|stem| stem.to_str()).unwrap_or(uri);
        let scale = asset.numbers::<3>("scale")?.unwrap_or([1.0; 3]);
        let folder = file.and_then(Path::parent).unwrap_or(Path::new(""));
        let mut within = Path::new(uri);
        if geoms.compiler.strip_path {
            within = within.file_name().map_or(within, Path::new);
        }
        let path = folder.join(&geoms.compiler.mesh_folder).join(within);
        let path = path.is_file().then_some(path);
        let mesh = MeshAsset { uri: uri.to_owned(), path, scale: Vector3::from(scale) };
        geoms.meshes.insert(node.attribute("name").unwrap_or(stem), mesh);
    }
    Ok(())
}

pub(super) fn read_exclusions<'a, 'i>(
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
