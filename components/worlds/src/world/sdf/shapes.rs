//! Geometries of collisions, and their colours.

use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use roxmltree::Node;

use super::super::reading::{fixed, mesh, problem, unique};
use super::super::{Ground, MeshCollision, MeshShape, Object, ObjectShape, WorldFileError};
use super::reader::Reader;
use super::values::{child, elements, named, text};

/// Thickness and side length of the box that replaces a sloped plane \[m\].
const THICK: f64 = 1.0;
const WIDE: f64 = 100.0;

/// Default of `<max_convex_hulls>`, and the maximum number of convex parts of a mesh.
const HULLS: f64 = 16.0;
const MOST_HULLS: f64 = 64.0;

impl Reader<'_> {
    /// Returns the shape element of a collision.
    pub(super) fn geometry<'a, 'i>(&self, collision: Node<'a, 'i>) -> Result<Node<'a, 'i>, WorldFileError> {
        let mut shapes = child(collision, "geometry").into_iter().flat_map(elements);
        let shape = shapes.next();
        let shape = shape.ok_or_else(|| problem(self.path, collision, "<collision> has no <geometry>"))?;
        match shapes.next() {
            Some(second) => {
                Err(problem(self.path, second, "a second shape in <geometry>; give it its own <collision>"))
            }
            None => Ok(shape),
        }
    }

    /// Returns the shape of an element of `<geometry>` other than a plane.
    pub(super) fn shape(
        &mut self,
        geometry: Node<'_, '_>,
        moves: bool,
    ) -> Result<ObjectShape, WorldFileError> {
        let round = |reader: &Self| -> Result<(f64, f64), WorldFileError> {
            Ok((reader.number(geometry, "radius")?, reader.number(geometry, "length")?))
        };
        Ok(match geometry.tag_name().name() {
            "box" => {
                let size = child(geometry, "size")
                    .ok_or_else(|| problem(self.path, geometry, "<box> has no <size>"))?;
                ObjectShape::Box { size: self.numbers(size)? }
            }
            "sphere" => ObjectShape::Sphere { radius: self.number(geometry, "radius")? },
            "cylinder" => round(self).map(|(radius, length)| ObjectShape::Cylinder { radius, length })?,
            "capsule" => round(self).map(|(radius, length)| ObjectShape::Capsule { radius, length })?,
            "mesh" => self.mesh(geometry, moves)?,
            _ => return Err(self.unsupported(geometry)),
        })
    }

    /// Sets the colour of an object to the diffuse colour of a visual of its link: the visual with the index
    /// of the collision, or else the last one.
    pub(super) fn paint(&mut self, collision: Node<'_, '_>, object: &str) {
        let of_kind = |kind| collision.parent().into_iter().flat_map(move |link| named(link, kind));
        let place = of_kind("collision").position(|other| other == collision).unwrap_or(0);
        let visual = of_kind("visual").nth(place).or_else(|| of_kind("visual").last());
        let diffuse =
            visual.and_then(|visual| child(visual, "material")).and_then(|looks| child(looks, "diffuse"));
        let Some(diffuse) = diffuse else { return };
        let parts: Vec<f64> = text(diffuse).split_whitespace().filter_map(|part| part.parse().ok()).collect();
        if let [red, green, blue, ..] = parts[..] {
            let colour = [red, green, blue].map(|part| part.clamp(0.0, 1.0));
            self.world.appearance.colours.insert(object.to_owned(), colour);
        }
    }

    fn mesh(&mut self, geometry: Node<'_, '_>, moves: bool) -> Result<ObjectShape, WorldFileError> {
        let uri =
            child(geometry, "uri").ok_or_else(|| problem(self.path, geometry, "<mesh> has no <uri>"))?;
        if let Some(part) = child(geometry, "submesh") {
            let text = "<submesh> in <mesh> is not supported; write the part into a separate file";
            return Err(problem(self.path, part, text));
        }
        let name = text(uri);
        let name = name.trim().strip_prefix("file://").unwrap_or(name.trim());
        if name.contains("://") {
            let text = format!("\"{name}\" is not a file; write a path relative to the SDF file");
            return Err(problem(self.path, uri, text));
        }
        let scale =
            child(geometry, "scale").map(|scale| self.numbers(scale)).transpose()?.unwrap_or([1.0; 3]);
        let file = self.path.parent().unwrap_or(Path::new("")).join(name);
        if !file.is_file() {
            let text = format!("its mesh \"{name}\" was not found relative to the SDF file");
            return Err(problem(self.path, uri, text));
        }
        let collision = match geometry.attribute("optimization") {
            None | Some("" | "mesh") => {
                let (shape, reason) = mesh(&file, scale, moves);
                if let Some(reason) = reason {
                    self.ignore(geometry, "concavity of a <mesh>", reason);
                }
                return Ok(shape);
            }
            Some("convex_hull") => MeshCollision::Hull,
            Some("convex_decomposition") => MeshCollision::Parts(self.convex_hulls(geometry)?),
            Some(other) => {
                let text = format!(
                    "optimization=\"{other}\" in <mesh> is not supported, expected \"convex_hull\" or \"convex_decomposition\""
                );
                return Err(problem(self.path, geometry, text));
            }
        };
        let file = std::path::absolute(&file).unwrap_or(file);
        Ok(ObjectShape::Mesh(MeshShape { scale, collision, ..MeshShape::new(file) }))
    }

    /// Returns the number of convex parts of a mesh.
    fn convex_hulls(&self, geometry: Node<'_, '_>) -> Result<usize, WorldFileError> {
        let settings = child(geometry, "convex_decomposition");
        let hulls = self.number_or(settings, "max_convex_hulls", HULLS)?;
        if !(1.0..=MOST_HULLS).contains(&hulls) || hulls.fract() != 0.0 {
            let text =
                format!("<max_convex_hulls> is {hulls}, expected a whole number from 1 to {MOST_HULLS}");
            return Err(problem(self.path, settings.unwrap_or(geometry), text));
        }
        Ok(hulls as usize)
    }

    /// Adds a plane: a level plane becomes the ground, a sloped plane a large box below it. By the
    /// specification of SDF, collision planes are infinite; their `size` is for drawing.
    pub(super) fn plane(
        &mut self,
        (collision, geometry): (Node<'_, '_>, Node<'_, '_>),
        model: &str,
        pose: &Isometry3<f64>,
        (friction, restitution): (f64, f64),
    ) -> Result<(), WorldFileError> {
        let normal = match child(geometry, "normal") {
            Some(normal) => Vector3::from(self.numbers::<3>(normal)?),
            None => Vector3::z(),
        };
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &normal);
        let Some(turn) = turn.filter(|_| normal.norm() > 1e-9) else {
            return Err(problem(
                self.path,
                geometry,
                "the normal of a plane points downwards or is zero, expected upwards or sideways",
            ));
        };
        let pose = pose * turn;
        if (pose.rotation * Vector3::z()).z > 1.0 - 1e-9 {
            if self.world.ground.is_some() {
                let text =
                    "a second level plane: planes are infinite, and a world has one ground; use a <box>";
                return Err(problem(self.path, geometry, text));
            }
            self.world.ground =
                Some(Ground { height: pose.translation.z, friction, restitution, ..Ground::default() });
            self.paint(collision, "ground");
            return Ok(());
        }
        let reason = "it becomes a box of 100 m by 100 m, 1 m thick";
        self.ignore(geometry, "the infinite extent of a sloped <plane>", reason);
        let shape = ObjectShape::Box { size: [WIDE, WIDE, THICK] };
        let pose = pose * Translation3::new(0.0, 0.0, -0.5 * THICK);
        let name = unique(&self.world, model);
        self.paint(collision, &name);
        self.world.objects.push(Object { friction, restitution, ..fixed(name, shape, &pose) });
        Ok(())
    }
}
