//! Surfaces of collisions, and masses by densities.

use nalgebra::Isometry3;
use roxmltree::Node;

use super::{Reader, WorldFileError, child, is_true, problem, text};

impl Reader<'_> {
    /// Returns the mass of a moving link. Warns if its centre or inertia differ from its shape's.
    pub(super) fn mass(
        &mut self,
        inertial: Node<'_, '_>,
        link: Node<'_, '_>,
    ) -> Result<Option<f64>, WorldFileError> {
        let collision = child(link, "collision");
        if inertial.attribute("auto").is_some_and(is_true) {
            return self.automatic_mass(inertial, collision);
        }
        if let Some(inertia) = child(inertial, "inertia") {
            self.ignore(
                inertia,
                "<inertia> of <inertial>",
                "an object has the inertia of its shape, of one density",
            );
        }
        if let Some(pose) = child(inertial, "pose") {
            let centre = self.pose(inertial)?.translation.vector;
            let shape = collision.map_or_else(|| Ok(Isometry3::identity()), |node| self.pose(node))?;
            if (centre - shape.translation.vector).norm() > 1e-6 {
                self.ignore(
                    pose,
                    "<pose> of <inertial>",
                    "an object has the centre of mass of its shape, of one density",
                );
            }
        }
        child(inertial, "mass").map(|_| self.number(inertial, "mass")).transpose()
    }

    /// Returns the mass of a shape from a density, the collision's before the link's; SDF's default is 1000
    /// kg/m3.
    fn automatic_mass(
        &self,
        inertial: Node<'_, '_>,
        collision: Option<Node<'_, '_>>,
    ) -> Result<Option<f64>, WorldFileError> {
        let Some(collision) = collision else { return Ok(None) };
        let stated = [Some(collision), Some(inertial)].into_iter().flatten();
        let stated = stated.filter_map(|node| child(node, "density")).next();
        let density = stated.map_or(Ok([1000.0]), |density| self.numbers::<1>(density))?[0];
        let geometry = child(collision, "geometry").and_then(|node| node.children().find(Node::is_element));
        let Some(geometry) = geometry else { return Ok(None) };
        let round = |height: f64, ends: f64| -> Result<f64, WorldFileError> {
            let radius = self.number(geometry, "radius")?;
            Ok(core::f64::consts::PI * radius * radius * (height + ends * radius))
        };
        let volume = match geometry.tag_name().name() {
            "box" => match child(geometry, "size") {
                Some(size) => self.numbers::<3>(size)?.iter().product(),
                None => return Ok(None),
            },
            "sphere" => round(0.0, 4.0 / 3.0)?,
            "cylinder" => round(self.number(geometry, "length")?, 0.0)?,
            "capsule" => round(self.number(geometry, "length")?, 4.0 / 3.0)?,
            name => {
                let text = format!("the mass of a <{name}> by its density is not read; write its <mass>");
                return Err(problem(self.path, inertial, text));
            }
        };
        Ok(Some(density * volume))
    }

    /// Returns friction and restitution of a surface; other elements cause warnings or errors.
    pub(super) fn surface(&mut self, collision: Node<'_, '_>) -> Result<(f64, f64), WorldFileError> {
        for node in collision.children().filter(Node::is_element) {
            if !["pose", "geometry", "surface", "density"].contains(&node.tag_name().name()) {
                self.leave_out("collision", node)?;
            }
        }
        let surface = child(collision, "surface");
        for node in surface.into_iter().flat_map(|node| node.descendants().skip(1)).filter(Node::is_element) {
            self.leave_out_of_surface(node)?;
        }
        let bounce = surface.and_then(|surface| child(surface, "bounce"));
        let restitution = match bounce.filter(|bounce| child(*bounce, "restitution_coefficient").is_some()) {
            Some(bounce) => self.number(bounce, "restitution_coefficient")?,
            None => 0.0,
        };
        Ok((self.friction(collision)?, restitution))
    }

    fn leave_out_of_surface(&mut self, node: Node<'_, '_>) -> Result<(), WorldFileError> {
        let name = node.tag_name().name();
        let value = text(node);
        let (value, number) = (value.trim(), value.trim().parse::<f64>().ok());
        let ode = node.parent().filter(|parent| parent.has_tag_name("ode"));
        let mu = ode.and_then(|ode| child(ode, "mu")).map(text);
        let is_default = match name {
            "collide_without_contact" => value.eq_ignore_ascii_case("false") || value == "0",
            "collide_bitmask" | "category_bitmask" => {
                value == "65535" || value.eq_ignore_ascii_case("0xffff")
            }
            "mu2" => number.is_some() && number == mu.map_or(Some(1.0), |mu| mu.trim().parse().ok()),
            "slip1" | "slip2" | "slip" | "kd" => number == Some(0.0),
            _ => false,
        };
        if name == "friction" && node.parent().is_some_and(|parent| parent.has_tag_name("bullet")) {
            self.ignore(node, "<friction> of <bullet>", "the `mu` of <ode> is read");
            return Ok(());
        }
        if is_default { Ok(()) } else { self.leave_out("surface", node) }
    }

    /// The coefficient of a collision; SDF's default is 1.
    fn friction(&self, collision: Node<'_, '_>) -> Result<f64, WorldFileError> {
        let ode =
            ["surface", "friction", "ode"].into_iter().try_fold(collision, |node, name| child(node, name));
        match ode.filter(|ode| child(*ode, "mu").is_some()) {
            Some(ode) => self.number(ode, "mu"),
            None => Ok(1.0),
        }
    }
}
