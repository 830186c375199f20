//! Suggestions for misspelt names: "did you mean".

/// Returns the candidate that is most similar to `wanted`, or `None` if no candidate is similar enough.
///
/// The measure is the case-insensitive Damerau-Levenshtein distance, in which `-`, `_` and spaces are equal.
/// A candidate is similar enough if its distance is at most 1, or at most a third of the number of letters in
/// `wanted`. It is also similar enough if `wanted` has at least three letters and is a prefix or suffix of
/// the candidate, such as `index_q1` of `left_index_q1`.
pub fn nearest<'a>(wanted: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |name: &str| name.to_lowercase().replace(['-', ' '], "_");
    let wanted = plain(wanted);
    let letters = wanted.chars().count();
    let slips = (letters / 3).max(1);
    candidates
        .into_iter()
        .filter_map(|name| {
            let candidate = plain(name);
            let part = letters > 2 && (candidate.starts_with(&wanted) || candidate.ends_with(&wanted));
            let distance = strsim::damerau_levenshtein(&wanted, &candidate);
            (part || distance <= slips && letters > 0).then_some((distance, name))
        })
        .min()
        .map(|(_, name)| name)
}

/// Returns the suggestion ` (did you mean "x"?)` for the name `x` in `nearest`, or an empty string for
/// `None`.
pub fn suggestion(nearest: Option<&str>) -> String {
    nearest.map(|name| format!(" (did you mean \"{name}\"?)")).unwrap_or_default()
}

/// Returns ` (did you mean "x"?)`, or the list of known names: ` (there are a, b)`.
pub(crate) fn suggestion_or_list(nearest: Option<&str>, known: &[String]) -> String {
    match (nearest, known) {
        (Some(_), _) => suggestion(nearest),
        (None, []) => " (there are none)".to_owned(),
        (None, known) => format!(" (there are {})", known.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINKS: [&str; 4] = ["panda_link1", "panda_hand", "panda_hand_tcp", "left_index_q1"];

    #[test]
    fn typo_or_missing_part_finds_the_name() {
        assert_eq!(nearest("panda_hnad", LINKS), Some("panda_hand"));
        assert_eq!(nearest("Panda Hand-TCP", LINKS), Some("panda_hand_tcp"));
        assert_eq!(nearest("index_q1", LINKS), Some("left_index_q1"));
        assert_eq!(nearest("hand", LINKS), Some("panda_hand"));
    }

    #[test]
    fn dissimilar_name_has_no_suggestion() {
        for wanted in ["elbow", "", "q", "x1"] {
            assert_eq!(nearest(wanted, LINKS), None, "{wanted}");
        }
    }
}
