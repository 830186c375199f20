//! The name a person most likely meant.

/// The candidate closest to `wanted`, if any is close enough to be a likely slip of the keyboard.
pub(crate) fn nearest<'a>(wanted: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wanted = wanted.to_lowercase();
    let likeness = |name: &str| {
        let name = name.to_lowercase();
        // A forgotten prefix or suffix ("index_q1" for "left_index_q1") looks far off letter by letter.
        let part = wanted.len() > 2 && (name.starts_with(&wanted) || name.ends_with(&wanted));
        strsim::jaro_winkler(&wanted, &name).max(if part { 0.9 } else { 0.0 })
    };
    candidates
        .into_iter()
        .map(|name| (likeness(name), name))
        .filter(|(score, _)| *score > 0.8)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name)
}

/// ` (did you mean "x"?)`, or nothing.
pub(crate) fn suggestion(nearest: Option<&str>) -> String {
    nearest.map(|name| format!(" (did you mean \"{name}\"?)")).unwrap_or_default()
}
