//! `policy.promp` in a running graph, with a kernelised primitive as written by `motorium primitive fit
//! --model kernelised`.

use motorium_primitives::file::PrimitiveFile;
use motorium_primitives::kmp::{KernelisedFit, KernelisedMovement};
use nalgebra::DMatrix;
use serde_json::json;

use crate::joint_policies::{assert_smooth, assert_steady, run};

/// Demonstration of two joints for 2 s, from rest to rest, starting at the arm's position in the graph.
fn shown(p: f64, offset: f64) -> [f64; 2] {
    let s = p * p * p * (10.0 + p * (6.0 * p - 15.0));
    let bow = offset * (std::f64::consts::PI * s).sin();
    [0.5 + 0.4 * s + bow, 0.8 - 0.5 * s + bow]
}

/// The file of a primitive fitted to five demonstrations.
fn fitted(folder: &std::path::Path) -> std::path::PathBuf {
    let demonstrations: Vec<DMatrix<f64>> = [-0.1, -0.05, 0.0, 0.05, 0.1]
        .iter()
        .map(|offset| DMatrix::from_fn(120, 2, |k, d| shown(k as f64 / 119.0, *offset)[d]))
        .collect();
    let movement = KernelisedMovement::fit(&demonstrations, 2.0, &KernelisedFit::default()).unwrap();
    let names = vec!["joint1".to_string(), "joint2".to_string()];
    let path = folder.join("reach.json");
    PrimitiveFile::kernelised(names, movement).unwrap().write(&path).unwrap();
    path
}

#[test]
fn joints_follow_a_kernelised_primitive_as_demonstrated() {
    let folder = tempfile::tempdir().unwrap();
    let config = format!(
        "primitives = [{:?}]\njoints = [\"joint1\", \"joint2\"]\njoint_command = {{ ease = \"10 ms\" }}",
        fitted(folder.path())
    );
    let (report, seen) = run("policy.promp", &config, "", 3.0);
    assert_steady(&report);
    assert_smooth(&seen);
    for (k, at) in seen.iter().take(2000).enumerate() {
        let expected = shown(k as f64 / 2000.0, 0.0);
        for (found, expected) in at.q.iter().zip(expected) {
            // a fifth of the spread of the demonstrations: the mixture smooths
            assert!((found - expected).abs() < 0.02, "step {k}: {:?} for {expected}", at.q);
        }
    }
    assert!(seen.iter().all(|seen| seen.q[2] == 0.8), "joint3 is not moved");
    let result = &report.results["policy"];
    assert_eq!((&result["movements"], &result["primitive"]), (&json!(1), &json!(0)));
}

#[test]
fn a_kernelised_primitive_passes_a_via_point() {
    let folder = tempfile::tempdir().unwrap();
    let config = format!(
        "primitives = [{:?}]\njoints = [\"joint1\", \"joint2\"]\nduration = \"3 s\"\n\
         via = [{{ at = 0.5, position = [0.82, 0.67] }}]",
        fitted(folder.path())
    );
    let (report, seen) = run("policy.promp", &config, "", 4.0);
    assert_steady(&report);
    assert_smooth(&seen);
    let is_near = |at: usize, expected: [f64; 2], most: f64| {
        let q = &seen[at].q;
        assert!(q.iter().zip(expected).all(|(q, e)| (q - e).abs() < most), "{q:?} for {expected:?}");
    };
    // off the demonstrated mean, in the direction in which the demonstrations differ: both joints deviate in
    // the same sense
    assert!((0..2).all(|d| [0.82, 0.67][d] - shown(0.5, 0.0)[d] > 0.11));
    is_near(1500, [0.82, 0.67], 5e-3);
    is_near(3500, shown(1.0, 0.0), 0.02);
}
