//! What a person probably meant.

/// "did you mean" when a name is near to what was written; else all names, after `otherwise`.
pub(crate) fn suggest<'a>(
    written: &str,
    known: impl IntoIterator<Item = &'a str> + Clone,
    otherwise: &str,
) -> String {
    match nearest(written, known.clone()) {
        Some(name) => format!("did you mean `{name}`?"),
        None => {
            let names: Vec<_> = known.into_iter().map(|name| format!("`{name}`")).collect();
            format!("{otherwise}: {}", names.join(", "))
        }
    }
}

/// The name nearest to what was written: a few slips away, or with its first parts left out.
fn nearest<'a>(written: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wanted = written.to_lowercase();
    let slips = (wanted.chars().count() / 3).max(1);
    known
        .into_iter()
        .filter_map(|name| {
            let candidate = name.to_lowercase();
            let distance = strsim::damerau_levenshtein(&wanted, &candidate);
            let last_part = candidate.rsplit(['/', '.']).next().unwrap_or_default();
            let near = distance <= slips || strsim::damerau_levenshtein(&wanted, last_part) <= slips;
            (near && !wanted.is_empty()).then_some((distance, name))
        })
        .min()
        .map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOPICS: [&str; 3] = ["panda/joint_state", "panda/joint_command", "panda/target"];

    #[test]
    fn a_slip_or_a_part_left_out_finds_its_name() {
        assert_eq!(nearest("panda/joint_sate", TOPICS), Some("panda/joint_state"));
        assert_eq!(nearest("target", TOPICS), Some("panda/target"));
        assert_eq!(nearest("Panda/Target", TOPICS), Some("panda/target"));
        assert_eq!(nearest("camera", TOPICS), None);
        assert_eq!(nearest("", TOPICS), None);
    }

    #[test]
    fn without_a_near_name_all_are_listed() {
        assert_eq!(suggest("camera", ["a/b", "c"], "there are"), "there are: `a/b`, `c`");
    }
}
