//! The files of a run: plan, control block, results, topics.

use std::cell::Cell;
use std::os::unix::fs::FileExt as _;
use std::path::PathBuf;
use std::rc::Rc;

use motorium::plan::{ComponentPlan, Plan};
use motorium::region::Region;
use motorium::run_folder::RunFolder;
use motorium::state::JointState;
use motorium::testing::{Endpoint, TopicSet};
use motorium::transport::Tap;

use crate::target::{target, workspace};

/// The plan of a typical graph.
fn plan() -> Plan {
    let path = workspace().join("graphs/panda-reach.toml");
    motorium::graph::load(&path, &[], &motorium_tools::registry()).expect("the graph is good").plan
}

/// Reads everything in a control block, as `top`, the metrics and the report do.
fn look(region: &Region) {
    let header = region.header();
    let _ = (header.command(), format!("{header:?}").len());
    for block in region.components() {
        let _ = (block.phase(), block.misses(), block.misses().missed(), block.stalls(), block.failure());
        for histogram in [&block.lateness, &block.execution, &block.cpu] {
            let _ = (histogram.count(), histogram.mean(), histogram.percentiles());
            let snapshot = histogram.snapshot();
            let _ = (snapshot.percentiles(), snapshot.since(&snapshot).sum(), snapshot.quantile(0.5));
        }
    }
    region.edges().iter().for_each(|edge| drop(edge.age.snapshot()));
    region
        .latencies()
        .iter()
        .for_each(|latency| assert!(latency.latency.percentiles().p50 <= latency.latency.percentiles().max));
}

#[test]
fn plans_and_results() {
    let plan = plan();
    let folder = tempfile::tempdir().expect("a folder");
    let run = RunFolder::open(folder.path());
    let text = serde_json::to_vec(&plan).expect("JSON");
    target("plans", &[text, b"{\"count\": 3, \"error\": 1e-3}".to_vec()], |bytes| {
        std::fs::write(folder.path().join("plan.json"), bytes).expect("the file can be written");
        std::fs::write(folder.path().join("result-a.json"), bytes).expect("the file can be written");
        if let Ok(plan) = run.plan() {
            let _ = (plan.edges().len(), plan.topics.iter().map(|topic| topic.slots()).max());
        }
        let _ = (run.result("a"), run.is_alive());
    });
}

#[test]
fn control_blocks() {
    let plan = plan();
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("region");
    drop(Region::create(&path, &plan).expect("it is made"));
    let bytes = std::fs::read(&path).expect("it can be read");
    target("control-blocks", &[bytes], |bytes| {
        std::fs::write(&path, bytes).expect("it can be written");
        if let Ok(region) = Region::open(&path) {
            let _ = region.fits(&plan);
            look(&region);
        }
    });
}

#[test]
fn topics() {
    let plan = plan();
    let reader = plan.components.iter().position(|component| component.name == "policy").expect("a policy");
    let is_state = |index: usize| plan.topics[index].layout.type_name == "motorium.JointState";
    let (port, index) = plan.components[reader]
        .inputs
        .iter()
        .find_map(|input| Some((input.port.clone(), input.topic.filter(|index| is_state(*index))?)))
        .expect("it reads a joint state");
    let topic = plan.topics[index].clone();
    let output_of = |component: &ComponentPlan| {
        component.outputs.iter().find(|output| output.topic == Some(index)).map(|output| output.port.clone())
    };
    let (writer, output) = plan
        .components
        .iter()
        .find_map(|component| Some((component.name.clone(), output_of(component)?)))
        .expect("somebody writes it");
    let output: &'static str = output.leak();
    let set = Rc::new(TopicSet::create(&plan).expect("there is shared memory"));
    let run = RunFolder::open(set.path());
    let domain = run.domain().expect("it has a domain");
    let files: Vec<PathBuf> =
        domain.objects().filter(|path| path.to_string_lossy().ends_with(".topic")).collect();
    let whole: Vec<Vec<u8>> = files.iter().map(|path| std::fs::read(path).expect("it can be read")).collect();
    let (writer, reader) = (
        Endpoint::join(set.path(), &writer).expect("it joins"),
        Endpoint::join(set.path(), "policy").expect("it joins"),
    );
    let mut output = writer.output::<JointState>(output).expect("it opens");
    let mut input = reader.input::<JointState>(&port).expect("it opens");
    let mut tap = Tap::open(&domain, &topic).expect("there is a place");
    let next = Cell::new(0);
    // The damaged files are the memories of all topics, with unchanged lengths: one is open, and readers hold
    // slots in it.
    let output = std::cell::RefCell::new(&mut output);
    let others = std::cell::RefCell::new((&mut input, &mut tap));
    target("topics", &whole, |bytes| {
        let which = next.get() % files.len();
        next.set(which + 1);
        let length = bytes.len().min(whole[which].len());
        let file = std::fs::OpenOptions::new().write(true).open(&files[which]).expect("it opens");
        file.write_all_at(&bytes[..length], 0).expect("it can be written");
        for _ in 0..3 {
            if let Ok(mut value) = output.borrow_mut().loan() {
                value.set_count(7);
                let _ = value.publish();
            }
            let (input, tap) = &mut *others.borrow_mut();
            if let Some(state) = input.latest() {
                let _ = (state.count(), state.position().iter().sum::<f64>(), state.age_ns());
            }
            for _ in 0..8 {
                if !tap.read(|stamp, bytes| assert!(stamp.sequence < u64::MAX || !bytes.is_empty())) {
                    break;
                }
            }
            let _ = tap.missed();
        }
    });
}
