//! Shell completions: graphs, runs, names in this user's newest run, robots and kinds.

use clap_complete::engine::{ArgValueCandidates, ArgValueCompleter, CompletionCandidate, PathCompleter};
use motorium::plan::Plan;
use motorium::run_folder::RunFolder;

/// Returns a completion candidate and a line about it.
fn candidate(word: impl Into<String>, about: impl Into<String>) -> CompletionCandidate {
    CompletionCandidate::new(word.into()).help(Some(about.into().into()))
}

/// Returns the plan of the newest run that is alive.
fn newest() -> Option<Plan> {
    RunFolder::list().into_iter().find(RunFolder::is_alive)?.plan().ok()
}

/// Returns the graph files.
pub(crate) fn graphs() -> ArgValueCompleter {
    let is_graph = |path: &std::path::Path| path.extension().is_some_and(|extension| extension == "toml");
    ArgValueCompleter::new(PathCompleter::file().filter(is_graph))
}

/// Runs that are alive, by their ids.
pub(crate) fn runs() -> ArgValueCandidates {
    ArgValueCandidates::new(|| {
        let alive = RunFolder::list().into_iter().filter(RunFolder::is_alive);
        alive
            .filter_map(|folder| {
                Some(candidate(folder.id(), format!("a run of graph {}", folder.plan().ok()?.name)))
            })
            .collect()
    })
}

/// Topics of the newest run.
pub(crate) fn topics() -> ArgValueCandidates {
    ArgValueCandidates::new(|| {
        let topics = newest().into_iter().flat_map(|plan| plan.topics);
        topics.map(|topic| candidate(topic.name, topic.layout.type_name)).collect()
    })
}

/// Components of the newest run.
pub(crate) fn components() -> ArgValueCandidates {
    ArgValueCandidates::new(|| {
        let components = newest().into_iter().flat_map(|plan| plan.components);
        components.map(|component| candidate(component.name, "a component of the newest run")).collect()
    })
}

/// Parameters of the newest run, `COMPONENT.PARAMETER`.
pub(crate) fn parameters() -> ArgValueCandidates {
    ArgValueCandidates::new(|| {
        let plan = newest();
        let components = plan.iter().flat_map(|plan| &plan.components);
        components
            .flat_map(|component| {
                component.parameters.iter().map(|parameter| {
                    let declared = &parameter.declaration;
                    candidate(format!("{}.{}", component.name, declared.name), declared.doc.as_str())
                })
            })
            .collect()
    })
}

/// Robots of the catalogue and installed ones.
pub(crate) fn robots() -> ArgValueCandidates {
    ArgValueCandidates::new(|| {
        let catalogue = motorium_robots::catalogue().iter();
        let installed = motorium_robots::installed();
        catalogue
            .map(|entry| candidate(entry.name, entry.profile.title.as_str()))
            .chain(installed.iter().map(|robot| candidate(robot.name.as_str(), "installed")))
            .collect()
    })
}

/// Returns the built-in kinds of components.
pub(crate) fn kinds() -> ArgValueCandidates {
    ArgValueCandidates::new(|| {
        let known = crate::registry::registry();
        known.kinds().iter().map(|kind| candidate(kind.name, kind.summary)).collect()
    })
}
