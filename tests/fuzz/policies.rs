//! Trained networks, and the folders of policies.

use motorium_models::onnx::Model;
use motorium_models::policy::{ImportOptions, Policy, PolicyNetwork, import_mjlab};
use motorium_models::safetensors;

use crate::target::{files, target};

/// Folders with networks and policies.
const FOLDERS: [&str; 9] = [
    "fixtures",
    "fixtures/isaac-lab",
    "fixtures/leapp",
    "graphs/cart-pole-camera",
    "graphs/cart-pole-policy",
    "graphs/policies/quadruped-ppo",
    "graphs/policies/quadruped-trot",
    "graphs/rover-policy",
    "robots/tests/golden",
];

#[test]
fn networks() {
    let policies = files(&FOLDERS, &["policy.toml"]);
    let policies: Vec<Policy> = policies
        .iter()
        .map(|bytes| Policy::parse(&String::from_utf8_lossy(bytes)).expect("a policy of the repository"))
        .collect();
    target("networks", &files(&FOLDERS, &[".onnx"]), |bytes| {
        let options = ImportOptions {
            rate: 50.0,
            history: None,
            robot: None,
            height_points: None,
            height_scale: None,
            height_offset: None,
        };
        match import_mjlab(bytes, options) {
            Ok((policy, _)) => assert!(policy.to_toml().is_ok_and(|text| Policy::parse(&text) == Ok(policy))),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
        let Ok(program) = Model::read(bytes).and_then(|model| model.program(1)) else { return };
        for policy in &policies {
            if let Ok(mut network) = PolicyNetwork::new(policy, program.clone()) {
                network.observation_mut().fill(0.5);
                network.run();
            }
        }
    });
}

#[test]
fn policies() {
    target("policies", &files(&FOLDERS, &["policy.toml"]), |bytes| {
        match Policy::parse(&String::from_utf8_lossy(bytes)) {
            Ok(policy) => {
                let text = policy.to_toml().expect("a valid policy can be written");
                assert_eq!(Policy::parse(&text), Ok(policy), "{text}");
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    });
}

#[test]
fn weights() {
    target("weights", &files(&FOLDERS, &[".safetensors"]), |bytes| {
        if let Ok(tensors) = safetensors::read::<f32>(bytes) {
            let written = safetensors::write(&tensors).expect("read tensors can be written");
            assert_eq!(
                safetensors::read::<f32>(&written).map(|again| again.tensors.len()),
                Ok(tensors.tensors.len())
            );
        }
    });
}
