//! Splitting of a library into body parts.

use nalgebra::DMatrix;

use motorium_algebra::{Wanted, left_singular};

use crate::{BuildError, Entry, Frame, LibraryParts, MotionLibrary, Part};

impl MotionLibrary {
    /// Returns the library of a part of the DoFs. The recordings are not needed.
    ///
    /// With `P` the rows of the part, `P F = P U S V^T`. `P U S` has the same left singular vectors as the
    /// part's data, because `V` cancels out. If this library is truncated, the result is truncated too.
    ///
    /// # Errors
    /// [`BuildError`] if the part is at rest in all recordings and therefore has no eigenforces.
    ///
    /// # Panics
    /// If the part contains an unknown DoF; [`Layout::part`](super::Layout::part) returns only valid parts.
    pub fn split(&self, part: &Part) -> Result<Self, BuildError> {
        let (parts, forces) = (self.parts(), self.spring().forces());
        let rows: Vec<usize> = part.dofs.iter().flat_map(|dof| dof * forces..(dof + 1) * forces).collect();
        let scaled =
            DMatrix::from_fn(rows.len(), self.rank(), |i, k| parts.basis[(rows[i], k)] * parts.singular[k]);
        let found = left_singular(&scaled, Wanted::All);
        if found.values.is_empty() {
            let names = part.dofs.iter().map(|dof| parts.layout.names()[*dof].clone());
            return Err(BuildError::Resting { names: names.collect::<Vec<_>>().join(", ") });
        }
        let turn = found
            .vectors
            .tr_mul(&DMatrix::from_fn(rows.len(), self.rank(), |i, k| parts.basis[(rows[i], k)]));
        let entries = parts
            .entries
            .iter()
            .map(|entry| Entry { frame: frame_of(&entry.frame, &part.dofs), ..entry.clone() });
        Self::from_parts(LibraryParts {
            layout: parts.layout.select(&part.dofs),
            spring: parts.spring,
            metric: parts.metric,
            weights: turn * &parts.weights,
            basis: found.vectors,
            singular: found.values,
            spectrum: found.spectrum,
            energy: found.energy,
            entries: entries.collect(),
        })
    }
}

fn frame_of(frame: &Frame, dofs: &[usize]) -> Frame {
    let pick = |values: &[f64]| dofs.iter().map(|dof| values[*dof]).collect();
    Frame {
        start: pick(&frame.start),
        goal: pick(&frame.goal),
        velocity: pick(&frame.velocity),
        duration: frame.duration,
    }
}
