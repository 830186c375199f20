//! Pictures for motorium.
//!
//! * [`chart`]: lines with errors, panels over time, paths in tiles, and latencies against percentiles, as
//!   SVG and PNG;
//! * [`graph`]: component graphs as Mermaid, DOT and SVG, and the schedules of their cores;
//! * [`robot`]: robots and their worlds as SVG and PNG;
//! * [`png`] and [`animation`]: encoders of pixels as PNG and animated PNG files.
//!
//! Equal inputs give equal files, bit for bit.

pub mod animation;
pub mod chart;
pub mod graph;
pub mod png;
pub mod robot;
mod text;

pub use text::escape;
