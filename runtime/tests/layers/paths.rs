//! Paths from one module of a crate to another.

use std::collections::BTreeMap;

use crate::tokens::Token;

/// A top module that uses another.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Arrow {
    pub(crate) from: String,
    pub(crate) to: String,
    /// Module and line.
    pub(crate) place: String,
}

/// Returns the modules in separate files that are only built for tests.
pub(crate) fn test_modules(module: &[String], tokens: &[Token]) -> Vec<Vec<String>> {
    tokens
        .windows(2)
        .filter(|pair| pair[0].is("test_module"))
        .filter_map(|pair| match &pair[1] {
            Token::Name(name, _) => Some(module.iter().cloned().chain([name.clone()]).collect()),
            Token::Mark(_) => None,
        })
        .collect()
}

/// Returns the macros that a file exports to the root of the crate, with the top module that contains them.
pub(crate) fn exported_macros(module: &[String], tokens: &[Token]) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for at in 0..tokens.len() {
        let exported = tokens[..at].iter().rev().take(40).any(|token| token.is("macro_export"));
        if let (true, true, Some(Token::Name(name, _)), Some(top)) =
            (tokens[at].is("macro_rules"), exported, tokens.get(at + 2), module.first())
        {
            found.push((name.clone(), top.clone()));
        }
    }
    found
}

/// Returns all arrows of one file. `macros` are the macros at the root of the crate, by name, with their
/// module.
pub(crate) fn arrows(module: &[String], tokens: &[Token], macros: &BTreeMap<String, String>) -> Vec<Arrow> {
    let mut found = Vec::new();
    // the brace depth at which each inner module ends
    let mut inner: Vec<usize> = Vec::new();
    let mut depth = 0;
    let mut at = 0;
    while at < tokens.len() {
        let mut next = at + 1;
        match &tokens[at] {
            Token::Mark('{') => {
                depth += 1;
                let opens_module = at >= 2 && tokens[at - 2].is("mod");
                if opens_module {
                    inner.push(depth);
                }
            }
            Token::Mark('}') => {
                if inner.last() == Some(&depth) {
                    inner.pop();
                }
                depth -= 1;
            }
            Token::Name(name, _) if name == "crate" && is_path(tokens, at + 1) => {
                next = heads(tokens, at + 3, module, macros, &mut found);
            }
            Token::Name(name, _) if name == "super" && !(at > 0 && tokens[at - 1].is(":")) => {
                let mut up = 1;
                next = at + 1;
                while is_path(tokens, next) && tokens.get(next + 2).is_some_and(|token| token.is("super")) {
                    (up, next) = (up + 1, next + 3);
                }
                if up == module.len() + inner.len() && is_path(tokens, next) {
                    next = heads(tokens, next + 2, module, macros, &mut found);
                }
            }
            _ => {}
        }
        at = next;
    }
    found
}

/// Returns `true` if the tokens at `at` are `::`.
fn is_path(tokens: &[Token], at: usize) -> bool {
    tokens.get(at).is_some_and(|token| token.is(":")) && tokens.get(at + 1).is_some_and(|token| token.is(":"))
}

/// Collects the names after `crate::`, one or a list in braces, and returns the next index.
fn heads(
    tokens: &[Token],
    at: usize,
    module: &[String],
    macros: &BTreeMap<String, String>,
    found: &mut Vec<Arrow>,
) -> usize {
    let mut add = |at: usize| {
        let (Some(Token::Name(name, line)), Some(from)) = (tokens.get(at), module.first()) else { return };
        let is_macro = tokens.get(at + 1).is_some_and(|token| token.is("!"));
        let to = if is_macro { macros.get(name).unwrap_or(name) } else { name };
        if to != from {
            let place = format!("{}, line {line}", module.join("::"));
            found.push(Arrow { from: from.clone(), to: to.clone(), place });
        }
    };
    if !tokens.get(at).is_some_and(|token| token.is("{")) {
        add(at);
        return at + 1;
    }
    let mut depth = 0;
    for (i, token) in tokens.iter().enumerate().skip(at) {
        match token {
            Token::Mark('{') => depth += 1,
            Token::Mark('}') => depth -= 1,
            Token::Name(..) if depth == 1 && (tokens[i - 1].is("{") || tokens[i - 1].is(",")) => add(i),
            _ => {}
        }
        if depth == 0 {
            return i + 1;
        }
    }
    tokens.len()
}
