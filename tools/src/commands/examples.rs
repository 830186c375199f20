//! Graphs built into the command, which run from any folder without a checkout.

use clap::builder::PossibleValuesParser;

/// A graph of the `graphs` folder, as of the build of the command.
struct ExampleGraph {
    /// Name of the graph, for `motorium run --example`.
    name: &'static str,
    text: &'static str,
}

macro_rules! examples {
    ($($name:literal),+ $(,)?) => {
        &[$(ExampleGraph { name: $name, text: include_str!(concat!("../../graphs/", $name, ".toml")) }),+]
    };
}

/// Examples that need no other files or programs.
const EXAMPLES: &[ExampleGraph] = examples!["draw-letter", "panda-reach", "quadruped-trot", "two-arms"];

/// Returns the text of an example.
pub(super) fn text(name: &str) -> Option<&'static str> {
    EXAMPLES.iter().find(|example| example.name == name).map(|example| example.text)
}

/// Returns the names of the examples, as values of an option.
pub(super) fn names() -> PossibleValuesParser {
    PossibleValuesParser::new(EXAMPLES.iter().map(|example| example.name))
}
