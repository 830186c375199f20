//! Colours and dashes of the light and the dark theme.

use std::fmt::Write as _;

/// Line colours in order: distinct on white, also for most colour-blind readers.
pub(super) const COLOURS: [&str; 8] =
    ["#1f6feb", "#d1242f", "#1a7f37", "#9a6700", "#8250df", "#0b7285", "#bf3989", "#57606a"];
/// Line colours on a dark background.
const ON_DARK: [&str; 8] =
    ["#58a6ff", "#ff7b72", "#56d364", "#e3b341", "#bc8cff", "#39c5cf", "#f778ba", "#9da7b3"];
/// Dash patterns of lines, in turn: lengths of strokes and gaps. 3 patterns and 8 colours distinguish 24
/// lines; neighbouring lines differ even in black and white.
pub(super) const DASHES: [&[f64]; 3] = [&[], &[7.0, 3.0], &[2.0, 2.5]];

/// Starts a picture. Every element has its colours as attributes, for all programs; programs with
/// style sheets replace them for users who prefer a dark background.
pub(super) fn begin(width: f64, height: f64) -> String {
    begin_with(width, height, 13, "")
}

/// The dark background.
pub(super) const DARK: &str = "#0d1117";

/// Starts a picture with a text size, and with CSS rules for its own classes on a dark background.
pub(super) fn begin_with(width: f64, height: f64, size: u32, rules: &str) -> String {
    let mut style = format!(
        ".paper{{fill:{DARK}}}.ink{{fill:#e6edf3}}.grid{{stroke:#262c34}}.frame{{stroke:#8b949e}}.old{{stroke:#484f58}}{rules}",
    );
    for (index, colour) in ON_DARK.iter().enumerate() {
        let _ = write!(style, ".c{index}{{stroke:{colour}}}.f{index}{{fill:{colour}}}");
    }
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" font-family=\"sans-serif\" font-size=\"{size}\">\n\
         <style>@media (prefers-color-scheme:dark){{{style}}}</style>\n\
         <rect class=\"paper\" width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
    )
}

/// The attributes of the line of a series.
pub(super) fn stroke(series: usize) -> String {
    let index = series % COLOURS.len();
    let dashes: Vec<String> = DASHES[series % DASHES.len()].iter().map(f64::to_string).collect();
    let dashes = match dashes.is_empty() {
        true => String::new(),
        false => format!(" stroke-dasharray=\"{}\"", dashes.join(" ")),
    };
    format!("class=\"c{index}\" stroke=\"{}\"{dashes}", COLOURS[index])
}

/// The attributes of a surface of a series.
pub(super) fn fill(series: usize) -> String {
    let index = series % COLOURS.len();
    format!("class=\"f{index}\" fill=\"{}\"", COLOURS[index])
}

/// A text; `attributes` are its size and anchor.
pub(super) fn text(x: f64, y: f64, attributes: &str, words: &str) -> String {
    let words = crate::text::escape(words);
    format!("<text class=\"ink\" fill=\"#1f2328\" x=\"{x:.1}\" y=\"{y:.1}\" {attributes}>{words}</text>\n")
}
