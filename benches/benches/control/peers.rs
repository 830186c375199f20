//! Streams and cycles compared with solvers and libraries of PyPI. Each peer is a Python process that is
//! called over a pipe, alternating with motorium.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Instant;

use crate::bipeds::{Biped, Files};
use crate::planner;
use crate::streams::{Solves, Stream};
use crate::torque::{Motion, Tasks, TorqueCycle};
use crate::velocity;

/// Turns of each side, and cycles in a turn; a turn over a stream solves all of it.
const TURNS: usize = 40;
const CYCLES: usize = 100;

/// A row of the comparison: motorium's work, and the peers for the same work.
struct Row<'a> {
    name: String,
    /// Motorium's side.
    run: Box<dyn FnMut() + 'a>,
    /// Calls in a turn.
    calls: usize,
    /// The peers by name, and the file that each of them reads.
    peers: Vec<(&'a str, PathBuf)>,
}

/// Prints the times of every stream and cycle on all sides. `MOTORIUM_PEER_PYTHON`, `MOTORIUM_PLACO_PYTHON`
/// and `MOTORIUM_TSID_PYTHON` name the Pythons that have the packages, by default those created by
/// `benches/peers/fetch control`. A peer that does not start is reported and skipped.
pub(crate) fn compare(streams: &[Stream]) {
    let pythons = Pythons {
        placo: python("MOTORIUM_PLACO_PYTHON", "placo"),
        tsid: python("MOTORIUM_TSID_PYTHON", "tsid"),
        others: python("MOTORIUM_PEER_PYTHON", "control"),
    };
    println!(
        "us per solve or cycle, {TURNS} turns, the sides in turn; ratio of the medians: ours to theirs. DAQP, PIQP and ProxQP\n\
         time themselves, the others are called from Python (about half a microsecond more)\n"
    );
    println!("{:<34} {:<10} {:>8} {:>8} {:>8} {:>9} {:>7}", "", "", "p50", "p99", "p99.9", "max", "ratio");
    for stream in streams {
        let file = stream.file.iter();
        let mut solves = Solves::active_set(stream);
        let peers = ["daqp", "quadprog", "piqp", "proxqp", "clarabel"];
        let row = Row {
            name: stream.name.clone(),
            run: Box::new(move || solves.run()),
            calls: stream.problems.len(),
            peers: file.flat_map(|file| peers.map(|peer| (peer, file.clone()))).collect(),
        };
        row.measure(&pythons);
    }
    let files = Files::find(&pythons.others, Path::new(env!("CARGO_TARGET_TMPDIR")));
    let talos = files.as_ref().map_err(Clone::clone).and_then(|files| Biped::talos(&files.talos));
    let at = |file: fn(&Files) -> &PathBuf, peers: &[&'static str]| {
        let file = files.as_ref().ok().map(file);
        peers.iter().filter_map(|peer| Some((*peer, file?.clone()))).collect::<Vec<_>>()
    };
    let panda = at(|files| &files.panda, &["placo-panda", "pink-panda"]);
    Row::cycle("Panda, hand and posture in a sum", velocity::panda(false), panda).measure(&pythons);
    Row::cycle("Panda, hand above posture", velocity::panda(true), Vec::new()).measure(&pythons);
    let humanoid = Biped::catalogue();
    Row::cycle("humanoid, four levels", velocity::in_four_levels(&humanoid), Vec::new()).measure(&pythons);
    let mut torque = TorqueCycle::new(&humanoid, Tasks::Four, Motion::ToAndFro);
    Row::cycle("humanoid, torques, four tasks", move || _ = torque.run(), Vec::new()).measure(&pythons);
    Row::cycle("quadruped, horizon of ten steps", planner::trot(), Vec::new()).measure(&pythons);
    match talos {
        Err(error) => eprintln!(
            "no Talos: {error}; run benches/peers/fetch control, or set MOTORIUM_EXAMPLE_ROBOT_DATA"
        ),
        Ok(talos) => {
            let peers = at(|files| &files.talos, &["placo-talos"]);
            let cycle = velocity::on_held_feet(&talos);
            Row::cycle("Talos, held feet, com and hand", cycle, peers).measure(&pythons);
            let mut torque = TorqueCycle::new(&talos, Tasks::Two, Motion::ToAndFro);
            let peers = at(|files| &files.talos, &["tsid-talos"]);
            Row::cycle("Talos, torques, com and posture", move || _ = torque.run(), peers).measure(&pythons);
        }
    }
}

/// Returns the reduced Talos, if the data of the peers are available.
pub(crate) fn talos() -> Result<Biped, String> {
    let files =
        Files::find(&python("MOTORIUM_PEER_PYTHON", "control"), Path::new(env!("CARGO_TARGET_TMPDIR")));
    files.and_then(|files| Biped::talos(&files.talos))
}

/// Returns the Python named by a variable, or the one in the user's cache.
fn python(variable: &str, folder: &str) -> PathBuf {
    let home = || std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".cache"));
    let cache = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from).or_else(home).unwrap_or_default();
    let fetched = cache.join("motorium/peers").join(folder).join("bin/python3");
    std::env::var_os(variable).map_or(fetched, PathBuf::from)
}

/// The Pythons that have the packages of the peers.
struct Pythons {
    placo: PathBuf,
    tsid: PathBuf,
    others: PathBuf,
}

impl Pythons {
    /// Returns the Python of a peer.
    fn python(&self, peer: &str) -> &Path {
        match peer.split('-').next() {
            Some("placo") => &self.placo,
            Some("tsid") => &self.tsid,
            _ => &self.others,
        }
    }
}

impl<'a> Row<'a> {
    fn cycle(name: &str, run: impl FnMut() + 'a, peers: Vec<(&'a str, PathBuf)>) -> Self {
        Self { name: name.to_owned(), run: Box::new(run), calls: CYCLES, peers }
    }

    fn measure(mut self, pythons: &Pythons) {
        let mut peers = Vec::new();
        for (name, file) in &self.peers {
            match Peer::start(pythons.python(name), name, file) {
                Ok(peer) => peers.push((name.split('-').next().unwrap_or(name), peer)),
                Err(error) => eprintln!("no {name}: {error}"),
            }
        }
        // like the peers, discard the first turn
        (0..self.calls).for_each(|_| (self.run)());
        let mut ours = Vec::with_capacity(TURNS * self.calls);
        let mut theirs = vec![Vec::new(); peers.len()];
        for _ in 0..TURNS {
            for _ in 0..self.calls {
                let start = Instant::now();
                (self.run)();
                ours.push(start.elapsed().as_nanos() as f64 * 1e-3);
            }
            for ((name, peer), times) in peers.iter_mut().zip(&mut theirs) {
                if let Err(error) = peer.turn(times) {
                    eprintln!("{name}: {error}");
                }
            }
        }
        let names = std::iter::once("motorium").chain(peers.iter().map(|(name, _)| *name));
        let mut own = None;
        let mut label = self.name.as_str();
        for (name, mut times) in names.zip(std::iter::once(ours).chain(theirs)) {
            times.sort_by(f64::total_cmp);
            let at = |share: f64| {
                let place = (times.len() as f64 * share).ceil() as usize;
                times.get(place.clamp(1, times.len().max(1)) - 1).copied().unwrap_or(f64::NAN)
            };
            let median = at(0.5);
            let ratio = own.map_or(String::new(), |own: f64| format!("{:.2}", own / median));
            println!(
                "{label:<34} {name:<10} {median:>8.2} {:>8.2} {:>8.2} {:>9.2} {ratio:>7}",
                at(0.99),
                at(0.999),
                at(1.0)
            );
            own = own.or(Some(median));
            label = "";
        }
    }
}

struct Peer {
    child: Child,
    ask: ChildStdin,
    answer: BufReader<ChildStdout>,
}

impl Peer {
    fn start(python: &Path, name: &str, file: &Path) -> Result<Self, String> {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/control.py");
        let mut child = Command::new(python)
            .arg(script)
            .arg(name)
            .arg(file)
            .envs([("OMP_NUM_THREADS", "1"), ("OPENBLAS_NUM_THREADS", "1")])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| {
                format!("{}: {error}; benches/peers/fetch control makes it", python.display())
            })?;
        let pipes = child.stdin.take().zip(child.stdout.take());
        let (ask, answer) = pipes.ok_or("the peer has no pipes")?;
        let mut peer = Self { child, ask, answer: BufReader::new(answer) };
        // earlier output comes from its packages
        while peer.line()? != "ready" {}
        Ok(peer)
    }

    fn line(&mut self) -> Result<String, String> {
        let mut line = String::new();
        match self.answer.read_line(&mut line) {
            Ok(0) => Err("it ended; are its packages (benches/peers/control.txt) there?".into()),
            Ok(_) => Ok(line.trim().to_owned()),
            Err(error) => Err(format!("it does not answer: {error}")),
        }
    }

    /// Appends the times of one turn, us.
    fn turn(&mut self, times: &mut Vec<f64>) -> Result<(), String> {
        writeln!(self.ask, "turn").map_err(|error| format!("it does not listen: {error}"))?;
        for number in self.line()?.split_whitespace() {
            times.push(number.parse().map_err(|_| format!("it answers `{number}`"))?);
        }
        Ok(())
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It has nothing to save, and may be gone already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
