//! ONNX files compared with onnxruntime; `onnx_cases.py` generates the cases.

use motorium_models::inference::Unary;
use motorium_models::onnx::{GruLayer, Model, OnnxError, write_gru, write_mlp};
use serde::Deserialize;

#[derive(Deserialize)]
struct Tensor {
    shape: Vec<usize>,
    values: Vec<f32>,
}

#[derive(Deserialize)]
struct Case {
    name: String,
    /// Bytes in hexadecimal.
    model: String,
    inputs: Vec<Tensor>,
    outputs: Vec<Tensor>,
}

fn cases(text: &str) -> Vec<Case> {
    serde_json::from_str(text).expect("cases")
}

/// 200 random networks.
fn networks() -> Vec<Case> {
    let packed = include_bytes!("networks.json.zlib");
    let text = miniz_oxide::inflate::decompress_to_vec_zlib(packed).expect("a compressed text");
    cases(core::str::from_utf8(&text).expect("text"))
}

fn bytes(hexadecimal: &str) -> Vec<u8> {
    let digit = |digit: u8| char::from(digit).to_digit(16).expect("a digit") as u8;
    hexadecimal.as_bytes().as_chunks::<2>().0.iter().map(|[a, b]| 16 * digit(*a) + digit(*b)).collect()
}

/// Returns the largest difference from onnxruntime, relative for numbers above 1.
fn difference(case: &Case) -> Result<f32, OnnxError> {
    let model = Model::read(&bytes(&case.model))?;
    let shapes: Vec<Vec<usize>> = case.inputs.iter().map(|input| input.shape.clone()).collect();
    let mut program = model.program_with(&shapes)?;
    let mut largest = 0.0_f32;
    // twice: a run must not depend on the previous one
    for _ in 0..2 {
        for (index, input) in case.inputs.iter().enumerate() {
            program.input_mut(index).copy_from_slice(&input.values);
        }
        program.run();
        for (index, expected) in case.outputs.iter().enumerate() {
            assert_eq!(program.outputs()[index].shape, expected.shape, "{}", case.name);
            for (found, expected) in program.output(index).iter().zip(&expected.values) {
                let error = (found - expected).abs() / expected.abs().max(1.0);
                largest = if error <= largest { largest } else { error };
            }
        }
    }
    Ok(largest)
}

fn compare(cases: &[Case]) {
    let wrong: Vec<String> = cases
        .iter()
        .filter_map(|case| match difference(case) {
            Ok(difference) if difference <= 1e-5 => None,
            other => Some(format!("{}: {other:?}", case.name)),
        })
        .collect();
    assert!(wrong.is_empty(), "{} of {} cases:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
}

#[test]
fn every_operator_matches_onnxruntime() {
    let cases = cases(include_str!("operators.json"));
    compare(&cases);
    assert!(cases.len() > 80);
}

#[test]
fn random_networks_match_onnxruntime() {
    let cases = networks();
    compare(&cases);
    assert_eq!(cases.len(), 200);
    // more cases: MOTORIUM_ONNX_CASES=FILE, written by `onnx_cases.py networks FILE 1000`
    if let Some(path) = std::env::var_os("MOTORIUM_ONNX_CASES") {
        compare(&self::cases(&std::fs::read_to_string(path).expect("cases")));
    }
}

#[test]
fn damaged_files_never_panic() {
    let mut seed = 1_u32;
    for case in cases(include_str!("operators.json")).iter().chain(&networks()) {
        let whole = bytes(&case.model);
        for _ in 0..40 {
            let mut file = whole.clone();
            for _ in 0..1 + seed % 3 {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let place = (seed >> 8) as usize % file.len();
                file[place] = (seed >> 3) as u8;
            }
            if let Ok(mut program) = Model::read(&file).and_then(|model| model.program(2)) {
                program.run();
            }
        }
        for length in 0..whole.len().min(200) {
            let _ = Model::read(&whole[..length]).and_then(|model| model.program(2));
        }
    }
}

fn number(k: usize) -> f32 {
    (0.7 * k as f32).sin()
}

fn layer(outputs: usize, inputs: usize) -> (Vec<f32>, Vec<f32>) {
    ((0..outputs * inputs).map(|k| 0.3 * number(k + outputs)).collect(), (0..outputs).map(number).collect())
}

fn gru() -> Vec<u8> {
    let (inputs, hidden) = (6, 9);
    let gru = GruLayer {
        inputs,
        hidden,
        input_weights: (0..3 * hidden * inputs).map(number).collect(),
        state_weights: (0..3 * hidden * hidden).map(|k| 0.4 * number(k)).collect(),
        bias: (0..6 * hidden).map(number).collect(),
    };
    write_gru(&gru, &[layer(12, hidden), layer(3, 12)], Unary::Elu(1.0), &[])
}

#[test]
fn batch_rows_match_single_rows_bit_for_bit() {
    let mlp = write_mlp(6, &[layer(70, 6), layer(33, 70), layer(3, 33)], Unary::Elu(1.0), &[]);
    for file in [mlp, gru()] {
        let model = Model::read(&file).expect("a model");
        let run = |rows: usize, first: usize| {
            let mut program = model.program(rows).expect("a program");
            for index in 0..program.inputs().len() {
                let input = program.input_mut(index);
                let width = input.len() / rows;
                input
                    .iter_mut()
                    .enumerate()
                    .for_each(|(k, x)| *x = number(k % width + 31 * (k / width + first)));
            }
            program.run();
            program.output(0).iter().map(|x| x.to_bits()).collect::<Vec<u32>>()
        };
        for rows in [1, 7, 63, 64, 65, 4096] {
            let batch = run(rows, 0);
            for row in [0, rows / 2, rows - 1] {
                assert_eq!(run(1, row), batch[3 * row..3 * (row + 1)], "row {row} of {rows}");
            }
        }
    }
}

#[test]
fn fed_back_state_continues_the_sequence() {
    let mut program = Model::read(&gru()).expect("a model").program(1).expect("a program");
    program.input_mut(0).fill(0.5);
    let mut run = || {
        program.run();
        program.feed_back(1, 1);
        program.output(0).to_vec()
    };
    let (first, second) = (run(), run());
    assert_ne!(first, second);
    program.input_mut(1).fill(0.0);
    program.run();
    assert_eq!(program.output(0), first);
}

#[test]
fn an_unsupported_operator_is_named_with_its_node() {
    let mut file = write_mlp(2, &[layer(3, 2), layer(1, 3)], Unary::Tanh, &[]);
    let place = file.windows(6).position(|bytes| bytes == *b"\"\x04Tanh").expect("an operator") + 2;
    file[place..place + 4].copy_from_slice(b"Sinh");
    let error = Model::read(&file).expect("a model").program(1).expect_err("no such operator");
    let OnnxError::Operator { node, operator } = error else { panic!("{error:?}") };
    assert_eq!((&node[..], &operator[..]), ("\"Tanh_dense_0_activated\"", "Sinh"));
}

#[test]
fn a_wrong_shape_names_the_input() {
    let model = Model::read(&write_mlp(2, &[layer(3, 2)], Unary::Tanh, &[])).expect("a model");
    let error = model.program_with(&[vec![1, 3]]).expect_err("a wrong shape");
    let message = "shape [1, 3], expected [rows, 2]".to_owned();
    assert_eq!(error, OnnxError::Input { name: "obs".to_owned(), message });
}
