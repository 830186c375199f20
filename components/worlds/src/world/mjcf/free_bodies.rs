//! Bodies with a free joint: objects with one or more shapes.

use motorium_robots::mjcf::{Attributes, Element, MjcfError, MjcfProblem, WATER, body_name};
use motorium_robots::{BasePose, Geometry, Inertia};
use nalgebra::Isometry3;
use roxmltree::Node;

use super::super::reading::unique;
use super::contacts::Surface;
use crate::{CompoundPart, Object, ObjectShape, World};

/// A geom of a moving body.
pub(super) struct FreeGeom<'a, 'i> {
    pub(super) node: Node<'a, 'i>,
    /// Its pose in the world.
    pub(super) pose: Isometry3<f64>,
    pub(super) shape: ObjectShape,
    pub(super) weight: Weight,
    pub(super) surface: Surface,
}

/// The mass of a geom.
#[derive(Clone, Copy, Debug)]
pub(super) enum Weight {
    /// Mass \[kg\].
    Mass(f64),
    /// Density \[kg/m3\].
    Density(f64),
}

impl Weight {
    pub(super) fn from_element(
        geometry: &Geometry,
        inertia: Result<Inertia, MjcfError>,
        read: &Element<'_, '_, '_>,
    ) -> Result<Self, MjcfError> {
        match (inertia, geometry) {
            (Ok(inertia), _) => Ok(Self::Mass(inertia.mass)),
            // Unlike meshes of robots, solid meshes have an inertia here.
            (Err(_), Geometry::Mesh { .. }) => match read.numbers::<1>("mass")? {
                Some([mass]) => Ok(Self::Mass(mass)),
                None => Ok(Self::Density(read.number("density", WATER)?)),
            },
            (Err(error), _) => Err(error),
        }
    }
}

/// Returns the object of a body; both have the pose `within` in the world.
pub(super) fn object<'a, 'i>(
    world: &World,
    attributes: &Attributes<'a, 'i>,
    (body, within): (Node<'a, 'i>, &Isometry3<f64>),
    geoms: Vec<FreeGeom<'a, 'i>>,
) -> Result<Object, MjcfError> {
    let other = |node, problem: &str| Err(attributes.error(node, MjcfProblem::Other(problem.to_owned())));
    let name = unique(world, &body_name(body));
    let (shape, mass, density, surface) = match <[_; 1]>::try_from(geoms) {
        Ok([FreeGeom { node, pose, shape, weight, surface }]) => {
            let shape = shape.displaced(&within.inv_mul(&pose));
            match weight {
                Weight::Mass(mass) if mass > 0.0 => (shape, Some(mass), None, surface),
                Weight::Density(density) if density > 0.0 => (shape, None, Some(density), surface),
                _ => {
                    return other(
                        node,
                        "this geom of a moving body has no mass, expected a mass or density above 0",
                    );
                }
            }
        }
        Err(geoms) => {
            let Some(surface) = geoms.first().map(|geom| geom.surface.clone()) else {
                return other(body, "a moving body has no colliding geom: an object needs one");
            };
            let mut parts = Vec::with_capacity(geoms.len());
            for FreeGeom { node, pose, shape, weight, surface: own } in geoms {
                if !own.rubs_like(&surface) {
                    return other(
                        node,
                        "its friction differs from the first geom's: an object has one surface",
                    );
                }
                let mass = match weight {
                    Weight::Mass(mass) => Some(mass),
                    Weight::Density(density) => shape.volume().map(|volume| density * volume),
                };
                let Some(mass) = mass else {
                    return other(node, "its mesh has no volume, and therefore no mass");
                };
                let BasePose { position, rpy } = BasePose::from_isometry(&within.inv_mul(&pose));
                parts.push(CompoundPart { shape, position, rpy, mass: Some(mass) });
            }
            (ObjectShape::Compound(parts), None, None, surface)
        }
    };
    let BasePose { position, rpy } = BasePose::from_isometry(within);
    Ok(Object { name, shape, mass, density, position, rpy, ..surface.object })
}
