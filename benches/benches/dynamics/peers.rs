//! Comparison with Pinocchio. A driver program for Pinocchio is built and called over a pipe, alternating
//! with motorium.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Instant;

use crate::quantities::{Bench, NAMES};
use crate::robots::Subject;

/// Number of turns per side, and of calls timed together in a turn: short enough that other programs rarely
/// interfere.
const TURNS: usize = 200;
const CALLS: usize = 64;

/// Prints the time of every quantity on both sides, and the ratio of the medians.
pub(crate) fn compare(subjects: &[Subject]) -> Result<(), String> {
    let program = build()?;
    println!("ns per call, minimum / median of {TURNS} turns of {CALLS} calls, the sides in turn\n");
    println!(
        "{:<10} {:<20} {:>17} {:>17} {:>7} {:>7}",
        "robot", "quantity", "motorium", "pinocchio", "min", "median"
    );
    for subject in subjects {
        let mut peer = Peer::start(&program, subject)?;
        for name in NAMES {
            let mut bench = Bench::new(subject);
            if !bench.run(name) {
                continue;
            }
            let (mut ours, mut theirs) = (Vec::new(), Vec::new());
            for _ in 0..TURNS {
                let start = Instant::now();
                for _ in 0..CALLS {
                    bench.run(name);
                }
                ours.push(start.elapsed().as_nanos() as f64 / CALLS as f64);
                theirs.push(peer.measure(name)?);
            }
            ours.sort_by(f64::total_cmp);
            theirs.sort_by(f64::total_cmp);
            let median = |times: &[f64]| times[times.len() / 2];
            println!(
                "{:<10} {:<20} {:>8.0}/{:>8.0} {:>8.0}/{:>8.0} {:>7.2} {:>7.2}",
                subject.name,
                name,
                ours[0],
                median(&ours),
                theirs[0],
                median(&theirs),
                ours[0] / theirs[0],
                median(&ours) / median(&theirs)
            );
        }
    }
    Ok(())
}

/// Builds the driver against the headers and libraries of the PyPI package `pin`.
fn build() -> Result<PathBuf, String> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/pinocchio.cpp");
    let prefix = prefix()?;
    // Cached between runs: compilation lasts minutes.
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("pinocchio");
    let written = |path: &Path| std::fs::metadata(path).and_then(|data| data.modified()).ok();
    if written(&program) > written(&source) {
        return Ok(program);
    }
    let (include, lib) = (prefix.join("include"), prefix.join("lib"));
    let output = Command::new(std::env::var_os("CXX").unwrap_or_else(|| "g++".into()))
        .args(["-O3", "-DNDEBUG", "-std=c++17"])
        .arg(&source)
        .arg("-I")
        .arg(&include)
        .arg("-I")
        .arg(include.join("eigen3"))
        .arg("-I")
        .arg(include.join("urdfdom_headers"))
        // Its list of joints is longer than Boost's default.
        .args(["-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", "-DBOOST_MPL_LIMIT_LIST_SIZE=30"])
        .args(["-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION"])
        .arg("-L")
        .arg(&lib)
        .arg(format!("-Wl,-rpath,{}", lib.display()))
        .args(["-lpinocchio_default", "-lpinocchio_parsers"])
        .arg("-o")
        .arg(&program)
        .output()
        .map_err(|error| format!("cannot run the C++ compiler: {error}; set CXX"))?;
    if output.status.success() {
        return Ok(program);
    }
    Err(format!("the driver does not compile:\n{}", String::from_utf8_lossy(&output.stderr)))
}

/// Returns the folder of Pinocchio's headers and libraries: `MOTORIUM_PINOCCHIO`, or the one of `python3` on
/// the path.
fn prefix() -> Result<PathBuf, String> {
    const INSTALL: &str = "pip install pin==4.1.0 cmeel-eigen cmeel-urdfdom-headers, and set MOTORIUM_PINOCCHIO to the \
                           folder cmeel.prefix of its site-packages";
    if let Some(folder) = std::env::var_os("MOTORIUM_PINOCCHIO") {
        return Ok(PathBuf::from(folder));
    }
    let output = Command::new("python3")
        .args(["-c", "import sysconfig; print(sysconfig.get_path('purelib'))"])
        .output()
        .map_err(|error| format!("cannot run python3: {error}; {INSTALL}"))?;
    let folder = PathBuf::from(String::from_utf8_lossy(&output.stdout).trim()).join("cmeel.prefix");
    if folder.join("include/pinocchio").is_dir() { Ok(folder) } else { Err(INSTALL.to_owned()) }
}

struct Peer {
    process: Child,
    questions: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Peer {
    fn start(program: &Path, subject: &Subject) -> Result<Self, String> {
        let mut process = Command::new(program)
            .arg(&subject.urdf)
            .arg(if subject.floating { "floating" } else { "fixed" })
            .arg(subject.frame)
            .arg(CALLS.to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| format!("cannot start the driver: {error}"))?;
        let (questions, answers) =
            process.stdin.take().zip(process.stdout.take()).ok_or("the driver has no pipes")?;
        Ok(Self { process, questions, answers: BufReader::new(answers) })
    }

    /// Nanoseconds per call.
    fn measure(&mut self, name: &str) -> Result<f64, String> {
        writeln!(self.questions, "{name}").map_err(|error| format!("the driver is gone: {error}"))?;
        let mut line = String::new();
        self.answers.read_line(&mut line).map_err(|error| format!("the driver is gone: {error}"))?;
        line.trim().parse().map_err(|_| format!("the driver says \"{}\" to {name}", line.trim()))
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // The process may be gone already, as intended.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
