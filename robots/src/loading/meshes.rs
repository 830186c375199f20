//! Mesh files of a robot that cannot be used.

use std::collections::HashMap;

use crate::formats::urdf::{LONGEST, extent};
use crate::loading::load::Loaded;
use crate::loading::mesh_references::MeshReferences;
use crate::{Geometry, ModelWarning, ShapeSource, TriangleMesh};

impl Loaded {
    /// Returns warnings about the robot's mesh files: files that cannot be read, and implausible sizes of
    /// moving links. `shapes` must be the kind of shapes with which the model was loaded. Missing files are
    /// not included, because loading already [warns](Self::warnings) about them.
    pub fn mesh_warnings(&self, shapes: ShapeSource) -> Vec<ModelWarning> {
        let model = &self.model;
        let fixed = model.base().shapes.iter().chain(&model.base().world_shapes).map(|shape| (shape, false));
        let moving = model.bodies().iter().flat_map(|body| &body.shapes).map(|shape| (shape, true));
        let (mut read, mut warnings) = (HashMap::new(), Vec::new());
        for (shape, moves) in fixed.chain(moving) {
            let Geometry::Mesh { uri, path: Some(path), inline: None, scale } = &shape.geometry else {
                continue;
            };
            let link = || shape.link.clone();
            let warning = match read
                .entry(path)
                .or_insert_with(|| TriangleMesh::read(path).map(|mesh| extent(&mesh)))
            {
                Err(error) => {
                    let (uri, error) = (uri.clone(), error.clone());
                    Some(ModelWarning::UnreadableMesh { link: link(), uri, at: None, error })
                }
                Ok(extent) => Some(extent.component_mul(scale).amax())
                    .filter(|metres| moves && *metres > LONGEST)
                    .map(|metres| ModelWarning::Oversized { link: link(), what: "mesh", metres }),
            };
            warnings.extend(warning.filter(|warning| !warnings.contains(warning)));
        }
        if let Ok(Some(text)) = self.text() {
            MeshReferences::read(&text, self.path.as_deref(), shapes).locate(&mut warnings);
        }
        warnings
    }
}
