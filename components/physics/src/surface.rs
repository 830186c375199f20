//! The changeable properties of surfaces.

/// Contact surface of one collider.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Part that has the surface: the name of a robot link or object, `ground` or `terrain`. A link with
    /// several shapes has one surface per shape.
    pub name: String,
    /// Coefficient of friction. A contact uses the mean value of both surfaces.
    pub friction: f64,
    /// Fraction of the approach speed kept after an impact, from 0 to 1. A contact uses the mean value of
    /// both surfaces.
    pub restitution: f64,
}
