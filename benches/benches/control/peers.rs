//! The streams beside DAQP and quadprog from PyPI: a Python process is asked over a pipe, in turn with our own code.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use crate::streams::{Solves, Stream};

/// Turns of each side; a turn solves the whole stream.
const TURNS: usize = 20;

/// Prints the median time of a solve on all sides. `MOTORIUM_PEER_PYTHON` names the Python that has the packages
/// (`pip install -r benches/peers/control.txt`), by default `python3`.
pub(crate) fn compare(streams: &[Stream]) -> Result<(), String> {
    println!(
        "us per solve, median of {TURNS} turns over a whole stream, the sides in turn; DAQP times itself\n"
    );
    println!("{:<14} {:>12} {:>12} {:>12} {:>12}", "stream", "motorium", "clarabel", "daqp", "ratio");
    for stream in streams {
        let Some(file) = &stream.file else { continue };
        let mut peer = Peer::start(file)?;
        let (mut ours, mut reference) = (Solves::active_set(stream), Solves::clarabel(stream));
        let mut times = [Vec::new(), Vec::new(), Vec::new()];
        for _ in 0..TURNS {
            for (solves, times) in [&mut ours, &mut reference].into_iter().zip(&mut times) {
                let start = Instant::now();
                for _ in 0..stream.problems.len() {
                    solves.run();
                }
                times.push(start.elapsed().as_secs_f64() * 1e6 / stream.problems.len() as f64);
            }
            times[2].push(peer.turn()?);
        }
        let [ours, clarabel, daqp] = times.map(median);
        let ratio = ours / daqp;
        println!("{:<14} {ours:>12.2} {clarabel:>12.2} {daqp:>12.2} {ratio:>12.2}", stream.name);
    }
    Ok(())
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

struct Peer {
    child: std::process::Child,
    ask: std::process::ChildStdin,
    answer: BufReader<std::process::ChildStdout>,
}

impl Peer {
    fn start(file: &Path) -> Result<Self, String> {
        let python = std::env::var_os("MOTORIUM_PEER_PYTHON").unwrap_or_else(|| "python3".into());
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/control.py");
        let mut child = Command::new(&python)
            .arg(script)
            .arg(file)
            .envs([("OMP_NUM_THREADS", "1"), ("OPENBLAS_NUM_THREADS", "1")])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| format!("{} does not start: {error}", python.display()))?;
        let pipes = child.stdin.take().zip(child.stdout.take());
        let (ask, answer) = pipes.ok_or("the peer has no pipes")?;
        Ok(Self { child, ask, answer: BufReader::new(answer) })
    }

    /// Median of the times of one turn over the stream, us per solve.
    fn turn(&mut self) -> Result<f64, String> {
        writeln!(self.ask, "turn").map_err(|error| format!("the peer does not listen: {error}"))?;
        let mut line = String::new();
        match self.answer.read_line(&mut line) {
            Ok(0) => {
                Err("the peer ended; pip install -r benches/peers/control.txt, and set MOTORIUM_PEER_PYTHON"
                    .into())
            }
            Ok(_) => line.trim().parse().map_err(|_| format!("the peer answers `{}`", line.trim())),
            Err(error) => Err(format!("the peer does not answer: {error}")),
        }
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It has nothing to save; when it is gone already, all the better.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
