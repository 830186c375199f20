//! The program of a component: its `main` function, as called by the launcher and by users.

use std::io::{Read as _, Write as _};
use std::process::ExitCode;

use crate::component::DynamicComponent;
use crate::declare::{Declaration, Declare};
use crate::plan;
use crate::run_folder::RunFolder;
use crate::worker::{
    CLEANER, ConfigProblem, DESCRIBE, DescribeAnswer, DescribeRequest, GUARD, KINDS, Kind, KindAnswer,
    KindsAnswer, Outcome, WORKER, Worker, declare_dynamic, run_dynamic,
};

/// A request from motorium to a component's program, parsed from the program's arguments.
#[derive(Debug)]
pub enum Program {
    /// Describe the program's component.
    Describe,
    /// List the kinds of components that the program contains.
    Kinds,
    /// Guard this run: end it if its launcher dies.
    Guard(RunFolder),
    /// Free the slots that dead processes of this run occupy.
    Cleaner(RunFolder),
    /// Run one component of a graph.
    Worker {
        /// Folder of the run.
        folder: RunFolder,
        /// Name of the component in the graph.
        component: String,
    },
}

impl Program {
    /// Parses the arguments of a program. Returns `None` if the arguments are not a request of motorium.
    pub fn from_arguments(arguments: &[String]) -> Option<Self> {
        match arguments {
            [_, first] if first == DESCRIBE => Some(Self::Describe),
            [_, first] if first == KINDS => Some(Self::Kinds),
            [_, first, folder] if first == GUARD => Some(Self::Guard(RunFolder::open(folder.as_ref()))),
            [_, first, folder] if first == CLEANER => Some(Self::Cleaner(RunFolder::open(folder.as_ref()))),
            [_, first, folder, component] if first == WORKER => {
                Some(Self::Worker { folder: RunFolder::open(folder.as_ref()), component: component.clone() })
            }
            _ => None,
        }
    }
}

/// Implements `main` for a program with one component. Use [`main!`](crate::main) to call it.
pub fn main(kind: &Kind) -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    match Program::from_arguments(&arguments) {
        Some(Program::Describe) => describe(core::slice::from_ref(kind)),
        Some(Program::Kinds) => list(core::slice::from_ref(kind)),
        Some(Program::Guard(folder)) => guard(&folder),
        Some(Program::Cleaner(folder)) => clean(&folder),
        Some(Program::Worker { folder, component }) => run_worker(&folder, &component, |_| Some(*kind)),
        None => introduce(&arguments, kind.name, kind.summary),
    }
}

/// Implements `main` for a program with one component whose kind, ports and configuration are only known at
/// run time.
///
/// Like a program made with [`main!`](crate::main), the program answers the queries of `motorium check`, and
/// it runs as a process of each graph that names the program by `exec`. Allocations are only counted if the
/// program's global allocator is [`CountingAllocator`](crate::telemetry::CountingAllocator).
pub fn main_of(component: impl DynamicComponent) -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    match Program::from_arguments(&arguments) {
        Some(Program::Describe) => answer(|request| {
            let (config, declare) = (request.config.clone(), declare_of(request));
            Some(declare_dynamic(&component, &config, declare))
        }),
        Some(Program::Kinds) => list_answers(vec![KindAnswer {
            name: component.kind().to_string(),
            summary: component.summary().to_string(),
            reads_world: false,
            reads_gravity: false,
            schema: component.schema(),
            definitions: serde_json::json!({}),
        }]),
        Some(Program::Guard(folder)) => guard(&folder),
        Some(Program::Cleaner(folder)) => clean(&folder),
        Some(Program::Worker { folder, component: name }) => {
            work(&folder, &name, |worker| Some(run_dynamic(worker, Box::new(component))))
        }
        None => introduce(&arguments, component.kind(), component.summary()),
    }
}

/// Prints the usage of a program with one component.
fn introduce(arguments: &[String], kind: &str, summary: &str) -> ExitCode {
    eprintln!(
        "{} is a motorium component ({kind}: {summary}).\nName it in a graph file, `exec = \"PATH\"`, and start the \
         graph with `motorium run GRAPH.toml`.",
        arguments.first().map_or("this", String::as_str),
    );
    ExitCode::from(2)
}

/// Implements `main` for a program that hosts several kinds for `motorium`. Use [`host!`](crate::host) to
/// call it.
pub fn host(kinds: &[Kind]) -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    match Program::from_arguments(&arguments) {
        Some(Program::Describe) => describe(kinds),
        Some(Program::Kinds) => list(kinds),
        Some(Program::Guard(folder)) => guard(&folder),
        Some(Program::Cleaner(folder)) => clean(&folder),
        Some(Program::Worker { folder, component }) => run_worker(&folder, &component, |plan| {
            let (plan::Program::Sibling { kind, .. } | plan::Program::Builtin { kind }) = &plan.program
            else {
                return None;
            };
            kinds.iter().find(|known| known.name == kind).copied()
        }),
        None => {
            let name = arguments.first().map_or("this", String::as_str);
            eprintln!(
                "{name} hosts kinds of components for `motorium`, which starts it. In a graph file write one of"
            );
            kinds.iter().for_each(|kind| eprintln!("kind = \"{}\"   # {}", kind.name, kind.summary));
            ExitCode::from(2)
        }
    }
}

/// Prints the kinds of components that the program hosts, as JSON on standard output.
pub fn list(kinds: &[Kind]) -> ExitCode {
    list_answers(kinds.iter().map(KindAnswer::from_kind).collect())
}

fn list_answers(mut kinds: Vec<KindAnswer>) -> ExitCode {
    kinds.sort_by(|one, other| one.name.cmp(&other.name));
    let motorium = env!("CARGO_PKG_VERSION").to_string();
    print(&KindsAnswer { motorium, memory: crate::region::layout_digest(), kinds })
}

fn print(answer: &impl serde::Serialize) -> ExitCode {
    match serde_json::to_string(answer).map(|text| std::io::stdout().write_all(text.as_bytes())) {
        Ok(Ok(())) => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    }
}

/// Guards a run.
#[cfg(feature = "launcher")]
fn guard(folder: &RunFolder) -> ExitCode {
    crate::launcher::guard::main(folder)
}

/// Fails, because only programs with a launcher can guard a run.
#[cfg(not(feature = "launcher"))]
fn guard(folder: &RunFolder) -> ExitCode {
    eprintln!("this program has no launcher and cannot guard the run {}", folder.id());
    ExitCode::from(2)
}

/// Frees the slots of topics and parameters that dead processes of a run occupy.
pub fn clean(folder: &RunFolder) -> ExitCode {
    crate::domain::quieten();
    match folder.domain() {
        Ok(domain) => {
            domain.clean();
            ExitCode::SUCCESS
        }
        Err(_) => ExitCode::FAILURE,
    }
}

/// Reads a request to describe a component from standard input and prints the answer on standard output, both
/// as JSON. If the program hosts only one kind, the request need not name it.
pub fn describe(kinds: &[Kind]) -> ExitCode {
    answer(|request| {
        let wanted = match (&request.kind, kinds) {
            (None, [only]) => Some(only),
            (None, _) => None,
            (Some(name), kinds) => kinds.iter().find(|kind| kind.name == name),
        };
        wanted.map(|kind| kind.declare_in(request.config.clone(), declare_of(request)))
    })
}

/// Returns the empty declaration for a request.
fn declare_of(request: &DescribeRequest) -> Declare {
    let declare = match request.robots.is_empty() {
        true => Declare::new(request.robot.clone()),
        false => Declare::of_robots(request.robots.clone()),
    };
    declare.placed(request.placement.clone())
}

/// Answers a request for a description; `describe` returns `None` if the program does not host its kind.
fn answer(describe: impl FnOnce(&DescribeRequest) -> Option<Result<Declaration, ConfigProblem>>) -> ExitCode {
    let mut text = String::new();
    let request: Result<DescribeRequest, String> = std::io::stdin()
        .read_to_string(&mut text)
        .map_err(|error| error.to_string())
        .and_then(|_| serde_json::from_str(&text).map_err(|error| error.to_string()));
    let request = match request {
        Ok(request) => request,
        Err(error) => {
            eprintln!("no valid request on standard input: {error}");
            return ExitCode::from(2);
        }
    };
    let Some(declared) = describe(&request) else {
        eprintln!("this program hosts no kind `{}`", request.kind.unwrap_or_default());
        return ExitCode::from(2);
    };
    let (declaration, error) = match declared {
        Ok(declaration) => (Some(declaration), None),
        Err(problem) => (None, Some(problem.error.into())),
    };
    let motorium = env!("CARGO_PKG_VERSION").to_string();
    print(&DescribeAnswer { motorium, memory: crate::region::layout_digest(), declaration, error })
}

/// Runs one component of a run in this process. `kinds` returns the component's type, or `None` if the
/// program does not host the component.
pub fn run_worker(
    folder: &RunFolder,
    component: &str,
    kinds: impl Fn(&crate::plan::ComponentPlan) -> Option<Kind>,
) -> ExitCode {
    work(folder, component, |worker| Some(kinds(worker.component())?.run(worker)))
}

/// Runs one component of a run in this process; `run` returns `None` if the program does not host its kind.
fn work(folder: &RunFolder, component: &str, run: impl FnOnce(Worker) -> Option<Outcome>) -> ExitCode {
    crate::domain::quieten();
    let worker = match Worker::open(folder.clone(), component) {
        Ok(worker) => worker,
        Err(error) => {
            eprintln!("{component}: {error}");
            return ExitCode::FAILURE;
        }
    };
    match run(worker) {
        Some(Outcome::Stopped) => ExitCode::SUCCESS,
        Some(Outcome::Failed) => ExitCode::FAILURE,
        None => {
            eprintln!("{component}: this program does not host its kind");
            ExitCode::FAILURE
        }
    }
}

/// Turns a component type into a program: `motorium::main!(MyController);`.
///
/// The program describes itself to `motorium check` and runs as a process of a graph that names it by
/// `exec = "PATH"`. The program counts its heap allocations.
#[macro_export]
macro_rules! main {
    ($component:ty) => {
        #[global_allocator]
        static ALLOCATOR: $crate::telemetry::CountingAllocator = $crate::telemetry::CountingAllocator;

        fn main() -> std::process::ExitCode {
            $crate::program::main(&$crate::worker::Kind::of::<$component>())
        }
    };
}

/// Turns component types into a program that hosts their kinds for `motorium`: `motorium::host!(Web,
/// Recorder);`.
///
/// Every graph with one of these kinds finds the program if it is installed next to `motorium` or on `PATH`,
/// under the name registered for the family of the kinds. The program counts its heap allocations.
#[macro_export]
macro_rules! host {
    ($($component:ty),+ $(,)?) => {
        #[global_allocator]
        static ALLOCATOR: $crate::telemetry::CountingAllocator = $crate::telemetry::CountingAllocator;

        fn main() -> std::process::ExitCode {
            $crate::program::host(&[$($crate::worker::Kind::of::<$component>()),+])
        }
    };
}
