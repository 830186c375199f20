//! Randomly damaged good files, which always result in a plan or in errors that can be rendered.

use motorium::graph::check;
use proptest::prelude::*;

use super::{good, kinds, machine};

#[derive(Debug, Clone)]
enum Damage {
    /// Removes a part.
    Cut { at: usize, length: usize },
    /// Inserts a text.
    Insert { at: usize, text: String },
    /// Repeats a line elsewhere.
    Repeat { line: usize, at: usize },
    /// Swaps two lines.
    Swap { one: usize, other: usize },
    /// Replaces a word of the file by another.
    Replace { one: usize, other: usize },
}

fn damage() -> impl Strategy<Value = Damage> {
    let text = prop_oneof![
        "[\\[\\]{}=\"'.,#\n a-z0-9-]{1,6}",
        Just("component".to_string()),
        Just("inf".to_string()),
        Just("99999999999999999999999".to_string()),
        Just("µ≤\u{1F916}".to_string()),
        Just("\r\n".to_string()),
    ];
    prop_oneof![
        (any::<usize>(), 1..40usize).prop_map(|(at, length)| Damage::Cut { at, length }),
        (any::<usize>(), text).prop_map(|(at, text)| Damage::Insert { at, text }),
        (any::<usize>(), any::<usize>()).prop_map(|(line, at)| Damage::Repeat { line, at }),
        (any::<usize>(), any::<usize>()).prop_map(|(one, other)| Damage::Swap { one, other }),
        (any::<usize>(), any::<usize>()).prop_map(|(one, other)| Damage::Replace { one, other }),
    ]
}

fn apply(text: &str, damage: &Damage) -> String {
    let characters: Vec<char> = text.chars().collect();
    let mut lines: Vec<&str> = text.split('\n').collect();
    let count = lines.len();
    match damage {
        Damage::Cut { at, length } => {
            let start = at % (characters.len() + 1);
            let end = (start + length).min(characters.len());
            characters[..start].iter().chain(&characters[end..]).collect()
        }
        Damage::Insert { at, text } => {
            let start = at % (characters.len() + 1);
            let (before, after) = characters.split_at(start);
            before.iter().copied().chain(text.chars()).chain(after.iter().copied()).collect()
        }
        Damage::Repeat { line, at } => {
            lines.insert(at % (count + 1), lines[line % count]);
            lines.join("\n")
        }
        Damage::Swap { one, other } => {
            lines.swap(one % count, other % count);
            lines.join("\n")
        }
        Damage::Replace { one, other } => {
            let words: Vec<&str> =
                text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
            match words.len() {
                0 => text.to_string(),
                words_count => text.replacen(words[one % words_count], words[other % words_count], 1),
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_damaged_graph_is_a_plan_or_errors_but_never_a_panic(
        file in prop_oneof![Just("panda-reach"), Just("everything")],
        all in prop::collection::vec(damage(), 1..6),
    ) {
        let path = good(file);
        let mut text = std::fs::read_to_string(&path).expect("the file");
        for damage in &all {
            text = apply(&text, damage);
        }
        match check(&path, text, &[], &kinds::registry(), &machine()) {
            Ok(checked) => {
                prop_assert!(serde_json::to_string(&checked.plan).is_ok());
                checked.warnings.iter().for_each(|warning| drop(warning.render(false)));
            }
            Err(error) => {
                prop_assert!(!error.diagnostics().is_empty());
                prop_assert!(error.render(true).contains("error"));
                prop_assert!(error.reports().iter().all(|report| report.line != Some(0)));
            }
        }
    }

    #[test]
    fn any_override_is_a_plan_or_errors_but_never_a_panic(
        path in "(component\\.|latency\\.)?(physics|policy|clock|0|cores)?(\\.[a-z0-9]{0,6}){0,3}",
        value in "[\\[\\]{}\"'a-z0-9 .,=\n#-]{0,12}",
    ) {
        let setting = motorium::graph::Override { path, value };
        let file = good("everything");
        if let Err(error) = motorium::graph::load_for(&file, &[setting], &kinds::registry(), &machine()) {
            prop_assert!(error.render(false).contains("error"));
        }
    }
}
