//! `motorium primitive` from recordings to movements.

use std::fmt::Write as _;
use std::path::Path;

use crate::program::{json, printed, run};

/// A recording of two channels: a stroke of one second that begins and ends at rest.
fn recording(path: &Path, wobble: f64) {
    let mut text = String::from("time_s,x,y\n");
    for k in 0..=150 {
        let p = f64::from(k) / 150.0;
        let s = p * p * p * (10.0 - 15.0 * p + 6.0 * p * p);
        let _ = writeln!(text, "{p},{},{}", 0.5 * s, (0.2 + wobble) * (std::f64::consts::PI * s).sin());
    }
    std::fs::write(path, text).expect("the folder takes files");
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

#[test]
fn recording_becomes_a_primitive_with_another_goal() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name);
    recording(&file("shown.csv"), 0.0);
    let (shown, model, plot) = (file("shown.csv"), file("model.json"), file("fit.svg"));
    let report =
        json(&["primitive", "fit", text(&shown), "--output", text(&model), "--plot", text(&plot), "--json"]);
    assert_eq!(report["kind"], "discrete");
    assert_eq!(report["dimensions"][0]["name"], "x");
    assert!(report["rms_error"].as_f64().expect("a number") < 1e-3, "{report}");
    let drawn = std::fs::read_to_string(&plot).expect("the plot was drawn");
    let document = roxmltree::Document::parse(&drawn).expect("SVG");
    assert_eq!(document.descendants().filter(|node| node.has_tag_name("polyline")).count(), 4);

    let shown_again = json(&["primitive", "show", text(&model), "--json"]);
    assert!(shown_again["equation"].as_str().is_some_and(|equation| equation.contains("g(t)")));
    assert_eq!(shown_again["settings"]["kernels"], 30);

    let there = json(&["primitive", "replay", text(&model), "--goal", "-1,2", "--duration", "2", "--json"]);
    let last = there["position"].as_array().and_then(|all| all.last()).expect("samples");
    assert!(
        (last[0].as_f64().expect("x") + 1.0).abs() < 1e-3
            && (last[1].as_f64().expect("y") - 2.0).abs() < 1e-3
    );
    assert_eq!(there["time"].as_array().expect("times").len(), 201);

    // a replay is a recording itself
    let (again, lines) = (file("again.csv"), file("again.jsonl"));
    for path in [&again, &lines] {
        printed(&["primitive", "replay", text(&model), "--output", text(path)]);
    }
    for (path, field) in
        [(&again, "position"), (&again, "velocity"), (&lines, "position"), (&lines, "velocity")]
    {
        let report = json(&["primitive", "fit", text(path), "--field", field, "--json"]);
        assert_eq!(report["dimensions"].as_array().map(Vec::len), Some(2), "{report}");
        assert!(report["rms_error"].as_f64().is_some_and(|error| error < 0.02), "{report}");
    }
    let csv = printed(&["primitive", "replay", text(&model), "--rate", "10"]);
    assert!(csv.starts_with("time_s,x,y,x_velocity,y_velocity\n0,"), "{csv}");
    assert_eq!(csv.lines().count(), 12);
}

#[test]
fn several_recordings_give_a_conditioned_distribution() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = folder.path().join("model.json");
    let mut arguments = vec!["primitive".to_string(), "fit".into(), "--model".into(), "probabilistic".into()];
    for (k, wobble) in [-0.1, 0.0, 0.1, 0.15].into_iter().enumerate() {
        let path = folder.path().join(format!("{k}.csv"));
        recording(&path, wobble);
        arguments.push(text(&path).to_string());
    }
    arguments.extend(["--kernels", "15", "--json", "--output", text(&model)].map(String::from));
    let report = json(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
    assert_eq!((&report["kind"], &report["recordings"]), (&"probabilistic".into(), &4.into()));
    let plot = folder.path().join("via.svg");
    let bent = json(&[
        "primitive",
        "replay",
        text(&model),
        "--via",
        "0.5:0.25,0.4",
        "--plot",
        text(&plot),
        "--json",
    ]);
    let middle = &bent["position"][50];
    assert!((middle[1].as_f64().expect("y") - 0.4).abs() < 5e-3, "{middle}");
    assert!(bent["deviation"][50][1].as_f64().expect("a deviation") < 0.01);
    assert!(std::fs::read_to_string(&plot).expect("the plot").contains("<polygon"));

    let replay = |via: &str| run(&["primitive", "replay", text(&model), "--via", via]);
    let far = String::from_utf8_lossy(&replay("0.5:0.25,9").stderr).into_owned();
    assert!(far.contains("standard deviations from the demonstrated `y`"), "{far}");
    assert_eq!(String::from_utf8_lossy(&replay("0.5:0.25,0.4").stderr), "");
}

#[test]
fn a_rhythm_is_learned_from_its_periods() {
    let folder = tempfile::tempdir().expect("a folder");
    let (shown, model) = (folder.path().join("shown.csv"), folder.path().join("model.json"));
    let mut lines = String::from("t,a\n");
    for k in 0..=300 {
        let t = f64::from(k) / 100.0;
        let _ = writeln!(lines, "{t},{}", 1.0 + (std::f64::consts::TAU * t / 1.5).sin());
    }
    std::fs::write(&shown, lines).expect("the folder takes files");
    let report = json(&[
        "primitive",
        "fit",
        text(&shown),
        "--model",
        "rhythmic",
        "--periods",
        "2",
        "--output",
        text(&model),
        "--json",
    ]);
    assert!((report["duration_s"].as_f64().expect("a period") - 1.5).abs() < 1e-12);
    assert!(report["rms_error"].as_f64().is_some_and(|error| error < 0.02), "{report}");
    let faster = json(&[
        "primitive",
        "replay",
        text(&model),
        "--duration",
        "0.5",
        "--amplitude",
        "2",
        "--periods",
        "4",
        "--json",
    ]);
    let places: Vec<f64> = faster["position"]
        .as_array()
        .expect("samples")
        .iter()
        .filter_map(|place| place[0].as_f64())
        .collect();
    let settled = &places[100..];
    let (low, high) = settled.iter().fold((f64::MAX, f64::MIN), |(low, high), y| (low.min(*y), high.max(*y)));
    assert!((low + 1.0).abs() < 0.05 && (high - 3.0).abs() < 0.05, "{low} to {high}");
}

#[test]
fn unreadable_or_invalid_input_is_refused_with_a_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let (shown, model) = (folder.path().join("shown.csv"), folder.path().join("model.json"));
    recording(&shown, 0.0);
    printed(&["primitive", "fit", text(&shown), "--output", text(&model)]);
    let refused = |arguments: &[&str]| {
        let output = run(arguments);
        assert!(!output.status.success(), "{arguments:?}");
        String::from_utf8_lossy(&output.stderr).to_string()
    };
    let error = refused(&["primitive", "fit", text(&shown), "--channel", "z"]);
    assert!(error.contains("no channel `z`; known: x, y"), "{error}");
    let error = refused(&["primitive", "replay", text(&model), "--goal", "1,2,3"]);
    assert!(error.contains("--goal has 3 numbers, expected one for all, or one for each of "), "{error}");
    let error = refused(&["primitive", "replay", text(&model), "--final-velocity", "1,2"]);
    assert!(error.contains("ends at rest"), "{error}");
    let error = refused(&["primitive", "replay", text(&model), "--via", "0.5:1,2"]);
    assert!(error.contains("no via points"), "{error}");
    let error = refused(&["primitive", "fit", text(&shown), "--model", "probabilistic"]);
    assert!(error.contains("expected at least 2"), "{error}");
    let error = refused(&["primitive", "fit", text(&shown), "--model", "rhythmic", "--variant", "classic"]);
    assert!(error.contains("--variant has no effect on this fit"), "{error}");
    std::fs::write(&model, "{\"version\": 2}").expect("the folder takes files");
    let error = refused(&["primitive", "show", text(&model)]);
    assert!(error.contains("model.json"), "{error}");
}

#[test]
fn kernelised_and_polynomial_primitives_round_trip() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name);
    let shown: Vec<std::path::PathBuf> =
        [-0.05, 0.0, 0.05].iter().map(|wobble| file(&format!("{wobble}.csv"))).collect();
    for (path, wobble) in shown.iter().zip([-0.05, 0.0, 0.05]) {
        recording(path, wobble);
    }
    let model = file("model.json");
    let fit = |options: &[&str]| {
        let files: Vec<&str> = shown.iter().map(|path| text(path)).collect();
        let output = ["--output", text(&model), "--overwrite", "--json"];
        json(&[&["primitive", "fit"], &files[..], &output, options].concat())
    };
    let report = fit(&["--model", "kernelised"]);
    assert_eq!(report["kind"], "kernelised");
    // The recordings differ from their mean by up to 0.05, in one dimension of two.
    assert!(report["rms_error"].as_f64().is_some_and(|error| error < 0.04), "{report}");
    let replayed = json(&["primitive", "replay", text(&model), "--via", "0.5:0.25,0.35:0.001", "--json"]);
    let middle = &replayed["position"][50];
    let error =
        (middle[0].as_f64().expect("x") - 0.25).abs().max((middle[1].as_f64().expect("y") - 0.35).abs());
    assert!(error < 5e-3, "{middle}");
    let shown_again = json(&["primitive", "show", text(&model), "--json"]);
    assert_eq!(shown_again["settings"]["points"], 50);

    let report = fit(&["--model", "polynomial", "--kernels", "7"]);
    assert_eq!((&report["kind"], &report["duration_s"]), (&"polynomial".into(), &1.0.into()));
    assert!(report["rms_error"].as_f64().is_some_and(|error| error < 0.04), "{report}");
    let shown_again = json(&["primitive", "show", text(&model), "--json"]);
    assert_eq!(shown_again["dimensions"][0]["weights"], 8);
    for (options, refused) in [
        (&["--model", "polynomial", "--variant", "classic"][..], "--variant"),
        (&["--model", "kernelised", "--penalty", "1e-3"], "--penalty"),
        (&["--model", "kernelised", "--regression", "ridge"], "--regression"),
    ] {
        let output = run(&[&["primitive", "fit", text(&shown[0])], options].concat());
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(
            !output.status.success() && errors.contains(&format!("{refused} has no effect on this fit")),
            "{errors}"
        );
    }
    let output = run(&["primitive", "replay", text(&model), "--goal", "1,2"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(errors.contains("a polynomial primitive accepts a duration, but no start, goal"), "{errors}");
}

/// Fits a table with one formula per column; returns the success, and output and errors together.
fn fitted(columns: &str, row: impl Fn(f64) -> String, options: &[&str]) -> (bool, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("shown.csv");
    let rows: String =
        (0..=225).map(|k| format!("{},{}\n", f64::from(k) * 0.01, row(f64::from(k) * 0.01))).collect();
    std::fs::write(&path, format!("{columns}\n{rows}")).expect("the folder takes files");
    let output = run(&[&["primitive", "fit", text(&path)], options].concat());
    let said = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8_lossy(&said).into_owned())
}

#[test]
fn angles_and_quaternions_are_fitted_without_jumps() {
    let wrapped = |t: f64| {
        let angle = 2.5 + t;
        (angle + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI
    };
    let (good, said) = fitted("time,yaw", |t| wrapped(t).to_string(), &[]);
    assert!(good && said.contains("`yaw` changed by a whole turn 1 times"), "{said}");
    let sign = |t: f64| if t > 1.0 { -1.0 } else { 1.0 };
    let rotation = |t: f64| format!("{},0,0,{}", sign(t) * (0.3 * t).sin(), sign(t) * (0.3 * t).cos());
    let (good, said) = fitted("time,qx,qy,qz,qw", rotation, &[]);
    assert!(good && said.contains("changed its sign 1 times"), "{said}");
}

#[test]
fn doubtful_fits_and_gaps_are_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("gap.csv");
    recording(&path, 0.0);
    let whole = std::fs::read_to_string(&path).expect("a recording");
    let kept: Vec<&str> =
        whole.lines().enumerate().filter(|(k, _)| !(50..90).contains(k)).map(|(_, line)| line).collect();
    std::fs::write(&path, kept.join("\n")).expect("the folder takes files");
    let output = run(&["primitive", "fit", text(&path)]);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && stderr.contains("no samples from 0.320 s to 0.593 s"), "{stderr}");

    // 100 samples per second and more
    let cutoff = |hertz: &str| fitted("time,x", |t| t.to_string(), &["--cutoff", hertz]);
    let (good, said) = cutoff("5000");
    assert!(good && said.contains("--cutoff 5000 has no effect: half of the sample rate is"), "{said}");
    let (good, said) = cutoff("10");
    assert!(good && !said.contains("--cutoff"), "{said}");

    // four cycles of 0.5625 s
    let wave = |t: f64| (std::f64::consts::TAU * t / 0.5625).sin().to_string();
    let rhythm = |periods| fitted("time,x", wave, &["--model", "rhythmic", "--periods", periods]);
    let (good, said) = rhythm("3");
    assert!(
        good && said.contains("`x` is reproduced with errors up to") && said.contains("--periods"),
        "{said}"
    );
    let (good, said) = rhythm("4");
    assert!(good && !said.contains("warning"), "{said}");
}

#[test]
fn recordings_with_channels_in_another_order_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let (one, two) = (folder.path().join("one.csv"), folder.path().join("two.csv"));
    recording(&one, 0.0);
    let swapped = std::fs::read_to_string(&one).expect("a recording").replace("time_s,x,y", "time_s,y,x");
    std::fs::write(&two, swapped).expect("the folder takes files");
    let output = run(&["primitive", "fit", text(&one), text(&two)]);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("two.csv has the channels y, x,") && stderr.contains("--channel"), "{stderr}");
    json(&["primitive", "fit", text(&one), text(&two), "--channel", "x", "--channel", "y", "--json"]);
}

#[test]
fn rhythm_with_a_gap_is_refused() {
    let wave = |t: f64| (std::f64::consts::TAU * t).sin().to_string();
    let (good, said) = fitted("time,x", wave, &["--model", "rhythmic"]);
    assert!(!good && said.contains("begins at 0.0000 and ends at 1.0000"), "{said}");
    let slow = |t: f64| (std::f64::consts::TAU * t / 1.125).sin().to_string();
    let (good, said) = fitted("time,x", slow, &["--model", "rhythmic", "--periods", "2"]);
    assert!(good, "{said}");
}
