//! The programs that host kinds: this program, further installed programs, and the user's program.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use motorium::declare::{Declaration, RobotReference};
use motorium::graph::programs::{self, ExecProblem};
use motorium::worker::{DescribeRequest, Kind, KindAnswer, Registry};
use serde_json::{Value as Json, json};

use crate::out::errln;
use crate::style;

/// A kind and the program that hosts it.
pub(super) enum KindSource<'a> {
    /// This program.
    BuiltIn(&'a Kind),
    /// Another installed program, also named by `kind` in a graph.
    Installed(PathBuf, KindAnswer),
    /// A program of the user, named by `exec`.
    Exec(PathBuf, KindAnswer),
}

/// Returns the kinds of a user's program.
pub(super) fn of_program(program: &Path) -> anyhow::Result<Vec<KindSource<'static>>> {
    let name = program.to_str().context("the path of the program is not text")?;
    let advised = |problem: ExecProblem| {
        let stderr = match &problem {
            ExecProblem::NoComponent { stderr, .. } if !stderr.is_empty() => {
                format!("; standard error: {stderr}")
            }
            _ => String::new(),
        };
        anyhow::anyhow!("{problem}{stderr}\n{}: {}", style::strong("help"), problem.advice())
    };
    let path = programs::find(name, Path::new("")).map_err(advised)?;
    let kinds = programs::kinds(&path).map_err(advised)?;
    Ok(kinds.into_iter().map(|kind| KindSource::Exec(path.clone(), kind)).collect())
}

/// Returns the built-in kinds and the kinds of other installed programs, by name. Prints a warning for a
/// program that does not answer.
pub(super) fn installed(registry: &Registry) -> Vec<KindSource<'_>> {
    let mut kinds: Vec<KindSource<'_>> = registry.kinds().iter().map(KindSource::BuiltIn).collect();
    for path in registry.siblings().iter().filter_map(programs::locate) {
        match programs::kinds(&path) {
            Ok(more) => {
                kinds.extend(more.into_iter().map(|kind| KindSource::Installed(path.clone(), kind)));
            }
            Err(problem) => errln!("{}: {problem}", style::warning("warning")),
        }
    }
    kinds.sort_by(|one, other| one.name().cmp(other.name()));
    kinds
}

impl KindSource<'_> {
    /// Returns the name in graph files.
    pub(super) fn name(&self) -> &str {
        match self {
            Self::BuiltIn(kind) => kind.name,
            Self::Installed(_, kind) | Self::Exec(_, kind) => &kind.name,
        }
    }

    /// Returns one line of explanation.
    pub(super) fn summary(&self) -> &str {
        match self {
            Self::BuiltIn(kind) => kind.summary,
            Self::Installed(_, kind) | Self::Exec(_, kind) => &kind.summary,
        }
    }

    /// Returns the other program that hosts the kind.
    pub(super) fn program(&self) -> Option<&Path> {
        match self {
            Self::BuiltIn(_) => None,
            Self::Installed(path, _) | Self::Exec(path, _) => Some(path),
        }
    }

    /// Returns the page of the book; every built-in kind has one.
    pub(super) fn page(&self) -> Option<String> {
        match self {
            Self::BuiltIn(kind) => Some(format!("kinds/{}.md", kind.name.replace(['.', '_'], "-"))),
            _ => None,
        }
    }

    /// Returns the JSON Schema of its `config` table, and the referenced definitions.
    pub(super) fn schema(&self) -> (Json, Json) {
        match self {
            Self::BuiltIn(kind) => kind.config_schema(),
            Self::Installed(_, kind) | Self::Exec(_, kind) => (kind.schema.clone(), kind.definitions.clone()),
        }
    }

    /// Declares the kind with a configuration and a robot.
    pub(super) fn declare(&self, config: Json, robot: Option<RobotReference>) -> Result<Declaration, String> {
        let refused = |error: motorium::declare::ConfigError| match error.key {
            Some(key) => format!("`{key}`: {}", error.message),
            None => error.message,
        };
        match self {
            Self::BuiltIn(kind) => kind.declare(config, robot).map_err(|problem| refused(problem.error)),
            Self::Installed(path, kind) | Self::Exec(path, kind) => {
                let request = DescribeRequest {
                    kind: Some(kind.name.clone()),
                    config,
                    robot,
                    robots: Vec::new(),
                    placement: motorium::declare::Placement::default(),
                };
                let answer = programs::describe(path, &request).map_err(|problem| problem.to_string())?;
                answer.map_err(refused)
            }
        }
    }

    /// Returns the entry of the kind in the JSON list.
    pub(super) fn line(&self) -> Json {
        json!({ "kind": self.name(), "summary": self.summary(), "program": self.program(), "page": self.page() })
    }
}
