//! Limbs of a robot: its feet and tools, from its SRDF or, without an SRDF, from the names of its links.

use std::collections::BTreeSet;

use crate::geometry::srdf::{GroupEnd, group_ends};
use crate::loading::end_effector::tip_joints;
use crate::loading::postures::srdf_beside;
use crate::{FrameId, Loaded, Model};

/// Minimum number of joints between the base and a foot.
const FEWEST_JOINTS: usize = 2;
/// Minimum number of joints between the base and a wheel at the end of a leg; fewer indicate the casters of a
/// mobile base.
const FEWEST_JOINTS_OF_WHEEL: usize = 4;

/// The end of a chain of joints.
#[derive(Clone, Debug)]
pub(super) struct Limb {
    /// Name in the SRDF, or of the link.
    pub(super) name: String,
    pub(super) frame: FrameId,
    /// Joints that move the limb, starting at the base.
    pub(super) joints: Vec<String>,
    /// Joints beyond the limb.
    pub(super) fingers: Vec<String>,
}

impl Limb {
    fn new(model: &Model, name: &str, frame: FrameId) -> Self {
        let (joints, fingers) = tip_joints(model, frame);
        Self { name: name.to_owned(), frame, joints, fingers }
    }

    /// Returns the body to which the limb is fixed.
    pub(super) fn body(&self, model: &Model) -> Option<usize> {
        model.frames()[self.frame.index()].body
    }
}

/// Feet and tools.
#[derive(Clone, Debug, Default)]
pub(super) struct Limbs {
    /// Either none or at least two.
    pub(super) feet: Vec<Limb>,
    /// End effectors that are not feet.
    pub(super) tools: Vec<Limb>,
    /// `true` if the limbs are from the SRDF.
    pub(super) from_srdf: bool,
}

impl Limbs {
    pub(super) fn of_robot(robot: &Loaded) -> Self {
        let model = &robot.model;
        let text = robot.path.as_ref().and_then(|path| srdf_beside(path, model));
        let ends = text.and_then(|text| group_ends(&text).ok()).unwrap_or_default();
        let mut limbs = Self::of_ends(model, &ends);
        if limbs.feet.len() < 2 {
            limbs.feet = feet_by_name(model);
        }
        if limbs.tools.is_empty() && limbs.feet.is_empty() {
            limbs.tools.extend(model.tip().map(|tip| Limb::new(model, "tool", tip)));
        }
        limbs
    }

    /// Returns the end effectors of an SRDF whose links exist in the model.
    fn of_ends(model: &Model, ends: &[GroupEnd]) -> Self {
        let mut limbs = Self::default();
        for end in ends {
            let Ok(frame) = model.frame(&end.link) else { continue };
            let Some(body) = model.frames()[frame.index()].body else { continue };
            let texts = [&end.name, &end.link, &end.group].map(|text| text.to_ascii_lowercase());
            let names =
                |parts: &[&str]| texts.iter().any(|text| parts.iter().any(|part| text.contains(part)));
            let known = |all: &[Limb], body: usize| all.iter().any(|limb| limb.body(model) == Some(body));
            if names(&["foot", "feet", "sole", "leg"]) {
                let limb = Limb::new(model, &end.name, frame);
                if limb.joints.len() >= FEWEST_JOINTS && !known(&limbs.feet, body) {
                    limbs.feet.push(limb);
                }
            } else {
                let palm = model.before_fingers(body);
                let last = model.frames().iter().rposition(|frame| frame.body == Some(palm)).map(FrameId);
                let frame = if palm == body { Some(frame) } else { last };
                if let Some(frame) = frame.filter(|_| !known(&limbs.tools, palm)) {
                    limbs.tools.push(Limb::new(model, &end.name, frame));
                }
            }
        }
        limbs.from_srdf = !limbs.feet.is_empty() || !limbs.tools.is_empty();
        limbs
    }
}

/// Returns the links at the ends of legs, by their names: either none or at least two.
fn feet_by_name(model: &Model) -> Vec<Limb> {
    for (words, joints) in [
        (&["foot", "sole"][..], FEWEST_JOINTS),
        (&["wheel"], FEWEST_JOINTS_OF_WHEEL),
        (&["toe"], FEWEST_JOINTS),
        (&["ankle"], FEWEST_JOINTS),
    ] {
        let named = |name: &str| words.iter().any(|word| name.to_ascii_lowercase().contains(word));
        let bodies: BTreeSet<usize> =
            model.frames().iter().filter(|frame| named(&frame.name)).filter_map(|frame| frame.body).collect();
        let carries_another = |body: usize| {
            bodies
                .iter()
                .any(|&other| other != body && ancestors(model, other).any(|ancestor| ancestor == body))
        };
        let ends = bodies.iter().copied().filter(|&body| !carries_another(body));
        let feet: Vec<Limb> = ends
            .filter_map(|body| {
                let here = |frame: &crate::Frame| frame.body == Some(body) && named(&frame.name);
                let frame = model.frames().iter().rposition(here).map(FrameId)?;
                let limb = Limb::new(model, &model.frames()[frame.index()].name, frame);
                (limb.joints.len() >= joints).then_some(limb)
            })
            .collect();
        if feet.len() >= 2 {
            return feet;
        }
    }
    Vec::new()
}

/// Iterates over the bodies from `body` towards the base, including `body`.
fn ancestors(model: &Model, body: usize) -> impl Iterator<Item = usize> + '_ {
    std::iter::successors(Some(body), |&body| model.bodies()[body].parent)
}
