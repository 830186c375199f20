//! Kinds that separate installed programs host. These programs are searched next to the current program and
//! on `PATH`, and are queried once.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use serde_json::Value as Json;

use super::draft::Draft;
use super::exec::{self, ExecProblem};
use crate::graph::diagnostic::Report;
use crate::graph::source::Span;
use crate::nearest::{list, nearest};
use crate::worker::{Kind, KindAnswer, Registry, Sibling};

/// The program that hosts a kind.
#[derive(Debug, Clone)]
pub(super) enum Home<'c> {
    /// A kind of this program.
    Here(&'c Kind),
    /// A kind of another program, with the index of the kind in that program.
    Sibling(Rc<Program>, usize),
}

/// Another program that hosts kinds.
#[derive(Debug)]
pub(super) struct Program {
    pub(super) path: PathBuf,
    kinds: Vec<KindAnswer>,
}

/// Reason why no program hosts a kind.
#[derive(Debug, Clone)]
pub(super) enum Homeless {
    /// The kind is neither in this program nor in the family of another program.
    Unknown,
    /// The program with the kind is not installed.
    Missing { sibling: Sibling, beside: PathBuf },
    /// The program that should host the kind cannot be used.
    Unusable { sibling: Sibling, problem: Rc<ExecProblem> },
    /// The program of its family does not host the kind.
    NotAmong { program: Rc<Program> },
}

/// Other host programs that were queried, by name.
#[derive(Debug, Default)]
pub(super) struct Siblings(RefCell<BTreeMap<&'static str, Result<Rc<Program>, Homeless>>>);

impl Home<'_> {
    /// Returns `true` if the configuration of the kind has a key `world`.
    pub(super) fn reads_world(&self) -> bool {
        match self {
            Self::Here(kind) => kind.reads_world,
            Self::Sibling(program, index) => program.kinds[*index].reads_world,
        }
    }

    /// Returns `true` if the configuration of the kind has a key `gravity`, which defaults to the gravity of
    /// the graph's world.
    pub(super) fn reads_gravity(&self) -> bool {
        match self {
            Self::Here(kind) => kind.reads_gravity,
            Self::Sibling(program, index) => program.kinds[*index].reads_gravity,
        }
    }

    /// Returns the JSON Schema of the `config` table, and its definitions.
    pub(super) fn config_schema(&self) -> (Json, Json) {
        match self {
            Self::Here(kind) => kind.config_schema(),
            Self::Sibling(program, index) => {
                let kind = &program.kinds[*index];
                (kind.schema.clone(), kind.definitions.clone())
            }
        }
    }
}

impl Siblings {
    /// Finds the program that hosts a kind.
    pub(super) fn home<'c>(&self, kind: &str, registry: &'c Registry) -> Result<Home<'c>, Homeless> {
        if let Some(kind) = registry.find(kind) {
            return Ok(Home::Here(kind));
        }
        let sibling = *registry.sibling(kind).ok_or(Homeless::Unknown)?;
        let mut asked = self.0.borrow_mut();
        let program = asked.entry(sibling.program).or_insert_with(|| find(sibling)).clone()?;
        match program.kinds.iter().position(|known| known.name == kind) {
            Some(index) => Ok(Home::Sibling(program, index)),
            None => Err(Homeless::NotAmong { program }),
        }
    }
}

/// Finds a program next to this one or on `PATH`, and queries its kinds.
fn find(sibling: Sibling) -> Result<Rc<Program>, Homeless> {
    let beside = own_folder();
    let Some(path) = locate(&sibling) else { return Err(Homeless::Missing { sibling, beside }) };
    match exec::kinds(&path) {
        Ok(kinds) => Ok(Rc::new(Program { path, kinds })),
        Err(problem) => Err(Homeless::Unusable { sibling, problem: Rc::new(problem) }),
    }
}

/// Returns the path of a sibling program, which is in the folder of the current program or on `PATH`; `None`
/// if it is not installed.
pub fn locate(sibling: &Sibling) -> Option<PathBuf> {
    let on_path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::iter::once(own_folder()).chain(std::env::split_paths(&on_path));
    let is_program = |path: &PathBuf| {
        path.metadata().is_ok_and(|facts| facts.is_file() && facts.permissions().mode() & 0o111 != 0)
    };
    folders.map(|folder| folder.join(sibling.program)).find(is_program)
}

fn own_folder() -> PathBuf {
    let own = std::env::current_exe().unwrap_or_default();
    own.parent().map(Path::to_path_buf).unwrap_or_default()
}

impl Homeless {
    /// Reports the kind of a component.
    pub(super) fn report(
        &self,
        kind: &str,
        draft: &Draft<'_, '_>,
        span: &Span,
        registry: &Registry,
        report: &mut Report,
    ) {
        match self {
            Self::Unknown => {
                let kinds = registry.kinds().iter().map(|kind| kind.name);
                let advice = match nearest(kind, kinds.clone()) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => "use one of them, or name your own program with `exec`".to_string(),
                };
                report
                    .error(format!("unknown kind `{kind}`"))
                    .label(span, "no such kind of component")
                    .note(format!("the built-in kinds are {}", list(kinds)))
                    .advise(advice);
            }
            Self::Missing { sibling, beside } => {
                let program = sibling.program;
                let here = registry.kinds().iter().map(|kind| kind.name);
                let get = match sibling.install {
                    Some(install) => format!("install it from a checkout of motorium: `{install}`"),
                    None => format!(
                        "motorium does not include it; build a program `{program}` of your own kinds with `motorium::host!`"
                    ),
                };
                let advice = match nearest(kind, here) {
                    Some(near) => format!("did you mean `{near}`? otherwise {get}"),
                    None => get,
                };
                report
                    .error(format!(
                        "kind `{kind}` belongs to the program `{program}`, which is not installed"
                    ))
                    .label(span, format!("`{program}` is neither in {} nor on PATH", beside.display()))
                    .advise(advice);
            }
            Self::Unusable { sibling, problem } => {
                let version = exec::VERSION;
                let diagnostic = report
                    .error(format!("component `{}`: {problem}", draft.name))
                    .label(span, format!("a kind of `{}`", sibling.program));
                if let ExecProblem::NoComponent { stderr, .. } = &**problem
                    && !stderr.is_empty()
                {
                    diagnostic.note(format!("standard error: {stderr}"));
                }
                diagnostic.advise(match sibling.install {
                    Some(install) => {
                        format!("install its version {version} from a checkout of motorium: `{install}`")
                    }
                    None => format!("build it again with motorium {version}"),
                });
            }
            Self::NotAmong { program } => {
                let kinds = program.kinds.iter().map(|kind| kind.name.as_str());
                let here = registry.kinds().iter().map(|kind| kind.name);
                let path = program.path.display();
                let (note, instead) = match program.kinds.is_empty() {
                    true => (format!("{path} has no kinds for graphs"), "name a built-in kind"),
                    false => (format!("the kinds of {path} are {}", list(kinds.clone())), "use one of them"),
                };
                let advice = match nearest(kind, kinds.chain(here)) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("{instead}, or name your own program with `exec`"),
                };
                report
                    .error(format!("unknown kind `{kind}`"))
                    .label(span, "no such kind of component")
                    .note(note)
                    .advise(advice);
            }
        }
    }
}
