//! Islands: the independent parts of a contact problem.

use core::ops::Range;

/// Contact points grouped by island. Two points belong to the same island if a chain of points and moving
/// bodies connects them: impulses in one island move nothing in another.
///
/// Bodies are numbered: articulations first, then free objects.
#[derive(Clone, Debug)]
pub(super) struct Islands {
    /// A body of the same island; the representative of an island is its own parent.
    parent: Vec<u32>,
    /// Island of each representative body.
    label: Vec<u32>,
    /// Contact points, grouped by island, in ascending order within each.
    order: Vec<u32>,
    /// End of each island in `order`.
    ends: Vec<u32>,
    /// Island of each contact point.
    of_point: Vec<u32>,
}

/// Not in any island.
const NONE: u32 = u32::MAX;

impl Islands {
    /// Creates a workspace for this many bodies and up to `most` contact points.
    pub(super) fn new(bodies: usize, most: usize) -> Self {
        Self {
            parent: vec![0; bodies],
            label: vec![NONE; bodies],
            order: Vec::with_capacity(most),
            ends: Vec::with_capacity(most),
            of_point: Vec::with_capacity(most),
        }
    }

    /// Reserves space for this number of contact points.
    pub(super) fn make_room(&mut self, most: usize) {
        self.order.reserve(most);
        self.ends.reserve(most);
        self.of_point.reserve(most);
    }

    /// Groups contact points by island; each point has the one or two bodies that move there.
    pub(super) fn find(&mut self, points: impl Iterator<Item = [Option<usize>; 2]> + Clone) {
        for (index, parent) in self.parent.iter_mut().enumerate() {
            *parent = index as u32;
        }
        self.label.fill(NONE);
        for bodies in points.clone() {
            if let [Some(a), Some(b)] = bodies {
                let (a, b) = (self.root(a), self.root(b));
                self.parent[a.max(b)] = a.min(b) as u32;
            }
        }
        self.of_point.clear();
        self.ends.clear();
        for bodies in points {
            let body = bodies[0].or(bodies[1]);
            // A point between parts that do not move is not in any island.
            let island = body.map_or(NONE, |body| {
                let root = self.root(body);
                if self.label[root] == NONE {
                    self.label[root] = self.ends.len() as u32;
                    self.ends.push(0);
                }
                self.label[root]
            });
            self.of_point.push(island);
            if island != NONE {
                self.ends[island as usize] += 1;
            }
        }
        // Convert counts to offsets.
        let mut place = 0;
        for end in &mut self.ends {
            (*end, place) = (place, place + *end);
        }
        self.order.clear();
        self.order.resize(place as usize, 0);
        for (point, island) in self.of_point.iter().enumerate().filter(|(_, island)| **island != NONE) {
            let place = &mut self.ends[*island as usize];
            self.order[*place as usize] = point as u32;
            *place += 1;
        }
    }

    fn root(&mut self, body: usize) -> usize {
        let mut body = body;
        while self.parent[body] as usize != body {
            let grand = self.parent[self.parent[body] as usize];
            self.parent[body] = grand;
            body = grand as usize;
        }
        body
    }

    /// Returns the island of a contact point; `None` between parts that do not move.
    pub(super) fn island(&self, point: usize) -> Option<usize> {
        let island = self.of_point[point];
        (island != NONE).then_some(island as usize)
    }

    /// Returns the number of islands.
    pub(super) fn count(&self) -> usize {
        self.ends.len()
    }

    /// Returns the island of a body; `None` if it touches nothing.
    pub(super) fn of_body(&mut self, body: usize) -> Option<usize> {
        let root = self.root(body);
        (self.label[root] != NONE).then(|| self.label[root] as usize)
    }

    /// Returns the places of an island's points in the [order](Self::point).
    pub(super) fn places(&self, island: usize) -> Range<usize> {
        let start = if island == 0 { 0 } else { self.ends[island - 1] };
        start as usize..self.ends[island] as usize
    }

    /// Returns the contact point at a place of the order.
    pub(super) fn point(&self, place: usize) -> usize {
        self.order[place] as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn islands(bodies: usize, points: &[[Option<usize>; 2]]) -> (Islands, Vec<Vec<usize>>) {
        let mut islands = Islands::new(bodies, 16);
        islands.find(points.iter().copied());
        let lists = (0..islands.count())
            .map(|island| islands.places(island).map(|place| islands.point(place)).collect())
            .collect();
        (islands, lists)
    }

    #[test]
    fn a_chain_of_bodies_is_one_island() {
        let points = [
            [Some(0), None],
            [Some(2), Some(3)],
            [Some(1), Some(0)],
            [None, Some(4)],
            [Some(3), Some(1)],
            [None, None],
        ];
        let (mut islands, lists) = islands(6, &points);
        assert_eq!(lists, [vec![0, 1, 2, 4], vec![3]]);
        assert_eq!([0, 3, 4, 5].map(|body| islands.of_body(body)), [Some(0), Some(0), Some(1), None]);
    }

    #[test]
    fn bodies_joined_only_by_the_world_are_separate_islands() {
        let (_, lists) = islands(3, &[[Some(2), None], [Some(0), None], [Some(2), None], [Some(1), None]]);
        assert_eq!(lists, [vec![0, 2], vec![1], vec![3]]);
    }
}
