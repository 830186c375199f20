//! Rows of the virtual machines, which run once and are then parsed.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::Instant;

use serde_json::Value;

use super::{adapters, often, scans, twelve};

/// The output of a row.
#[derive(Debug)]
pub(crate) struct Row {
    pub(crate) code: i32,
    /// Report of the row.
    pub(crate) text: String,
    /// Standard error of the row.
    pub(crate) errors: String,
    /// Start and end, in seconds of machine time.
    within: [f64; 2],
    /// Clock discontinuities of the machine during the row, ms.
    pub(crate) leaps_ms: Vec<f64>,
}

impl Row {
    pub(crate) fn report(&self) -> Value {
        serde_json::from_str(&self.text)
            .unwrap_or_else(|error| panic!("{error}: {}\n{}", self.text, self.errors))
    }

    pub(crate) fn results(&self) -> Value {
        self.report()["results"].clone()
    }
}

impl Row {
    /// Asserts that no reply is missing and nothing has tripped. If the machine's clock jumped during the
    /// row, which is printed, each drive may miss the current cycle; if it jumped by more than the watchdog
    /// time, each drive may trip.
    pub(crate) fn assert_steady(&self, adapter: &Value) {
        let joints = adapter["joints"].as_object().expect("joints").len();
        let missing = number(&adapter["missing_replies"]);
        assert!(missing <= (joints * self.leaps_ms.len()) as u64, "leaps {:?} ms: {adapter}", self.leaps_ms);
        let is_let_go = self.leaps_ms.iter().any(|ms| *ms >= WATCHDOG_MS);
        assert!(adapter["tripped"] == false || is_let_go, "leaps {:?} ms: {adapter}", self.leaps_ms);
    }
}

/// Watchdog time of all drives, ms.
const WATCHDOG_MS: f64 = 20.0;

/// Results of a run of virtual machines.
pub(crate) struct Machine {
    pub(crate) rows: BTreeMap<String, Row>,
    /// Error of the first failed row.
    pub(crate) end: Result<(), String>,
    /// Durations of the rows, and the clock discontinuities.
    pub(crate) times: String,
}

/// Returns the rows of two virtual machines after their only run, even if some rows failed; `None` if the
/// machines cannot be started. They run in parallel, and each keeps one core of the host busy.
pub(crate) fn machine() -> Option<&'static Machine> {
    static MACHINE: OnceLock<Option<Machine>> = OnceLock::new();
    let run = || {
        std::thread::scope(|scope| {
            let serial = scope.spawn(|| run("serial"));
            let (socket, serial) = (run("socket")?, serial.join().expect("it runs to its end")?);
            let rows = socket.rows.into_iter().chain(serial.rows).collect();
            Some(Machine { rows, end: socket.end.and(serial.end), times: socket.times + &serial.times })
        })
    };
    MACHINE.get_or_init(run).as_ref()
}

/// Returns the row with this name; `None`, with the reason printed, if there was no machine to run it on.
pub(crate) fn row(name: &str) -> Option<&'static Row> {
    let Some(Machine { rows, end, .. }) = machine() else {
        eprintln!("skipped: no virtual machine");
        return None;
    };
    let missing =
        || panic!("no row `{name}` among {:?}: {}", rows.keys(), end.as_ref().err().map_or("", |end| end));
    let row = rows.get(name).unwrap_or_else(missing);
    if !row.leaps_ms.is_empty() {
        // shown if the test fails
        println!("during `{name}` the clock of the machine jumped, ms: {:?}", row.leaps_ms);
    }
    Some(row)
}

/// Returns the command that a machine emulates. The rows other than the twelve joints use the release build
/// in `MOTORIUM_CAN_PROGRAM=target/release/motorium`, if set, as users run it. Otherwise it is the command
/// under test, which has more assertions and is three times as slow.
fn program(rows: &str) -> PathBuf {
    let named = std::env::var_os("MOTORIUM_CAN_PROGRAM").filter(|_| rows == "serial");
    named.map_or_else(|| env!("CARGO_BIN_EXE_motorium-under-test").into(), PathBuf::from)
}

/// Runs these rows in a machine.
fn run(rows: &str) -> Option<Machine> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scratch = tempfile::tempdir().expect("a folder");
    let graphs = scratch.path().join("graphs");
    let copied = Command::new("cp").arg("-r").arg(here.join("../graphs")).arg(&graphs).status();
    assert!(copied.is_ok_and(|status| status.success()), "the graphs are copied");
    twelve::write(&graphs);
    adapters::write(&graphs);
    scans::write(&graphs);
    // a longer run of the twelve joints: `MOTORIUM_CAN_SECONDS=60 cargo only vcan`
    let seconds = std::env::var("MOTORIUM_CAN_SECONDS");
    std::fs::write(graphs.join("seconds"), seconds.as_deref().unwrap_or("5")).expect("a file");
    // `MOTORIUM_CAN_KILLS=100 cargo only vcan often`: more kills of the adapter
    std::fs::write(graphs.join("kills"), often::kills().to_string()).expect("a file");
    std::fs::write(graphs.join("rows"), rows).expect("a file");
    let put = |from: &Path, to: &str| format!("{}:{to}", from.display());
    let began = Instant::now();
    let mut machine = Command::new("bash")
        .arg(here.join("can/vm.sh"))
        .args(["--put", &put(&program(rows), "/bin/motorium")])
        .args(["--put", &put(Path::new(env!("CARGO_BIN_EXE_clock-watch")), "/bin/clock-watch")])
        .args(["--put", "/usr/bin/chrt:/bin/chrt"])
        .args(["--put", &put(&graphs, "/graphs")])
        .arg(here.join("can/rows.sh"))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("bash starts");
    let mut errors = machine.stderr.take().expect("a pipe");
    let errors = std::thread::spawn(move || {
        let mut text = Vec::new();
        errors.read_to_end(&mut text).map(|_| String::from_utf8_lossy(&text).into_owned())
    });
    let (mut text, mut ended_s) = (String::new(), Vec::new());
    for line in BufReader::new(machine.stdout.take().expect("a pipe")).split(b'\n') {
        let line = line.expect("it can be read");
        if line.starts_with(b"=== ") {
            ended_s.push(began.elapsed().as_secs_f64());
        }
        text += &String::from_utf8_lossy(&line);
        text.push('\n');
    }
    let status = machine.wait().expect("it ends");
    let errors = errors.join().expect("it ends").expect("it can be read");
    if status.code() == Some(125) {
        eprintln!("{errors}");
        return None;
    }
    let (found, times) = read(&text, &ended_s);
    if let Some(folder) = std::env::var_os("MOTORIUM_VM_KEEP") {
        let keep =
            |end: &str, text: &str| std::fs::write(Path::new(&folder).join(format!("{rows}.{end}")), text);
        keep("txt", &text).and_then(|()| keep("times", &times)).expect("files");
    }
    let end = if status.success() { Ok(()) } else { Err(format!("{status}: {errors}")) };
    Some(Machine { rows: found, end, times })
}

/// Parses the rows printed by a machine, each of which ended this number of seconds after its start, and
/// formats the durations.
fn read(text: &str, ended_s: &[f64]) -> (BTreeMap<String, Row>, String) {
    let mut rows = BTreeMap::new();
    let mut times =
        String::from("row                    real s  until it runs  runs  computes (s of the machine)\n");
    let mut before_s = 0.0;
    for (part, ended_s) in text.split("=== ").skip(1).zip(ended_s) {
        // a terminated machine may have been in the middle of a row
        let Some((head, rest)) = part.split_once('\n') else { continue };
        let Some((name, code)) = head.split_once(' ') else { continue };
        let Ok(code) = code.trim().parse() else { continue };
        let Some((rest, printed)) = rest.split_once("--- times\n") else { continue };
        let (text, errors) = rest.split_once("--- errors\n").unwrap_or((rest, ""));
        // everything below belongs to the commands of the next row
        let printed = printed.lines().next().unwrap_or_default();
        let numbers = printed.split_whitespace().filter_map(|number| number.parse().ok());
        let [began, idle_before, ran, ended, idle] = numbers.collect::<Vec<f64>>()[..] else { continue };
        let busy = ended - began - (idle - idle_before);
        let real = ended_s - before_s;
        before_s = *ended_s;
        let _ = writeln!(times, "{name:<22} {real:6.1} {:14.2} {:5.2} {busy:9.2}", ran - began, ended - ran);
        let row = Row {
            code,
            text: text.to_string(),
            errors: errors.to_string(),
            within: [began, ended],
            leaps_ms: Vec::new(),
        };
        rows.insert(name.to_string(), row);
    }
    for name in ["socket_leaps", "serial_leaps"] {
        let Some(row) = rows.remove(name) else { continue };
        for leap in row.text.lines().filter_map(Leap::read) {
            let _ = writeln!(times, "the clock jumped {leap:?}");
            // the time of a row is rounded
            let is_within =
                |row: &&mut Row| leap.at >= row.within[0] - 0.01 && leap.began() <= row.within[1] + 0.01;
            rows.values_mut().filter(is_within).for_each(|row| row.leaps_ms.push(leap.length_ms));
        }
    }
    (rows, times)
}

/// An interval in which nothing ran although a thread of the highest priority was ready: the processor was
/// idle, so the clock must have jumped.
#[derive(Debug)]
struct Leap {
    /// End of the interval, in seconds of machine time.
    at: f64,
    length_ms: f64,
}

impl Leap {
    /// Parses a line of `clock-watch`. Returns `None` if the processor was busy: then the kernel delayed the
    /// thread, and no clock jumped.
    fn read(line: &str) -> Option<Self> {
        let numbers: Vec<f64> = line.split_whitespace().filter_map(|number| number.parse().ok()).collect();
        let [at, length_ms, idle_ms] = numbers[..] else { return None };
        // idle time is reported in steps of 10 ms
        (idle_ms > 0.0 && idle_ms + 10.0 >= length_ms - 1.0).then_some(Self { at, length_ms })
    }

    fn began(&self) -> f64 {
        self.at - self.length_ms * 1e-3
    }
}

pub(crate) fn number(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// Returns the number of drives for which this is true.
pub(crate) fn drives(results: &Value, is: impl Fn(&Value) -> bool) -> usize {
    results["drives"]["drives"].as_object().expect("drives").values().filter(|drive| is(drive)).count()
}

#[test]
fn machine_output_is_read_with_clock_leaps() {
    let text = "=== one 0\nreport\n--- errors\nsaid\n--- times\n1.00 0.50 1.40 2.00 0.70\n\
                === two 3\n--- errors\n--- times\n2.00 0.70 2.10 3.00 1.50\n=== cut 0\nrep\n\
                === socket_leaps 0\n1.50 98.1 100\n1.70 20.0 0\n2.50 7.0 10\n--- errors\n--- times\n3.0 1.5 3.0 3.0 1.5\n";
    let (rows, times) = read(text, &[10.0, 14.0, 15.0, 15.0]);
    let of = |name: &str| (rows[name].code, rows[name].leaps_ms.clone());
    assert_eq!(rows.keys().collect::<Vec<_>>(), ["one", "two"]);
    // the interval of 20 ms has another reason: the processor was busy
    assert_eq!((of("one"), of("two")), ((0, vec![98.1]), (3, vec![7.0])));
    assert_eq!((rows["one"].text.as_str(), rows["one"].errors.as_str()), ("report\n", "said\n"));
    let fields = |line: usize| times.lines().nth(line).unwrap().split_whitespace().collect::<Vec<_>>();
    assert_eq!(fields(1), ["one", "10.0", "0.40", "0.60", "0.80"], "{times}");
    assert_eq!(fields(2), ["two", "4.0", "0.10", "0.90", "0.20"], "{times}");
}
