//! Import of a policy from a file of weights and a handwritten table that describes the policy.

use serde::Deserialize;

use super::{ImportError, NETWORK};
use crate::inference::{Program, Unary};
use crate::onnx::{Model, write_mlp};
use crate::policy::{Policy, PolicyNetwork};
use crate::safetensors::Tensors;

/// Weights of a multilayer perceptron, as described by a handwritten table.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Weights {
    /// Dense layers from the input to the output: each is `NAME.weight` (outputs x inputs) and `NAME.bias`.
    layers: Vec<String>,
    activation: Activation,
    normaliser: Option<Normaliser>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Activation {
    Elu,
    Relu,
    Tanh,
}

/// Observations are `(x - mean) / (std + epsilon)`, or `(x - mean) / sqrt(variance + epsilon)`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Normaliser {
    mean: String,
    std: Option<String>,
    variance: Option<String>,
    epsilon: f64,
}

/// Creates a policy from weights and a table. Returns the policy and the bytes of its network as an ONNX
/// file. The table is a `policy.toml` without `network` and with an additional table `weights`:
///
/// ```toml
/// [weights]
/// layers     = ["actor.0", "actor.2", "actor.4"]
/// activation = "elu"
/// normaliser = { mean = "normalizer._mean", std = "normalizer._std", epsilon = 1e-2 }
/// ```
///
/// The normaliser is merged into the first layer.
///
/// # Errors
///
/// [`ImportError`] with the invalid key or tensor.
pub fn import_weights(file: &Tensors, table: &str) -> Result<(Policy, Vec<u8>), ImportError> {
    let wrong = |error: toml::de::Error| ImportError::Table(error.to_string());
    let mut table: toml::Table = table.parse().map_err(wrong)?;
    let unusable = |key: &'static str, message: &str| ImportError::Key { key, message: message.to_owned() };
    let missing = || unusable("weights", "missing, expected a table with `layers` and `activation`");
    let weights = table.remove("weights").ok_or_else(missing)?;
    let Weights { layers: names, activation, normaliser } = weights.try_into().map_err(wrong)?;
    if table.insert("network".to_owned(), NETWORK.into()).is_some() {
        return Err(unusable("network", "expected no value, because the import writes it"));
    }
    let policy: Policy = table.try_into().map_err(wrong)?;
    policy.check()?;
    let tensor = |name: &str, shape: &[usize]| {
        let refused = |message: String| ImportError::Tensor { name: name.to_owned(), message };
        let tensor = file.tensors.get(name).ok_or_else(|| {
            let names: Vec<&str> = file.tensors.keys().map(String::as_str).collect();
            refused(format!("not in the file, which has {}", names.join(", ")))
        })?;
        // normalisers have rows of length one
        let found: Vec<usize> = tensor.shape.iter().copied().skip_while(|length| *length == 1).collect();
        let expected: Vec<usize> = shape.iter().copied().skip_while(|length| *length == 1).collect();
        if found != expected {
            return Err(refused(format!("shape {:?}, expected {shape:?}", tensor.shape)));
        }
        Ok(tensor.values.clone())
    };
    let inputs = policy.inputs()?;
    let mut width = inputs;
    let mut layers = Vec::new();
    for name in &names {
        let bias_name = format!("{name}.bias");
        let outputs = file.tensors.get(&bias_name).map_or(0, |bias| bias.values.len());
        let bias = tensor(&bias_name, &[outputs])?;
        layers.push((tensor(&format!("{name}.weight"), &[outputs, width])?, bias));
        width = outputs;
    }
    if let (Some(normaliser), Some((weights, bias))) = (&normaliser, layers.first_mut()) {
        let Normaliser { mean, std, variance, epsilon } = normaliser;
        let mean = tensor(mean, &[inputs])?;
        let deviation: Vec<f64> = match (std, variance) {
            (Some(std), None) => {
                tensor(std, &[inputs])?.iter().map(|std| f64::from(*std) + epsilon).collect()
            }
            (None, Some(variance)) => tensor(variance, &[inputs])?
                .iter()
                .map(|variance| (f64::from(*variance) + epsilon).sqrt())
                .collect(),
            _ => {
                return Err(unusable("weights.normaliser", "expected one of `std` and `variance`"));
            }
        };
        if let Some(found) = deviation.iter().find(|deviation| deviation.is_nan() || **deviation <= 0.0) {
            let message = format!("found a deviation of {found}, expected above 0");
            return Err(unusable("weights.normaliser", &message));
        }
        for (row, bias) in weights.chunks_exact_mut(inputs).zip(bias) {
            let mut shift = f64::from(*bias);
            for ((weight, mean), deviation) in row.iter_mut().zip(&mean).zip(&deviation) {
                let scaled = f64::from(*weight) / deviation;
                shift -= scaled * f64::from(*mean);
                *weight = scaled as f32;
            }
            *bias = shift as f32;
        }
    }
    let activation = match activation {
        Activation::Elu => Unary::Elu(1.0),
        Activation::Relu => Unary::Relu,
        Activation::Tanh => Unary::Tanh,
    };
    let network = write_mlp(inputs, &layers, activation, &[]);
    let program: Program = Model::read(&network)?.program(1)?;
    PolicyNetwork::new(&policy, program)?;
    Ok((policy, network))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::safetensors::Tensor;

    const TABLE: &str = r#"
rate = 50.0
observations = [{ term = "joint_positions" }, { term = "joint_velocities", scale = 0.05 }]
[action]
joints = ["hip"]
scale = 0.5
default_pose = [0.3]
[weights]
layers = ["actor.0", "actor.2"]
activation = "tanh"
normaliser = { mean = "norm.mean", variance = "norm.var", epsilon = 0.25 }
"#;

    fn weights() -> Tensors {
        let mut file = Tensors::default();
        for (name, shape, values) in [
            ("actor.0.weight", vec![3, 2], vec![0.5, -1.0, 2.0, 0.25, -0.75, 1.5]),
            ("actor.0.bias", vec![3], vec![0.1, -0.2, 0.3]),
            ("actor.2.weight", vec![1, 3], vec![1.0, -2.0, 0.5]),
            ("actor.2.bias", vec![1], vec![0.05]),
            ("norm.mean", vec![1, 2], vec![0.4, -0.1]),
            ("norm.var", vec![1, 2], vec![2.0, 0.0]),
        ] {
            file.tensors.insert(name.to_owned(), Tensor { shape, values });
        }
        file
    }

    #[test]
    fn weights_with_a_normaliser_give_the_same_outputs() {
        let (policy, network) = import_weights(&weights(), TABLE).expect("a policy");
        let program = Model::read(&network).and_then(|model| model.program(1)).expect("a network");
        let mut network = PolicyNetwork::new(&policy, program).expect("it fits");
        for x in [[0.0, 0.0], [1.0, -0.5], [-3.0, 0.2]] {
            network.observation_mut().copy_from_slice(&[x[0] as f32, x[1] as f32]);
            let found = f64::from(network.run()[0]);
            let z = [(x[0] - 0.4) / 1.5, (x[1] + 0.1) / 0.5];
            let hidden: [f64; 3] =
                [0.5 * z[0] - z[1] + 0.1, 2.0 * z[0] + 0.25 * z[1] - 0.2, -0.75 * z[0] + 1.5 * z[1] + 0.3];
            let expected = hidden[0].tanh() - 2.0 * hidden[1].tanh() + 0.5 * hidden[2].tanh() + 0.05;
            assert!((found - expected).abs() < 2e-6, "{found} {expected}");
        }
    }

    #[test]
    fn mismatched_weights_are_reported() {
        let mut file = weights();
        file.tensors.remove("actor.2.weight");
        let tensor = |file: &Tensors, table: &str| match import_weights(file, table) {
            Err(ImportError::Tensor { name, .. }) => name,
            other => panic!("{other:?}"),
        };
        assert_eq!(tensor(&file, TABLE), "actor.2.weight");
        let table = TABLE.replace("{ term = \"joint_positions\" }, ", "");
        assert_eq!(tensor(&weights(), &table), "actor.0.weight");
        let table = TABLE.replace("[\"hip\"]", "[\"hip\", \"knee\"]").replace("[0.3]", "[0.3, 0.1]");
        assert_eq!(tensor(&weights(), &table), "actor.0.weight", "two joints");
        let import = |from: &str, to: &str| import_weights(&weights(), &TABLE.replace(from, to));
        for (from, to, expected) in [
            ("[weights]", "[weight]", "weights"),
            ("rate = 50.0", "rate = 50.0\nnetwork = \"policy.onnx\"", "network"),
            ("variance = \"norm.var\", ", "", "weights.normaliser"),
            ("epsilon = 0.25", "epsilon = 0.0", "weights.normaliser"),
        ] {
            match import(from, to) {
                Err(ImportError::Key { key, .. }) => assert_eq!(key, expected),
                other => panic!("{to}: {other:?}"),
            }
        }
        assert!(matches!(import("\"tanh\"", "\"selu\""), Err(ImportError::Table(_))));
    }
}
