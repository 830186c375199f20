//! `policy.library` that writes letters from their pictures, in a running graph.

use motorium_learners::perception::{Coupling, Picture, Training, chamfer, unit_extent};
use motorium_library::letters::{Variation, letters};
use motorium_library::{DAMPING, Recordings, SampledSpring};
use nalgebra::DMatrix;

use crate::library_policy::run_in;
use crate::support;

/// Three built-in letters, as movements of two joints of the arm.
fn known() -> Recordings {
    let mut known = letters(1, Variation::default(), 3);
    known.trajectories.truncate(3);
    known.names = vec!["joint1".to_string(), "joint2".to_string()];
    known
}

/// The part of a path between the two rests of a movement: from the last rest before it until the next rest.
fn written(path: &[[f64; 2]]) -> &[[f64; 2]] {
    let moves = |k: usize| (0..2).any(|d| (path[k + 1][d] - path[k][d]).abs() > 1e-7);
    // In transit to the start for 1 s, then at rest.
    let begin = (1100..path.len() - 1).find(|k| moves(*k)).unwrap();
    let end = (begin..path.len() - 1).rfind(|k| moves(*k)).unwrap();
    &path[begin..=end + 1]
}

#[test]
fn joints_write_letters_at_the_given_speed() {
    let (folder, known) = (tempfile::tempdir().unwrap(), known());
    let spring = SampledSpring::new(80, DAMPING).unwrap();
    let training = Training { epochs: 600, eigenforces: 6, augmentation: 0.03, ..Training::default() };
    let coupling = Coupling::train(&known, spring, &training, |_, _| {}).unwrap();
    coupling.write(&folder.path().join("letters.coupling")).unwrap();
    let curves: Vec<DMatrix<f64>> =
        known.trajectories.iter().map(|letter| unit_extent(&letter.resampled(200))).collect();
    for (k, curve) in curves.iter().enumerate() {
        std::fs::write(folder.path().join("shown.pgm"), Picture::from_path(curve).to_pgm()).unwrap();
        let drawing = folder.path().join("drawn.svg");
        let config = format!(
            "library = \"letters.coupling\"\npictures = [\"shown.pgm\"]\npen_speed = 1.0\npicture = {drawing:?}"
        );
        let report = run_in(folder.path(), &config, false);
        assert_eq!(support::faults(&report), (Some(0), 0), "a step allocates or fails");
        let policy = &report.results["policy"];
        assert_eq!(policy["movements"][0]["movement"], "shown", "{policy}");
        assert_eq!((&policy["movements_begun"], &policy["finished"]), (&1.into(), &true.into()));
        let path: Vec<[f64; 2]> = serde_json::from_value(report.results["robot"]["path"].clone()).unwrap();
        let path = written(&path);
        let drawn = DMatrix::from_fn(path.len(), 2, |i, d| path[i][d]);

        // The path matches this letter and no other.
        let distances: Vec<f64> = curves.iter().map(|curve| chamfer(&unit_extent(&drawn), curve)).collect();
        let nearest = (0..curves.len()).min_by(|a, b| distances[*a].total_cmp(&distances[*b])).unwrap();
        assert!(nearest == k && distances[k] < 0.05, "letter {k}: {distances:?}");

        // One letter size per second, along the whole stroke.
        let steps: Vec<f64> = path.windows(2).map(|p| (p[1][0] - p[0][0]).hypot(p[1][1] - p[0][1])).collect();
        let length: f64 = steps.iter().sum();
        let within = |part: f64| {
            let mut gone = 0.0;
            steps
                .iter()
                .position(|step| {
                    gone += step;
                    gone > part * length
                })
                .unwrap()
        };
        let seconds = (within(0.9) - within(0.1)) as f64 * 1e-3;
        assert!((0.8 * length / seconds - 1.0).abs() < 0.1, "{length} letter sizes, {seconds} s for 80 %");

        let document = std::fs::read_to_string(&drawing).unwrap();
        let name = format!(">shown, n = {}<", coupling.library().rank());
        assert!(document.contains(&name) && document.matches("<path").count() == 3, "{document}");
    }
}
