//! Order of joints in the vectors of the input, and the number of entries per joint.

use anyhow::{Context as _, ensure};
use motorium_robots::{JointKind, Model};
use serde_json::{Value, json};

/// Entries of a joint in the vectors.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Entry {
    pub(super) name: String,
    /// Index among the model's independent joints; `None` for the floating base.
    pub(super) joint: Option<usize>,
    pub(super) idx_q: usize,
    /// 7 for the base, 2 (cosine, sine) for a continuous joint, otherwise 1.
    pub(super) nq: usize,
    pub(super) idx_v: usize,
    pub(super) nv: usize,
}

/// Position of every joint in the vectors of the input.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layout {
    pub(super) entries: Vec<Entry>,
    pub(super) nq: usize,
    pub(super) nv: usize,
}

/// Name of the floating base among the joints.
const ROOT: &str = "root_joint";

impl Layout {
    /// Reads the layout from `joints` of the document: a list of names, or of tables with `name` and
    /// optionally `idx_q`, `nq`, `idx_v`. Without it, Pinocchio's layout is used: the base, then the joints
    /// in `order`, or in the model's order if `order` is empty, as for an MJCF file.
    pub(super) fn from_document(model: &Model, document: &Value, order: &[String]) -> anyhow::Result<Self> {
        let mut entries = match &document["joints"] {
            Value::Null if order.is_empty() => usual(model, model.joint_names()),
            Value::Null => usual(model, order),
            Value::Array(joints) => {
                joints.iter().map(|joint| entry(model, joint)).collect::<anyhow::Result<Vec<_>>>()?
            }
            _ => anyhow::bail!("`joints` is not a list"),
        };
        let first = &document["cases"][0]["q"];
        number(&mut entries, &document["joints"], first.as_array().map(Vec::len))?;
        let layout = Self {
            nq: entries.iter().map(|entry| entry.idx_q + entry.nq).max().unwrap_or(0),
            nv: entries.iter().map(|entry| entry.idx_v + entry.nv).max().unwrap_or(0),
            entries,
        };
        layout.check(model)?;
        Ok(layout)
    }

    /// Checks that every joint occurs once, and that no two overlap.
    fn check(&self, model: &Model) -> anyhow::Result<()> {
        let mut seen = vec![false; model.joint_count()];
        for entry in &self.entries {
            if let Some(joint) = entry.joint {
                ensure!(!seen[joint], "joint `{}` is listed twice", entry.name);
                seen[joint] = true;
            }
        }
        let missing: Vec<_> = model
            .joint_names()
            .iter()
            .zip(seen)
            .filter(|(_, seen)| !seen)
            .map(|(name, _)| name.as_str())
            .collect();
        ensure!(missing.is_empty(), "joints of the robot are missing: {}", missing.join(", "));
        let based = self.entries.iter().any(|entry| entry.joint.is_none());
        ensure!(
            based == model.base().floating,
            "{}",
            if based {
                "`root_joint` is listed, but the robot's base is fixed; add --floating-base"
            } else {
                "the robot's base floats, but `root_joint` is not listed; add --fixed-base if the base should be fixed"
            }
        );
        ensure!(self.nv == model.nv(), "the joints have {} entries in v, expected {}", self.nv, model.nv());
        Ok(())
    }

    /// Returns the layout for the answer.
    pub(super) fn json(&self) -> Value {
        let entry = |entry: &Entry| json!({ "name": entry.name, "idx_q": entry.idx_q, "nq": entry.nq, "idx_v": entry.idx_v, "nv": entry.nv });
        self.entries.iter().map(entry).collect()
    }

    /// Returns the index in our velocity vector for each entry of theirs.
    pub(super) fn columns(&self, model: &Model) -> Vec<usize> {
        let offset = model.nv() - model.joint_count();
        let mut columns = vec![0; self.nv];
        for entry in &self.entries {
            for place in 0..entry.nv {
                columns[entry.idx_v + place] = entry.joint.map_or(place, |joint| offset + joint);
            }
        }
        columns
    }

    /// Converts their configuration to ours.
    pub(super) fn ours(&self, model: &Model, theirs: &[f64]) -> Vec<f64> {
        let mut q = model.neutral();
        let offset = model.nq() - model.joint_count();
        for entry in &self.entries {
            let part = &theirs[entry.idx_q..entry.idx_q + entry.nq];
            match (entry.joint, part) {
                (None, base) => q[..7].copy_from_slice(base),
                (Some(joint), &[cosine, sine]) => q[offset + joint] = sine.atan2(cosine),
                (Some(joint), part) => q[offset + joint] = part[0],
            }
        }
        q
    }

    /// Converts our configuration to theirs.
    pub(super) fn theirs(&self, model: &Model, ours: &[f64]) -> Vec<f64> {
        let mut q = vec![0.0; self.nq];
        let offset = model.nq() - model.joint_count();
        for entry in &self.entries {
            match (entry.joint, entry.nq) {
                (None, _) => q[entry.idx_q..entry.idx_q + 7].copy_from_slice(&ours[..7]),
                (Some(joint), 2) => {
                    let (sine, cosine) = ours[offset + joint].sin_cos();
                    (q[entry.idx_q], q[entry.idx_q + 1]) = (cosine, sine);
                }
                (Some(joint), _) => q[entry.idx_q] = ours[offset + joint],
            }
        }
        q
    }
}

fn base() -> Entry {
    Entry { name: ROOT.to_string(), joint: None, idx_q: 0, nq: 7, idx_v: 0, nv: 6 }
}

fn single(model: &Model, joint: usize) -> Entry {
    let nq = if model.joint(joint).kind == JointKind::Continuous { 2 } else { 1 };
    Entry { name: model.joint_names()[joint].clone(), joint: Some(joint), idx_q: 0, nq, idx_v: 0, nv: 1 }
}

/// Returns Pinocchio's order; the parts of a planar joint, a single joint there, are consecutive.
fn usual(model: &Model, order: &[String]) -> Vec<Entry> {
    let mut entries: Vec<Entry> = model.base().floating.then(base).into_iter().collect();
    for name in order {
        let planar = |joint: &String| joint.strip_prefix(name).is_some_and(|rest| rest.starts_with('/'));
        let found =
            model.joint_names().iter().enumerate().filter(|(_, joint)| *joint == name || planar(joint));
        entries.extend(found.map(|(joint, _)| single(model, joint)));
    }
    entries
}

/// Reads one entry of `joints`, without its positions.
fn entry(model: &Model, joint: &Value) -> anyhow::Result<Entry> {
    let name = joint.as_str().or_else(|| joint["name"].as_str()).context("a joint has no name")?;
    if name == ROOT && model.joint_index(name).is_none() {
        return Ok(base());
    }
    let index = model
        .joint_index(name)
        .with_context(|| format!("robot `{}` has no independent joint `{name}`", model.name()))?;
    let mut entry = single(model, index);
    if let Some(nq) = joint["nq"].as_u64() {
        let two = nq == 2 && model.joint(index).kind != JointKind::Prismatic;
        ensure!(nq == 1 || two, "joint `{name}` has {nq} entries in q, expected 1, or 2 for cosine and sine");
        entry.nq = nq as usize;
    }
    Ok(entry)
}

/// Assigns the positions of every entry: the given ones, or else consecutive ones.
fn number(entries: &mut [Entry], stated: &Value, length: Option<usize>) -> anyhow::Result<()> {
    // If the list does not define the form of continuous joints, the length of q does.
    let says = |index: usize| stated[index]["nq"].is_u64();
    let plain = |entry: &Entry| if entry.joint.is_some() { 1 } else { entry.nq };
    if length == Some(entries.iter().map(plain).sum()) {
        for (_, entry) in entries.iter_mut().enumerate().filter(|(index, _)| !says(*index)) {
            entry.nq = plain(entry);
        }
    }
    let (mut q, mut v) = (0, 0);
    for (index, entry) in entries.iter_mut().enumerate() {
        let place = |key: &str| stated[index][key].as_u64().map(|place| place as usize);
        (entry.idx_q, entry.idx_v) = (place("idx_q").unwrap_or(q), place("idx_v").unwrap_or(v));
        (q, v) = (entry.idx_q + entry.nq, entry.idx_v + entry.nv);
        ensure!(q <= 100_000 && v <= 100_000, "the index of joint `{}` is above 100000", entry.name);
    }
    Ok(())
}
