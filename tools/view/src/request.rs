//! The request of `motorium view` to this program.

use std::path::PathBuf;

use motorium::schedule::Overheads;
use serde::Deserialize;

/// First argument of the program when started by `motorium view`. The second argument is the request as JSON.
pub const SERVE: &str = "motorium-view";

/// A request of `motorium view` to the viewer program: the run or recording to show, the port and the rates.
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
    /// Path of the `motorium` command that sent the request, used to start further processes.
    pub motorium: PathBuf,
    /// Graph to start; `None` to view a run that was started separately.
    #[serde(default)]
    pub graph: Option<PathBuf>,
    /// Recording to play; `None` to view a run.
    #[serde(default)]
    pub recording: Option<PathBuf>,
    /// Options for `motorium run`, without the graph.
    #[serde(default)]
    pub arguments: Vec<String>,
    /// Id of the first run to view. When it has ended, the viewer follows newer runs of the same graph.
    /// `None` for the newest run, unless `graph` is set.
    #[serde(default)]
    pub run: Option<String>,
    /// Port on the loopback interface; 0 for any free port.
    pub port: u16,
    /// Maximum rate at which samples of a topic are sent, Hz.
    pub rate_hz: f64,
    /// File for a screenshot of the page. If set, the viewer checks the page in a headless browser and ends;
    /// `None` to serve the page.
    #[serde(default)]
    pub headless_check: Option<PathBuf>,
    /// `true` if an internal client subscribes to everything, for measurements of the viewer's cost.
    #[serde(default)]
    pub watched: bool,
    /// Overheads of this machine, for the predicted timeline; `None` for motorium's cautious defaults.
    #[serde(default)]
    pub overheads: Option<Overheads>,
    /// Time at which the command `motorium view` started, ms since 1970.
    #[serde(default)]
    pub began_ms: Option<u64>,
    /// Token required for commands; `None` generates a random token.
    #[serde(default)]
    pub token: Option<String>,
}
