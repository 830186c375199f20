//! Comparison with MuJoCo: a Python driver holds the scene and is called over a pipe, alternating with
//! motorium. The driver measures library calls of [`Scan::repeats`] scans each.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use crate::table::{Scan, TableTop};
use crate::{RANGE, TURNS, figures, share, turn};

const INSTALL: &str =
    "pip install mujoco numpy in a virtual environment, and set MOTORIUM_PEERS_PYTHON to its python3";

/// Fraction of rays whose distances may differ by more than a micrometre: rays that graze an edge.
const GRAZING: f64 = 0.002;

/// Prints the time of every scan on both sides, the ratio of the medians, and how the distances compare.
pub(crate) fn compare(table: &mut TableTop) -> Result<(), String> {
    let mut peer = Peer::start(table)?;
    println!("{:<28} {:>26} {:>26} {:>9}", "scan", "motorium", "mujoco", "ratio");
    for scan in &table.scans {
        let mut hits = vec![None; scan.rays.len()];
        let (mut ours, mut theirs) = (Vec::with_capacity(TURNS), Vec::with_capacity(TURNS));
        for _ in 0..TURNS {
            ours.push(turn(&mut table.scene, scan, &mut hits));
            theirs.push(peer.turn(scan)?);
        }
        let (own, other) = (figures(&mut ours), figures(&mut theirs));
        let ratio = ours[TURNS / 2] / theirs[TURNS / 2];
        let distances = peer.distances(scan)?;
        let apart = hits.iter().zip(&distances).filter(|(hit, distance)| {
            let found = hit.map_or(-1.0, |hit| hit.distance);
            (found - **distance).abs() > 1e-6
        });
        let apart = apart.count();
        if distances.len() != hits.len() || apart as f64 > GRAZING * hits.len() as f64 {
            return Err(format!("{}: {apart} of {} distances differ", scan.name, hits.len()));
        }
        println!("{:<28} {own:>26} {other:>26} {ratio:>9.2}   {}, {apart} differ", scan.name, share(&hits));
    }
    Ok(())
}

struct Peer {
    process: Child,
    questions: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Peer {
    fn start(table: &TableTop) -> Result<Self, String> {
        let python = std::env::var_os("MOTORIUM_PEERS_PYTHON").unwrap_or_else(|| "python3".into());
        let mut process = Command::new(python)
            .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/rays.py"))
            .arg(RANGE.to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| format!("cannot start python3: {error}; {INSTALL}"))?;
        let (questions, answers) =
            process.stdin.take().zip(process.stdout.take()).ok_or("the driver has no pipes")?;
        let mut peer = Self { process, questions, answers: BufReader::new(answers) };
        peer.ask(&table.mjcf)?;
        for scan in &table.scans {
            let numbers = |of: &dyn Fn(&motorium_worlds::Ray) -> [f64; 3]| -> Vec<String> {
                scan.rays.iter().flat_map(|ray| of(ray).map(|number| format!("{number:e}"))).collect()
            };
            let origins = numbers(&|ray| ray.origin.coords.into()).join(" ");
            let directions = numbers(&|ray| ray.direction.into_inner().into()).join(" ");
            peer.ask(&format!("{} {} {origins} {directions}", scan.word, scan.repeats))?;
        }
        match peer.line()?.trim() {
            "ready" => Ok(peer),
            other => Err(format!("the driver says \"{other}\"; {INSTALL}")),
        }
    }

    fn ask(&mut self, line: &str) -> Result<(), String> {
        writeln!(self.questions, "{line}").map_err(|error| format!("the driver is gone: {error}; {INSTALL}"))
    }

    fn line(&mut self) -> Result<String, String> {
        let mut line = String::new();
        let read = self.answers.read_line(&mut line);
        if read.map_err(|error| format!("the driver is gone: {error}"))? == 0 {
            return Err(format!("the driver does not start; {INSTALL}"));
        }
        Ok(line)
    }

    /// Microseconds per scan.
    fn turn(&mut self, scan: &Scan) -> Result<f64, String> {
        self.ask(&format!("time {}", scan.word))?;
        let line = self.line()?;
        line.trim().parse().map_err(|_| format!("the driver says \"{}\"", line.trim()))
    }

    /// Distances of a scan; -1 without a hit.
    fn distances(&mut self, scan: &Scan) -> Result<Vec<f64>, String> {
        self.ask(&format!("distances {}", scan.word))?;
        let line = self.line()?;
        let numbers: Result<_, _> = line.split_whitespace().map(str::parse).collect();
        numbers.map_err(|_| "the driver's distances are no numbers".to_owned())
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // The process may be gone already, as intended.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
