//! The progress of a run in one short line per second: the changes since the previous line.

use motorium::launcher::{ComponentStatus, Status};
use motorium::region::{Misses, Phase};

/// Maximum number of components whose changes are printed in a line; the rest are counted.
const MAX_REPORTED: usize = 3;

/// The last printed state of the components.
#[derive(Debug, Default)]
pub(crate) struct Progress {
    reported: Vec<Reported>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Reported {
    misses: Misses,
    restarts: u64,
    safe: bool,
}

impl Progress {
    /// Returns the line of a state: the components that missed steps, were restarted, or entered or left
    /// their safe state.
    pub(crate) fn line(&mut self, status: &Status) -> String {
        let mut first = self.reported.is_empty();
        if self.reported.len() != status.components.len() {
            (self.reported, first) = (vec![Reported::default(); status.components.len()], true);
        }
        let changes: Vec<String> = status
            .components
            .iter()
            .zip(&mut self.reported)
            .filter_map(|(component, reported)| change(component, reported, first))
            .collect();
        let running = status.components.iter().filter(|component| component.phase == Phase::Running).count();
        let (all, seconds) = (status.components.len(), status.elapsed_ns as f64 * 1e-9);
        let reported = match changes.len() {
            0 if running == all => format!("{all} components run"),
            0 => format!("{running} of {all} components run"),
            count if count > MAX_REPORTED => {
                format!("{}; {} others, too", changes[..MAX_REPORTED].join("; "), count - MAX_REPORTED)
            }
            _ => changes.join("; "),
        };
        format!("{seconds:5.1} s  {reported}")
    }
}

/// Returns the changes of a component and remembers its state. Every run begins in a safe state, which the
/// `first` line omits.
fn change(component: &ComponentStatus, reported: &mut Reported, first: bool) -> Option<String> {
    let ComponentStatus { report, safe, .. } = component;
    let now = Reported { misses: report.misses, restarts: report.restarts.into(), safe: *safe };
    let before = std::mem::replace(reported, now);
    let mut changes = Vec::new();
    let missed = since(&now.misses, &before.misses);
    if missed.missed() > 0 {
        changes.push(format!("missed {}", causes(&missed)));
    }
    match now.restarts.saturating_sub(before.restarts) {
        0 => {}
        1 => changes.push("was restarted".to_string()),
        count => changes.push(format!("was restarted {count} times")),
    }
    match (before.safe, now.safe) {
        (false, true) if !first => changes.push("is in its safe state".to_string()),
        (true, false) => changes.push("left its safe state".to_string()),
        _ => {}
    }
    (!changes.is_empty()).then(|| format!("{} {}", report.name, changes.join(", ")))
}

/// Returns the misses since a moment.
fn since(now: &Misses, before: &Misses) -> Misses {
    let more = |now: u64, before: u64| now.saturating_sub(before);
    Misses {
        stolen: more(now.stolen, before.stolen),
        late_wake: more(now.late_wake, before.late_wake),
        long_step: more(now.long_step, before.long_step),
        late_input: more(now.late_input, before.late_input),
        ..Misses::default()
    }
}

/// Returns the missed steps and their causes: `4 (3 stolen, 1 long step)`.
pub(crate) fn causes(misses: &Misses) -> String {
    let causes = [
        (misses.stolen, "stolen"),
        (misses.late_wake, "late wake"),
        (misses.long_step, "long step"),
        (misses.late_input, "late input"),
    ];
    let those: Vec<String> = causes
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, cause)| format!("{count} {cause}"))
        .collect();
    match misses.missed() {
        0 => "0".to_string(),
        all => format!("{all} ({})", those.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use motorium::launcher::ComponentReport;

    use super::*;

    fn component(name: &str, stolen: u64, restarts: u64, safe: bool) -> ComponentStatus {
        let report = ComponentReport {
            name: name.to_string(),
            misses: Misses { stolen, ..Misses::default() },
            restarts: restarts.try_into().expect("few"),
            ..ComponentReport::default()
        };
        ComponentStatus { phase: Phase::Running, safe, report }
    }

    fn status(seconds: u64, components: Vec<ComponentStatus>) -> Status {
        Status { elapsed_ns: seconds * 1_000_000_000, components, latencies: vec![], edges: vec![] }
    }

    #[test]
    fn progress_lines_print_only_changes() {
        let mut progress = Progress::default();
        let with = |stolen, restarts, safe| {
            vec![component("physics", stolen, 0, safe), component("policy", 0, restarts, false)]
        };
        assert_eq!(progress.line(&status(1, with(0, 0, false))), "  1.0 s  2 components run");
        let line = progress.line(&status(2, with(2, 0, false)));
        assert_eq!(line, "  2.0 s  physics missed 2 (2 stolen)");
        assert_eq!(progress.line(&status(3, with(2, 0, false))), "  3.0 s  2 components run");
        let line = progress.line(&status(4, with(3, 1, true)));
        assert_eq!(line, "  4.0 s  physics missed 1 (1 stolen), is in its safe state; policy was restarted");
        assert_eq!(progress.line(&status(5, with(3, 1, false))), "  5.0 s  physics left its safe state");
    }

    #[test]
    fn line_length_is_bounded_for_many_components() {
        let many = |stolen| (0..40).map(|_| component("camera-servo", stolen, 0, false)).collect();
        let mut progress = Progress::default();
        assert_eq!(progress.line(&status(1, many(0))), "  1.0 s  40 components run");
        let line = progress.line(&status(2, many(1)));
        assert!(line.ends_with("; 37 others, too") && line.chars().count() < 130, "{line}");
        let mut fewer: Vec<ComponentStatus> = many(1);
        fewer[0].phase = Phase::Stopped;
        assert_eq!(progress.line(&status(3, fewer)), "  3.0 s  39 of 40 components run");
    }

    #[test]
    fn causes_come_with_their_counts() {
        assert_eq!(causes(&Misses::default()), "0");
        let all = Misses { stolen: 1, late_wake: 2, long_step: 3, late_input: 4, ..Misses::default() };
        assert_eq!(causes(&all), "10 (1 stolen, 2 late wake, 3 long step, 4 late input)");
    }
}
