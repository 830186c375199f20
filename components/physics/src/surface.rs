//! The changeable properties of surfaces.

/// The surface of one collider.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Robot link, object, `ground` or `terrain`. A link with several shapes has one surface for each.
    pub name: String,
    /// Coefficient of friction. A contact uses the mean of both surfaces.
    pub friction: f64,
    /// Fraction of the approach speed kept after an impact. A contact uses the mean of both surfaces.
    pub restitution: f64,
}
