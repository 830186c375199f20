//! `motorium library couple` and `library write`: letters from their pictures.

use std::path::Path;

use crate::program::{complaint, json, printed};

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

/// A picture of a stroke from the lower left to the upper right, dark on light.
fn picture(path: &Path) {
    let side = 64_i32;
    let mut words = format!("P2\n{side} {side}\n255\n");
    for row in 0..side {
        for column in 0..side {
            let inside = (8..56).contains(&row) && (column - (side - 1 - row)).abs() <= 2;
            words += if inside { "10 " } else { "250 " };
        }
        words.push('\n');
    }
    std::fs::write(path, words).expect("the folder takes files");
}

#[test]
fn coupling_is_trained_saved_and_writes_at_pen_speed() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name);
    let (letters, coupling, shown) = (file("letters.jsonl"), file("letters.coupling"), file("stroke.pgm"));
    printed(&["library", "letters", "--each", "1", "--output", text(&letters)]);
    let trained = json(&[
        "library",
        "couple",
        text(&letters),
        "--epochs",
        "3",
        "--eigenforces",
        "6",
        "--output",
        text(&coupling),
        "--json",
    ]);
    let loss = |name: &str| trained["loss"][name].as_f64().expect("a loss");
    assert!(loss("last") < loss("first"), "{trained}");
    picture(&shown);
    let usual = json(&["library", "write", text(&coupling), text(&shown), "--json"]);
    let speed = |report: &serde_json::Value| report["pen_speed"]["mean"].as_f64().expect("a speed");
    assert!((speed(&usual) - trained["pen_speed"].as_f64().expect("a speed")).abs() < 1e-9, "{usual}");
    let slow = json(&[
        "library",
        "write",
        text(&coupling),
        text(&shown),
        "--size",
        "0.1",
        "--pen-speed",
        "0.05",
        "--json",
    ]);
    assert!((speed(&slow) - 0.05).abs() < 1e-9);
    let length = |report: &serde_json::Value| report["length"].as_f64().expect("a length");
    assert!((length(&slow) - 0.1 * length(&usual)).abs() < 1e-9);
    let csv = printed(&["library", "write", text(&coupling), text(&shown)]);
    assert!(csv.starts_with("t,x,y\n0,") && csv.lines().count() == 101, "{csv}");

    let error = complaint(&["library", "write", text(&letters), text(&shown)]);
    assert!(error.contains("not a coupling; train one with `motorium library couple`"), "{error}");
    let error = complaint(&["library", "write", text(&coupling), text(&letters)]);
    assert!(error.contains("it begins with neither P2 nor P5"), "{error}");
}
