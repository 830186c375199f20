//! `motorium view`: a running graph in 3D, in plots and tables, for our page and for viewers that speak Foxglove's protocol.

use std::os::unix::process::CommandExt as _;
use std::path::PathBuf;
use std::process::{Command, ExitCode};
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context as _;
use motorium::graph::programs;
use serde_json::json;

use crate::out::errln;
use crate::runs::RunArg;
use crate::{complete, overheads, registry, style};

/// First argument of the viewer; the order, as JSON, is the second.
const SERVE: &str = "motorium-view";

/// Show a running graph: the robot in 3D, plots, parameters, a stop button.
///
/// With a graph it starts that; without one it shows a run that goes on, and whatever run of the same graph comes after it. The
/// page and the WebSocket of Foxglove's protocol, for Foxglove and Lichtblick, are on one port of this machine. Who has the
/// address with its token may command; who has not may look.
///
/// Example: motorium view graphs/panda-reach.toml
#[derive(Debug, clap::Args)]
pub(crate) struct View {
    /// The graph to start; a run that goes on is shown if not given
    #[arg(add = complete::graphs(), conflicts_with = "run")]
    graph: Option<PathBuf>,
    #[command(flatten)]
    run: RunArg,
    /// Port of this machine on which to serve; 0 for any that is free
    #[arg(long, value_name = "PORT", default_value_t = 8765)]
    port: u16,
    /// Most samples of a topic to send a second, in Hz
    #[arg(long, value_name = "HZ", default_value_t = 60.0, value_parser = rate)]
    rate: f64,
    /// Open the page in a headless browser, compare what it shows with the run, write its picture to this file, and end
    #[arg(long, value_name = "PNG")]
    headless_check: Option<PathBuf>,
    /// The token for commands; one that nobody can guess if not given. Other users of the machine see it in the list of
    /// processes
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

impl View {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let began = SystemTime::now().duration_since(UNIX_EPOCH)?;
        let sibling = registry::viewer();
        let Some(program) = programs::locate(&sibling) else {
            let name = sibling.program;
            anyhow::bail!(
                "`{name}` is neither beside motorium nor on PATH; install it: `{}`, or build it: `cargo build --release -p {name}`",
                sibling.install
            );
        };
        if let Err(problem) = programs::kinds(&program) {
            errln!("{}: {problem}", style::error("error"));
            anyhow::bail!(
                "install the `{}` that goes with this motorium: `{}`",
                sibling.program,
                sibling.install
            );
        }
        let run = match &self.graph {
            Some(_) => None,
            None => Some(self.run.look()?.folder.id().to_string()),
        };
        let motorium = std::env::current_exe().context("finding this program's own file")?;
        let order = json!({
            "motorium": motorium,
            "graph": self.graph,
            "arguments": self.arguments,
            "run": run,
            "port": self.port,
            "rate_hz": self.rate,
            "headless_check": self.headless_check,
            "token": self.token,
            "overheads": overheads::load().overheads,
            "began_ms": u64::try_from(began.as_millis())?,
        });
        // It takes the place of this process, so that signals reach it, and with it the graph that it starts.
        let error = Command::new(&program).args([SERVE, &order.to_string()]).exec();
        Err(error).with_context(|| format!("starting {}", program.display()))
    }
}
