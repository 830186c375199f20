//! Comparison with Python packages. A process per package is called over a pipe, alternating with motorium.
//!
//! The script of a comparison gets the name of a package as its argument. It first prints the names of its
//! works (measured calls) in one line. It then reads lines: it answers a line with the name of a work by the
//! processor time of one call, ns, and a line `values NAME WORDS` by numbers.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};

/// Number of turns per side, and the minimum processor time of one turn, s.
const TURNS: usize = 40;
const TURN: f64 = 0.001;

/// A measured call.
pub struct Work {
    /// Name of the call, the same for all peers.
    pub name: &'static str,
    /// Function to call.
    pub run: Box<dyn FnMut()>,
}

/// Prints the time of each of the `works`, for motorium and for every peer. `script` is a file in
/// `benches/peers`. `MOTORIUM_PEER_PYTHON` names the Python that has the packages, by default `python3`.
/// Ratios are the times of the peers divided by motorium's time. Arguments of this program after `--peers`
/// select works by a part of their names. Returns the running peers.
///
/// # Errors
/// A peer does not start or does not answer. The error is a text.
pub fn compare(works: &mut [Work], script: &str, packages: &[&'static str]) -> Result<Vec<Peer>, String> {
    let peers = packages.iter().map(|package| Peer::start(script, package));
    let mut peers = peers.collect::<Result<Vec<_>, _>>()?;
    println!("us of processor time per call, minimum / median of {TURNS} turns, the sides in turn\n");
    print!("{:<22} {:>19}", "", "motorium");
    packages.iter().for_each(|package| print!(" {package:>19} {:>7}", "ratio"));
    println!();
    let words: Vec<String> = std::env::args().skip_while(|argument| argument != "--peers").skip(1).collect();
    let words: Vec<&String> = words.iter().filter(|word| !word.starts_with('-')).collect();
    let is_selected =
        |work: &&mut Work| words.is_empty() || words.iter().any(|word| work.name.contains(word.as_str()));
    for work in works.iter_mut().filter(is_selected) {
        let mut ours = Vec::new();
        let mut theirs = vec![Vec::new(); peers.len()];
        for _ in 0..TURNS {
            ours.push(seconds(work) * 1e6);
            for (peer, times) in peers.iter_mut().zip(&mut theirs) {
                if peer.works.iter().any(|name| name == work.name) {
                    times.push(peer.measure(work.name)? * 1e-3);
                }
            }
        }
        let own = median(&mut ours);
        print!("{:<22} {:>19}", work.name, shown(&ours));
        for mut times in theirs {
            // peers' median over motorium's
            let ratio = median(&mut times).zip(own).map(|(theirs, own)| format!("{:.1}", theirs / own));
            print!(" {:>19} {:>7}", shown(&times), ratio.as_deref().unwrap_or("-"));
        }
        println!();
    }
    Ok(peers)
}

/// Sorts the times and returns the median.
fn median(times: &mut [f64]) -> Option<f64> {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied()
}

/// Formats the minimum and the median of sorted times.
fn shown(times: &[f64]) -> String {
    match times.first() {
        None => "-".to_string(),
        Some(least) => format!("{least:.3} / {:.3}", times[times.len() / 2]),
    }
}

/// Returns the processor time of this program, which does not advance while other programs have the
/// processor.
pub fn processor_time() -> Duration {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    Duration::new(now.tv_sec.unsigned_abs(), u32::try_from(now.tv_nsec).unwrap_or_default())
}

/// Seconds per call, averaged over the calls that fill a turn.
fn seconds(work: &mut Work) -> f64 {
    let mut calls = 1_u32;
    loop {
        let start = processor_time();
        for _ in 0..calls {
            (work.run)();
        }
        let elapsed = (processor_time() - start).as_secs_f64();
        if elapsed >= TURN {
            return elapsed / f64::from(calls);
        }
        calls = calls.saturating_mul(2);
    }
}

/// A process of a script in `benches/peers` for one package.
pub struct Peer {
    name: &'static str,
    child: Child,
    ask: ChildStdin,
    answer: BufReader<ChildStdout>,
    works: Vec<String>,
}

impl Peer {
    /// Starts the script for a package.
    ///
    /// # Errors
    /// The script does not start or does not answer. The error is a text.
    pub fn start(script: &str, name: &'static str) -> Result<Self, String> {
        let python = std::env::var_os("MOTORIUM_PEER_PYTHON").unwrap_or_else(|| "python3".into());
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers").join(script);
        let mut child = Command::new(&python)
            .arg(script)
            .arg(name)
            // the linear algebra libraries of numpy would use every core; the comparison is on one core
            .envs([("OMP_NUM_THREADS", "1"), ("OPENBLAS_NUM_THREADS", "1")])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| format!("{} does not start: {error}", python.display()))?;
        let (ask, answer) = (child.stdin.take(), child.stdout.take());
        let (Some(ask), Some(answer)) = (ask, answer) else {
            return Err(format!("{name} has no pipes"));
        };
        let mut peer = Self { name, child, ask, answer: BufReader::new(answer), works: Vec::new() };
        peer.works = peer.line()?.split_whitespace().map(str::to_string).collect();
        Ok(peer)
    }

    /// Returns the processor time of one call of `work`, ns. If the line `work` describes several calls,
    /// returns the time of all these calls.
    ///
    /// # Errors
    /// The answer is not a number. The error is a text.
    pub fn measure(&mut self, work: &str) -> Result<f64, String> {
        let answer = self.values(work)?;
        match answer.as_slice() {
            [time] => Ok(*time),
            other => Err(format!("{} answered {} numbers, expected a time", self.name, other.len())),
        }
    }

    /// Returns the name of the package.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Sends a line and returns the numbers that the peer answers, such as the results of a call.
    ///
    /// # Errors
    /// The answer is not a list of numbers. The error is a text.
    pub fn values(&mut self, line: &str) -> Result<Vec<f64>, String> {
        let answer = self.exchange(line)?;
        let numbers = answer.split_whitespace().map(str::parse).collect::<Result<_, _>>();
        numbers.map_err(|_| format!("{} answered `{}`, expected numbers", self.name, answer.trim()))
    }

    /// Sends a line and returns the next line of the peer.
    ///
    /// # Errors
    /// The peer has ended. The error is a text.
    pub fn exchange(&mut self, line: &str) -> Result<String, String> {
        self.send(line)?;
        self.line()
    }

    /// Sends a line that has no answer.
    ///
    /// # Errors
    /// The peer has ended. The error is a text.
    pub fn send(&mut self, line: &str) -> Result<(), String> {
        writeln!(self.ask, "{line}")
            .map_err(|error| format!("{} does not read its input: {error}", self.name))
    }

    fn line(&mut self) -> Result<String, String> {
        let mut line = String::new();
        match self.answer.read_line(&mut line) {
            Ok(0) => Err(format!("{} ended: is it installed? help: set MOTORIUM_PEER_PYTHON", self.name)),
            Ok(_) => Ok(line),
            Err(error) => Err(format!("{} does not answer: {error}", self.name)),
        }
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // The peer has nothing to save, and may already have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
