//! The tokens of a Rust source that matter for paths, without comments, strings and tests.

/// A name or a single other character.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Token {
    /// An identifier or keyword, and its line from 1.
    Name(String, usize),
    /// Any other character except blanks; `::` is two tokens.
    Mark(char),
}

impl Token {
    pub(crate) fn is(&self, text: &str) -> bool {
        match self {
            Self::Name(name, _) => name == text,
            Self::Mark(mark) => text.chars().eq([*mark]),
        }
    }
}

/// A piece of a source with the line it starts on, from 1.
pub(crate) struct Piece {
    pub(crate) kind: PieceKind,
    pub(crate) text: String,
    pub(crate) line: usize,
}

/// The kinds of pieces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PieceKind {
    Comment,
    /// A string or character literal, or the quote of a lifetime.
    Literal,
    /// An identifier, keyword or number.
    Name,
    /// A single other character, blanks included.
    Mark,
}

/// Splits a source into comments, literals, names and marks.
pub(crate) fn pieces(source: &str) -> Vec<Piece> {
    let text: Vec<char> = source.chars().collect();
    let mut pieces = Vec::new();
    let (mut at, mut line) = (0, 1);
    while let Some(&c) = text.get(at) {
        let next = text.get(at + 1).copied();
        let (kind, end) = match c {
            '/' if next == Some('/') => (PieceKind::Comment, find(&text, at, |rest| rest[0] == '\n')),
            '/' if next == Some('*') => (PieceKind::Comment, block_comment(&text, at)),
            '"' => (PieceKind::Literal, string(&text, at)),
            '\'' => (PieceKind::Literal, character(&text, at)),
            'r' | 'b' | 'c' if prefixed(&text, at).is_some() => {
                (PieceKind::Literal, prefixed(&text, at).unwrap_or(at + 1))
            }
            c if c.is_alphanumeric() || c == '_' => {
                (PieceKind::Name, find(&text, at, |rest| !(rest[0].is_alphanumeric() || rest[0] == '_')))
            }
            _ => (PieceKind::Mark, at + 1),
        };
        pieces.push(Piece { kind, text: text[at..end].iter().collect(), line });
        line += text[at..end].iter().filter(|c| **c == '\n').count();
        at = end;
    }
    pieces
}

/// Returns the names and marks of a source, without comments and literals.
pub(crate) fn tokens(source: &str) -> Vec<Token> {
    pieces(source)
        .into_iter()
        .filter_map(|piece| match piece.kind {
            PieceKind::Name => Some(Token::Name(piece.text, piece.line)),
            PieceKind::Mark => piece.text.chars().find(|c| !c.is_whitespace()).map(Token::Mark),
            PieceKind::Comment | PieceKind::Literal => None,
        })
        .collect()
}

fn find(text: &[char], from: usize, end: impl Fn(&[char]) -> bool) -> usize {
    (from + 1..text.len()).find(|at| end(&text[*at..])).unwrap_or(text.len())
}

fn block_comment(text: &[char], from: usize) -> usize {
    let (mut at, mut depth) = (from, 0);
    while at < text.len() {
        match (text[at], text.get(at + 1)) {
            ('/', Some('*')) => (depth, at) = (depth + 1, at + 2),
            ('*', Some('/')) => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
        if depth == 0 {
            return at;
        }
    }
    at
}

fn string(text: &[char], quote: usize) -> usize {
    let mut at = quote + 1;
    while at < text.len() && text[at] != '"' {
        at += if text[at] == '\\' { 2 } else { 1 };
    }
    (at + 1).min(text.len())
}

/// Returns the end of a character such as `'"'`, or of the quote of a lifetime.
fn character(text: &[char], quote: usize) -> usize {
    match (text.get(quote + 1), text.get(quote + 2)) {
        (Some('\\'), _) => (find(text, quote + 2, |rest| rest[0] == '\'') + 1).min(text.len()),
        (Some(_), Some('\'')) => quote + 3,
        _ => quote + 1,
    }
}

/// Returns the end of a string with a prefix (`r#"..."#`, `b"..."`, `b'.'`), or of a raw name (`r#type`).
fn prefixed(text: &[char], from: usize) -> Option<usize> {
    let mut at = from;
    while at < from + 2 && matches!(text.get(at), Some('r' | 'b' | 'c')) {
        at += 1;
    }
    let raw = text[from..at].contains(&'r');
    let hashes = text[at..].iter().take_while(|c| **c == '#').count();
    match text.get(at + hashes) {
        Some('"') if raw => {
            let close = |rest: &[char]| {
                rest[0] == '"' && rest[1..].iter().take_while(|c| **c == '#').count() >= hashes
            };
            Some((find(text, at + hashes, close) + 1 + hashes).min(text.len()))
        }
        Some('"') if hashes == 0 => Some(string(text, at)),
        Some('\'') if hashes == 0 && text[from] == 'b' && at == from + 1 => Some(character(text, at)),
        _ => None,
    }
}

/// Returns the tokens without items under `#[cfg(test)]` and `#[cfg(doc)]`. Declarations of modules in
/// separate files, `#[cfg(test)] mod tests;`, are kept for [`super::paths::test_modules`].
pub(crate) fn product(tokens: Vec<Token>) -> Vec<Token> {
    let mut kept = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        let Some(end) = attribute(&tokens, at) else {
            kept.push(tokens[at].clone());
            at += 1;
            continue;
        };
        if !is_test(&tokens[at..end]) {
            kept.extend_from_slice(&tokens[at..end]);
            at = end;
            continue;
        }
        let mut item = end;
        while let Some(next) = attribute(&tokens, item) {
            item = next;
        }
        let end = item_end(&tokens, item);
        if let Some(name) = outlined_module(&tokens[item..end]) {
            kept.extend([Token::Mark('#'), Token::Name("test_module".into(), 0), name]);
        }
        at = end;
    }
    kept
}

/// Returns the end of an attribute that begins here.
pub(crate) fn attribute(tokens: &[Token], at: usize) -> Option<usize> {
    (tokens.get(at)?.is("#") && tokens.get(at + 1)?.is("[")).then(|| closing(tokens, at + 1))
}

/// Returns `true` if an attribute excludes the following item from ordinary builds.
fn is_test(attribute: &[Token]) -> bool {
    attribute.get(2).is_some_and(|token| token.is("cfg"))
        && attribute.iter().any(|token| token.is("test") || token.is("doc"))
        && !attribute.iter().any(|token| token.is("not") || token.is("any"))
}

/// Returns the end of the group that an opening bracket begins.
pub(crate) fn closing(tokens: &[Token], open: usize) -> usize {
    let mut depth = 0;
    for (at, token) in tokens.iter().enumerate().skip(open) {
        match token {
            Token::Mark('(' | '[' | '{') => depth += 1,
            Token::Mark(')' | ']' | '}') => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return at + 1;
        }
    }
    tokens.len()
}

/// Returns the end of an item, which is its semicolon or its block.
fn item_end(tokens: &[Token], from: usize) -> usize {
    let is_use = tokens[from..].iter().take(8).any(|token| token.is("use"));
    let mut at = from;
    while at < tokens.len() {
        match &tokens[at] {
            Token::Mark(';') => return at + 1,
            Token::Mark('{') if !is_use => return closing(tokens, at),
            Token::Mark('(' | '[' | '{') => at = closing(tokens, at),
            _ => at += 1,
        }
    }
    at
}

fn outlined_module(item: &[Token]) -> Option<Token> {
    let module = item.iter().position(|token| token.is("mod"))?;
    let ends = item.get(module + 2).is_some_and(|token| token.is(";"));
    ends.then(|| item[module + 1].clone())
}
