//! Drawings of graphs: Mermaid, DOT, and an SVG picture with its own layout.
//!
//! * [`labels`]: texts of components and topics, the same in every format;
//! * [`wires`]: the edges of the graph, and their latency budgets;
//! * [`layers`], [`card`], [`placement`]: columns from left to right, boxes, then positions;
//! * [`mod@svg`], [`style`]: the picture;
//! * [`timeline`], [`mod@timeline_text`], [`mod@timeline_svg`]: the schedule of the cores.

mod card;
mod dot;
mod labels;
mod layers;
mod mermaid;
mod placement;
mod style;
mod svg;
mod timeline;
mod timeline_svg;
mod timeline_text;
mod wires;

#[cfg(test)]
mod tests;

pub use dot::dot;
pub use mermaid::mermaid;
pub use svg::svg;
pub use timeline_svg::timeline_svg;
pub use timeline_text::timeline_text;

/// Measured values as text, for a picture of a running graph. Indices are as in the plan; missing entries are
/// not drawn.
#[derive(Debug, Clone, Default)]
pub struct Measured {
    /// Rate of each component, such as `999.9 Hz`.
    pub rates: Vec<Option<String>>,
    /// Latency of each topic, from the source time to its publication, such as `p99 212 us`.
    pub topics: Vec<Option<String>>,
    /// Latency of each latency budget, such as `p99 231 us, 0 missed`.
    pub latencies: Vec<Option<String>>,
}

impl Measured {
    fn text_at(values: &[Option<String>], index: usize) -> Option<&str> {
        values.get(index)?.as_deref()
    }
}
