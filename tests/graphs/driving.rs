//! Robots that follow the keys pressed in `tools/scripts/drive.py`, and stop when they are released.

use std::io::Write as _;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use rustix::process::Signal;
use serde_json::Value;

use crate::exports::python;
use crate::program::printed;
use crate::support::{Run, machine, signal, workspace};

/// The script, ended with the test.
struct Keys(Child);

impl Keys {
    fn open(robot: &str) -> Option<Self> {
        let mut script = Command::new(python("termios")?);
        script.arg(workspace().join("tools/scripts/drive.py")).arg(robot).stdin(Stdio::piped());
        Some(Self(script.spawn().expect("the script starts")))
    }

    fn press(&mut self, key: u8) {
        self.0.stdin.as_mut().expect("a pipe").write_all(&[key]).expect("the script reads keys");
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A number of the newest sample of a topic, and the sample's time, in s.
fn newest(run: &Run, topic: &str, field: &str, entry: usize) -> (f64, f64) {
    let text = printed(&["topic", "echo", topic, "--run", run.folder.id(), "--count", "1", "--json"]);
    let sample: Value = serde_json::from_str(text.trim()).expect("JSON");
    let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("{sample}"));
    (number(&sample["value"][field][entry]), 1e-9 * number(&sample["source_time_ns"]))
}

/// Presses a key until a number has changed by `distance`, releases it, and waits until the number changes by
/// less than `rest` per second. The script stays alive. `options` are further options of the run.
fn drive(
    robot: &str,
    graph: &str,
    options: &[&str],
    (topic, field, entry): (&str, &str, usize),
    distance: f64,
    rest: f64,
) {
    let _machine = machine();
    let overlay = workspace().join(format!("graphs/overlays/{robot}-by-hand.toml"));
    let arguments = ["--with", overlay.to_str().expect("a path of text"), "--for", "120 s", "--force"];
    let arguments = [&arguments[..], options].concat();
    let Some(mut keys) = Keys::open(robot) else { return };
    let run = Run::start_when(&workspace().join("graphs").join(graph), &arguments, |plan, region| {
        let physics = plan.components.iter().position(|component| component.name == "physics");
        region.components()[physics.expect("physics")].steps.load(std::sync::atomic::Ordering::Relaxed) > 2000
    });
    let sample = || newest(&run, topic, field, entry);
    let ((start, _), begun) = (sample(), Instant::now());
    let mut last = start;
    while (last - start).abs() < distance {
        keys.press(b'w');
        (last, _) = sample();
        assert!(begun.elapsed() < Duration::from_secs(60), "{robot} moved by {}", last - start);
    }
    let released = Instant::now();
    let mut before = sample();
    loop {
        assert!(released.elapsed() < Duration::from_secs(60), "{robot} does not stop");
        let now = sample();
        let elapsed = now.1 - before.1;
        if elapsed < 0.5 {
            continue;
        }
        if (now.0 - before.0).abs() < rest * elapsed {
            break;
        }
        before = now;
    }
    assert!(keys.0.try_wait().expect("the script can be asked").is_none(), "the script has ended");
    signal(run.launcher(), Signal::INT);
    let ended = run.finish();
    let hand = &ended.report().results["hand"];
    assert!(hand["published"].as_u64() > Some(5) && hand["introduced"] == 1, "{hand}");
}

#[test]
fn rover_is_driven_by_hand() {
    drive("rover", "drive-square.toml", &[], ("rover/true_base", "position", 0), 0.2, 2e-3);
}

#[test]
fn arm_is_driven_by_hand() {
    drive("panda", "panda-reach.toml", &[], ("panda/true_joint_state", "position", 1), 0.1, 2e-3);
}

#[test]
fn quadruped_is_driven_by_hand() {
    // Without optimisation its components may be too slow for their full rates.
    let physics = "component.physics.rate=\"500 Hz\"";
    let planner = "component.planner.rate=\"100 Hz\"";
    drive(
        "quadruped",
        "quadruped-mpc.toml",
        &["--set", physics, "--set", planner],
        ("quadruped/true_base_state", "position", 0),
        0.2,
        0.06,
    );
}
