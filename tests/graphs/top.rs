//! A running graph observed with `motorium top`, and its metrics as read by a scraper.

use std::collections::BTreeMap;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Output};
use std::time::{Duration, Instant};

use crate::exposition::{Family, Labels};
use crate::program::{complaint, json, machine, motorium, printed};
use crate::support::ANY_LOSS;
use serde_json::Value;

const GRAPH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/panda-reach.toml");
const COMPONENTS: [&str; 4] = ["physics", "encoder", "policy", "controller"];

/// A program that serves metrics, ended on drop.
struct Serving {
    child: Child,
    errors: BufReader<ChildStderr>,
    address: String,
}

impl Serving {
    fn start(mut command: Command) -> Self {
        let mut child = command.spawn().expect("the program starts");
        let mut errors = BufReader::new(child.stderr.take().expect("it is caught"));
        let mut text = String::new();
        // Warnings may come first.
        let address = loop {
            let start = text.len();
            assert!(errors.read_line(&mut text).expect("a line") > 0, "no address: {text}");
            let address = text[start..].trim().strip_prefix("metrics at http://");
            if let Some(address) = address.and_then(|address| address.strip_suffix("/metrics")) {
                break address.to_string();
            }
        };
        Self { child, errors, address }
    }

    fn ask(&self, method: &str, path: &str) -> (String, String) {
        let mut client = TcpStream::connect(&self.address).expect("somebody listens");
        write!(client, "{method} {path} HTTP/1.1\r\nHost: {}\r\n\r\n", self.address)
            .expect("the server reads the request");
        let mut answer = String::new();
        client.read_to_string(&mut answer).expect("it answers");
        let (head, body) = answer.split_once("\r\n\r\n").expect("a head and a body");
        (head.to_string(), body.to_string())
    }

    fn scrape(&self) -> BTreeMap<String, Family> {
        let (head, body) = self.ask("GET", "/metrics");
        assert!(head.starts_with("HTTP/1.1 200 OK\r\n"), "{head}");
        assert!(head.contains("Content-Type: application/openmetrics-text; version=1.0.0"), "{head}");
        crate::exposition::parse(&body)
    }

    fn steps(&self) -> f64 {
        self.scrape()["motorium_component_steps"].value(&[("component", "controller")])
    }

    fn comes_to_life(&self) {
        let deadline = Instant::now() + Duration::from_secs(60);
        while self.steps() < 20.0 {
            assert!(Instant::now() < deadline, "the graph does not step");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    fn end(mut self) -> (bool, String) {
        signal(&self.child, rustix::process::Signal::INT);
        let success = self.child.wait().expect("it ends").success();
        let mut text = String::new();
        self.errors.read_to_string(&mut text).expect("text");
        (success, text)
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        signal(&self.child, rustix::process::Signal::TERM);
        let _ = self.child.wait();
    }
}

fn signal(child: &Child, signal: rustix::process::Signal) {
    let _ = rustix::process::kill_process(rustix::process::Pid::from_child(child), signal);
}

fn graph(name: &str, more: &[&str]) -> Command {
    let name = format!("name={name}");
    // in lockstep, an hour and more of real time
    let mut arguments = vec!["run", GRAPH, "--set", &name, "--for", "100000s", "--json", "--metrics", "0"];
    arguments.extend(ANY_LOSS);
    arguments.extend(more);
    motorium(&arguments)
}

#[test]
fn top_shows_all_data_of_a_running_graph() {
    let _machine = machine();
    let name = format!("seen-{}", std::process::id());
    let run = Serving::start(graph(&name, &["--force"]));
    run.comes_to_life();
    data_has_the_shape_of_its_schema(&name);
    tables_name_everything(&name);
    looking_on_takes_no_place(&name);
    there_is_a_line_per_interval(&name);
    metrics_say_what_happened(&run, &name);
    metrics_are_served_beside_a_run(&run, &name);
    a_taken_port_stops_a_run_before_it_starts(&run);
    wrong_names_are_refused(&name);
    assert_end_of_run_reported(run, &name);
}

/// Validates the objects of some data and their keys against a schema.
fn assert_fits(data: &Value, schema: &Value, root: &Value, place: &str) {
    if let Some(name) = schema["$ref"].as_str() {
        let target = root.pointer(name.trim_start_matches('#')).expect("references lead somewhere");
        return assert_fits(data, target, root, place);
    }
    if let Some([only]) = schema["allOf"].as_array().map(Vec::as_slice) {
        return assert_fits(data, only, root, place);
    }
    if let (Some(properties), Some(data)) = (schema["properties"].as_object(), data.as_object()) {
        let names: Vec<&String> = properties.keys().collect();
        assert_eq!(data.keys().collect::<Vec<_>>(), names, "{place}");
        for (name, schema) in properties {
            assert_fits(&data[name], schema, root, &format!("{place}.{name}"));
        }
    } else if let (Some(items), Some(data)) = (schema.get("items"), data.as_array()) {
        data.iter().for_each(|data| assert_fits(data, items, root, &format!("{place}[]")));
    }
    let is = match data {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(number) if number.is_f64() => "number",
        Value::Number(_) => "integer",
        Value::String(_) => "string",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
    };
    let allowed: Vec<&str> = match &schema["type"] {
        Value::String(one) => vec![one.as_str()],
        Value::Array(several) => several.iter().filter_map(Value::as_str).collect(),
        // An enumeration of strings.
        _ => return,
    };
    let fits = allowed.contains(&is) || (is == "integer" && allowed.contains(&"number"));
    assert!(fits, "{place} is {is}, expected {allowed:?}");
}

fn data_has_the_shape_of_its_schema(name: &str) {
    let top = json(&["top", name, "--once", "--json", "--interval", "500ms"]);
    let schema = json(&["schema", "top"]);
    assert_fits(&top, &schema, &schema, "top");
    assert!(top["run"].as_str().is_some_and(|run| run.starts_with(name)), "{top}");
    assert_eq!(
        (&top["graph"], &top["clock"], &top["state"]),
        (&name.into(), &"realtime".into(), &"running".into())
    );
    let named: Vec<_> =
        top["components"].as_array().expect("components").iter().map(|c| &c["name"]).collect();
    assert_eq!(named, COMPONENTS);
    for component in top["components"].as_array().expect("components") {
        let (run, interval) = (&component["run"], &component["interval"]);
        let rate = interval["rate_hz"].as_f64().expect("a rate");
        assert!(rate > 0.0 && rate < 1500.0, "{component}");
        assert!(interval["steps"].as_u64() > Some(0) && interval["steps"].as_u64() < run["steps"].as_u64());
        for of in ["execution_ns", "cpu_ns"] {
            assert!(interval[of]["p50"].as_u64() > Some(0), "{of}: {component}");
            assert!(interval[of]["p50"].as_u64() <= interval[of]["p999"].as_u64(), "{of}: {component}");
            assert!(interval[of]["max"].as_u64() <= run[of]["max"].as_u64(), "{of}: {component}");
        }
        let share = component["core_share"].as_f64().expect("a share");
        assert!(share > 0.0 && share < 1.5, "{component}");
        let (all, shared) = (component["resident_bytes"].as_u64(), component["shared_bytes"].as_u64());
        assert!(shared > Some(0) && all > shared, "{component}");
    }
    assert_eq!(top["latencies"][0]["max_ns"], 600_000);
    assert!(top["latencies"][0]["interval"]["count"].as_u64() > Some(0), "{top}");
    assert_eq!(top["edges"].as_array().map(Vec::len), Some(5), "{}", top["edges"]);
    for core in top["cores"].as_array().expect("cores") {
        let parts = ["user", "system", "interrupts", "idle", "stolen"];
        let sum: f64 = parts.iter().filter_map(|part| core[*part].as_f64()).sum();
        assert!((sum - 1.0).abs() < 1e-6, "{core}");
    }
}

fn tables_name_everything(name: &str) {
    let text = printed(&["top", "--run", name, "--once", "--interval", "100ms", "--sort", "name", "--last"]);
    assert!(!text.contains('\x1b'), "no colours in a file: {text}");
    assert!(text.starts_with(name) && text.contains("running in real time"), "{text}");
    for part in
        ["stolen", "p99.9", "panda/true_joint_state -> panda/joint_command", "panda/target -> controller"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
    let lines: Vec<&str> = text.lines().filter_map(|line| line.split_whitespace().next()).collect();
    let sorted = ["controller", "encoder", "physics", "policy"];
    assert!(lines.windows(4).filter(|four| *four == sorted).count() == 2, "both tables are sorted: {text}");
}

/// A topic has slots for four observers.
fn looking_on_takes_no_place(name: &str) {
    let look =
        || motorium(&["top", name, "--once", "--interval", "400ms", "--json"]).spawn().expect("it starts");
    let lookers: Vec<Child> = (0..6).map(|_| look()).collect();
    for looker in lookers {
        let Output { status, stderr, .. } = looker.wait_with_output().expect("it ends");
        assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
    }
}

fn there_is_a_line_per_interval(name: &str) {
    let lines = |more: &[&str]| -> Vec<String> {
        let arguments = [&["top", name, "--interval", "150ms"], more].concat();
        let mut child = motorium(&arguments).spawn().expect("the program starts");
        let out = BufReader::new(child.stdout.take().expect("it is caught"));
        let lines = out.lines().take(3).map(|line| line.expect("a line")).collect();
        signal(&child, rustix::process::Signal::INT);
        assert!(child.wait().expect("it ends").success(), "an interrupt is a good end");
        lines
    };
    for line in lines(&[]) {
        let named = COMPONENTS.iter().all(|component| line.contains(&format!("{component} ")));
        assert!(named && line.contains(" Hz, late p99 ") && line.contains("missed "), "{line}");
    }
    let data: Vec<Value> =
        lines(&["--json"]).iter().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let steps = |top: &Value| top["components"][0]["run"]["steps"].as_u64();
    let between = |top: &Value| top["components"][0]["interval"]["steps"].as_u64();
    assert_eq!(
        steps(&data[1]).zip(between(&data[1])).map(|(all, new)| all - new),
        steps(&data[0]),
        "no step is lost"
    );
}

fn metrics_say_what_happened(run: &Serving, name: &str) {
    let (before, data) = (run.scrape(), json(&["top", name, "--once", "--json", "--interval", "200ms"]));
    let (after, last) = (run.scrape(), run.scrape());
    let page = page();
    for (name_of, family) in &after {
        let sample = if family.kind == "counter" { format!("{name_of}_total") } else { name_of.clone() };
        assert!(page.contains(&format!("`{sample}`")), "the book says nothing of `{sample}`");
        for labels in family.series() {
            assert_eq!(labels.get("graph").map(String::as_str), Some(name), "{labels:?}");
            assert!(labels.get("run").is_some_and(|run| run.starts_with(name)), "{labels:?}");
        }
    }
    crate::dashboard::assert_dashboard_matches(&after);
    for (index, component) in COMPONENTS.iter().enumerate() {
        let labels = [("component", *component)];
        let of = |text: &BTreeMap<String, Family>| text["motorium_component_steps"].value(&labels);
        let between = data["components"][index]["run"]["steps"].as_f64().expect("steps");
        assert!(of(&before) < between && between < of(&after), "{component}");
        let family = &after["motorium_component_execution_seconds"];
        let series: Vec<Labels> =
            family.series().into_iter().filter(|labels| labels["component"] == *component).collect();
        assert_eq!(series.len(), 1);
        let (count, sum) = family.histogram(&series[0]);
        assert!(of(&before) - 1.0 <= count && count <= of(&last) + 1.0, "each step was timed: {count}");
        assert!(sum > 0.0 && sum / count < 0.1, "in seconds: {sum}");
    }
    assert_eq!(after["motorium_component_execution_seconds"].kind, "histogram");
    assert_eq!(after["motorium_component_execution_seconds"].unit.as_deref(), Some("seconds"));
    let causes = ["late_wake", "long_step", "stolen", "late_input"];
    for cause in causes {
        after["motorium_component_missed_steps"].value(&[("component", "policy"), ("cause", cause)]);
    }
    let chain = [("from", "panda/true_joint_state"), ("to", "panda/joint_command")];
    assert!((after["motorium_latency_budget_seconds"].value(&chain) - 600e-6).abs() < 1e-12);
    assert_eq!(after["motorium_edge_age_seconds"].series().len(), 5);
    assert!(after["motorium_core_seconds"].value(&[("core", "0"), ("mode", "idle")]) > 0.0);
    assert!(run.ask("GET", "/").0.starts_with("HTTP/1.1 404 "));
    assert!(run.ask("POST", "/metrics").0.starts_with("HTTP/1.1 405 "));
}

fn metrics_are_served_beside_a_run(run: &Serving, name: &str) {
    let beside = Serving::start(motorium(&["top", name, "--metrics", "0"]));
    let (own, theirs) = (beside.scrape(), run.scrape());
    let names = |of: &BTreeMap<String, Family>| of.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&own), names(&theirs));
    let (success, text) = beside.end();
    assert!(success, "{text}");
}

fn a_taken_port_stops_a_run_before_it_starts(run: &Serving) {
    let port = run.address.rsplit(':').next().expect("a port");
    let name = format!("never-{}", std::process::id());
    let set = format!("name={name}");
    let text = complaint(&["run", GRAPH, "--set", &set, "--for", "1s", "--force", "--metrics", port]);
    assert!(text.contains(&format!("127.0.0.1:{port}: another program has this port")), "{text}");
    assert!(!text.contains("all ports connected"), "nothing was started: {text}");
    let text = complaint(&["run", GRAPH, "--metrics", "localhost"]);
    assert!(text.contains("neither a port nor an address"), "{text}");
}

fn wrong_names_are_refused(name: &str) {
    let text = complaint(&["top", "no-run-of-this-name", "--once"]);
    assert!(text.contains("no run is called `no-run-of-this-name`"), "{text}");
    let text = complaint(&["top", name, "--once", "--interval", "1ms"]);
    assert!(text.contains("expected 100 ms to 1 h"), "{text}");
}

fn assert_end_of_run_reported(run: Serving, name: &str) {
    let lockstep = Serving::start(graph(&format!("{name}-b"), &["--clock", "lockstep"]));
    lockstep.comes_to_life();
    // Two of ours are at least two, whatever else runs on this machine.
    let text = complaint(&["param", "set", "no.such", "1"]);
    assert!(text.contains("several graphs are running") && text.contains(&format!("graph {name}")), "{text}");
    let newest = motorium(&["top", "--once", "--interval", "100ms"]).output().expect("the program starts");
    let message = String::from_utf8_lossy(&newest.stderr);
    assert!(newest.status.success() && message.contains("the newest of several runs: "), "{message}");
    let twin = format!("{name}-b");
    let top = json(&["top", &twin, "--once", "--json", "--interval", "300ms"]);
    assert_eq!(top["clock"], "lockstep");
    let table = printed(&["top", &twin, "--once", "--interval", "100ms"]);
    assert!(table.contains("in lockstep") && !table.contains("lateness"), "{table}");
    assert!(lockstep.end().0);

    let follow = motorium(&["top", name, "--interval", "200ms"]).spawn().expect("the program starts");
    let once = motorium(&["top", name, "--once", "--interval", "60s"]).spawn().expect("the program starts");
    std::thread::sleep(Duration::from_millis(700));
    assert!(run.end().0, "an interrupted run ends in good order");
    let Output { status, stderr, stdout } = follow.wait_with_output().expect("it ends");
    let errors = String::from_utf8_lossy(&stderr);
    assert!(status.success() && errors.contains("is over"), "{errors}");
    assert!(String::from_utf8_lossy(&stdout).lines().count() >= 1, "it showed the run");
    let Output { status, stderr, stdout } = once.wait_with_output().expect("it ends");
    let errors = String::from_utf8_lossy(&stderr);
    assert!(!status.success() && errors.contains("ended before the interval was over"), "{errors}");
    assert!(stdout.is_empty());
}

#[test]
fn every_field_of_the_data_is_in_the_book() {
    let page = page();
    let mut wanted = Vec::new();
    names(&json(&["schema", "top"]), &mut wanted);
    assert!(wanted.len() > 50, "{wanted:?}");
    for name in wanted {
        assert!(page.contains(&format!("`{name}`")), "nothing is said of `{name}`");
    }
}

/// Returns the page of the book.
fn page() -> String {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/src/top.md");
    std::fs::read_to_string(page).expect("the page is there")
}

/// Collects the names of all properties in a schema.
fn names(schema: &Value, found: &mut Vec<String>) {
    if let Some(properties) = schema["properties"].as_object() {
        found.extend(properties.keys().cloned());
    }
    match schema {
        Value::Object(object) => object.values().for_each(|value| names(value, found)),
        Value::Array(items) => items.iter().for_each(|item| names(item, found)),
        _ => {}
    }
}
