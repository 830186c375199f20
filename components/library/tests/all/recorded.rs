//! The recorded movements of `golden/library.json` and their library.

use motorium_library::{DAMPING, Metric, MotionLibrary, Recordings, SampledSpring, Trajectory, Truncation};
use nalgebra::DMatrix;
use serde_json::Value;

pub(crate) fn golden() -> Value {
    serde_json::from_str(include_str!("../golden/library.json")).unwrap()
}

pub(crate) fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

pub(crate) fn recordings(golden: &Value) -> Recordings {
    let trajectories = golden["paths"].as_array().unwrap().iter().enumerate().map(|(k, movement)| {
        let dofs: Vec<Vec<f64>> = movement.as_array().unwrap().iter().map(numbers).collect();
        Trajectory {
            id: format!("m{k}"),
            label: Some(if k % 2 == 0 { "even" } else { "odd" }.into()),
            duration: 2.0,
            positions: DMatrix::from_fn(dofs[0].len(), dofs.len(), |i, d| dofs[d][i]),
        }
    });
    Recordings {
        names: ["l_arm", "leg", "r_arm"].map(String::from).to_vec(),
        trajectories: trajectories.collect(),
    }
}

pub(crate) fn spring() -> SampledSpring {
    SampledSpring::new(48, DAMPING).unwrap()
}

pub(crate) fn library(metric: Metric) -> MotionLibrary {
    MotionLibrary::build(&recordings(&golden()), spring(), metric, Truncation::All).unwrap()
}
