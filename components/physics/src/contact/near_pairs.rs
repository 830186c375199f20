//! Pairs of colliders that may soon approach each other.

use motorium_robots::Collisions;

use super::bounds::{Motions, margin};
use super::pair::Pair;
use super::point::ROUNDING;

/// Pairs within this distance of their margin are listed \[m\].
pub(super) const SKIN: f64 = 0.08;

/// A list of the pairs that may need a measurement (a Verlet list). It is valid until the fastest collider
/// could have brought any other pair near, so only a few of many pairs are inspected per step.
#[derive(Clone, Debug)]
pub(super) struct NearPairs {
    list: Vec<u32>,
    /// Distances travelled by the colliders when the list was built.
    start: Vec<[f64; 2]>,
    made: bool,
    /// Parts of the motions that apply to any pair.
    parts: [bool; 2],
}

impl NearPairs {
    /// Creates a list for these pairs of `colliders` colliders.
    pub(super) fn new(pairs: &[Pair], colliders: usize) -> Self {
        let parts = [0, 1].map(|part| pairs.iter().any(|pair| pair.part == part));
        Self { list: Vec::with_capacity(pairs.len()), start: vec![[0.0; 2]; colliders], made: false, parts }
    }

    /// Returns the parts of the motions that apply to any pair.
    pub(super) fn parts(&self) -> [bool; 2] {
        self.parts
    }

    /// Returns the longest distance travelled by a collider since the list was built \[m\].
    pub(super) fn way(&self, motions: &Motions) -> f64 {
        motions.most_since(&self.start, self.parts).0
    }

    /// Marks the list to be rebuilt.
    pub(super) fn forget(&mut self) {
        self.made = false;
    }

    /// Returns the indices of the pairs, ascending.
    pub(super) fn list(&self) -> &[u32] {
        &self.list
    }

    /// Rebuilds the list if it may have to contain other pairs, for a step of `h` \[s\] and distances up to
    /// `least` \[m\].
    pub(super) fn update(
        &mut self,
        pairs: &mut [Pair],
        distances: &Collisions,
        motions: &Motions,
        (h, least): (f64, f64),
    ) {
        let (way, speed) = motions.most_since(&self.start, self.parts);
        if self.made && 2.0 * way + margin(h, 2.0 * speed).max(least) < SKIN {
            return;
        }
        self.made = true;
        self.list.clear();
        motions.copy_ways(&mut self.start);
        for (index, pair) in pairs.iter_mut().enumerate() {
            let (way, _) = motions.of_pair(pair.part, pair.first, pair.second);
            if pair.until - way > SKIN {
                continue;
            }
            if !pair.half_space {
                let gap = distances.position(pair.first) - distances.position(pair.second);
                let gap = gap.norm() - pair.reach;
                if gap > SKIN {
                    pair.until = pair.until.max(gap + way - ROUNDING);
                    continue;
                }
            }
            self.list.push(index as u32);
        }
    }
}
