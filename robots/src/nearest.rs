//! Suggestions for misspelt names: "did you mean".

/// The candidate nearest to `wanted`, if one is near enough to be meant.
///
/// The measure is the Damerau-Levenshtein distance (letters inserted, left out, replaced or swapped) without regard to
/// case, `-`, `_` and spaces being one letter. A candidate is near within a third of the letters of `wanted`, at least
/// one; or when `wanted` (three letters or more) is its beginning or its end, as `index_q1` is of `left_index_q1`.
/// Graph files use the same measure.
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

/// ` (did you mean "x"?)`, or nothing.
pub(crate) fn suggestion(nearest: Option<&str>) -> String {
    nearest.map(|name| format!(" (did you mean \"{name}\"?)")).unwrap_or_default()
}

/// ` (did you mean "x"?)`, or the names that there are: ` (there are a, b)`.
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
    fn a_slip_of_the_finger_or_a_part_left_out_finds_its_name() {
        assert_eq!(nearest("panda_hnad", LINKS), Some("panda_hand"));
        assert_eq!(nearest("Panda Hand-TCP", LINKS), Some("panda_hand_tcp"));
        assert_eq!(nearest("index_q1", LINKS), Some("left_index_q1"));
        assert_eq!(nearest("hand", LINKS), Some("panda_hand"));
    }

    #[test]
    fn a_name_unlike_all_others_finds_none() {
        for wanted in ["elbow", "", "q", "x1"] {
            assert_eq!(nearest(wanted, LINKS), None, "{wanted}");
        }
    }
}
