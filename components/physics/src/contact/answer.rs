//! The response of one contact point to impulses.

/// Compliance of a contact point, relative to the diagonal of W. It makes the forces unique if a rigid robot
/// stands on redundant points.
pub(super) const COMPLIANCE: f64 = 1e-6;

/// The W block of one contact point with derived quantities: the response of the point to impulses.
#[derive(Clone, Copy, Debug)]
pub(super) struct PointAnswer {
    /// Compliance along the normal, and the inverse of the normal entry, compliance included.
    compliance: f64,
    inverse: f64,
    /// Coupling entries between the normal and the tangents.
    coupling: [f64; 2],
    /// Inverse of the tangential block: its diagonal and its off-diagonal entry.
    tangents: [f64; 3],
    /// Inverse of the largest eigenvalue of the tangential block.
    slip: f64,
    /// The diagonal of the block.
    pub(super) diagonal: [f64; 3],
}

impl PointAnswer {
    /// The response of a point whose impulse is not computed.
    pub(super) const NONE: Self = Self {
        compliance: 0.0,
        inverse: 0.0,
        coupling: [0.0; 2],
        tangents: [0.0; 3],
        slip: 0.0,
        diagonal: [0.0; 3],
    };

    /// Creates the response from the point's W block `own`, and `soft`, the approach speed of its surfaces
    /// per unit of impulse.
    pub(super) fn new(own: &[[f64; 3]; 3], soft: f64) -> Self {
        // The entry of a tangent may be zero if the joints block motion along it.
        let [normal, tangents] = [own[0][0], own[1][1].max(own[2][2])].map(|entry| COMPLIANCE * entry);
        Self::with_compliance(own, [normal + soft, tangents])
    }

    /// Creates the response from the W block of the torques at a contact point. Joints may block rotation
    /// about any of the axes.
    pub(super) fn couple(own: &[[f64; 3]; 3]) -> Self {
        let soft = COMPLIANCE * own[0][0].max(own[1][1]).max(own[2][2]);
        Self::with_compliance(own, [soft; 2])
    }

    fn with_compliance(own: &[[f64; 3]; 3], [compliance, soft]: [f64; 2]) -> Self {
        let (a, b, c) = (own[1][1] + soft, own[1][2], own[2][2] + soft);
        let determinant = (a * c - b * b).max(f64::MIN_POSITIVE);
        let stiffest = 0.5 * (a + c) + (0.25 * (a - c) * (a - c) + b * b).sqrt();
        Self {
            compliance,
            inverse: 1.0 / (own[0][0] + compliance),
            coupling: [own[1][0], own[2][0]],
            tangents: [c / determinant, a / determinant, b / determinant],
            slip: 1.0 / stiffest,
            diagonal: [own[0][0], own[1][1], own[2][2]],
        }
    }

    /// Returns the impulse with the impulses at all other points fixed: `old` is the current impulse, and
    /// `velocity` the current velocity.
    #[inline]
    pub(super) fn relax(
        &self,
        old: &[f64; 3],
        velocity: &[f64; 3],
        (target, friction): (f64, f64),
    ) -> [f64; 3] {
        let missing = velocity[0] - target + self.compliance * old[0];
        let normal = (old[0] - missing * self.inverse).max(0.0);
        if normal == 0.0 {
            return [0.0; 3];
        }
        // Slip with the new normal impulse.
        let step = normal - old[0];
        let slip = [velocity[1] + self.coupling[0] * step, velocity[2] + self.coupling[1] * step];
        let tangent = self.relax_tangent([old[1], old[2]], slip, friction * normal);
        [normal, tangent[0], tangent[1]]
    }

    /// Returns the moments about the normal and about the tangents with the impulses at all other points
    /// fixed. Each of the two has a separate bound.
    #[inline]
    pub(super) fn relax_couple(
        &self,
        old: &[f64; 3],
        velocity: &[f64; 3],
        [torsional, rolling]: [f64; 2],
    ) -> [f64; 3] {
        let missing = velocity[0] + self.compliance * old[0];
        let about_normal = (old[0] - missing * self.inverse).min(torsional).max(-torsional);
        let step = about_normal - old[0];
        let turning = [velocity[1] + self.coupling[0] * step, velocity[2] + self.coupling[1] * step];
        let tangent = self.relax_tangent([old[1], old[2]], turning, rolling);
        [about_normal, tangent[0], tangent[1]]
    }

    /// Returns the two tangential entries of an impulse, limited to the magnitude `bound`, that stop the
    /// `slip` or oppose it.
    #[inline]
    fn relax_tangent(&self, old: [f64; 2], slip: [f64; 2], bound: f64) -> [f64; 2] {
        let [first, second, beside] = self.tangents;
        let mut tangent =
            [old[0] - (first * slip[0] - beside * slip[1]), old[1] - (second * slip[1] - beside * slip[0])];
        let squared = |tangent: &[f64; 2]| tangent[0] * tangent[0] + tangent[1] * tangent[1];
        if squared(&tangent) > bound * bound {
            // Slipping: a projected step along the slip, whose fixed point opposes the slip.
            tangent = [old[0] - slip[0] * self.slip, old[1] - slip[1] * self.slip];
            let size = squared(&tangent);
            if size > bound * bound {
                let share = bound / size.sqrt();
                tangent = tangent.map(|part| part * share);
            }
        }
        tangent
    }
}
