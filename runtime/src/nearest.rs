//! Suggestions for misspelt names: "did you mean ...?".

/// Maximum length of a compared word, in bytes: longer words are not typing errors and are expensive to
/// compare.
const LONGEST: usize = 256;

/// Returns the known name that is most similar to `written`, or `None` if none is similar enough.
pub fn nearest<'a>(written: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    if written.len() > LONGEST {
        return None;
    }
    let plain = |name: &str| name.to_lowercase().replace(['-', ' '], "_");
    let wanted = plain(written);
    let count = wanted.chars().count();
    // names without a common character are not similar, even if short
    let slight = |distance: usize, other: &str| {
        distance <= (count / 3).max(1) && distance < count.max(other.chars().count())
    };
    known
        .into_iter()
        .filter_map(|name| {
            let candidate = plain(name);
            let distance = strsim::damerau_levenshtein(&wanted, &candidate);
            // a part left out, such as `joint_state` for `panda/joint_state`
            let part = |whole: &str, part: &str| {
                !part.is_empty()
                    && (whole.ends_with(&format!("/{part}")) || whole.ends_with(&format!(".{part}")))
            };
            // a slip in the last part, with the parts before it left out
            let last_part = candidate.rsplit(['/', '.']).next().unwrap_or_default();
            let slip =
                !wanted.is_empty() && slight(strsim::damerau_levenshtein(&wanted, last_part), last_part);
            let near = slight(distance, &candidate)
                || slip
                || part(&candidate, &wanted)
                || part(&wanted, &candidate);
            near.then_some((distance, name))
        })
        .min()
        .map(|(_, name)| name)
}

/// Formats names in backticks, separated by commas.
pub fn list<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    names.into_iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

/// Returns "did you mean" with the most similar name. If none is similar enough, returns `otherwise` followed
/// by all known names.
pub fn suggest<'a>(
    written: &str,
    known: impl IntoIterator<Item = &'a str> + Clone,
    otherwise: &str,
) -> String {
    match nearest(written, known.clone()) {
        Some(name) => format!("did you mean `{name}`?"),
        None => format!("{otherwise}: {}", list(known)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typing_error_finds_its_name() {
        let known = ["rate", "trigger", "budget", "panda/joint_state"];
        assert_eq!(nearest("rte", known), Some("rate"));
        assert_eq!(nearest("Trigger", known), Some("trigger"));
        assert_eq!(nearest("joint-state", known), Some("panda/joint_state"));
        assert_eq!(nearest("joint_sate", known), Some("panda/joint_state"));
        assert_eq!(nearest("colour", known), None);
        assert_eq!(nearest("", known), None);
        assert_eq!(nearest("t", ["c", "s"]), None);
        assert_eq!(nearest("t", ["c", "tt"]), Some("tt"));
        assert_eq!(nearest(&"rate".repeat(1_000_000), known), None);
    }
}
