//! Observation terms whose order or zero point in an imported network differs from motorium's.

use super::error::ImportError;
use crate::onnx::{Adapter, Model, Part};
use crate::policy::{Numbers, Observation, Policy, PolicyNetwork, Term};

/// An observation term, the index of each of its values in the order of motorium, and a number to add to
/// each value.
pub(super) struct Served {
    pub(super) observation: Observation,
    pub(super) order: Vec<usize>,
    pub(super) add: f64,
}

/// Returns the bytes of a network that reads the terms in the order of motorium; `bytes` if nothing changes.
pub(super) fn adapt(model: &Model, bytes: &[u8], terms: &[Served]) -> Result<Vec<u8>, ImportError> {
    let (mut picks, mut added) = (Vec::new(), Vec::new());
    for Served { observation, order, add } in terms {
        for _ in 0..observation.history {
            let first = picks.len();
            picks.extend(order.iter().map(|index| first + index));
            added.extend(order.iter().map(|_| *add as f32));
        }
    }
    let is_unchanged = picks.is_sorted() && added.iter().all(|add| *add == 0.0);
    let inputs: Vec<String> = model.inputs().into_iter().map(|input| input.name).collect();
    let outputs = model.outputs();
    match (&inputs[..], &outputs[..]) {
        ([input, inputs @ ..], [action, outputs @ ..]) if !is_unchanged => {
            let adapter = Adapter {
                width: picks.len(),
                parts: vec![Part { picks, add: added, ..Part::new(input) }],
                action: action.clone(),
                states: inputs.iter().cloned().zip(outputs.iter().cloned()).collect(),
                ..Adapter::default()
            };
            Ok(model.adapt(&adapter)?)
        }
        _ => Ok(bytes.to_vec()),
    }
}

/// Checks a policy with its network, and returns both; the network reads the terms in the order of motorium.
pub(super) fn finish(
    policy: Policy,
    model: &Model,
    bytes: &[u8],
    terms: &[Served],
) -> Result<(Policy, Vec<u8>), ImportError> {
    policy.check()?;
    PolicyNetwork::new(&policy, model.program(1)?)?;
    let network = adapt(model, bytes, terms)?;
    Ok((policy, network))
}

/// Grid of points at which a height scanner of Isaac Lab or mjlab measures, with the offset of the observed
/// heights.
///
/// Both programs observe the height of the sensor above the surface minus an offset (`height_scan` in
/// `isaaclab/envs/mdp/observations.py` and `mjlab/envs/mdp/observations.py`), whereas motorium observes the
/// height of the surface above the sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightGrid {
    /// Number of points along x and along y.
    points: [usize; 2],
    /// `true` if neighbouring values are neighbours along x, `false` if along y.
    is_along_x: bool,
    /// Height subtracted from the height of the sensor above the surface \[m\].
    offset: f64,
}

impl HeightGrid {
    /// Creates a grid from its lengths along x and y and the distance between points \[m\], like
    /// `grid_pattern` of Isaac Lab. `is_along_x` is `true` for the ordering `xy`. `offset` is the offset of
    /// the observed heights \[m\].
    pub fn new(size: [f64; 2], resolution: f64, is_along_x: bool, offset: f64) -> Self {
        let points = size.map(|length| (length / resolution + 1e-6).clamp(0.0, 999.0) as usize + 1);
        Self { points, is_along_x, offset }
    }

    /// Creates a grid from the numbers of points along x and y, in the order of mjlab's `GridPatternCfg`
    /// (ordering `xy`). `offset` is the offset of the observed heights \[m\].
    pub fn from_points(points: [usize; 2], offset: f64) -> Self {
        Self { points, is_along_x: true, offset }
    }

    /// Returns the number of points.
    pub(super) fn count(&self) -> usize {
        self.points[0].saturating_mul(self.points[1])
    }

    /// Returns the index of each value in a height scan of motorium: rows from back to front, each from right
    /// to left.
    pub(super) fn order(&self) -> Vec<usize> {
        let [along_x, along_y] = self.points;
        if !self.is_along_x {
            return (0..along_x * along_y).collect();
        }
        (0..along_y).flat_map(|y| (0..along_x).map(move |x| x * along_y + y)).collect()
    }

    /// Returns the term of a height scan with this factor and these bounds, which apply before the factor.
    pub(super) fn served(&self, scale: f64, clip: Option<[f64; 2]>, history: usize) -> Served {
        let order = self.order();
        let observation = Observation {
            scale: Numbers::All(-scale),
            clip: clip.map(|[low, high]| [-high - self.offset, -low - self.offset]),
            history,
            rays: Some(order.len()),
            ..Observation::new(Term::HeightScan)
        };
        Served { observation, order, add: -scale * self.offset }
    }
}
