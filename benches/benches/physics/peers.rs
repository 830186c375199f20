//! Comparison with MuJoCo and PyBullet: a Python driver holds their simulations and is called over a pipe,
//! alternating with motorium. The driver measures library calls of [`STEPS`] steps each.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use crate::scenes::Scene;
use crate::{STEPS, TURNS, figures, turn};

const INSTALL: &str = "pip install mujoco pybullet numpy in a virtual environment, and set MOTORIUM_PEERS_PYTHON to \
                       its python3";

/// Prints the time of every scene on all sides, and the ratios of the medians to MuJoCo's.
pub(crate) fn compare(scenes: &mut [Scene]) -> Result<(), String> {
    println!("{:<24} {:>23} {:>23} {:>23} {:>9}", "scene", "motorium", "mujoco", "pybullet", "to mujoco");
    for scene in scenes {
        let mut peers = ["mujoco", "pybullet"]
            .into_iter()
            .map(|engine| Peer::start(engine, scene.motion.word(), scene.boxes, &scene.urdf))
            .collect::<Result<Vec<_>, _>>()?;
        let mut ours = Vec::with_capacity(TURNS);
        let mut theirs = vec![Vec::with_capacity(TURNS); peers.len()];
        for _ in 0..TURNS {
            ours.push(turn(scene));
            for (peer, times) in peers.iter_mut().zip(&mut theirs) {
                times.extend(peer.turn()?);
            }
        }
        let own = figures(&mut ours);
        let cells: Vec<String> = theirs
            .iter_mut()
            .map(|times| if times.is_empty() { "-".into() } else { figures(times) })
            .collect();
        let ratio = if theirs[0].is_empty() {
            "-".to_owned()
        } else {
            format!("{:.2}", ours[ours.len() / 2] / theirs[0][theirs[0].len() / 2])
        };
        println!(
            "{:<24} {own:>23} {:>23} {:>23} {ratio:>9}   {}",
            scene.name,
            cells[0],
            cells[1],
            scene.contacts()
        );
    }
    Ok(())
}

/// Returns the URDF of a robot of the catalogue.
pub(crate) fn urdf(robot: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robots/catalogue").join(robot);
    folder.join(robot).with_extension("urdf")
}

/// A peer's simulation behind a pipe.
pub(crate) struct Peer {
    process: Child,
    questions: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Peer {
    /// Starts the driver with a motion, a number of boxes (or robots), and a robot.
    pub(crate) fn start(engine: &str, motion: &str, boxes: usize, urdf: &Path) -> Result<Self, String> {
        let python = std::env::var_os("MOTORIUM_PEERS_PYTHON").unwrap_or_else(|| "python3".into());
        let mut process = Command::new(python)
            .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/physics.py"))
            .args([engine, motion, &STEPS.to_string(), &boxes.to_string()])
            .arg(urdf)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| format!("cannot start python3: {error}; {INSTALL}"))?;
        let (questions, answers) =
            process.stdin.take().zip(process.stdout.take()).ok_or("the driver has no pipes")?;
        let mut peer = Self { process, questions, answers: BufReader::new(answers) };
        match peer.line()?.trim() {
            "ready" => Ok(peer),
            other => Err(format!("the driver of {engine} says \"{other}\"; {INSTALL}")),
        }
    }

    fn line(&mut self) -> Result<String, String> {
        let mut line = String::new();
        let read = self.answers.read_line(&mut line);
        if read.map_err(|error| format!("the driver is gone: {error}"))? == 0 {
            return Err(format!("the driver does not start; {INSTALL}"));
        }
        Ok(line)
    }

    /// Returns the microseconds per step, or another figure defined by the motion; `None` if the engine does
    /// not support the scene.
    pub(crate) fn turn(&mut self) -> Result<Option<f64>, String> {
        writeln!(self.questions, "turn").map_err(|error| format!("the driver is gone: {error}"))?;
        let line = self.line()?;
        if line.trim() == "cannot" {
            return Ok(None);
        }
        line.trim().parse().map(Some).map_err(|_| format!("the driver says \"{}\"", line.trim()))
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // The process may be gone already, as intended.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
