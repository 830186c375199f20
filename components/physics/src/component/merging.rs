//! Merges contact points into fewer message entries when a message has no room for all of them.
//!
//! Points on the same link share entries: the first points keep separate entries, and the others become two
//! forces with the same sum and moment. A sensor that sums forces or wrenches therefore reads the same values
//! as without merging.

use nalgebra::{Point3, Vector3};

/// A force at a point of a link.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub(super) link: u32,
    pub(super) other: u32,
    pub(super) point: Point3<f64>,
    pub(super) force: Vector3<f64>,
    pub(super) depth: f64,
}

/// Passes the same points in the same order to a function in every call.
type Visit<'a> = dyn FnMut(&mut dyn FnMut(&Entry)) + 'a;

/// Points that share entries.
#[derive(Clone, Copy, Debug)]
struct Group {
    link: u32,
    /// `None` if points on any other body share the entries.
    other: Option<u32>,
    first: Entry,
    /// Numbers of points, of entries, and of points seen so far while entries are filled.
    points: usize,
    entries: usize,
    seen: usize,
    force: Vector3<f64>,
    /// Moment about the world origin \[N m\].
    moment: Vector3<f64>,
    /// Sums of weights and of weighted positions.
    weight: f64,
    weighted: Vector3<f64>,
    depth: f64,
    /// The merged point farthest from the first.
    farthest: Vector3<f64>,
}

/// Storage for the groups of a message with a maximum number of entries.
pub(super) struct Merger {
    groups: Vec<Group>,
    most: usize,
}

impl Merger {
    pub(super) fn new(most: usize) -> Self {
        Self { groups: Vec::with_capacity(most), most }
    }

    /// Calls `write` with the entries for the points that `visit` passes. Returns the number of points
    /// without a separate entry: they are merged, or omitted if there are more links than entries.
    pub(super) fn fill(&mut self, visit: &mut Visit<'_>, write: &mut dyn FnMut(&Entry)) -> u64 {
        let mut points = 0;
        visit(&mut |_| points += 1);
        if points <= self.most {
            visit(write);
            return 0;
        }
        if !self.share(visit, true) {
            self.share(visit, false);
        }
        let mut written = 0;
        let Self { groups, .. } = self;
        visit(&mut |entry| {
            let Some(group) = groups.iter_mut().find(|group| group.holds(entry)) else { return };
            group.seen += 1;
            if group.seen <= group.own() {
                written += 1;
                write(entry);
            } else {
                group.add(entry);
            }
        });
        for group in &self.groups {
            for entry in group.merged().into_iter().flatten() {
                written += 1;
                write(&entry);
            }
        }
        (points - written) as u64
    }

    /// Distributes the entries to links, or to pairs of links and other bodies. Returns `false` if some group
    /// gets no entry, or fewer than the two entries that merged points need.
    fn share(&mut self, visit: &mut Visit<'_>, pairs: bool) -> bool {
        let Self { groups, most } = self;
        groups.clear();
        let mut whole = true;
        visit(&mut |entry| {
            if let Some(group) = groups.iter_mut().find(|group| group.holds(entry)) {
                group.points += 1;
            } else if groups.len() < *most {
                groups.push(Group::new(entry, pairs));
            } else {
                whole = false;
            }
        });
        // One entry for each group, then a second, then the rest in order.
        let mut left = *most - groups.len();
        for most in [2, usize::MAX] {
            for group in &mut *groups {
                let more = (group.points.min(most) - group.entries).min(left);
                whole &= group.entries + more >= group.points.min(2);
                (group.entries, left) = (group.entries + more, left - more);
            }
        }
        whole
    }
}

impl Group {
    fn new(first: &Entry, pairs: bool) -> Self {
        Self {
            link: first.link,
            other: pairs.then_some(first.other),
            first: *first,
            points: 1,
            entries: 1,
            seen: 0,
            force: Vector3::zeros(),
            moment: Vector3::zeros(),
            weight: 0.0,
            weighted: Vector3::zeros(),
            depth: 0.0,
            farthest: Vector3::zeros(),
        }
    }

    fn holds(&self, entry: &Entry) -> bool {
        self.link == entry.link && self.other.is_none_or(|other| other == entry.other)
    }

    /// Returns the number of points with a separate entry.
    fn own(&self) -> usize {
        if self.points <= self.entries { self.points } else { self.entries.saturating_sub(2) }
    }

    fn add(&mut self, entry: &Entry) {
        let (at, start) = (entry.point.coords, self.first.point.coords);
        if self.weight == 0.0 || (at - start).norm() > (self.farthest - start).norm() {
            self.farthest = at;
        }
        // Points without force have a small weight, so that the centre is defined even if no point has a
        // force.
        let weight = entry.force.norm() + f64::MIN_POSITIVE;
        self.weight += weight;
        self.weighted += at * weight;
        self.force += entry.force;
        self.moment += at.cross(&entry.force);
        self.depth = self.depth.max(entry.depth);
    }

    /// Returns the entries of the merged points: one or two forces on both sides of their centre.
    fn merged(&self) -> [Option<Entry>; 2] {
        if self.weight == 0.0 {
            return [None; 2];
        }
        let centre = self.weighted / self.weight;
        let entry = |at: Vector3<f64>, force: Vector3<f64>| {
            let depth = self.depth;
            Some(Entry { point: Point3::from(at), force, depth, ..self.first })
        };
        if self.entries < 2 {
            return [entry(centre, self.force), None];
        }
        let moment = self.moment - centre.cross(&self.force);
        let arm = arm(&(self.farthest - centre), &moment);
        let square = arm.norm_squared();
        // Forces (F - D) / 2 and (F + D) / 2 at both ends of the arm; their moment is arm x D.
        let difference = if square > 0.0 { moment.cross(&arm) / square } else { Vector3::zeros() };
        [
            entry(centre - arm, (self.force - difference) * 0.5),
            entry(centre + arm, (self.force + difference) * 0.5),
        ]
    }
}

/// Returns a vector with the length of `reach` and perpendicular to `moment`, as close to `reach` as
/// possible.
fn arm(reach: &Vector3<f64>, moment: &Vector3<f64>) -> Vector3<f64> {
    let length = reach.norm();
    let Some(axis) = moment.try_normalize(f64::MIN_POSITIVE) else { return *reach };
    let across = reach - axis * axis.dot(reach);
    let across = if across.norm() > 1e-3 * length {
        across
    } else {
        axis.cross(&if axis.x.abs() < 0.8 { Vector3::x() } else { Vector3::y() })
    };
    // A pure couple of coincident points has zero reach.
    across.normalize() * if length > 0.0 { length } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Creates the given number of points on each link, in contact with one of three other bodies.
    fn points(links: &[usize]) -> Vec<Entry> {
        let mut entries = Vec::new();
        for (link, count) in links.iter().enumerate() {
            for index in 0..*count {
                let phase = (97 * link + index) as f64;
                let wave = |rate: f64| (rate * phase).sin();
                entries.push(Entry {
                    link: link as u32,
                    other: (index % 3) as u32,
                    point: Point3::new(wave(1.1), wave(2.3), 0.2 * wave(0.7)),
                    force: Vector3::new(wave(3.1), wave(1.7), 2.0 + wave(2.9)),
                    depth: 1e-3 * wave(0.3).abs(),
                });
            }
        }
        entries
    }

    fn filled(entries: &[Entry], most: usize) -> (Vec<Entry>, u64) {
        let mut found = Vec::new();
        let cut = Merger::new(most)
            .fill(&mut |visit| entries.iter().for_each(&mut *visit), &mut |entry| found.push(*entry));
        (found, cut)
    }

    fn wrench(entries: &[Entry], link: u32) -> [Vector3<f64>; 2] {
        let own = entries.iter().filter(|entry| entry.link == link);
        own.fold([Vector3::zeros(); 2], |[force, moment], entry| {
            [force + entry.force, moment + entry.point.coords.cross(&entry.force)]
        })
    }

    #[test]
    fn merged_entries_keep_the_wrench_on_every_link() {
        for links in [&[80][..], &[65], &[500, 3, 1], &[30; 5], &[40; 16], &[7; 30], &[9; 32]] {
            let entries = points(links);
            let (found, cut) = filled(&entries, 64);
            assert_eq!((found.len(), cut), (64, entries.len() as u64 - 64), "{links:?}");
            for link in 0..links.len() as u32 {
                let ([force, moment], sums) = (wrench(&entries, link), wrench(&found, link));
                assert!((force - sums[0]).norm() < 1e-11 * entries.len() as f64, "{links:?}: {sums:?}");
                assert!((moment - sums[1]).norm() < 1e-11 * entries.len() as f64, "{links:?}: {sums:?}");
            }
        }
    }

    #[test]
    fn points_that_have_room_keep_their_entries() {
        let entries = points(&[40, 24]);
        let (found, cut) = filled(&entries, 64);
        assert_eq!((found.len(), cut), (64, 0));
        assert!(found.iter().zip(&entries).all(|(a, b)| a.point == b.point && a.force == b.force));
    }

    #[test]
    fn one_link_on_one_body_keeps_all_but_the_last_points() {
        let mut entries = points(&[80]);
        entries.iter_mut().for_each(|entry| entry.other = 0);
        let (found, _) = filled(&entries, 64);
        assert!(found[..62].iter().zip(&entries).all(|(a, b)| a.point == b.point && a.force == b.force));
    }

    #[test]
    fn more_links_than_entries_are_counted() {
        let entries = points(&[2; 70]);
        let (found, cut) = filled(&entries, 64);
        assert_eq!((found.len(), cut), (64, 140 - 64));
    }

    #[test]
    fn coincident_points_and_points_without_force_are_merged() {
        let entry = Entry {
            link: 0,
            other: 0,
            point: Point3::new(1.0, 2.0, 3.0),
            force: Vector3::zeros(),
            depth: 0.0,
        };
        for force in [Vector3::zeros(), Vector3::x()] {
            let (found, cut) = filled(&[Entry { force, ..entry }; 70], 64);
            assert_eq!((found.len(), cut), (64, 6));
            assert!(found.iter().all(|found| (found.point - entry.point).norm() < 1e-9), "{found:?}");
            let [sum, moment] = wrench(&found, 0);
            let expected = entry.point.coords.cross(&(force * 70.0));
            assert!((sum - force * 70.0).norm() < 1e-9 && (moment - expected).norm() < 1e-9);
        }
    }
}
