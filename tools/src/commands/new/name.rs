//! Names of component crates.

/// Names unavailable for a crate or its program: keywords, names used by cargo, and dependencies.
const TAKEN: [&str; 66] = [
    "abstract",
    "alloc",
    "as",
    "async",
    "await",
    "become",
    "box",
    "break",
    "build",
    "const",
    "continue",
    "core",
    "crate",
    "deps",
    "do",
    "dyn",
    "else",
    "enum",
    "examples",
    "extern",
    "false",
    "final",
    "fn",
    "for",
    "gen",
    "if",
    "impl",
    "in",
    "incremental",
    "let",
    "loop",
    "macro",
    "match",
    "mod",
    "motorium",
    "move",
    "mut",
    "override",
    "priv",
    "proc-macro",
    "proc_macro",
    "pub",
    "ref",
    "return",
    "schemars",
    "self",
    "serde",
    "serde_json",
    "static",
    "std",
    "struct",
    "super",
    "test",
    "trait",
    "true",
    "try",
    "type",
    "typeof",
    "unsafe",
    "unsized",
    "use",
    "virtual",
    "where",
    "while",
    "yield",
    "union",
];
/// Maximum length of graph names, in characters.
const LONGEST: usize = 64;

/// Error of an invalid crate name.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum NameError {
    #[error("the name is empty; try `my-controller`")]
    Empty,
    #[error("`{name}` has {length} characters, at most {LONGEST} are allowed")]
    Long { name: String, length: usize },
    #[error("`{name}` begins with `{first}`, but must begin with a lower-case letter{}", also(.better))]
    Begin { name: String, first: char, better: String },
    #[error("`{name}` has the character `{found}`; lower-case letters, digits, `-` and `_` are allowed{}", also(.better))]
    Character { name: String, found: char, better: String },
    #[error("`{name}` cannot be used as a crate name because it is reserved; try `my-{name}`")]
    Taken { name: String },
}

fn also(better: &str) -> String {
    if better.is_empty() { String::new() } else { format!("; try `{better}`") }
}

/// Checks the name of a crate, its program, its folder and its graph.
pub(super) fn check(name: &str) -> Result<(), NameError> {
    let Some(first) = name.chars().next() else { return Err(NameError::Empty) };
    let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
    let name = name.to_string();
    if let Some(found) = name.chars().find(|c| !allowed(*c)) {
        let better = better(&name);
        return Err(NameError::Character { name, found, better });
    }
    if !first.is_ascii_lowercase() {
        let better = better(&name);
        return Err(NameError::Begin { name, first, better });
    }
    let length = name.len();
    if length > LONGEST {
        return Err(NameError::Long { name, length });
    }
    if TAKEN.contains(&name.as_str()) { Err(NameError::Taken { name }) } else { Ok(()) }
}

/// Returns the nearest valid name, or an empty text.
fn better(name: &str) -> String {
    let mut better = String::new();
    let mut last = ' ';
    for c in name.chars() {
        if c.is_ascii_uppercase() {
            if last.is_ascii_lowercase() {
                better.push('-');
            }
            better.push(c.to_ascii_lowercase());
        } else if c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' {
            better.push(c);
        } else if !better.ends_with('-') {
            better.push('-');
        }
        last = c;
    }
    let better = better.trim_matches(|c: char| c == '-' || c == '_');
    better.trim_start_matches(|c: char| !c.is_ascii_lowercase()).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_names_are_accepted() {
        for name in ["my-controller", "reach2", "a", "left_arm"] {
            assert_eq!(check(name), Ok(()), "{name}");
        }
    }

    #[test]
    fn invalid_name_is_answered_with_a_valid_one() {
        for (name, better) in [
            ("MyController", "my-controller"),
            ("my controller", "my-controller"),
            ("../escape", "escape"),
            ("2fast", "fast"),
            ("-x", "x"),
            ("greifer/öffner", "greifer-ffner"),
        ] {
            let text = check(name).unwrap_err().to_string();
            assert!(text.ends_with(&format!("try `{better}`")), "{name}: {text}");
            assert_eq!(check(better), Ok(()));
        }
    }

    #[test]
    fn reserved_names_are_refused() {
        for name in TAKEN {
            assert_eq!(check(name), Err(NameError::Taken { name: name.into() }));
        }
        assert!(check("motorium").unwrap_err().to_string().ends_with("try `my-motorium`"));
    }

    #[test]
    fn empty_and_endless_names_are_refused() {
        assert_eq!(check(""), Err(NameError::Empty));
        let long = "a".repeat(65);
        assert!(matches!(check(&long), Err(NameError::Long { length: 65, .. })));
        assert!(check("...").unwrap_err().to_string().ends_with("are allowed"), "nothing to propose");
    }
}
