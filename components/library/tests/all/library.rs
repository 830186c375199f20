//! The motion library against numpy and scipy, and against its documentation.

use std::path::Path;

use motorium_library::{
    DAMPING, Generator, Interpolation, MergeError, Metric, MotionLibrary, Movement, Recogniser, Recordings,
    RecursiveLibrary, RecursiveScatter, SampledSpring, Superposition, Truncation, letters, merge_movements,
    merge_parts,
};
use motorium_recordings::Selection;
use nalgebra::{DMatrix, DVector};

use crate::recorded::{golden, library, numbers, recordings, spring};

/// The largest difference, relative to the largest known value.
fn off(found: &[f64], known: &[f64]) -> f64 {
    assert_eq!(found.len(), known.len());
    let size = known.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    found.iter().zip(known).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) / size
}

fn approximated(library: &MotionLibrary, forces: &[f64], n: usize) -> Vec<f64> {
    let weights = library.project(forces);
    library.forces(&weights.as_slice()[..n])
}

#[test]
fn forces_and_responses_match_scipy() {
    let golden = golden();
    let movement = Movement::from_trajectory(&recordings(&golden).trajectories[3], &spring());
    assert!(off(&movement.forces, &numbers(&golden["forces_of_3"])) < 1e-12);
    let mut response = movement.forces.clone();
    response.chunks_exact_mut(47).for_each(|block| spring().respond(block));
    assert!(off(&response, &numbers(&golden["response_of_3"])) < 1e-12);
}

#[test]
fn eigenforces_match_a_direct_decomposition() {
    let golden = golden();
    let library = library(Metric::Force);
    assert!(off(&library.parts().singular, &numbers(&golden["singular"])[..library.rank()]) < 1e-12);
    let forces = numbers(&golden["forces_of_3"]);
    assert!(off(&approximated(&library, &forces, 4), &numbers(&golden["approximation_of_3_by_4"])) < 1e-12);
    assert!((library.explained().iter().sum::<f64>() - 1.0).abs() < 1e-12);
}

#[test]
fn position_metric_minimises_the_response_residual() {
    let golden = golden();
    let library = library(Metric::Position);
    assert!(off(&library.parts().singular, &numbers(&golden["singular_position"])[..library.rank()]) < 1e-12);
    let mut found = approximated(&library, &numbers(&golden["forces_of_3"]), 4);
    found.chunks_exact_mut(47).for_each(|block| spring().respond(block));
    assert!(off(&found, &numbers(&golden["position_approximation_of_3_by_4"])) < 1e-11);
}

#[test]
fn split_part_equals_the_library_of_its_data() {
    let golden = golden();
    let whole = library(Metric::Force);
    let arms = whole.split(&whole.layout().part("arms=l_*,r_*").unwrap()).unwrap();
    assert_eq!(arms.layout().names(), ["l_arm", "r_arm"]);
    let known = numbers(&golden["singular_of_dofs_0_2"]);
    assert!(off(&arms.parts().singular, &known[..arms.rank()]) < 1e-12);
    let forces = numbers(&golden["forces_of_3"]);
    let forces = [&forces[..47], &forces[94..]].concat();
    assert!(
        off(&approximated(&arms, &forces, 4), &numbers(&golden["approximation_of_dofs_0_2_by_4"])) < 1e-12
    );
    // the movements kept their weights
    assert!(off(arms.project(&forces).as_slice(), arms.weights().column(3).as_slice()) < 1e-11);
}

#[test]
fn dependent_parts_merge_into_the_whole() {
    for metric in [Metric::Force, Metric::Position] {
        let whole = library(metric);
        let part = |text: &str| whole.split(&whole.layout().part(text).unwrap()).unwrap();
        let parts = [part("a=l_arm"), part("b=leg"), part("c=r_arm")];
        let merged = merge_parts(&parts.each_ref(), Truncation::All).unwrap();
        assert!(off(&merged.parts().singular, &whole.parts().singular) < 1e-12);
        let forces = numbers(&golden()["forces_of_3"]);
        assert!(off(&approximated(&merged, &forces, 4), &approximated(&whole, &forces, 4)) < 1e-11);
        assert_eq!(merged.entries(), whole.entries());
    }
}

#[test]
fn independent_parts_merge_by_singular_value() {
    let set = recordings(&golden());
    let whole = library(Metric::Force);
    let half = |text: &str, from: usize, to: usize| {
        let set = Recordings { names: set.names.clone(), trajectories: set.trajectories[from..to].to_vec() };
        let library = MotionLibrary::build(&set, spring(), Metric::Force, Truncation::All).unwrap();
        library.split(&whole.layout().part(text).unwrap()).unwrap()
    };
    let (arm, leg) = (half("a=l_arm", 0, 6), half("b=leg", 6, 14));
    let merged = merge_parts(&[&arm, &leg], Truncation::All).unwrap();
    assert_eq!(merged.rank(), arm.rank() + leg.rank());
    assert!(merged.parts().singular.is_sorted_by(|a, b| a >= b));
    assert_eq!(merged.entries().len(), 14);
    let weights: Vec<f64> = merged.weights().column(7).iter().copied().collect();
    let forces = merged.forces(&weights);
    assert!(forces[..47].iter().all(|f| f.abs() < 1e-9), "the other part rests");
    assert!(off(&forces[47..], &leg.forces(leg.weights().column(1).as_slice())) < 1e-12);
}

#[test]
fn libraries_of_one_body_merge() {
    let set = recordings(&golden());
    let half = |from: usize, to: usize| {
        let set = Recordings { names: set.names.clone(), trajectories: set.trajectories[from..to].to_vec() };
        MotionLibrary::build(&set, spring(), Metric::Force, Truncation::All).unwrap()
    };
    let merged = merge_movements(&[&half(0, 9), &half(9, 14)], Truncation::All).unwrap();
    let whole = library(Metric::Force);
    assert!(off(&merged.parts().singular, &whole.parts().singular) < 1e-12);
    assert_eq!(merged.entries(), whole.entries());
    assert!(
        off(
            &merged.forces(merged.weights().column(11).as_slice()),
            &whole.forces(whole.weights().column(11).as_slice())
        ) < 1e-10
    );
    let other =
        MotionLibrary::build(&set, SampledSpring::new(60, DAMPING).unwrap(), Metric::Force, Truncation::All)
            .unwrap();
    assert_eq!(merge_movements(&[&whole, &other], Truncation::All).unwrap_err(), MergeError::Spring(2));
}

#[test]
fn recursive_updates_match_a_direct_decomposition() {
    let golden = golden();
    let set = recordings(&golden);
    let first = Recordings { names: set.names.clone(), trajectories: set.trajectories[..9].to_vec() };
    let start = MotionLibrary::build(&first, spring(), Metric::Force, Truncation::All).unwrap();
    assert!(off(&start.parts().singular, &numbers(&golden["singular_of_first_9"])) < 1e-12);
    let mut recursive = RecursiveLibrary::new(start.clone(), 50, 1.0);
    set.trajectories[9..].iter().for_each(|trajectory| recursive.add(trajectory).unwrap());
    let known = numbers(&golden["singular"]);
    assert!(off(&recursive.singular(), &known) < 1e-11);
    let grown = recursive.into_library();
    let whole = library(Metric::Force);
    assert_eq!(grown.entries(), whole.entries());
    assert!(
        off(grown.project(&numbers(&golden["forces_of_3"])).as_slice(), grown.weights().column(3).as_slice())
            < 1e-9
    );
    let mut block = RecursiveLibrary::new(start, 50, 1.0);
    let rest = DMatrix::from_fn(141, 5, |i, k| {
        Movement::from_trajectory(&set.trajectories[9 + k], &spring()).forces[i]
    });
    block.add_block(&rest);
    assert!(off(&block.singular(), &known) < 1e-11);
}

#[test]
fn forgetting_weights_movements_by_age() {
    let golden = golden();
    let set = recordings(&golden);
    let first = Recordings { names: set.names.clone(), trajectories: set.trajectories[..1].to_vec() };
    let start = MotionLibrary::build(&first, spring(), Metric::Force, Truncation::All).unwrap();
    let mut recursive = RecursiveLibrary::new(start, 50, 0.9);
    set.trajectories[1..9].iter().for_each(|trajectory| recursive.add(trajectory).unwrap());
    assert!(off(&recursive.singular(), &numbers(&golden["forgetting_0_9"])) < 1e-11);
}

#[test]
fn recursive_covariance_matches_the_batch_covariance() {
    let golden = golden();
    let mut scatter = RecursiveScatter::new(47);
    for trajectory in &recordings(&golden).trajectories {
        scatter
            .add(&DVector::from_column_slice(&Movement::from_trajectory(trajectory, &spring()).forces[..47]));
    }
    assert!(off(scatter.mean().as_slice(), &numbers(&golden["mean_of_dof_0"])) < 1e-12);
    assert!(off(&scatter.components().values[..10], &numbers(&golden["variances_of_dof_0"])) < 1e-12);
}

#[test]
fn known_movements_are_recognised_and_new_ones_are_novel() {
    let set = recordings(&golden());
    let library = library(Metric::Force);
    let mut recogniser = Recogniser::new(&library, 8);
    let found = recogniser.recognise(&set.trajectories[5]);
    assert_eq!(found.nearest.map(|(k, _)| k), Some(5));
    let mut strange = set.trajectories[5].clone();
    strange.positions.iter_mut().enumerate().for_each(|(k, y)| *y += 0.5 * (0.9 * k as f64).sin());
    assert!(recogniser.recognise(&strange).novelty > 3.0 * found.novelty + 0.3);
}

#[test]
fn generated_movement_follows_recording_and_new_goal() {
    let set = recordings(&golden());
    let library = library(Metric::Force);
    let movement = Superposition::from_entry(&library, 2, usize::MAX);
    let path = movement.path(&library);
    assert!((&path - &set.trajectories[2].positions).amax() < 1e-10);
    let mut generator = Generator::new(&library);
    generator.start(&movement.weights, &movement.frame).unwrap();
    let step = movement.frame.duration / 47.0;
    for k in 1..48 {
        generator.step(step);
        assert!((generator.position()[1] - path[(k, 1)]).abs() < 1e-9, "sample {k}");
    }
    // a goal that changes halfway is reached without a discontinuity
    generator.start(&movement.weights, &movement.frame).unwrap();
    let goal: Vec<f64> = movement.frame.goal.iter().map(|g| g + 0.5).collect();
    let mut last = generator.position().to_vec();
    for k in 0..3000 {
        generator.step(1e-3);
        if k == 900 {
            generator.set_goal(&goal).unwrap();
        }
        assert!(generator.position().iter().zip(&last).all(|(a, b)| (a - b).abs() < 0.02));
        last.copy_from_slice(generator.position());
    }
    assert!(generator.is_finished());
    assert!(last.iter().zip(&goal).all(|(a, b)| (a - b).abs() < 0.05), "{last:?} {goal:?}");
}

#[test]
fn blend_stays_between_its_movements() {
    let library = library(Metric::Position);
    let (a, b) = (Superposition::from_entry(&library, 0, 14), Superposition::from_entry(&library, 1, 14));
    let middle = a.blend(&b, 0.3).path(&library);
    let known = a.path(&library) * 0.7 + b.path(&library) * 0.3;
    assert!((middle - known).amax() < 1e-10);
}

#[test]
fn fewer_eigenforces_are_kept_by_error_and_by_bytes() {
    let set = recordings(&golden());
    let build = |keep| MotionLibrary::build(&set, spring(), Metric::Force, keep).unwrap();
    let by_error = build(Truncation::Error(0.1));
    let left: f64 = 1.0 - by_error.explained().iter().sum::<f64>();
    assert!(left <= 0.01 && by_error.rank() < 14);
    let one_less: f64 = 1.0 - by_error.explained()[..by_error.rank() - 1].iter().sum::<f64>();
    assert!(one_less > 0.01, "one fewer does not suffice");
    assert_eq!(build(Truncation::Bytes(5 * 8 * 142)).rank(), 5);
}

#[test]
fn synthetic_letters_need_few_eigenforces() {
    let set = letters::letters(6, letters::Variation::default(), 7);
    let (seen, held) = set.hold_out(3);
    let spring = SampledSpring::new(120, DAMPING).unwrap();
    let library = MotionLibrary::build(&seen, spring, Metric::Position, Truncation::Rank(32)).unwrap();
    assert!(motorium_library::nearest_neighbour_rate(&library, &held, 16) > 0.9);
    let basis = |n| motorium_library::Basis::eigenforces(&library, n);
    let error = |n| motorium_library::evaluate(&basis(n), &held, &spring).position.mean;
    assert!(error(16) < 0.5 * error(8) && error(16) < 0.15, "{} {}", error(8), error(16));
}

/// A few outliers bend the eigenforces of the mean square towards them, but not the eigenforces of the mean.
#[test]
fn balanced_eigenforces_resist_outliers() {
    let (seen, held) = letters::letters(12, letters::Variation::default(), 3).hold_out(3);
    let spring = SampledSpring::new(120, DAMPING).unwrap();
    let library = MotionLibrary::build(&seen, spring, Metric::Position, Truncation::All).unwrap();
    let balanced = library.balanced(12, Truncation::All).unwrap();
    let error = |library: &MotionLibrary, set: &Recordings| {
        let basis = motorium_library::Basis::eigenforces(library, 12);
        motorium_library::evaluate(&basis, set, &spring).position
    };
    let (plain, even) = (error(&library, &seen), error(&balanced, &seen));
    assert!(even.mean < plain.mean && even.median < plain.median, "{plain:?} {even:?}");
    let squares = |e: &motorium_library::PathError| e.mean * e.mean + e.deviation * e.deviation;
    assert!(squares(&even) > squares(&plain), "singular vectors have the smallest mean square");
    assert!(error(&balanced, &held).mean < 1.05 * error(&library, &held).mean);
    let gram = balanced.parts().basis.transpose() * &balanced.parts().basis;
    assert!((gram - DMatrix::<f64>::identity(balanced.rank(), balanced.rank())).norm() < 1e-9);
    assert_eq!(balanced.entries(), library.entries());
}

/// Known values: `spectrum_of_letters` of `golden/library.py`, by scipy, for the 928 training letters of
/// these 1,151.
#[test]
fn spectrum_of_recorded_letters_matches_scipy() {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/uci-char-trajectories/train.jsonl");
    if !path.exists() {
        eprintln!("skipped: no recorded letters at {}", path.display());
        return;
    }
    let all = Recordings::read([&path], &Selection { rate: Some(200.0), ..Selection::default() }).unwrap();
    let (seen, _) = all.hold_out(5);
    if (all.trajectories.len(), seen.trajectories.len()) != (1151, 928) {
        eprintln!("skipped: {} other letters than the 1,151 known ones", all.trajectories.len());
        return;
    }
    let spring = SampledSpring::new(200, DAMPING).unwrap();
    let along = |interpolation| {
        let spring = spring.with_interpolation(interpolation);
        MotionLibrary::build(&seen, spring, Metric::Force, Truncation::Rank(5)).unwrap().explained()
    };
    let splines = [0.597389132, 0.141591526, 0.066376451, 0.048114091, 0.038390778];
    assert!(off(&along(Interpolation::Spline)[..5], &splines) < 1e-7);
    let lines = [0.591273441, 0.139937860, 0.065634982, 0.047563579, 0.037899571];
    assert!(off(&along(Interpolation::Linear)[..5], &lines) < 1e-7);
}

#[test]
fn part_at_rest_is_rejected_by_name() {
    let mut resting = recordings(&golden());
    resting.trajectories.iter_mut().for_each(|movement| movement.positions.column_mut(1).fill(0.0));
    let whole = MotionLibrary::build(&resting, spring(), Metric::Force, Truncation::All).unwrap();
    let refused = whole.split(&whole.layout().part("rest=leg").unwrap()).unwrap_err().to_string();
    assert!(refused.starts_with("leg: at rest in all recordings"), "{refused}");
    assert!(whole.split(&whole.layout().part("arms=l_*,r_*").unwrap()).is_ok());
}
