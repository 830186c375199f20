//! The order of `motorium view` to this program.

use std::path::PathBuf;

use motorium::schedule::Overheads;
use serde::Deserialize;

/// First argument of the program when `motorium view` starts it; its order, as JSON, is the second.
pub const SERVE: &str = "motorium-view";

/// The order of `motorium view`.
///
/// ```
/// use motorium_view::Request;
///
/// let text = r#"{"motorium": "/usr/bin/motorium", "graph": "graph.toml", "port": 8765, "rate_hz": 60.0}"#;
/// let request: Request = serde_json::from_str(text)?;
/// assert_eq!((request.port, request.arguments.len(), request.run), (8765, 0, None));
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// The `motorium` command that started the viewer; it also starts the graph.
    pub motorium: PathBuf,
    /// The graph to start; `None` to show a run started elsewhere.
    #[serde(default)]
    pub graph: Option<PathBuf>,
    /// The recording to play; `None` to look at a run.
    #[serde(default)]
    pub recording: Option<PathBuf>,
    /// Options for `motorium run`, besides the graph.
    #[serde(default)]
    pub arguments: Vec<String>,
    /// Id of the run to look at first; then the newest run of its graph. Without it, and without a graph, any
    /// newest run.
    #[serde(default)]
    pub run: Option<String>,
    /// Port on the loopback interface; 0 for any that is free.
    pub port: u16,
    /// Most samples of a topic that are sent a second.
    pub rate_hz: f64,
    /// File for a picture of the page, made by a headless browser that also checks it; `None` to serve.
    #[serde(default)]
    pub headless_check: Option<PathBuf>,
    /// True if a client of the viewer's own looks at everything that it serves, as measurements of its cost
    /// need it.
    #[serde(default)]
    pub watched: bool,
    /// Overheads of this machine, for the predicted timeline; `None` for the cautious ones.
    #[serde(default)]
    pub overheads: Option<Overheads>,
    /// Time of the command, ms since 1970.
    #[serde(default)]
    pub began_ms: Option<u64>,
    /// The token for commands; `None` for a random one.
    #[serde(default)]
    pub token: Option<String>,
}
