//! Learned actuator networks compared with numpy, and their files.

use std::path::Path;
use std::sync::Arc;

use motorium_networks::safetensors::{self, SafetensorsError};
use motorium_robots::{
    Activation, ActuatorNetwork, ActuatorTable, InputOrder, NetworkError, NetworkSettings, NetworkTable,
    NetworkWeights,
};

const FILE: &[u8] = include_bytes!("golden/actuator_network.safetensors");

fn settings(input_order: InputOrder) -> NetworkSettings {
    NetworkSettings {
        weights: NetworkWeights::read(FILE, 6, Activation::Softsign).unwrap(),
        times: vec![0.0, 0.01, 0.02],
        input_order,
        position_scale: 2.0,
        velocity_scale: 0.25,
        effort_scale: 20.0,
    }
}

/// Position errors, velocities and the efforts that numpy computes from them.
fn golden() -> [Vec<f64>; 3] {
    let json: serde_json::Value = serde_json::from_str(include_str!("golden/actuator_network.json")).unwrap();
    ["error", "velocity", "effort"]
        .map(|key| json[key].as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect())
}

#[test]
fn network_efforts_match_numpy_with_measurement_history() {
    let [errors, velocities, efforts] = golden();
    let mut network = ActuatorNetwork::new(Arc::new(settings(InputOrder::PositionVelocity)));
    for round in 0..2 {
        for (step, ((error, velocity), expected)) in errors.iter().zip(&velocities).zip(&efforts).enumerate()
        {
            let effort = network.effort(*error, *velocity);
            assert!((effort - expected).abs() < 1e-12 * 20.0, "{round}, {step}: {effort}, {expected}");
            network.advance(*error, *velocity, 2e-3);
        }
        network.reset();
    }
}

#[test]
fn input_order_swaps_errors_and_velocities() {
    let [errors, velocities, efforts] = golden();
    let other = NetworkSettings {
        position_scale: 0.25,
        velocity_scale: 2.0,
        ..settings(InputOrder::VelocityPosition)
    };
    let mut network = ActuatorNetwork::new(Arc::new(other));
    for ((error, velocity), expected) in errors.iter().zip(&velocities).zip(&efforts) {
        assert!((network.effort(*velocity, *error) - expected).abs() < 1e-11);
        network.advance(*velocity, *error, 2e-3);
    }
}

/// Returns a file of zero tensors.
fn file(tensors: &[(&str, &str, &[usize])]) -> Vec<u8> {
    let mut header = serde_json::Map::new();
    let mut size = 0;
    for (name, dtype, shape) in tensors {
        let bytes = shape.iter().product::<usize>() * if *dtype == "F64" { 8 } else { 4 };
        let entry =
            serde_json::json!({ "dtype": dtype, "shape": shape, "data_offsets": [size, size + bytes] });
        header.insert((*name).to_owned(), entry);
        size += bytes;
    }
    let header = serde_json::to_vec(&header).unwrap();
    let mut file = (header.len() as u64).to_le_bytes().to_vec();
    file.extend(header);
    file.resize(file.len() + size, 0);
    file
}

#[test]
fn mismatched_layers_report_the_expected_shape() {
    let refused = |tensors: &[(&str, &str, &[usize])], inputs: usize| {
        NetworkWeights::read(&file(tensors), inputs, Activation::Tanh).unwrap_err().to_string()
    };
    let good: &[(&str, &str, &[usize])] = &[
        ("a.0.weight", "F64", &[3, 4]),
        ("a.0.bias", "F64", &[3]),
        ("a.10.weight", "F32", &[1, 3]),
        ("a.10.bias", "F32", &[1]),
    ];
    assert!(NetworkWeights::read(&file(good), 4, Activation::Tanh).is_ok());
    assert_eq!(refused(good, 6), "tensor \"a.0.weight\" is [3, 4], expected [N, 6]");
    assert_eq!(refused(&good[..3], 4), "tensor \"a.10.bias\" is missing, expected [1]");
    assert_eq!(refused(&good[..2], 4), "tensor \"a.0.weight\" is [3, 4], expected [1, 4]");
    let read = |tensors: &[(&str, &str, &[usize])]| NetworkWeights::read(&file(tensors), 1, Activation::Tanh);
    assert_eq!(read(&[("bias", "F32", &[1])]), Err(NetworkError::Empty));
    let integers = SafetensorsError::Type { name: "0.weight".to_owned(), found: "I64".to_owned() };
    assert_eq!(read(&[("0.weight", "I64", &[1, 1])]), Err(NetworkError::File(integers)));
}

#[test]
fn damaged_files_are_rejected_without_overread() {
    assert!(matches!(safetensors::read::<f64>(&FILE[..5]), Err(SafetensorsError::Short { found: 5, .. })));
    let cut = safetensors::read::<f64>(&FILE[..FILE.len() - 1]).unwrap_err();
    assert!(matches!(cut, SafetensorsError::Bytes { .. }), "{cut}");
    let mut long = FILE.to_vec();
    long[..8].copy_from_slice(&u64::MAX.to_le_bytes());
    assert!(matches!(
        safetensors::read::<f64>(&long),
        Err(SafetensorsError::Short { expected: u64::MAX, .. })
    ));
    let mut broken = FILE.to_vec();
    broken[9] = b'{';
    assert!(matches!(safetensors::read::<f64>(&broken), Err(SafetensorsError::Header(_))));
}

#[test]
fn table_reads_its_network_and_names_the_invalid_key() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden"));
    let read = |text: &str| {
        let network: NetworkTable<f64> = toml::from_str(text).unwrap();
        let table = ActuatorTable { network: Some(network), ..Default::default() };
        table.settings("actuator", folder, |seconds| seconds)
    };
    let good = read("file = \"actuator_network.safetensors\"\nposition_scale = 2.0").unwrap();
    let network = good.network.unwrap();
    assert_eq!((network.times.as_slice(), network.position_scale), (&[0.0, 0.01, 0.02][..], 2.0));
    let missing = read("file = \"none.safetensors\"").unwrap_err();
    assert_eq!(missing.key, "actuator.network.file");
    let other = read("file = \"actuator_network.safetensors\"\ntimes = [0.0, 0.01]").unwrap_err();
    assert!(other.message.contains("is [8, 6], expected [N, 4]"), "{other}");
    let never = read("file = \"actuator_network.safetensors\"\ntimes = []").unwrap_err();
    assert_eq!(never.key, "actuator.network.times");
}
