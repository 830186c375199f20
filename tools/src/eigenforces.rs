//! Eigenforces of a motion library over time.

use motorium_library::MotionLibrary;

use motorium_pictures::chart::{Chart, Series};

/// Units of the forces of a library: its time is normalised, and the acceleration of `y'' = K (g - y) - D y'
/// + f` the same as the positions it was built from.
const FORCE: &str = "force of weight 1, position units / duration^2";

/// Chart of the given eigenforces, counted from 0; unknown ones are skipped.
pub(crate) fn eigenforces(library: &MotionLibrary, title: &str, which: impl Iterator<Item = usize>) -> Chart {
    let spring = library.spring();
    let mut series = Vec::new();
    for k in which.filter(|k| *k < library.rank()) {
        let column = library.eigenforces().column(k);
        for (name, forces) in
            library.layout().names().iter().zip(column.as_slice().chunks_exact(spring.forces()))
        {
            let points = forces.iter().enumerate().map(|(i, force)| [i as f64 * spring.step(), *force, 0.0]);
            series.push(Series { name: format!("{} {name}", k + 1), points: points.collect() });
        }
    }
    let (x, y) = ("time, durations".to_string(), FORCE.to_string());
    Chart { title: title.to_string(), x, y, log_x: false, log_y: false, series }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motorium_library::letters::{Variation, letters};
    use motorium_library::{DAMPING, Metric, SampledSpring, Truncation};

    #[test]
    fn axes_have_units_and_every_freedom_has_a_line() {
        let spring = SampledSpring::new(60, DAMPING).unwrap();
        let known = letters(1, Variation::default(), 1);
        let library = MotionLibrary::build(&known, spring, Metric::Position, Truncation::Rank(3)).unwrap();
        let chart = eigenforces(&library, "Eigenforces", [0, 2, 9].into_iter());
        let names: Vec<&str> = chart.series.iter().map(|series| series.name.as_str()).collect();
        assert_eq!(names, ["1 x", "1 y", "3 x", "3 y"], "the library has no tenth");
        assert!(chart.y.contains("position units / duration^2"), "{}", chart.y);
        assert!(chart.x.contains("durations"));
        assert!(chart.series.iter().all(|series| series.points.len() == 59));
    }
}
