//! Composite rigid body algorithm (Walker and Orin 1982; Featherstone 2008, table 6.2). Uses frames on the
//! joint axes if bodies are ordered depth first without mimic joints, otherwise base coordinates.

use nalgebra::DMatrix;

use super::Dynamics;
use crate::Model;
use crate::math::{Spatial, Work, widest};
use crate::model::flat::FlatModel;

struct BodiesMass<'a, const BOTH: bool> {
    dynamics: &'a mut Dynamics,
    model: &'a Model,
    q: &'a [f64],
    out: &'a mut DMatrix<f64>,
}

impl<const BOTH: bool> Work for BodiesMass<'_, BOTH> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        self.dynamics.bodies_mass::<FUSED, BOTH>(self.model, self.q, self.out);
    }
}

impl Dynamics {
    /// Computes both triangles of the joint-space mass matrix `M(q)` (nv x nv).
    pub fn crba(&mut self, model: &Model, q: &[f64], out: &mut DMatrix<f64>) {
        // matrices are filled entry by entry, slices at memory bandwidth
        out.as_mut_slice().fill(0.0);
        widest(BodiesMass::<true> { dynamics: self, model, q, out });
        turn_rotors(model.flat(), out);
    }

    /// Computes the upper triangle of the mass matrix, including the diagonal. The entry of two joints is
    /// only written if one of them carries the other; all other entries are zero. Initialise the matrix with
    /// zeros once, and reuse it.
    pub fn crba_upper(&mut self, model: &Model, q: &[f64], out: &mut DMatrix<f64>) {
        widest(BodiesMass::<false> { dynamics: self, model, q, out });
        turn_rotors(model.flat(), out);
    }

    /// Computes the mass matrix without the rotors of the drives: the upper triangle, and its mirror image if
    /// `BOTH`.
    #[inline(always)]
    fn bodies_mass<const FUSED: bool, const BOTH: bool>(
        &mut self,
        model: &Model,
        q: &[f64],
        out: &mut DMatrix<f64>,
    ) {
        let n = model.nv();
        assert_eq!(out.shape(), (n, n), "shape of the mass matrix");
        let flat = model.flat();
        let out = out.as_mut_slice();
        if flat.orderly {
            self.check(model, q);
            self.composite[0].inertia = self.crba.mass::<FUSED, BOTH>(flat, q, out, n);
            if flat.floating {
                self.base_block(out, n);
            }
        } else {
            self.set_positions(model, q);
            self.placed_mass(flat, out, n);
        }
        if BOTH {
            let mirrored = if flat.orderly { if flat.floating { 6 } else { 0 } } else { n };
            // Column by column, so that writes are contiguous.
            for column in 1..mirrored {
                for row in 0..column {
                    out[row * n + column] = out[column * n + row];
                }
            }
        }
    }

    /// Computes the upper triangle in base coordinates.
    #[inline(always)]
    fn placed_mass(&mut self, flat: &FlatModel, out: &mut [f64], n: usize) {
        self.sweep(flat);
        if flat.coupled {
            self.coupled_mass(flat, out, n);
            return;
        }
        for (index, node) in flat.nodes.iter().enumerate().rev() {
            let (outer, inner) = self.composite.split_at_mut(index + 1);
            let body = &inner[0];
            outer[node.parent].inertia += body.inertia;
            // wrench for a unit acceleration of everything beyond the joint
            let wrench = body.inertia.apply(body.joint);
            let column = &mut out[node.column * n..][..=node.column];
            column[node.column] = body.joint.dot(wrench);
            let mut ancestor = node.parent;
            while ancestor != 0 {
                let node = &flat.nodes[ancestor - 1];
                column[node.column] = outer[ancestor].joint.dot(wrench);
                ancestor = node.parent;
            }
            if flat.floating {
                column[..6].copy_from_slice(&wrench.array());
            }
        }
        if flat.floating {
            self.base_block(out, n);
        }
    }

    /// Computes the upper triangle of the six columns of the base.
    fn base_block(&self, out: &mut [f64], n: usize) {
        let inertia = &self.composite[0].inertia;
        for column in 0..6 {
            let mut unit = [0.0; 6];
            unit[column] = 1.0;
            let wrench = inertia.apply(Spatial::from_slice(&unit)).array();
            out[column * n..][..=column].copy_from_slice(&wrench[..=column]);
        }
    }

    /// Computes the mass matrix if joints share columns: each pair of joints adds to its columns' entry.
    fn coupled_mass(&mut self, flat: &FlatModel, out: &mut [f64], n: usize) {
        for column in 0..n {
            out[column * n..][..=column].fill(0.0);
        }
        for (index, node) in flat.nodes.iter().enumerate().rev() {
            let (outer, inner) = self.composite.split_at_mut(index + 1);
            let body = &inner[0];
            outer[node.parent].inertia += body.inertia;
            let wrench = body.inertia.apply(body.joint) * node.multiplier;
            out[node.column * n + node.column] += node.multiplier * body.joint.dot(wrench);
            let mut ancestor = node.parent;
            while ancestor != 0 {
                let other = &flat.nodes[ancestor - 1];
                let entry = other.multiplier * outer[ancestor].joint.dot(wrench);
                let (row, column) = (node.column.min(other.column), node.column.max(other.column));
                // Twice on the diagonal when a mimic and its master share the column: both cross terms land
                // there.
                out[column * n + row] += if row == column { 2.0 * entry } else { entry };
                ancestor = other.parent;
            }
            if flat.floating {
                for (row, entry) in wrench.array().into_iter().enumerate() {
                    out[node.column * n + row] += entry;
                }
            }
        }
        if flat.floating {
            self.base_block(out, n);
        }
    }
}

/// Adds the rotors of the drives.
#[inline(always)]
fn turn_rotors(flat: &FlatModel, out: &mut DMatrix<f64>) {
    if flat.geared {
        flat.nodes.iter().for_each(|node| out[(node.column, node.column)] += node.armature);
    }
}
