//! Graphs built in code and run in the process of a test.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::closure::Part;
use super::instance::Instance;
use crate::component::Component;
use crate::graph::{self, Checked, GraphError, Machine, Override};
use crate::launcher::{Options, Report};
use crate::session::{self, SessionError};
use crate::worker::{Kind, Registry, RobotSource};

/// A graph built in code or from the text of a graph file, with the kinds of components it may use.
///
/// Components run as threads of this process, in lockstep unless the graph sets `clock = "realtime"`. Robots
/// are not checked: any model name is accepted. See [the module](super) for an example.
#[derive(Debug)]
pub struct Graph {
    text: String,
    file: PathBuf,
    overrides: Vec<Override>,
    kinds: Vec<Kind>,
    parts: Vec<Part>,
}

/// Error of running a graph.
#[derive(thiserror::Error)]
pub enum RunError {
    /// The graph is invalid.
    #[error("{}", .0.render(false))]
    Graph(#[from] GraphError),
    /// The graph did not start.
    #[error(transparent)]
    Launch(#[from] SessionError),
}

impl core::fmt::Debug for RunError {
    /// Same as `Display`, so that `unwrap` in a test shows the positions in the graph.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        core::fmt::Display::fmt(self, f)
    }
}

impl Graph {
    /// Creates an empty graph that runs in lockstep.
    pub fn new(name: &str) -> Self {
        Self::from_toml(format!("name = {}\nclock = \"lockstep\"\n", toml::Value::from(name)))
    }

    /// Creates a graph from the text of a graph file. [`with`](Self::with) adds further components.
    pub fn from_toml(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            file: "graph.toml".into(),
            overrides: Vec::new(),
            kinds: Vec::new(),
            parts: Vec::new(),
        }
    }

    /// Sets the path of the graph file. Relative paths in the graph refer to the folder of this file. The
    /// default is `graph.toml` in the working directory.
    #[must_use]
    pub fn at_path(mut self, file: &Path) -> Self {
        self.file = file.to_path_buf();
        self
    }

    /// Registers a kind of component that the text of the graph uses.
    #[must_use]
    pub fn kind<C: Component>(mut self) -> Self {
        self.know(Kind::of::<C>());
        self
    }

    fn know(&mut self, kind: Kind) {
        if self.kinds.iter().all(|known| known.name != kind.name) {
            self.kinds.push(kind);
        }
    }

    /// Adds a robot with a model.
    #[must_use]
    pub fn robot(mut self, name: &str, urdf: &str) -> Self {
        let _ = write!(self.text, "\n[robot.{name}]\nurdf = {}\n", toml::Value::from(urdf));
        self
    }

    /// Adds a component: an [`Instance`], a [`Source`](super::Source), a [`Function`](super::Function) or a
    /// [`Probe`](super::Probe).
    #[must_use]
    pub fn with(mut self, instance: impl Into<Instance>) -> Self {
        let Instance { name, kind, table, part } = instance.into();
        self.know(kind);
        self.parts.extend(part);
        let named = toml::Table::from_iter([(name, toml::Value::Table(table))]);
        let whole = toml::Table::from_iter([("component".to_string(), toml::Value::Table(named))]);
        let _ = write!(self.text, "\n{whole}");
        self
    }

    /// Sets a key of the graph, such as `clock`, like `--set path=value` on the command line.
    #[must_use]
    pub fn set(mut self, path: &str, value: &str) -> Self {
        self.overrides.push(Override { path: path.to_string(), value: value.to_string() });
        self
    }

    /// Checks the graph for this machine, like `motorium check`.
    ///
    /// # Errors
    /// Returns all errors found.
    pub fn check(&self) -> Result<Checked, GraphError> {
        graph::check(&self.file, self.text.clone(), &self.overrides, &self.registry(), &Machine::detect())
    }

    fn registry(&self) -> Registry {
        Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, self.kinds.iter().copied())
    }

    /// Runs the graph for a duration such as `"2 s"`, which is simulated time in lockstep.
    ///
    /// # Errors
    /// The graph is invalid or does not start. If the graph started and then failed, the function returns
    /// `Ok`, and the report contains the failure.
    pub fn run(self, duration: &str) -> Result<Report, RunError> {
        let this = self.set("duration", duration);
        let plan = this.check()?.plan;
        Ok(session::run(plan, &this.registry(), &Options::threads(), &mut |_| {})?)
    }
}
