//! Import of policies from other training frameworks.
//!
//! - [`import_mjlab`]: an ONNX file with the metadata of mjlab (`mjlab/rl/exporter_utils.py`: `joint_names`,
//!   `default_joint_pos`, `joint_stiffness`, `joint_damping`, `action_scale`, `observation_names`). Numbers
//!   have three decimals there.
//! - [`import_weights`]: the safetensors of rsl_rl, Stable-Baselines3 or CleanRL, with a handwritten table.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::{
    Action, ActionKind, NetworkMismatch, Numbers, Observation, Policy, PolicyError, PolicyNetwork, Term,
};
use crate::inference::{Program, Unary};
use crate::onnx::{Model, OnnxError, write_mlp};
use crate::safetensors::Tensors;

/// File name of the network in an imported folder.
const NETWORK: &str = "policy.onnx";

/// Observation terms of mjlab and Isaac Lab, by the names of their functions.
const TERMS: [(&str, Term); 11] = [
    ("base_lin_vel", Term::BaseLinearVelocity),
    ("base_ang_vel", Term::BaseAngularVelocity),
    ("projected_gravity", Term::ProjectedGravity),
    ("command", Term::Command),
    ("velocity_commands", Term::Command),
    ("joint_pos", Term::JointPositions),
    ("joint_vel", Term::JointVelocities),
    ("actions", Term::LastAction),
    ("last_action", Term::LastAction),
    ("height_scan", Term::HeightScan),
    ("height_scanner", Term::HeightScan),
];

/// The policy cannot be imported.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImportError {
    /// The network cannot be read or compiled.
    #[error(transparent)]
    Onnx(#[from] OnnxError),
    /// An entry of the metadata is missing.
    #[error("no `{0}` in the metadata of the file; help: export it with mjlab, which adds it")]
    Missing(&'static str),
    /// An entry of the metadata is not a list of numbers.
    #[error("`{key}` has \"{found}\", expected numbers with commas between them")]
    Number {
        /// The entry.
        key: &'static str,
        /// The text found.
        found: String,
    },
    /// An entry of the metadata has a different length from the action.
    #[error("`{key}` has {found} entries, expected {expected}, one for each output of the network")]
    Count {
        /// The entry.
        key: &'static str,
        /// Number of entries found.
        found: usize,
        /// Number of outputs of the network.
        expected: usize,
    },
    /// No topic provides this observation term.
    #[error("observation \"{name}\" is unknown, expected one of {}", known())]
    Term {
        /// Name of the term.
        name: String,
    },
    /// The size of the observation terms differs from the network's input.
    #[error(
        "the observation terms have {expected} numbers, the network reads {found}; help: a history of several steps is given by `--history`"
    )]
    Width {
        /// Size of the network's input.
        found: usize,
        /// Size of the terms.
        expected: usize,
    },
    /// The table does not parse.
    #[error("{0}")]
    Table(String),
    /// A tensor is missing or has the wrong shape.
    #[error("tensor \"{name}\": {message}")]
    Tensor {
        /// Name of the tensor.
        name: String,
        /// The shape found and the shape expected.
        message: String,
    },
    /// The result is not a valid policy.
    #[error(transparent)]
    Policy(#[from] PolicyError),
    /// The network does not match the policy.
    #[error(transparent)]
    Network(#[from] NetworkMismatch),
}

fn known() -> String {
    TERMS.map(|(name, _)| name).join(", ")
}

/// Settings that are missing in the metadata of an ONNX file.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportOptions {
    /// Rate of the policy \[Hz\].
    pub rate: f64,
    /// Steps of history of each term.
    pub history: usize,
    /// Robot the policy was trained for.
    pub robot: Option<String>,
}

/// Creates a policy from an ONNX file with the metadata of mjlab. The network stays unchanged, under the name
/// `policy.onnx`.
///
/// # Errors
///
/// [`ImportError`] with the invalid entry or the unsupported node.
pub fn import_mjlab(bytes: &[u8], options: ImportOptions) -> Result<Policy, ImportError> {
    let model = Model::read(bytes)?;
    let program = model.program(1)?;
    let numbers =
        |shape: Option<&crate::inference::Port>| shape.map_or(0, |port| port.shape.iter().product::<usize>());
    let (inputs, outputs) = (numbers(program.inputs().first()), numbers(program.outputs().first()));
    let metadata: BTreeMap<&str, &str> = model.metadata().collect();
    let entry = |key: &'static str| metadata.get(key).copied().ok_or(ImportError::Missing(key));
    let list = |key: &'static str| {
        let names: Vec<String> = entry(key)?.split(',').map(|name| name.trim().to_owned()).collect();
        Ok::<_, ImportError>(names)
    };
    let count = |key: &'static str, found: usize| {
        if found == outputs { Ok(()) } else { Err(ImportError::Count { key, found, expected: outputs }) }
    };
    let values = |key: &'static str| {
        let parse =
            |text: &String| text.parse::<f64>().map_err(|_| ImportError::Number { key, found: text.clone() });
        list(key)?.iter().map(parse).collect::<Result<Vec<f64>, ImportError>>()
    };
    let each = |key: &'static str| {
        let values = values(key)?;
        count(key, values.len())?;
        Ok::<_, ImportError>(values)
    };
    let joints = list("joint_names")?;
    count("joint_names", joints.len())?;
    let scale = match values("action_scale")?.as_slice() {
        [scale] => Numbers::All(*scale),
        scales => {
            count("action_scale", scales.len())?;
            Numbers::Each(scales.to_vec())
        }
    };
    let action = Action {
        joints,
        kind: ActionKind::Position,
        scale,
        offset: Numbers::All(0.0),
        default_pose: each("default_joint_pos")?,
        clip: None,
        kp: Some(Numbers::Each(each("joint_stiffness")?)),
        kd: Some(Numbers::Each(each("joint_damping")?)),
    };
    let term = |name: &String| match TERMS.iter().find(|(known, _)| known == name) {
        Some((_, term)) => Ok(Observation { history: options.history, ..Observation::new(*term) }),
        None => Err(ImportError::Term { name: name.clone() }),
    };
    let observations = list("observation_names")?.iter().map(term).collect::<Result<_, _>>()?;
    let ImportOptions { rate, history, robot } = options;
    let mut policy = Policy { network: NETWORK.to_owned(), rate, robot, observations, action, pattern: None };
    // the rest of the input is the height scan
    let width = |policy: &Policy| -> usize {
        policy.observations.iter().map(|term| policy.width(term) * term.history).sum()
    };
    let others = width(&policy);
    let mut scans = policy.observations.iter_mut().filter(|observation| observation.term == Term::HeightScan);
    if let (Some(scan), None) = (scans.next(), scans.next()) {
        scan.rays = inputs.checked_sub(others).map(|left| left / history.max(1));
    }
    let expected = width(&policy);
    if expected != inputs {
        return Err(ImportError::Width { found: inputs, expected });
    }
    policy.check()?;
    PolicyNetwork::new(&policy, program)?;
    Ok(policy)
}

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

/// Creates a policy and its network, an ONNX file, from weights and a table. The table is a `policy.toml`
/// without `network`, and with a table `weights`:
///
/// ```toml
/// [weights]
/// layers     = ["actor.0", "actor.2", "actor.4"]
/// activation = "elu"
/// normaliser = { mean = "normalizer._mean", std = "normalizer._std", epsilon = 1e-2 }
/// ```
///
/// The normaliser becomes part of the first layer.
///
/// # Errors
///
/// [`ImportError`] with the key or the tensor.
pub fn import_weights(file: &Tensors, table: &str) -> Result<(Policy, Vec<u8>), ImportError> {
    let wrong = |error: toml::de::Error| ImportError::Table(error.to_string());
    let mut table: toml::Table = table.parse().map_err(wrong)?;
    let weights = table.remove("weights").ok_or_else(|| {
        ImportError::Table("no table `weights`, expected `layers` and `activation`".to_owned())
    })?;
    let Weights { layers: names, activation, normaliser } = weights.try_into().map_err(wrong)?;
    if table.insert("network".to_owned(), NETWORK.into()).is_some() {
        let message = "`network` is given, expected to be left out: the import writes it";
        return Err(ImportError::Table(message.to_owned()));
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
                let message = "`weights.normaliser` expected one of `std` and `variance`";
                return Err(ImportError::Table(message.to_owned()));
            }
        };
        if let Some(found) = deviation.iter().find(|deviation| deviation.is_nan() || **deviation <= 0.0) {
            let message = format!("a deviation of {found} in `weights.normaliser`, expected above 0");
            return Err(ImportError::Table(message));
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

    const METADATA: [(&str, &str); 7] = [
        ("run_path", "team/run"),
        ("joint_names", "knee,hip"),
        ("default_joint_pos", "0.100,-0.200"),
        ("joint_stiffness", "20.000,30.000"),
        ("joint_damping", "0.500,0.600"),
        ("action_scale", "0.250"),
        (
            "observation_names",
            "base_ang_vel,projected_gravity,command,joint_pos,joint_vel,actions,height_scan",
        ),
    ];

    fn options() -> ImportOptions {
        ImportOptions { rate: 50.0, history: 1, robot: Some("go1".to_owned()) }
    }

    fn network(inputs: usize, metadata: &[(&str, &str)]) -> Vec<u8> {
        write_mlp(inputs, &[(vec![0.1; 2 * inputs], vec![0.0; 2])], Unary::Elu(1.0), metadata)
    }

    #[test]
    fn metadata_of_mjlab_makes_a_policy() {
        let policy = import_mjlab(&network(15 + 7, &METADATA), options()).expect("a policy");
        assert_eq!(policy.action.joints, ["knee", "hip"]);
        assert_eq!(policy.action.scale, Numbers::All(0.25));
        assert_eq!(policy.action.kp, Some(Numbers::Each(vec![20.0, 30.0])));
        assert_eq!(policy.observations[6].rays, Some(7));
        let text = policy.to_toml().expect("text");
        assert_eq!(Policy::parse(&text).as_ref(), Ok(&policy), "{text}");
        let terms = METADATA.map(|(key, value)| (key, value.trim_end_matches(",height_scan")));
        let history = ImportOptions { history: 3, ..options() };
        assert_eq!(import_mjlab(&network(45, &terms), history).expect("a policy").inputs(), Ok(45));
    }

    #[test]
    fn metadata_that_does_not_fit_is_named() {
        let error = |inputs: usize, key: &str, value: Option<&str>| {
            let entries: Vec<(&str, &str)> = METADATA
                .into_iter()
                .filter_map(|(name, old)| if name == key { Some((name, value?)) } else { Some((name, old)) })
                .collect();
            import_mjlab(&network(inputs, &entries), options()).expect_err(key)
        };
        assert_eq!(error(22, "joint_names", None), ImportError::Missing("joint_names"));
        let found = error(22, "joint_names", Some("knee,hip,foot"));
        assert_eq!(found, ImportError::Count { key: "joint_names", found: 3, expected: 2 });
        let found = error(22, "joint_damping", Some("0.5,x"));
        assert_eq!(found, ImportError::Number { key: "joint_damping", found: "x".to_owned() });
        let found = error(22, "observation_names", Some("joint_pos,motion_anchor"));
        assert_eq!(found, ImportError::Term { name: "motion_anchor".to_owned() });
        let found = error(22, "observation_names", Some("joint_pos,joint_vel"));
        assert_eq!(found, ImportError::Width { found: 22, expected: 4 });
        assert!(matches!(error(22, "joint_names", Some("hip,hip")), ImportError::Policy(_)));
    }

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
    fn weights_that_do_not_fit_are_named() {
        let mut file = weights();
        file.tensors.remove("actor.2.weight");
        let error = import_weights(&file, TABLE).expect_err("a missing tensor").to_string();
        assert!(
            error.starts_with("tensor \"actor.2.weight\": not in the file, which has actor.0.bias"),
            "{error}"
        );
        let table = TABLE.replace("{ term = \"joint_positions\" }, ", "");
        let error = import_weights(&weights(), &table).expect_err("another width").to_string();
        assert!(error.starts_with("tensor \"actor.0.weight\": shape [3, 2], expected [3, 1]"), "{error}");
        let table = TABLE.replace("[\"hip\"]", "[\"hip\", \"knee\"]").replace("[0.3]", "[0.3, 0.1]");
        assert!(import_weights(&weights(), &table).is_err(), "two joints");
        for (from, to, message) in [
            ("[weights]", "[weight]", "no table `weights`"),
            ("\"tanh\"", "\"selu\"", "unknown variant `selu`"),
            ("variance = \"norm.var\", ", "", "`weights.normaliser` expected one of"),
            ("epsilon = 0.25", "epsilon = 0.0", "a deviation of 0 in"),
        ] {
            let error = import_weights(&weights(), &TABLE.replace(from, to)).expect_err(to).to_string();
            assert!(error.contains(message), "{error}");
        }
    }
}
