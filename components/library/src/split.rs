//! Parts of a body out of a library of the whole.

use nalgebra::DMatrix;

use crate::{Entry, Frame, LibraryParts, MotionLibrary, Part};
use motorium_algebra::{Wanted, left_singular};

impl MotionLibrary {
    /// The library of some DoFs alone, without the recordings.
    ///
    /// With `P` the rows of the part, `P F = P U S V^T`: the left singular vectors of `P U S` are those of the part's data,
    /// and `V` drops out. If this library was truncated, so is its part: of what was left out nothing is known.
    ///
    /// # Panics
    /// When the part names a DoF the library does not have; [`Layout::part`](super::Layout::part) makes parts that fit.
    pub fn split(&self, part: &Part) -> Self {
        let (parts, forces) = (self.parts(), self.spring().forces());
        let rows: Vec<usize> = part.dofs.iter().flat_map(|dof| dof * forces..(dof + 1) * forces).collect();
        let scaled =
            DMatrix::from_fn(rows.len(), self.rank(), |i, k| parts.basis[(rows[i], k)] * parts.singular[k]);
        let found = left_singular(&scaled, Wanted::All);
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
        .expect("a part of a library fits itself")
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
