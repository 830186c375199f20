//! Observer slots in topics: the slots of killed observers become free again.

use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::support::{FAULTY, MOTORIUM, Run, kill, machine, panda_reach};

/// More than the observer slots of a topic.
const OBSERVERS: usize = 9;

/// Starts `motorium topic echo` and waits until it has shown a value.
fn observer(run: &Run, topic: &str) -> Child {
    let mut child = Command::new(MOTORIUM)
        .args(["topic", "echo", topic, "--json", "--run", run.folder.id()])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("motorium starts");
    let mut line = String::new();
    let output = child.stdout.as_mut().expect("its output is read");
    BufReader::new(output).read_line(&mut line).expect("it can be read");
    if line.is_empty() {
        let output = child.wait_with_output().expect("it ends");
        panic!("`{topic}` is not shown: {}", String::from_utf8_lossy(&output.stderr));
    }
    child
}

/// The Panda with a component that also forwards its state as a stream.
fn with_stream() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("stream.toml");
    let text = std::fs::read_to_string(panda_reach()).expect("the graph can be read");
    let added = format!(
        "\n[component.faulty]\nexec = \"{FAULTY}\"\ntrigger = \"panda/joint_state\"\nsubscribe = {{ input = \"panda/joint_state\" }}\n\
         publish = {{ output = \"panda/passed_on\", stream = \"panda/each\" }}\nconfig = {{ fault = \"none\" }}\n"
    );
    std::fs::write(&path, text + &added).expect("the graph can be written");
    (folder, path)
}

#[test]
fn killed_observers_free_their_places() {
    let _machine = machine();
    let (_folder, graph) = with_stream();
    let run = Run::start(&graph, &["--for", "60 s", "--force"]);
    for topic in ["panda/joint_state", "panda/each"] {
        for _ in 0..OBSERVERS {
            let mut observer = observer(&run, topic);
            kill(observer.id());
            observer.wait().expect("it has ended");
            let killed = Instant::now();
            while run.folder.domain().expect("the run has a domain").has_dead() {
                assert!(killed.elapsed() < Duration::from_secs(10), "the places of `{topic}` stay taken");
                std::thread::sleep(Duration::from_millis(10));
            }
        }
    }
    drop(run);
}

#[test]
fn observers_killed_together_free_their_slots() {
    let _machine = machine();
    let (_folder, graph) = with_stream();
    let run = Run::start(&graph, &["--for", "60 s", "--force"]);
    for topic in ["panda/joint_state", "panda/each"] {
        let full: Vec<Child> = (0..4).map(|_| observer(&run, topic)).collect();
        for mut observer in full {
            kill(observer.id());
            observer.wait().expect("it has ended");
        }
        let killed = Instant::now();
        while run.folder.domain().expect("the run has a domain").has_dead() {
            assert!(killed.elapsed() < Duration::from_secs(10), "the places of `{topic}` stay taken");
            std::thread::sleep(Duration::from_millis(10));
        }
        let mut again: Vec<Child> = (0..4).map(|_| observer(&run, topic)).collect();
        for observer in &mut again {
            kill(observer.id());
            observer.wait().expect("it has ended");
        }
    }
    drop(run);
}
