//! Rows of the virtual machines: run once, and read back.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use serde_json::Value;

use super::{adapters, often, twelve};

/// A row as it came out: its exit code, its report, and what it said.
#[derive(Debug)]
pub(crate) struct Row {
    pub(crate) code: i32,
    pub(crate) text: String,
    pub(crate) errors: String,
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

/// Results of a run of virtual machines: their rows, and the end of the first that failed.
pub(crate) struct Machine {
    pub(crate) rows: BTreeMap<String, Row>,
    pub(crate) end: Result<(), String>,
}

/// Rows of two virtual machines after their one run, whichever rows failed in them; `None` where they cannot be started. They
/// run side by side: each keeps one core of the host busy.
pub(crate) fn machine() -> Option<&'static Machine> {
    static MACHINE: OnceLock<Option<Machine>> = OnceLock::new();
    let run = || {
        std::thread::scope(|scope| {
            let serial = scope.spawn(|| run("serial"));
            let (socket, serial) = (run("socket")?, serial.join().expect("it runs to its end")?);
            let rows = socket.rows.into_iter().chain(serial.rows).collect();
            Some(Machine { rows, end: socket.end.and(serial.end) })
        })
    };
    MACHINE.get_or_init(run).as_ref()
}

/// The row of this name; `None`, with the reason printed, if there was no machine to run it on.
pub(crate) fn row(name: &str) -> Option<&'static Row> {
    let Some(Machine { rows, end }) = machine() else {
        eprintln!("NOT RUN: `{name}` needs a virtual machine");
        return None;
    };
    let missing =
        || panic!("no row `{name}` among {:?}: {}", rows.keys(), end.as_ref().err().map_or("", |end| end));
    Some(rows.get(name).unwrap_or_else(missing))
}

/// Runs those rows in a machine.
fn run(rows: &str) -> Option<Machine> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scratch = tempfile::tempdir().expect("a folder");
    let graphs = scratch.path().join("graphs");
    let copied = Command::new("cp").args(["-r", "../graphs"]).arg(&graphs).current_dir(here).status();
    assert!(copied.expect("cp starts").success());
    twelve::write(&graphs);
    adapters::write(&graphs);
    // a longer run of the twelve joints: `MOTORIUM_CAN_SECONDS=60 cargo only can`
    let seconds = std::env::var("MOTORIUM_CAN_SECONDS").unwrap_or_else(|_| "5".to_string());
    std::fs::write(graphs.join("seconds"), seconds).expect("a file");
    // more deaths of the adapter: `MOTORIUM_CAN_KILLS=100 cargo only can often`
    std::fs::write(graphs.join("kills"), often::kills().to_string()).expect("a file");
    std::fs::write(graphs.join("rows"), rows).expect("a file");
    // for one of the two an optimised build, which is emulated in two thirds of the time; the other asserts more
    let program = std::env::var_os("MOTORIUM_CAN_PROGRAM").filter(|_| rows == "socket");
    let program = program.unwrap_or_else(|| env!("CARGO_BIN_EXE_motorium-under-test").into());
    let put = |from: &Path, to: &str| format!("{}:{to}", from.display());
    let output = Command::new("bash")
        .arg(here.join("can/vm.sh"))
        .args(["--put", &put(Path::new(&program), "/bin/motorium")])
        .args(["--put", &put(&graphs, "/graphs")])
        .arg(here.join("can/rows.sh"))
        .stdin(Stdio::null())
        .output()
        .expect("bash starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    let jumps = |line: &&str| line.contains("the clock of the machine jumped");
    errors.lines().filter(jumps).for_each(|line| eprintln!("{line}"));
    if output.status.code() == Some(125) {
        eprintln!("{errors}");
        return None;
    }
    let text = String::from_utf8_lossy(&output.stdout);
    if let Some(folder) = std::env::var_os("MOTORIUM_VM_KEEP") {
        std::fs::write(Path::new(&folder).join(format!("{rows}.txt")), text.as_bytes()).expect("a file");
    }
    let mut rows = BTreeMap::new();
    for part in text.split("=== ").skip(1) {
        // a machine that was ended may have been in the middle of a row
        let Some((head, rest)) = part.split_once('\n') else { continue };
        let Some((name, code)) = head.split_once(' ') else { continue };
        let Ok(code) = code.trim().parse() else { continue };
        let (body, said) = rest.split_once("--- errors\n").unwrap_or((rest, ""));
        rows.insert(name.to_string(), Row { code, text: body.to_string(), errors: said.to_string() });
    }
    let end = if output.status.success() { Ok(()) } else { Err(format!("{}: {errors}", output.status)) };
    Some(Machine { rows, end })
}

pub(crate) fn number(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// The drives of which this is true.
pub(crate) fn drives(results: &Value, is: impl Fn(&Value) -> bool) -> usize {
    results["drives"]["drives"].as_object().expect("drives").values().filter(|drive| is(drive)).count()
}
