//! `motorium qp solve`: recorded quadratic programs.

use crate::program::run;

/// Two problems a tick apart, and an infeasible one.
const PROBLEMS: &str = r#"[
    { "P": [[1, 0], [0, 1]], "q": [-2.0, -0.5], "lb": [0, 0], "ub": [1, 1], "G": [[1, 1]], "ug": [10] },
    { "P": [[1, 0], [0, 1]], "q": [-2.1, -0.4], "lb": [0, 0], "ub": [1, 1], "G": [[1, 1]], "ug": [10] },
    { "P": [[1, 0], [0, 1]], "q": [-2.1, -0.4], "lb": [0, 0], "ub": [1, 1], "G": [[1, 1]], "ug": [-1] }
]"#;

#[test]
fn solvers_solve_recorded_problems_and_name_infeasible() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("problems.json");
    std::fs::write(&path, PROBLEMS).expect("the folder takes files");
    let file = path.to_str().expect("a plain path");
    for solver in ["active-set", "active-set-cold", "clarabel"] {
        let ended = run(&["qp", "solve", file, "--solver", solver, "--each", "--json"]);
        assert_eq!(ended.status.code(), Some(1), "one problem has no solution");
        let report: serde_json::Value = serde_json::from_slice(&ended.stdout).expect("JSON");
        assert_eq!((report["problems"].as_u64(), report["solved"].as_u64()), (Some(3), Some(2)));
        let each = report["each"].as_array().expect("a list");
        for (each, expected) in each.iter().zip([[1.0, 0.5], [1.0, 0.4]]) {
            assert_eq!(each["status"], "solved");
            for (x, expected) in each["x"].as_array().expect("numbers").iter().zip(expected) {
                assert!((x.as_f64().expect("a number") - expected).abs() < 1e-7, "{solver}: {each}");
            }
        }
        assert_eq!(each[2]["status"], "infeasible");
        let words = each[2]["error"].as_str().expect("words");
        assert!(words.contains("upper side of row 0"), "{words}");
        assert!(report["time_us"]["p50"].as_f64().expect("a time") > 0.0);
        assert!(report["worst_violation"].as_f64().expect("a number") < 1e-9);
    }
}

#[test]
fn problems_of_different_sizes_are_solved_in_order() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("mixed.json");
    let small = r#"{ "P": [[1]], "q": [-2], "ub": [1] }"#;
    let mixed = PROBLEMS.replacen('[', &format!("[{small}, {small}, "), 1);
    std::fs::write(&path, mixed).expect("the folder takes files");
    let file = path.to_str().expect("a plain path");
    let ended = run(&["qp", "solve", file, "--rounds", "1", "--each", "--json"]);
    assert_eq!(ended.status.code(), Some(1), "the last problem has no solution");
    let report: serde_json::Value = serde_json::from_slice(&ended.stdout).expect("JSON");
    assert_eq!((report["problems"].as_u64(), report["solved"].as_u64()), (Some(5), Some(4)));
    let lengths: Vec<_> = report["each"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|each| each["x"].as_array().map(Vec::len))
        .collect();
    assert_eq!(lengths, [1, 1, 2, 2, 0].map(Some));
}

#[test]
fn file_without_a_problem_is_refused_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("problems.json");
    std::fs::write(&path, "[{ \"P\": [[1]], \"q\": [0, 1] }]").expect("the folder takes files");
    let ended = run(&["qp", "solve", path.to_str().expect("a plain path")]);
    assert_eq!(ended.status.code(), Some(1));
    let words = String::from_utf8_lossy(&ended.stderr);
    assert!(
        words.contains("problems.json") && words.contains("`P` is a matrix with 1 numbers in row 0"),
        "{words}"
    );
}
