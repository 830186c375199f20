//! The topics that a component reads through taps.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// The topics that a component reads through taps. A tap reads every value of a topic in order. It needs no
/// port, and the writer of the topic does not wait for it.
///
/// ```
/// use motorium::declare::Taps;
/// use std::time::Duration;
///
/// let taps = Taps::new(["panda/*", "phase"], Duration::from_millis(200));
/// assert!(taps.includes("panda/joint_state") && taps.includes("phase"));
/// assert!(!taps.includes("other/phase"));
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Taps {
    /// Patterns of topic names, in which `*` matches any characters.
    pub topics: Vec<String>,
    /// Time for which a tap may go unread without losing values. Tapped topics keep the values that are
    /// published in this time.
    pub bridges: Duration,
}

impl Taps {
    /// Creates taps on all topics whose names match one of `topics`. In a pattern, `*` matches any
    /// characters.
    pub fn new<'a>(topics: impl IntoIterator<Item = &'a str>, bridges: Duration) -> Self {
        Self { topics: topics.into_iter().map(str::to_string).collect(), bridges }
    }

    /// Returns `true` if a topic with this name is tapped.
    pub fn includes(&self, topic: &str) -> bool {
        self.topics.iter().any(|pattern| matches(pattern, topic))
    }

    /// Returns the first pattern that matches none of `topics`.
    pub fn unmatched<'a>(&'a self, topics: &[String]) -> Option<&'a str> {
        let is_idle = |pattern: &&String| !topics.iter().any(|topic| matches(pattern, topic));
        self.topics.iter().find(is_idle).map(String::as_str)
    }
}

/// Returns `true` if a text matches a pattern, in which `*` matches any characters.
fn matches(pattern: &str, text: &str) -> bool {
    let mut parts = pattern.split('*');
    let Some(mut rest) = parts.next().and_then(|first| text.strip_prefix(first)) else { return false };
    let Some(last) = parts.next_back() else { return rest.is_empty() };
    for part in parts {
        let Some(at) = rest.find(part) else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn star_is_the_only_wildcard() {
        for (pattern, text, fits) in [
            ("*", "", true),
            ("*", "panda/target", true),
            ("panda/target", "panda/target", true),
            ("panda/target", "panda/targets", false),
            ("panda/*", "panda/target", true),
            ("*/joint_state", "left/joint_state", true),
            ("*/joint_state", "left/true_joint_state", false),
            ("*joint*", "left/true_joint_state", true),
            ("a*b*c", "axxbyyc", true),
            ("a*b*c", "axxcyyb", false),
            ("ab*ba", "aba", false),
        ] {
            assert_eq!(matches(pattern, text), fits, "{pattern} {text}");
        }
        let taps = Taps::new(["left/*", "phase"], Duration::ZERO);
        assert_eq!(taps.unmatched(&["left/target".to_string()]), Some("phase"));
    }
}
