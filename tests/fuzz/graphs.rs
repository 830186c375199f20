//! Graph files.

use motorium::graph::{Machine, check, load_with};
use motorium::schedule::{Overheads, RtLimit, admit};

use crate::target::{files, target, workspace};

#[test]
fn graphs() {
    let corpus = files(&["graphs", "graphs/broken", "tests/fuzz/corpus/graphs"], &[".toml"]);
    // A graph with a program would start whatever path the damage produces.
    let corpus: Vec<_> = corpus.into_iter().filter(|bytes| !starts_a_program(bytes)).collect();
    let (registry, machine) = (motorium_tools::registry(), Machine::detect());
    let path = workspace().join("graphs/fuzzed.toml");
    target("graphs", &corpus, |bytes| {
        if starts_a_program(bytes) {
            return;
        }
        match check(&path, String::from_utf8_lossy(bytes).into_owned(), &[], &registry, &machine) {
            Ok(checked) => {
                admit(&checked.plan, &Overheads::default(), RtLimit::detect());
                assert!(serde_json::to_string(&checked.plan).is_ok());
                checked.warnings.iter().for_each(|warning| drop(warning.render(true)));
            }
            Err(error) => {
                assert!(!error.diagnostics().is_empty() && error.render(false).contains("error"));
                assert!(error.reports().len() <= 21);
            }
        }
    });
}

fn starts_a_program(bytes: &[u8]) -> bool {
    bytes.windows(4).any(|word| word == b"exec")
}

/// Damages a file that overlays a graph, or that extends one.
#[test]
fn overlays() {
    let corpus = files(&["graphs/overlays", "runtime/tests/graph_file/overlays", "graphs"], &[".toml"]);
    let corpus: Vec<_> = corpus.into_iter().filter(|bytes| !starts_a_program(bytes)).collect();
    let (registry, machine) = (motorium_tools::registry(), Machine::detect());
    let graph = workspace().join("graphs/panda-reach.toml");
    let folder = tempfile::tempdir().expect("a folder");
    let overlay = folder.path().join("overlay.toml");
    target("overlays", &corpus, |bytes| {
        if starts_a_program(bytes) {
            return;
        }
        std::fs::write(&overlay, bytes).expect("a file");
        if let Err(error) = load_with(&graph, std::slice::from_ref(&overlay), &[], &registry, &machine) {
            assert!(!error.diagnostics().is_empty() && error.render(false).contains("error"));
            for report in error.reports() {
                let (graph, overlay) = (graph.display().to_string(), overlay.display().to_string());
                let known = [graph, overlay].contains(&report.file) || report.file.ends_with(".toml");
                assert!(known && report.line.is_none_or(|line| line > 0), "{report:?}");
            }
        }
    });
}
