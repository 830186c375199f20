//! Letters written from their pictures.

use motorium_learners::experiments::perception::{CurveErrors, Letters};
use motorium_learners::perception::{
    Coupling, CouplingFileError, ImageError, Picture, Training, length, unit_extent,
};
use motorium_library::letters::{Variation, letters};
use motorium_library::{DAMPING, SampledSpring};

#[test]
fn nearest_picture_of_a_known_letter_is_its_own() {
    let set = letters(2, Variation::default(), 1);
    let errors = Letters::new(&set, &set).nearest_picture();
    assert_eq!(errors.begun.len(), set.trajectories.len());
    assert!(errors.begun.iter().chain(&errors.centred).all(|error| *error < 1e-9), "{errors:?}");
    let other = letters(1, Variation::default(), 5);
    let errors = Letters::new(&set, &other).nearest_picture();
    let mean = errors.centred.iter().sum::<f64>() / errors.centred.len() as f64;
    assert!(mean > 1e-3 && mean < 0.1, "{mean}");
}

#[test]
fn network_learns_to_write_held_out_letters() {
    let (seen, held) = (letters(3, Variation::default(), 1), letters(1, Variation::default(), 5));
    let spring = SampledSpring::new(60, DAMPING).unwrap();
    let training = Training { epochs: 6, eigenforces: 8, ..Training::default() };
    let mut epochs = 0;
    let set = Letters::new(&seen, &held);
    let network = set.network(spring, &training, || epochs += 1).unwrap();
    assert_eq!((epochs, network.losses.len()), (6, 6));
    assert!(network.losses[5] < 0.7 * network.losses[0], "{:?}", network.losses);
    assert_eq!(
        (network.written.len(), network.errors.begun.len()),
        (held.trajectories.len(), set.shown.len())
    );
    // an untrained network writes the mean letter; a letter is about as wide as high
    let mean = network.errors.centred.iter().sum::<f64>() / held.trajectories.len() as f64;
    assert!(mean < 0.25, "{mean}");
}

#[test]
fn mean_of_networks_is_computed_per_letter() {
    let a = CurveErrors { begun: vec![1.0, 2.0], centred: vec![0.0, 4.0] };
    let b = CurveErrors { begun: vec![3.0, 4.0], centred: vec![2.0, 0.0] };
    let mean = CurveErrors::mean(&[a, b]);
    assert_eq!(mean, CurveErrors { begun: vec![2.0, 3.0], centred: vec![1.0, 2.0] });
}

fn coupling() -> Coupling {
    let spring = SampledSpring::new(60, DAMPING).unwrap();
    let training = Training { epochs: 2, eigenforces: 6, ..Training::default() };
    Coupling::train(&letters(1, Variation::default(), 1), spring, &training, |_, _| {}).unwrap()
}

/// Returns a separate file for each test.
fn file(name: &str) -> std::path::PathBuf {
    std::env::temp_dir().join(format!("motorium-{}-{name}", std::process::id()))
}

#[test]
fn reloaded_coupling_writes_the_same_movement() {
    let (path, coupling) = (file("coupling"), coupling());
    coupling.write(&path).unwrap();
    let read = Coupling::read(&path).unwrap();
    assert!(Coupling::is_coupling(&path));
    for letter in &letters(1, Variation::default(), 3).trajectories[..5] {
        let picture = Picture::from_path(&unit_extent(&letter.resampled(80)));
        assert_eq!(read.written(&picture, None), coupling.written(&picture, None));
    }
    let whole = std::fs::read(&path).unwrap();
    for length in [4, 20, 200, whole.len() - 3] {
        std::fs::write(&path, &whole[..length]).unwrap();
        assert!(Coupling::read(&path).is_err(), "cut after {length} bytes");
    }
    let mut changed = whole.clone();
    changed[whole.len() / 2] ^= 1;
    std::fs::write(&path, changed).unwrap();
    assert!(matches!(Coupling::read(&path), Err(CouplingFileError::Damaged { .. })));
    std::fs::remove_file(&path).unwrap();
}

#[test]
fn letter_is_written_at_the_given_or_learned_speed() {
    let known = letters(1, Variation::default(), 1);
    let coupling = coupling();
    let speeds =
        known.trajectories.iter().map(|letter| length(&unit_extent(&letter.positions)) / letter.duration);
    let mean = speeds.sum::<f64>() / known.trajectories.len() as f64;
    assert!((coupling.pen_speed() - mean).abs() < 1e-12 * mean);
    let picture = Picture::from_path(&unit_extent(&known.trajectories[3].resampled(80)));
    for (asked, expected) in [(None, mean), (Some(0.25), 0.25)] {
        let movement = coupling.written(&picture, asked);
        let found = length(&movement.path(coupling.library())) / movement.frame.duration;
        assert!((found - expected).abs() < 1e-9, "{found}, expected {expected}");
    }
}

#[test]
fn picture_is_normalised_in_contrast_size_and_position() {
    let letter = unit_extent(&letters(1, Variation::default(), 1).trajectories[0].resampled(80));
    let expected = Picture::from_path(&letter);
    // Three times as large, and off-centre.
    let large = |ink: bool| {
        let mut bytes = b"P5\n# a letter\n120 100\n255\n".to_vec();
        for (row, column) in (0..100_usize).flat_map(|row| (0..120_usize).map(move |column| (row, column))) {
            let inside = row < 84 && (20..104).contains(&column);
            let grey = if inside { expected.0[row / 3 * 28 + (column - 20) / 3] } else { 0.0 };
            let grey = if ink { 1.0 - grey } else { grey };
            bytes.push((255.0 * grey).round() as u8);
        }
        bytes
    };
    let path = file("letter.pgm");
    for bytes in [expected.to_pgm(), large(true), large(false)] {
        std::fs::write(&path, bytes).unwrap();
        let read = Picture::read(&path).unwrap();
        let apart = read.0.iter().zip(&expected.0).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
        let whole = expected.0.iter().map(|grey| grey * grey).sum::<f32>();
        assert!(apart < 0.15 * whole, "{apart} of {whole}");
    }
    std::fs::write(&path, "P2 2 2 9 1 1 1 1").unwrap();
    assert!(matches!(Picture::read(&path), Err(ImageError::Blank { .. })));
    std::fs::write(&path, "P5 20 20 255 short").unwrap();
    let error = Picture::read(&path).unwrap_err().to_string();
    assert!(error.contains("it ends after 5 of 400 bytes"), "{error}");
    std::fs::write(&path, "P6 1 1 255 ...").unwrap();
    assert!(Picture::read(&path).unwrap_err().to_string().contains("neither P2 nor P5"));
    std::fs::remove_file(&path).unwrap();
}
