//! The articulations of an island: half solutions with their mass factors, and their velocities due to the
//! impulses.

use core::ops::Range;

use super::{Impulses, MovedByImpulses};

impl Impulses {
    /// Computes the half solution for contact point `index` and its velocity without impulses.
    pub(super) fn reduce(&mut self, index: usize, articulations: &mut [impl MovedByImpulses]) {
        let n = self.n;
        let site = &mut self.sites[index];
        site.free = [0.0; 3];
        self.supported[index] = 0;
        let own = &self.jacobian[index * n..][..n];
        let reduced = &mut self.reduced[index * n..][..n];
        let mut velocity = [0.0; 4];
        if self.parts.len() > 1 {
            reduced.fill([0.0; 4]);
        }
        for of in site.articulations() {
            let (part, target) = (self.parts[of].clone(), articulations[of].target());
            let marked = &mut self.marked[part.clone()];
            let reduced = &mut reduced[part.clone()];
            let mut touches = false;
            for (k, column) in own[part.clone()].iter().enumerate() {
                let moves = *column != [0.0; 4];
                marked[k] = moves;
                touches |= moves;
                if moves {
                    for (velocity, entry) in velocity.iter_mut().zip(column) {
                        *velocity += entry * target.x[k];
                    }
                }
                reduced[k] = if target.held[k] { [0.0; 4] } else { *column };
            }
            if touches {
                target.factor.mark_carriers(marked);
                let first = self.supported[index];
                let support = &mut self.support[index * n..][..n];
                for k in (0..part.len()).filter(|k| marked[*k]) {
                    support[self.supported[index]] = k as u32;
                    self.supported[index] += 1;
                }
                let support = &mut support[first..self.supported[index]];
                target.factor.half_solve(support, reduced);
                support.iter_mut().for_each(|k| *k += part.start as u32);
            }
        }
        for (axis, free) in site.free.iter_mut().enumerate() {
            *free = velocity[axis] + site.falling[axis] + site.conveyed[axis];
        }
    }

    /// Adds the effect of the impulses of an island to the velocities of its articulations.
    pub(super) fn move_articulations(
        &mut self,
        places: Range<usize>,
        articulations: &mut [impl MovedByImpulses],
    ) {
        for (of, own) in articulations.iter_mut().enumerate() {
            let (part, target) = (self.parts[of].clone(), own.target());
            let mut moved = false;
            self.sum[part.clone()].fill(0.0);
            for place in places.clone() {
                let index = self.islands.point(place);
                let lambda = &self.lambda[3 * index..][..3];
                if lambda == [0.0; 3] || !self.sites[index].articulations().any(|other| other == of) {
                    continue;
                }
                moved = true;
                let times = |column: &[f64; 4]| column.iter().zip(lambda).map(|(a, b)| a * b).sum::<f64>();
                for &k in &self.support[index * self.n..][..self.supported[index]] {
                    let k = k as usize;
                    if part.contains(&k) {
                        self.sum[k] += times(&self.reduced[index * self.n + k]);
                        target.impulse[k - part.start] += times(&self.jacobian[index * self.n + k]);
                    }
                }
            }
            if moved {
                target.factor.finish_solve(&mut self.sum[part.clone()]);
                for (x, sum) in target.x.iter_mut().zip(&self.sum[part]) {
                    *x += sum;
                }
            }
        }
    }
}
