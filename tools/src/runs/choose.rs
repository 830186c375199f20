//! Choice among several runs.

use motorium::nearest::{nearest, suggest};

/// A candidate run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Candidate {
    pub(super) id: String,
    pub(super) graph: String,
    pub(super) alive: bool,
}

/// No run could be chosen.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum ChooseError {
    #[error("no graph is running; start one with `motorium run GRAPH.toml`")]
    NoneRuns,
    #[error("several graphs are running; choose one with `--run ID`:{}", listed(.0))]
    SeveralRun(Vec<Candidate>),
    #[error("`{wanted}` matches several runs; write more of the id:{}", listed(.candidates))]
    Ambiguous { wanted: String, candidates: Vec<Candidate> },
    #[error("no run is called `{wanted}`; {advice}")]
    Unknown { wanted: String, advice: String },
    #[error(
        "run `{id}` is over, but its shared memory was left behind; `motorium doctor --clean` removes it"
    )]
    Over { id: String },
}

fn listed(candidates: &[Candidate]) -> String {
    candidates.iter().map(|candidate| format!("\n  {}  (graph {})", candidate.id, candidate.graph)).collect()
}

/// Chooses a run like [`choose`], with the newest live run as the default. The candidates must be sorted from
/// newest to oldest.
pub(super) fn choose_newest(wanted: Option<&str>, candidates: &[Candidate]) -> Result<usize, ChooseError> {
    match (wanted, candidates.iter().position(|candidate| candidate.alive)) {
        (None, Some(newest)) => Ok(newest),
        _ => choose(wanted, candidates),
    }
}

/// Returns the index of the requested run among all runs, including ended ones.
pub(super) fn choose(wanted: Option<&str>, candidates: &[Candidate]) -> Result<usize, ChooseError> {
    let living = |test: &dyn Fn(&Candidate) -> bool| -> Vec<usize> {
        (0..candidates.len()).filter(|&i| candidates[i].alive && test(&candidates[i])).collect()
    };
    let these = |found: Vec<usize>| found.into_iter().map(|i| candidates[i].clone()).collect::<Vec<_>>();
    let Some(wanted) = wanted else {
        let found = living(&|_| true);
        return match found.as_slice() {
            [] => Err(ChooseError::NoneRuns),
            [only] => Ok(*only),
            _ => Err(ChooseError::SeveralRun(these(found))),
        };
    };
    let by_id = living(&|candidate| candidate.id == wanted);
    let by_graph = living(&|candidate| candidate.graph == wanted);
    let by_prefix = living(&|candidate| !wanted.is_empty() && candidate.id.starts_with(wanted));
    for found in [by_id, by_graph, by_prefix] {
        match found.as_slice() {
            [] => {}
            [only] => return Ok(*only),
            _ => return Err(ChooseError::Ambiguous { wanted: wanted.to_string(), candidates: these(found) }),
        }
    }
    if let Some(over) = candidates.iter().find(|candidate| candidate.id == wanted) {
        return Err(ChooseError::Over { id: over.id.clone() });
    }
    let all = these(living(&|_| true));
    let advice = match all.as_slice() {
        [] => "no graph is running; start one with `motorium run GRAPH.toml`".to_string(),
        all => {
            let ids = all.iter().map(|candidate| candidate.id.as_str());
            let mut graphs: Vec<&str> = all.iter().map(|candidate| candidate.graph.as_str()).collect();
            graphs.sort_unstable();
            graphs.dedup();
            // Several runs of a graph have one name.
            match nearest(wanted, graphs.iter().copied()) {
                Some(graph) => format!("did you mean `{graph}`?"),
                None => suggest(wanted, ids, "running are"),
            }
        }
    };
    Err(ChooseError::Unknown { wanted: wanted.to_string(), advice })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(id: &str, graph: &str, alive: bool) -> Candidate {
        Candidate { id: id.into(), graph: graph.into(), alive }
    }

    fn three() -> [Candidate; 3] {
        [
            run("reach-0a1b2c3d", "reach", true),
            run("reach-0a99ffff", "reach", false),
            run("walk-12345678", "walk", true),
        ]
    }

    #[test]
    fn the_only_living_run_needs_no_name() {
        assert_eq!(choose(None, &[run("a-1", "a", false), run("b-2", "b", true)]), Ok(1));
    }

    #[test]
    fn missing_run_error_says_how_to_start_one() {
        let error = choose(None, &[run("a-1", "a", false)]).unwrap_err();
        assert_eq!(error, ChooseError::NoneRuns);
        assert!(error.to_string().contains("motorium run GRAPH.toml"));
    }

    #[test]
    fn several_living_runs_are_listed_and_one_must_be_named() {
        let text = choose(None, &three()).unwrap_err().to_string();
        assert!(
            text.contains("--run ID") && text.contains("reach-0a1b2c3d") && text.contains("walk-12345678")
        );
        assert!(!text.contains("reach-0a99ffff"), "a dead run is no choice: {text}");
    }

    #[test]
    fn newest_living_run_is_chosen_by_default() {
        let runs = [run("c-3", "c", false), run("b-2", "b", true), run("a-1", "a", true)];
        assert_eq!(choose_newest(None, &runs), Ok(1));
        assert_eq!(choose_newest(Some("a"), &runs), Ok(2));
        assert_eq!(choose_newest(None, &runs[..1]), Err(ChooseError::NoneRuns));
    }

    #[test]
    fn run_is_named_by_id_prefix_or_graph() {
        for (wanted, expected) in [("walk-12345678", 2), ("walk", 2), ("w", 2), ("reach", 0), ("reach-0a", 0)]
        {
            assert_eq!(choose(Some(wanted), &three()), Ok(expected), "{wanted}");
        }
    }

    #[test]
    fn ambiguous_name_is_refused_with_both_runs() {
        let runs = [run("reach-1", "reach", true), run("reach-2", "reach", true)];
        for wanted in ["reach", "rea"] {
            let error = choose(Some(wanted), &runs).unwrap_err();
            assert_eq!(error, ChooseError::Ambiguous { wanted: wanted.into(), candidates: runs.to_vec() });
        }
        assert_eq!(choose(Some("reach-2"), &runs), Ok(1));
    }

    #[test]
    fn exact_id_takes_precedence_over_a_longer_one() {
        let runs = [run("a-1", "a", true), run("a-12", "b", true)];
        assert_eq!(choose(Some("a-1"), &runs), Ok(0));
    }

    #[test]
    fn unknown_name_suggests_the_nearest_one() {
        let text = choose(Some("wlak"), &three()).unwrap_err().to_string();
        assert_eq!(text, "no run is called `wlak`; did you mean `walk`?");
        let runs = [run("reach-1", "reach", true), run("reach-2", "reach", true)];
        let text = choose(Some("nothing"), &runs).unwrap_err().to_string();
        assert_eq!(text, "no run is called `nothing`; running are: `reach-1`, `reach-2`");
    }

    #[test]
    fn ended_run_is_reported_as_ended() {
        let error = choose(Some("reach-0a99ffff"), &three()).unwrap_err();
        assert_eq!(error, ChooseError::Over { id: "reach-0a99ffff".into() });
    }

    #[test]
    fn an_empty_name_names_no_run() {
        assert!(matches!(choose(Some(""), &three()), Err(ChooseError::Unknown { .. })));
    }
}
