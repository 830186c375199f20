//! `motorium view`: shows a running graph in 3D, plots and tables, in the built-in page and in viewers that
//! support Foxglove's protocol.

use std::fs::File;
use std::io::Read as _;
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context as _;
use motorium::graph::programs;
use serde_json::json;

use super::loading::graph_file;
use crate::out::errln;
use crate::runs::RunArg;
use crate::{complete, overheads, registry, style};

/// First bytes of an MCAP file.
const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
/// First argument of the viewer; the order, as JSON, is the second.
const SERVE: &str = "motorium-view";

/// Default of the maximum number of samples of a topic sent per second.
const RATE_HZ: f64 = 60.0;

/// Show a running graph, or a recording: the robot in 3D, plots, parameters, a stop button.
///
/// With a graph, it starts the graph. With a recording, it plays the recording, with playback control in the
/// page and in Foxglove. Without either, it shows a running graph, and later runs of the same graph. The page
/// and Foxglove's WebSocket protocol, for Foxglove and Lichtblick, share one port of this machine. Clients
/// with the token may send commands; others may only observe.
///
/// Example: motorium view graphs/panda-reach.toml
#[derive(Debug, clap::Args)]
pub(crate) struct View {
    /// The graph to start, or the recording (`.mcap`) to play; default: a running graph
    #[arg(value_name = "GRAPH|RECORDING", add = complete::graphs(), conflicts_with = "run",
          value_parser = graph_file())]
    graph: Option<PathBuf>,
    #[command(flatten)]
    run: RunArg,
    /// Port of this machine to serve on; 0 selects a free one
    #[arg(long, value_name = "PORT", default_value_t = 8765)]
    port: u16,
    /// Maximum rate at which samples of a topic are sent, in Hz
    #[arg(long, value_name = "HZ", default_value_t = RATE_HZ, value_parser = rate)]
    rate: f64,
    /// Open the page in a headless browser, compare its values with the run, write a screenshot to this file,
    /// and exit
    #[arg(long, value_name = "PNG")]
    headless_check: Option<PathBuf>,
    /// Token for commands [default: random]; other users of the machine can see it in the process list
    #[arg(long, value_name = "TOKEN")]
    token: Option<String>,
    /// Options for `motorium run`, after `--`, such as `-- --clock lockstep --pace 1`
    #[arg(last = true, value_name = "RUN OPTIONS", requires = "graph")]
    arguments: Vec<String>,
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if (1.0..=1000.0).contains(&rate) => Ok(rate),
        _ => Err("expected a number of samples a second, from 1 to 1000".to_string()),
    }
}

/// Returns `true` for a recording, recognised by its first bytes or its name.
fn is_recording(path: &Path) -> bool {
    let mut head = [0; MAGIC.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut head));
    (read.is_ok() && &head == MAGIC) || path.extension().is_some_and(|extension| extension == "mcap")
}

/// Returns the path of the viewer's program.
fn program() -> anyhow::Result<PathBuf> {
    let sibling = registry::viewer();
    programs::locate(&sibling).with_context(|| {
        let name = sibling.program;
        let install = registry::INSTALL_VIEWER;
        format!(
            "`{name}` not found in the folder of motorium or on PATH; install it from a checkout of motorium: `{install}`"
        )
    })
}

impl View {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let began = SystemTime::now().duration_since(UNIX_EPOCH)?;
        if let Some(path) = self.graph.as_deref().filter(|path| is_recording(path)) {
            File::open(path).with_context(|| path.display().to_string())?;
        }
        let (sibling, program) = (registry::viewer(), program()?);
        if let Err(problem) = programs::kinds(&program) {
            errln!("{}: {problem}", style::error("error"));
            anyhow::bail!(
                "install the `{}` that matches this motorium, from the same checkout: `{}`",
                sibling.program,
                registry::INSTALL_VIEWER
            );
        }
        let is_recording = self.graph.as_deref().is_some_and(is_recording);
        if is_recording {
            let wrong = match (&self.headless_check, self.arguments.is_empty()) {
                (Some(_), _) => Some("--headless-check compares the page with a run"),
                (None, false) => Some("options after `--` are for `motorium run`"),
                (None, true) => None,
            };
            if let Some(wrong) = wrong {
                anyhow::bail!("{wrong}; a recording is played, not run");
            }
        }
        if let Some(path) = self.graph.as_deref().filter(|path| path.to_str().is_none()) {
            anyhow::bail!("{}: the path is not UTF-8, expected one of text: rename the file", path.display());
        }
        let (recording, graph) = if is_recording { (&self.graph, &None) } else { (&None, &self.graph) };
        let run = match &self.graph {
            Some(_) => None,
            None => Some(self.run.look()?.folder.id().to_string()),
        };
        let motorium = std::env::current_exe().context("finding this program's own file")?;
        let order = json!({
            "motorium": motorium,
            "graph": graph,
            "recording": recording,
            "arguments": self.arguments,
            "run": run,
            "port": self.port,
            "rate_hz": self.rate,
            "headless_check": self.headless_check,
            "token": self.token,
            "overheads": overheads::load().overheads,
            "began_ms": u64::try_from(began.as_millis())?,
        });
        // It replaces this process, so that signals reach it and the graph that it starts.
        let error = Command::new(&program).args([SERVE, &order.to_string()]).exec();
        Err(error).with_context(|| format!("starting {}", program.display()))
    }
}

/// A viewer of a run with a client that subscribes to everything; ended when dropped.
pub(super) struct Watched(Child);

impl Watched {
    /// Starts the viewer on a free port.
    pub(super) fn start(run: &str) -> anyhow::Result<Self> {
        let program = program()?;
        let motorium = std::env::current_exe().context("finding this program's own file")?;
        let order =
            json!({ "motorium": motorium, "run": run, "port": 0, "rate_hz": RATE_HZ, "watched": true });
        let mut command = Command::new(&program);
        command
            .args([SERVE, &order.to_string()])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        Ok(Self(command.spawn().with_context(|| format!("starting {}", program.display()))?))
    }

    /// Returns `true` if the viewer is still running.
    pub(super) fn goes_on(&mut self) -> bool {
        matches!(self.0.try_wait(), Ok(None))
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        // It has started nothing that could be left behind.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
