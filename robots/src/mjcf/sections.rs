//! The sections beside the tree of bodies: meshes, and pairs that do not collide.

use std::path::Path;

use nalgebra::Vector3;
use roxmltree::Node;

use super::attributes::{Attributes, MAIN};
use super::error::MjcfError;
use super::geoms::{Geoms, MeshAsset};
use crate::Srdf;

pub(super) fn read_assets<'a, 'i>(
    section: Node<'a, 'i>,
    geoms: &mut Geoms<'_, 'a, 'i>,
    file: Option<&Path>,
) -> Result<(), MjcfError> {
    for asset in section.children().filter(|asset| asset.has_tag_name("mesh")) {
        let attributes = geoms.attributes;
        attributes
            .only(asset, &["name", "class", "file", "scale", "inertia", "smoothnormal", "maxhullvert"])?;
        let class = attributes.class_of(asset, MAIN)?;
        let uri = attributes.get(asset, class, "file").ok_or_else(|| attributes.missing(asset, "file"))?;
        let stem = Path::new(uri).file_stem().and_then(|stem| stem.to_str()).unwrap_or(uri);
        let scale = attributes.numbers::<3>(asset, class, "scale")?.unwrap_or([1.0; 3]);
        let folder = file.and_then(Path::parent).unwrap_or(Path::new(""));
        let path = folder.join(&geoms.compiler.mesh_folder).join(uri);
        let path = path.is_file().then_some(path);
        let mesh = MeshAsset { uri: uri.to_owned(), path, scale: Vector3::from(scale) };
        geoms.meshes.insert(asset.attribute("name").unwrap_or(stem), mesh);
    }
    Ok(())
}

pub(super) fn read_exclusions(
    section: Node<'_, '_>,
    attributes: &Attributes<'_, '_>,
    exclusions: &mut Srdf,
) -> Result<(), MjcfError> {
    for rule in section.children().filter(|rule| rule.has_tag_name("exclude")) {
        let body =
            |name| rule.attribute(name).map(str::to_owned).ok_or_else(|| attributes.missing(rule, name));
        exclusions.disabled.push((body("body1")?, body("body2")?));
    }
    Ok(())
}
