//! Positions of the references to mesh files in a robot's file.

use std::path::Path;

use roxmltree::{Document, Node, ParsingOptions};

use crate::formats::lines::Lines;
use crate::formats::mjcf::{Expanded, expand, parse_document};
use crate::{FilePosition, ModelWarning, ShapeSource, is_mjcf};

/// The references of a file, in its order.
pub(crate) struct MeshReferences(Vec<Reference>);

struct Reference {
    /// Link of a URDF file; MJCF files define their meshes once for all bodies.
    link: Option<String>,
    uri: String,
    at: FilePosition,
}

impl MeshReferences {
    /// Returns the references of a URDF or MJCF text; none if it does not parse.
    pub(crate) fn read(text: &str, file: Option<&Path>, shapes: ShapeSource) -> Self {
        match is_mjcf(text) {
            true => expand(text, file).map_or(Self(Vec::new()), |expanded| Self::of_mjcf(&expanded)),
            false => Self::of_urdf(text, file, shapes),
        }
    }

    /// Returns the references of a URDF text in its visuals or collision shapes.
    fn of_urdf(text: &str, file: Option<&Path>, shapes: ShapeSource) -> Self {
        let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
        let Ok(document) = Document::parse_with_options(text, options) else { return Self(Vec::new()) };
        let lines = Lines::new(text);
        let element = match shapes {
            ShapeSource::Collision => "collision",
            ShapeSource::Visual => "visual",
        };
        let links = document.root_element().children().filter(|node| node.has_tag_name("link"));
        let shapes = links.flat_map(|link| link.children().filter(|node| node.has_tag_name(element)));
        let meshes = shapes.flat_map(|shape| shape.descendants().filter(|node| node.has_tag_name("mesh")));
        let reference = |mesh: Node<'_, '_>| {
            let mut around = mesh.ancestors();
            let link = around.find(|node| node.has_tag_name("link"))?.attribute("name")?.to_owned();
            let uri = mesh.attribute("filename")?.to_owned();
            let at = lines.position(mesh.range().start);
            Some(Reference { link: Some(link), uri, at: FilePosition { file: file.map(Path::to_owned), at } })
        };
        Self(meshes.filter_map(reference).collect())
    }

    /// Returns the references of an MJCF text in its assets.
    fn of_mjcf(expanded: &Expanded) -> Self {
        let Ok(document) = parse_document(&expanded.text) else { return Self(Vec::new()) };
        let lines = Lines::new(&expanded.text);
        let meshes = document.root_element().descendants().filter(|node| {
            let in_assets = node.parent().is_some_and(|parent| parent.has_tag_name("asset"));
            node.has_tag_name("mesh") && in_assets
        });
        let reference = |mesh: Node<'_, '_>| {
            let uri = mesh.attribute("file")?.to_owned();
            let at = expanded.file_position(lines.position(mesh.range().start));
            Some(Reference { link: None, uri, at })
        };
        Self(meshes.filter_map(reference).collect())
    }

    /// Returns the position of a mesh of a link.
    fn find(&self, link: &str, uri: &str) -> Option<FilePosition> {
        let is_same = |reference: &&Reference| {
            reference.uri == uri && reference.link.as_deref().is_none_or(|known| known == link)
        };
        self.0.iter().find(is_same).map(|reference| reference.at.clone())
    }

    /// Adds the positions to warnings of missing and unreadable meshes.
    pub(crate) fn locate(&self, warnings: &mut [ModelWarning]) {
        for warning in warnings {
            if let ModelWarning::MissingMesh { link, uri, at, .. }
            | ModelWarning::UnreadableMesh { link, uri, at, .. } = warning
            {
                *at = self.find(link, uri);
            }
        }
    }
}
