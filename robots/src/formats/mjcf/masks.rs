//! `contype` and `conaffinity`: which bodies can collide.

use std::collections::BTreeMap;

use roxmltree::Node;

use super::attributes::Attributes;
use crate::Srdf;

/// Masks of the shapes of each body, by body name.
#[derive(Default)]
pub(crate) struct Masks {
    by_body: BTreeMap<String, Vec<[i32; 2]>>,
}

impl Masks {
    pub(crate) fn add(&mut self, body: &str, masks: [i32; 2]) {
        let known = self.by_body.entry(body.to_owned()).or_default();
        if !known.contains(&masks) {
            known.push(masks);
        }
    }

    /// Excludes pairs of bodies whose shapes cannot collide.
    pub(crate) fn exclude(&self, attributes: &Attributes<'_, '_>, root: Node<'_, '_>, exclusions: &mut Srdf) {
        let bodies: Vec<_> = self.by_body.iter().collect();
        for (index, (second, theirs)) in bodies.iter().enumerate() {
            for (first, ours) in &bodies[..index] {
                let compatible = |a: &[i32; 2], b: &[i32; 2]| a[0] & b[1] != 0 || b[0] & a[1] != 0;
                let colliding = ours.iter().flat_map(|a| theirs.iter().map(move |b| compatible(a, b)));
                let (some, all) = colliding.fold((false, true), |(some, all), one| (some || one, all && one));
                if !some {
                    exclusions.disabled.push(((*first).clone(), (*second).clone()));
                } else if !all {
                    let what = "contype and conaffinity of some geoms of a pair of bodies".to_owned();
                    let reason = "all shapes of two bodies are checked for collision, or none";
                    attributes.ignored(root, what, reason);
                }
            }
        }
    }
}
