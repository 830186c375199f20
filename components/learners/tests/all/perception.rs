//! Letters written from their pictures.

use motorium_learners::experiments::perception::{CurveErrors, Letters};
use motorium_learners::perception::Training;
use motorium_library::letters::{Variation, letters};
use motorium_library::{DAMPING, SampledSpring};

#[test]
fn the_nearest_picture_of_a_letter_that_is_known_is_its_own() {
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
fn a_network_learns_epoch_by_epoch_and_writes_every_letter_held_out() {
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
    // untrained, it writes the mean letter; a letter is about as wide as high
    let mean = network.errors.centred.iter().sum::<f64>() / held.trajectories.len() as f64;
    assert!(mean < 0.25, "{mean}");
}

#[test]
fn the_mean_of_several_networks_is_taken_letter_by_letter() {
    let a = CurveErrors { begun: vec![1.0, 2.0], centred: vec![0.0, 4.0] };
    let b = CurveErrors { begun: vec![3.0, 4.0], centred: vec![2.0, 0.0] };
    let mean = CurveErrors::mean(&[a, b]);
    assert_eq!(mean, CurveErrors { begun: vec![2.0, 3.0], centred: vec![1.0, 2.0] });
}
