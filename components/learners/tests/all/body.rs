//! Libraries of a body and its parts, on clips whose arms and legs move independently.

use motorium_learners::experiments::body::{Body, WINDOW, difference, learned_alone, windows};
use motorium_library::{Movement, Recordings, Trajectory};
use nalgebra::DMatrix;

const NAMES: [&str; 12] = [
    "lfemur_rx",
    "ltibia_rx",
    "rfemur_rx",
    "rtibia_rx",
    "lhumerus_rx",
    "lradius_rx",
    "lwrist_ry",
    "lhand_rx",
    "rhumerus_rx",
    "rradius_rx",
    "rwrist_ry",
    "rhand_rx",
];

/// Clips in deg: legs swing at one frequency and arms at another, with different phases and amplitudes in
/// each clip.
fn clips() -> Recordings {
    let trajectories = (0..6)
        .map(|clip| {
            let positions = DMatrix::from_fn(500, NAMES.len(), |k, d| {
                let (rate, size) = if d < 4 { (0.11, 30.0) } else { (0.17, 20.0) };
                let phase = (clip * 7 + d * 3) as f64;
                let slow = 0.3 * (0.031 * k as f64 + phase).cos();
                (size + clip as f64) * ((rate * k as f64 + phase).sin() + slow)
            });
            Trajectory { id: format!("clip{clip}"), label: None, duration: 499.0 / 30.0, positions }
        })
        .collect();
    Recordings { names: NAMES.map(String::from).to_vec(), trajectories }
}

#[test]
fn windows_are_in_radians_and_end_in_the_last_fifth() {
    let (seen, held) = windows(clips());
    // windows of 60 samples, one every 8, of 400 and of 100 samples
    assert_eq!((seen.trajectories.len(), held.trajectories.len()), (6 * 43, 6 * 6));
    assert!(seen.trajectories.iter().all(|window| window.positions.nrows() == WINDOW));
    let raw = clips().trajectories[0].positions[(430, 0)].to_radians();
    let smooth = held.trajectories[3].positions[(430 - 400 - 24, 0)];
    assert!((raw - smooth).abs() < 0.02, "{raw} {smooth}");
}

#[test]
fn windows_with_an_angle_discontinuity_are_dropped() {
    let mut jumping = clips();
    for k in 200..500 {
        jumping.trajectories[0].positions[(k, 0)] += 360.0;
    }
    let of_clip = |set: &Recordings| set.trajectories.iter().filter(|t| t.id.starts_with("clip0@")).count();
    assert!(of_clip(&windows(jumping).0) < of_clip(&windows(clips()).0));
}

#[test]
fn split_and_merged_parts_equal_their_recordings() {
    let (seen, _) = windows(clips());
    let body = Body::learn(&seen).unwrap();
    assert!(difference(&body.together, &body.whole) < 1e-12);
    for part in [&body.arms, &body.legs, &body.right_arm, &body.left_leg] {
        let alone = learned_alone(&seen, part).unwrap();
        assert!(difference(part, &alone) < 1e-12, "{:?}", part.layout().names());
    }
    assert_eq!(body.right_arm.layout().names(), &NAMES[8..]);
    assert_eq!(body.two_parts.layout().dofs(), NAMES.len());
}

#[test]
fn composite_goals_combine_limbs_of_two_clips() {
    let (seen, held) = windows(clips());
    let body = Body::learn(&seen).unwrap();
    let goals = body.composites(&held);
    assert_eq!(goals.len(), held.trajectories.len().div_ceil(3));
    let (spring, steps) = (body.whole.spring(), body.whole.spring().forces());
    let same = |window: &Trajectory, dofs: std::ops::Range<usize>| {
        let forces = Movement::from_trajectory(window, spring).forces;
        let range = dofs.start * steps..dofs.end * steps;
        forces[range.clone()] == goals[2].forces[range]
    };
    let arms: Vec<&str> =
        held.trajectories.iter().filter(|t| same(t, 4..12)).map(|t| t.id.as_str()).collect();
    let legs: Vec<&str> = held.trajectories.iter().filter(|t| same(t, 0..4)).map(|t| t.id.as_str()).collect();
    assert_eq!((arms.len(), legs.len()), (1, 1));
    assert_ne!(arms[0].split('@').next(), legs[0].split('@').next());
}

#[test]
fn libraries_of_any_rank_reproduce_their_movements() {
    let (seen, held) = windows(clips());
    let body = Body::learn(&seen).unwrap();
    let goals = body.composites(&held);
    for library in [&body.whole, &body.two_parts, &body.four_parts] {
        let basis = body.eigenforces(library, 12);
        let gram = basis.tr_mul(&basis);
        assert!((gram - DMatrix::identity(12, 12)).amax() < 1e-10, "still orthonormal");
        let errors: Vec<f64> = [4, 16, 64]
            .map(|n| body.errors(library, n, &goals).iter().sum::<f64>() / goals.len() as f64)
            .to_vec();
        assert!(errors[0] > errors[1] && errors[1] > errors[2] && errors[2] < 0.05, "{errors:?}");
    }
}

#[test]
fn recordings_without_limbs_are_refused() {
    let (mut seen, _) = windows(clips());
    seen.names = ["a", "b", "c", "d", "e", "f"].map(String::from).to_vec();
    assert!(Body::learn(&seen).is_err());
}
