//! Links that start too close to each other, and links and objects that overlap something at the start.

use super::Articulated;
use crate::BuildWarning;

/// Links that start closer than this are excluded from self-collision \[m\].
const TOO_CLOSE: f64 = 0.010;

/// Initial penetration depth above which a link or object gets a warning \[m\].
const INSIDE: f64 = 1e-3;

impl Articulated {
    /// Returns the pairs of links closer than [`TOO_CLOSE`], with a warning each. Also warns of links inside
    /// other things.
    pub(super) fn close_links(&mut self, warnings: &mut Vec<BuildWarning>) -> Vec<[usize; 2]> {
        let mut close = Vec::new();
        self.scene.detect(0.0, TOO_CLOSE);
        for (_, point, ..) in self.scene.points() {
            let (a, b) = point.colliders;
            let pair = [a.min(b), a.max(b)];
            let colliders = self.scene.colliders();
            let name = |index: usize| colliders.colliders[index].name.clone();
            let (first, second) = (name(pair[0]), name(pair[1]));
            if colliders.both_links(pair) {
                if close.contains(&pair) {
                    continue;
                }
                close.push(pair);
                // Links with several shapes are named once.
                let named = |warning: &BuildWarning| {
                    matches!(warning, BuildWarning::SelfCollisionOff { first: a, second: b, .. }
                        if (a, b) == (&first, &second))
                };
                if !warnings.iter().any(named) {
                    let distance = point.distance.max(0.0);
                    warnings.push(BuildWarning::SelfCollisionOff { first, second, distance });
                }
            } else if pair[0] < colliders.first_object && point.distance < -INSIDE {
                let warning = BuildWarning::StartsInside { link: first, other: second };
                if !warnings.contains(&warning) {
                    warnings.push(warning);
                }
            } else if point.distance < -INSIDE {
                add_overlap((first, second), -point.distance, warnings);
            }
        }
        close
    }
}

/// Warns of two overlapping objects, once for each pair, with the depth of its deepest point.
fn add_overlap(names: (String, String), depth: f64, warnings: &mut Vec<BuildWarning>) {
    let known = warnings.iter_mut().find_map(|warning| match warning {
        BuildWarning::ObjectsOverlap { first, second, depth }
            if (&*first, &*second) == (&names.0, &names.1) =>
        {
            Some(depth)
        }
        _ => None,
    });
    match known {
        Some(known) => *known = known.max(depth),
        None => warnings.push(BuildWarning::ObjectsOverlap { first: names.0, second: names.1, depth }),
    }
}
