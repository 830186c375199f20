//! Joint names as regular expressions, as in the configurations of Isaac Lab.
//!
//! A pattern matches a whole name, like Python's `re.fullmatch`. Supported: literals, `.`, classes such as
//! `[a-z_]` and `\d`, groups, `|`, and the quantifiers `*`, `+`, `?` and `{n,m}`.

use std::collections::BTreeSet;

/// A parsed pattern.
#[derive(Clone, Debug)]
pub(super) struct Pattern {
    choices: Vec<Vec<Piece>>,
}

/// An atom, repeated at least and at most this number of times.
#[derive(Clone, Debug)]
struct Piece {
    atom: Atom,
    least: usize,
    most: usize,
}

#[derive(Clone, Debug)]
enum Atom {
    Any,
    /// Ranges of characters, and `true` if the characters outside these ranges match.
    Class(Vec<(char, char)>, bool),
    Group(Pattern),
}

/// Maximum number of repetitions written as a number.
const MOST_REPEATS: usize = 64;
/// Maximum depth of groups.
const MOST_GROUPS: usize = 16;

impl Pattern {
    /// Parses a pattern. The error describes the defect.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let mut rest: Vec<char> = text.chars().rev().collect();
        let pattern = choices(&mut rest, 0)?;
        match rest.pop() {
            None => Ok(pattern),
            Some(found) => Err(format!("found `{found}` without an opening bracket")),
        }
    }

    /// Returns `true` if the pattern matches all of `name`.
    pub(super) fn matches(&self, name: &str) -> bool {
        let name: Vec<char> = name.chars().collect();
        self.ends(&name, &BTreeSet::from([0])).contains(&name.len())
    }

    /// Returns the positions after a match that starts at one of `starts`.
    fn ends(&self, name: &[char], starts: &BTreeSet<usize>) -> BTreeSet<usize> {
        let follow = |pieces: &Vec<Piece>| {
            pieces.iter().fold(starts.clone(), |starts, piece| piece.ends(name, &starts))
        };
        self.choices.iter().flat_map(follow).collect()
    }
}

impl Piece {
    fn ends(&self, name: &[char], starts: &BTreeSet<usize>) -> BTreeSet<usize> {
        let mut all = if self.least == 0 { starts.clone() } else { BTreeSet::new() };
        let mut current = starts.clone();
        for count in 1..=self.most {
            current = self.atom.ends(name, &current);
            let before = all.len();
            if count >= self.least {
                all.extend(&current);
            }
            // no new position: further repetitions have no effect
            if current.is_empty() || (count > self.least && all.len() == before) {
                break;
            }
        }
        all
    }
}

impl Atom {
    fn ends(&self, name: &[char], starts: &BTreeSet<usize>) -> BTreeSet<usize> {
        let one = |accepts: &dyn Fn(char) -> bool| {
            starts
                .iter()
                .filter(|at| name.get(**at).is_some_and(|found| accepts(*found)))
                .map(|at| at + 1)
                .collect()
        };
        match self {
            Self::Any => one(&|found| found != '\n'),
            Self::Class(ranges, is_negated) => one(&|found| {
                ranges.iter().any(|(first, last)| (*first..=*last).contains(&found)) != *is_negated
            }),
            Self::Group(pattern) => pattern.ends(name, starts),
        }
    }
}

fn choices(rest: &mut Vec<char>, depth: usize) -> Result<Pattern, String> {
    let mut choices = vec![Vec::new()];
    while let Some(next) = rest.last().copied().filter(|next| *next != ')') {
        rest.pop();
        let atom = match next {
            '|' => {
                choices.push(Vec::new());
                continue;
            }
            // a whole name is matched: anchors at its ends have no effect
            '^' if choices.last().is_some_and(Vec::is_empty) => continue,
            '$' if matches!(rest.last(), None | Some('|' | ')')) => continue,
            '.' => Atom::Any,
            '(' => group(rest, depth)?,
            '[' => class(rest)?,
            '\\' => Atom::Class(escape(rest)?, false),
            '*' | '+' | '?' | '{' | '^' | '$' => {
                return Err(format!("found `{next}` without a character before it"));
            }
            literal => Atom::Class(vec![(literal, literal)], false),
        };
        let (least, most) = quantifier(rest)?;
        if let Some(pieces) = choices.last_mut() {
            pieces.push(Piece { atom, least, most });
        }
    }
    Ok(Pattern { choices })
}

fn group(rest: &mut Vec<char>, depth: usize) -> Result<Atom, String> {
    if depth == MOST_GROUPS {
        return Err(format!("found groups nested deeper than {MOST_GROUPS}"));
    }
    if rest.last() == Some(&'?') {
        rest.pop();
        if rest.pop() != Some(':') {
            return Err("found a group with an option, expected `(...)` or `(?:...)`".to_owned());
        }
    }
    let inner = choices(rest, depth + 1)?;
    match rest.pop() {
        Some(')') => Ok(Atom::Group(inner)),
        _ => Err("found `(` without `)`".to_owned()),
    }
}

fn class(rest: &mut Vec<char>) -> Result<Atom, String> {
    let is_negated = rest.last() == Some(&'^');
    if is_negated {
        rest.pop();
    }
    let mut ranges = Vec::new();
    loop {
        let first = match rest.pop().ok_or("found `[` without `]`")? {
            ']' if !ranges.is_empty() => return Ok(Atom::Class(ranges, is_negated)),
            '\\' => {
                ranges.extend(escape(rest)?);
                continue;
            }
            first => first,
        };
        let is_range = rest.last() == Some(&'-') && rest.iter().rev().nth(1).is_some_and(|next| *next != ']');
        let last = if is_range {
            rest.pop();
            rest.pop().unwrap_or(first)
        } else {
            first
        };
        if last < first {
            return Err(format!("found the range `{first}-{last}`, expected the smaller character first"));
        }
        ranges.push((first, last));
    }
}

fn escape(rest: &mut Vec<char>) -> Result<Vec<(char, char)>, String> {
    match rest.pop().ok_or("found `\\` at the end")? {
        'd' => Ok(vec![('0', '9')]),
        'w' => Ok(vec![('a', 'z'), ('A', 'Z'), ('0', '9'), ('_', '_')]),
        found if found.is_alphanumeric() => Err(format!("found `\\{found}`, expected `\\d` or `\\w`")),
        literal => Ok(vec![(literal, literal)]),
    }
}

/// Parses the smallest and largest number of repetitions.
fn quantifier(rest: &mut Vec<char>) -> Result<(usize, usize), String> {
    let range = match rest.last() {
        Some('*') => (0, usize::MAX),
        Some('+') => (1, usize::MAX),
        Some('?') => (0, 1),
        Some('{') => {
            rest.pop();
            let mut text = String::new();
            while let Some(next) = rest.last().filter(|next| **next != '}') {
                text.push(*next);
                rest.pop();
            }
            let (least, most) = text.split_once(',').unwrap_or((&text, &text));
            let parse = |text: &str| text.trim().parse::<usize>().ok().filter(|count| *count <= MOST_REPEATS);
            let bounds = match (parse(least), parse(most), most.trim().is_empty()) {
                (Some(least), _, true) => Some((least, usize::MAX)),
                (Some(least), Some(most), false) if least <= most => Some((least, most)),
                _ => None,
            };
            bounds.filter(|_| rest.last() == Some(&'}')).ok_or_else(|| {
                format!("found the repetition `{{{text}`, expected two numbers up to {MOST_REPEATS}")
            })?
        }
        _ => return Ok((1, 1)),
    };
    rest.pop();
    Ok(range)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_match_whole_names() {
        for (pattern, matching, others) in [
            (
                ".*_hip_(yaw|roll)",
                &["left_hip_yaw", "_hip_roll"][..],
                &["left_hip_pitch", "hip_yaw", "l_hip_yaw_"][..],
            ),
            ("panda_joint[1-4]", &["panda_joint1", "panda_joint4"], &["panda_joint5", "panda_joint11"]),
            ("(?:FL|FR)_.+", &["FL_hip", "FR_calf"], &["RL_hip", "FL_"]),
            ("j\\d{2,3}", &["j12", "j123"], &["j1", "j1234"]),
            ("a{2,}b?", &["aa", "aaab"], &["ab", "a"]),
            ("[^LR].*|knee", &["Xa", "knee"], &["Left", "Right"]),
            ("^torso$", &["torso"], &["torso_"]),
            ("(a*)*b", &["b", "aaab"], &["aac"]),
            ("[]x-]+", &["x-]", "]"], &["y"]),
            ("", &[""], &["a"]),
        ] {
            let parsed = Pattern::parse(pattern).expect(pattern);
            for name in matching {
                assert!(parsed.matches(name), "{pattern} {name}");
            }
            for name in others {
                assert!(!parsed.matches(name), "{pattern} {name}");
            }
        }
    }

    #[test]
    fn defects_of_patterns_are_named() {
        for pattern in
            ["*a", "(a", "a)", "[a", "a{3,2}", "a{2", "a{999}", "(?=a)", "\\s", "a\\", "[z-a]", "a**"]
        {
            assert!(Pattern::parse(pattern).is_err(), "{pattern}");
        }
        assert!(Pattern::parse(&"(".repeat(1000)).is_err());
    }
}
