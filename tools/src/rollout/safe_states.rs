//! Actuators that were in their safe state at the end of a run.

use std::collections::BTreeMap;

use motorium::launcher::Event;

/// Actuators in their safe state before the end of the run, with the causes.
#[derive(Debug, Default)]
pub(super) struct SafeStates(BTreeMap<String, String>);

impl SafeStates {
    /// Follows the events of a run.
    pub(super) fn observe(&mut self, event: &Event<'_>) {
        match event {
            Event::EnteredSafeState { component, cause, is_end: false, .. } => {
                self.0.insert((*component).to_owned(), (*cause).to_owned());
            }
            Event::LeftSafeState { component, before_ns: None, resuming: false } => {
                self.0.remove(*component);
            }
            _ => {}
        }
    }

    /// Returns one sentence for each actuator that did not follow its commands when the run ended.
    pub(super) fn at_the_end(&self) -> impl Iterator<Item = String> {
        let sentence = |(component, cause)| format!("`{component}` ended in its safe state: {cause}");
        self.0.iter().map(sentence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entered(is_end: bool) -> Event<'static> {
        let cause = "by an emergency stop";
        Event::EnteredSafeState { component: "drives", times: 1, cause, is_end, since_ns: 0 }
    }

    fn left(before_ns: Option<u64>, resuming: bool) -> Event<'static> {
        Event::LeftSafeState { component: "drives", before_ns, resuming }
    }

    #[test]
    fn safe_state_counts_until_commands_are_followed_again() {
        let mut states = SafeStates::default();
        let mut count = |event: Event<'_>| {
            states.observe(&event);
            states.at_the_end().count()
        };
        assert_eq!(count(left(None, false)), 0);
        assert_eq!(count(entered(false)), 1);
        assert_eq!(count(left(None, true)), 1, "it approaches its command");
        assert_eq!(count(left(None, false)), 0);
        // it left and entered between two polls
        assert_eq!([count(left(Some(5), false)), count(entered(false))], [0, 1]);
        let reasons: Vec<String> = states.at_the_end().collect();
        assert_eq!(reasons, ["`drives` ended in its safe state: by an emergency stop"]);
    }

    #[test]
    fn end_of_the_run_is_no_failure() {
        let mut states = SafeStates::default();
        states.observe(&entered(true));
        assert_eq!(states.at_the_end().count(), 0);
    }
}
