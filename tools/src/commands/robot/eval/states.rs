//! Reader of states.

use anyhow::{Context as _, ensure};
use motorium_robots::{FrameId, Model, Wrench};
use nalgebra::Vector3;
use serde_json::Value;

use super::layout::Layout;

/// A state, in the model's order.
#[derive(Debug, Clone)]
pub(super) struct State {
    pub(super) q: Vec<f64>,
    /// Configuration as given, returned unchanged.
    pub(super) q_given: Vec<f64>,
    pub(super) v: Vec<f64>,
    pub(super) a: Vec<f64>,
    pub(super) tau: Vec<f64>,
    pub(super) wrench: Option<(FrameId, Wrench)>,
}

/// States of a document, and the quantities to compute.
#[derive(Debug, Clone)]
pub(super) struct States {
    pub(super) layout: Layout,
    pub(super) gravity: Vector3<f64>,
    /// Step of `q_integrated` \[s\].
    pub(super) dt: f64,
    /// Frames whose Jacobians and motions are requested.
    pub(super) frames: Vec<FrameId>,
    pub(super) cases: Vec<State>,
}

/// Returns the cases of a document: its `cases`, or the document if it is a list.
pub(super) fn cases(document: &Value) -> anyhow::Result<&Vec<Value>> {
    let cases = document.as_array().or_else(|| document["cases"].as_array());
    cases.context("the states have no list `cases`")
}

/// Reads the states of a document; `frames` as requested on the command line.
pub(super) fn read(
    model: &Model,
    layout: Layout,
    document: &Value,
    frames: &[String],
) -> anyhow::Result<States> {
    let named = match (&frames, &document["jacobian_frames"]) {
        ([], Value::Array(names)) => names.iter().filter_map(Value::as_str).map(str::to_string).collect(),
        ([], _) => model.frames().iter().map(|frame| frame.name.clone()).collect(),
        (named, _) => named.to_vec(),
    };
    let named = named.iter().map(|name| Ok(model.frame(name)?)).collect::<anyhow::Result<_>>()?;
    let gravity = match &document["gravity"] {
        Value::Null => vec![0.0, 0.0, -9.81],
        gravity => vector("gravity", gravity, 3)?,
    };
    let dt = match &document["dt"] {
        Value::Null => 0.01,
        dt => dt.as_f64().context("`dt` is not a number")?,
    };
    let states = cases(document)?.iter().enumerate();
    let states =
        states.map(|(index, case)| state(model, &layout, case).with_context(|| format!("case {index}")));
    let cases = states.collect::<anyhow::Result<_>>()?;
    Ok(States { gravity: Vector3::from_column_slice(&gravity), dt, frames: named, cases, layout })
}

fn state(model: &Model, layout: &Layout, case: &Value) -> anyhow::Result<State> {
    let (q, q_given) = configuration(model, layout, case)?;
    let columns = layout.columns(model);
    let tangent = |key: &str| {
        let mut ours = vec![0.0; model.nv()];
        if !case[key].is_null() {
            let theirs = vector(key, &case[key], layout.nv)?;
            columns.iter().zip(theirs).for_each(|(&column, value)| ours[column] = value);
        }
        anyhow::Ok(ours)
    };
    let wrench = match &case["fext"] {
        Value::Null => None,
        outside => {
            let frame = model.frame(outside["frame"].as_str().context("`fext.frame` is not a name")?)?;
            let six = vector("fext.wrench_local", &outside["wrench_local"], 6)?;
            let force = Vector3::from_column_slice(&six[..3]);
            Some((frame, Wrench { force, moment: Vector3::from_column_slice(&six[3..]) }))
        }
    };
    Ok(State { q, q_given, v: tangent("v")?, a: tangent("a")?, tau: tangent("tau")?, wrench })
}

/// Returns our configuration, and theirs.
fn configuration(model: &Model, layout: &Layout, case: &Value) -> anyhow::Result<(Vec<f64>, Vec<f64>)> {
    if case["q"].is_null() {
        let positions = case["joint_positions"].as_object().context("neither `q` nor `joint_positions`")?;
        let mut q = model.neutral();
        let offset = model.nq() - model.joint_count();
        for (name, value) in positions {
            let joint = model
                .joint_index(name)
                .with_context(|| format!("robot `{}` has no independent joint `{name}`", model.name()))?;
            q[offset + joint] =
                value.as_f64().with_context(|| format!("the position of `{name}` is not a number"))?;
        }
        let theirs = layout.theirs(model, &q);
        return Ok((q, theirs));
    }
    let theirs = vector("q", &case["q"], layout.nq)?;
    let q = layout.ours(model, &theirs);
    if model.base().floating {
        let norm = q[3..7].iter().map(|x| x * x).sum::<f64>().sqrt();
        ensure!((norm - 1.0).abs() < 1e-6, "the quaternion of `q` has norm {norm}, expected 1");
    }
    Ok((q, theirs))
}

fn vector(what: &str, value: &Value, length: usize) -> anyhow::Result<Vec<f64>> {
    let list = value.as_array().with_context(|| format!("`{what}` is not a list of numbers"))?;
    ensure!(list.len() == length, "`{what}` has {} entries, expected {length}", list.len());
    let number = |entry: &Value| {
        entry.as_f64().with_context(|| format!("`{what}` contains {entry}, expected numbers"))
    };
    list.iter().map(number).collect()
}
