//! Compilation of a model.

use super::library::Library;
use super::native::{Kind, Native};
use super::places::{ArticulationPlaces, ObjectPlace, Places};
use super::{Mujoco, YIELD, mjcf};
use crate::contact::Colliders;
use crate::robot::Robot;
use crate::{BuildError, World};

impl Mujoco {
    /// Writes the model and compiles it with MuJoCo.
    pub(super) fn compile(
        library: &'static Library,
        robot: &Robot,
        world: &World,
        colliders: &Colliders,
    ) -> Result<(Native, Places, Vec<usize>), BuildError> {
        let mut native = Native::compile(library, &mjcf::write(robot, world, colliders))
            .map_err(|reason| BuildError::Refused { reason })?;
        let lost =
            |what: String| BuildError::Refused { reason: format!("{what} is missing after compilation") };
        let joint = |native: &Native, name: String| {
            native.id(Kind::Joint, &name).map(|id| native.joint_places(id)).ok_or_else(|| lost(name))
        };
        let mut places = Places { articulations: Vec::new(), objects: Vec::new(), masses: Vec::new() };
        for (of, own) in robot.articulations.iter().enumerate() {
            let (model, base) = (&own.model, mjcf::base_joint(of));
            let mut part = ArticulationPlaces {
                base: if model.base().floating { Some(joint(&native, base)?) } else { None },
                joints: Vec::new(),
                coordinates: model.bodies().iter().map(|body| body.joint.coordinate).collect(),
                drives: (0..model.joint_count()).map(|index| model.joint_body(index)).collect(),
            };
            for index in 0..model.bodies().len() {
                let name = mjcf::body_joint(of, index);
                let (place, dof) = joint(&native, name.clone())?;
                // Check the assumed memory layout: values written into the model must be found at their
                // offsets.
                let armature = mjcf::armature(robot, (of, index));
                if native.timestep() != mjcf::TIMESTEP || native.armature(dof) != armature {
                    return Err(lost(format!("armature of {name}")));
                }
                native.harden(dof, YIELD);
                part.joints.push((place, dof));
            }
            places.articulations.push(part);
        }
        for (index, object) in world.objects.iter().enumerate() {
            let name = format!("o{index}");
            places.masses.push(object.mass_properties());
            places.objects.push(if object.is_dynamic() {
                let (place, dof) = joint(&native, name)?;
                ObjectPlace::Free(place, dof)
            } else {
                let mocap = native.id(Kind::Body, &name).and_then(|body| native.mocap_of(body));
                ObjectPlace::Placed(mocap.ok_or_else(|| lost(name))?)
            });
        }
        let mut geometries = Vec::new();
        for index in 0..colliders.colliders.len() {
            if let Some(id) = native.id(Kind::Geometry, &format!("c{index}")) {
                geometries.resize(geometries.len().max(id + 1), 0);
                geometries[id] = index;
            }
        }
        Ok((native, places, geometries))
    }
}
