//! Text in a picture: its width, and its escaping.

/// Width of a text in a sans-serif typeface of this size, in pixels. The estimate is generous because the
/// viewer chooses the typeface, and a box that is slightly too wide is better than overflowing text.
pub(crate) fn width(text: &str, size: f64) -> f64 {
    let em: f64 = text
        .chars()
        .map(|c| match c {
            'i' | 'j' | 'l' | '.' | ',' | ':' | ';' | '\'' | '|' | '!' => 0.32,
            'f' | 't' | 'r' | '(' | ')' | '/' | '-' | ' ' => 0.41,
            'm' | 'w' | 'M' | 'W' | '@' | '%' => 0.97,
            '≤' | '→' | '_' => 0.8,
            'A'..='Z' => 0.74,
            _ => 0.63,
        })
        .sum();
    em * size
}

/// Escapes the special characters of XML and HTML as entities.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            // XML 1.0 cannot represent these
            c if c.is_control() => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}
