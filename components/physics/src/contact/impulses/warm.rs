//! Warm start: the impulses of the last step, which are the initial guess for the next step.

use super::Impulses;

/// The impulse at a contact point, which is the initial guess for the same point in the next step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Known {
    key: u64,
    impulse: [f64; 3],
    /// Length of the step in which the impulse acted \[s\].
    h: f64,
}

impl Impulses {
    /// Returns the impulses of the last step by the keys of their contact points, which are the warm start of
    /// the next step.
    pub(crate) fn save(&self) -> Vec<Known> {
        self.known().collect()
    }

    pub(super) fn known(&self) -> impl Iterator<Item = Known> {
        let known = |(index, &(key, h)): (usize, &(u64, f64))| Known { key, impulse: self.impulse(index), h };
        self.keys.iter().enumerate().map(known)
    }

    /// Restores saved impulses.
    pub(crate) fn restore(&mut self, impulses: &[Known]) {
        self.forget();
        for (index, known) in impulses.iter().enumerate() {
            self.keys.push((known.key, known.h));
            self.lambda[3 * index..][..3].copy_from_slice(&known.impulse);
        }
    }

    /// Returns the force of the last step at the contact point with this key, as an impulse over `h` \[s\].
    /// Also returns the index of the point, which is likely the `expected` one.
    pub(super) fn of_last(&self, key: u64, h: f64, expected: usize) -> ([f64; 3], Option<usize>) {
        let (ahead, behind) = self.last.split_at(expected);
        let found = behind.iter().chain(ahead).position(|known| known.key == key);
        let place = found.map(|place| (expected + place) % self.last.len());
        let impulse = place.map_or([0.0; 3], |place| {
            let Known { impulse, h: length, .. } = self.last[place];
            if length == h { impulse } else { impulse.map(|part| part * (h / length)) }
        });
        (impulse, place)
    }
}
