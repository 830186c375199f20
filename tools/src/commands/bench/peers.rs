//! Other systems, as far as they are installed: `benches/peers/measure` runs them and tells what it saw.

use std::path::Path;
use std::process::{Command, Stdio};

use motorium_benches::Distribution;
use motorium_benches::host::Watch;
use motorium_benches::latency::{Measurement, Skipped};
use serde::Deserialize;

/// The script that measures the peers, from the folder of the checkout.
const SCRIPT: &str = "benches/peers/measure";

/// One line of the script's output.
#[derive(Debug, Deserialize, PartialEq)]
#[serde(untagged)]
enum Line {
    /// Its samples.
    Measured { name: String, what: String, samples_ns: Vec<u64> },
    /// Why there are none.
    Skipped { name: String, skipped: String },
}

/// Measures the peers. Each that is not installed is named.
pub(super) fn measure() -> (Vec<Measurement>, Vec<Skipped>) {
    let mut found = (Vec::new(), Vec::new());
    let nothing = |reason: String| (Vec::new(), vec![Skipped { name: "peers".to_string(), reason }]);
    if !Path::new(SCRIPT).is_file() {
        return nothing(format!("there is no {SCRIPT} here: start this in a checkout of motorium"));
    }
    let watch = Watch::start();
    let output = match Command::new(SCRIPT).stdin(Stdio::null()).stderr(Stdio::inherit()).output() {
        Ok(output) => output,
        Err(error) => return nothing(format!("{SCRIPT} could not be started: {error}")),
    };
    let host = watch.stop();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        match serde_json::from_str(line) {
            Ok(Line::Measured { name, what, samples_ns }) => {
                let ns = Distribution::of(samples_ns);
                found.0.push(Measurement {
                    name: format!("peer.{name}"),
                    what,
                    ns,
                    fifo: 0,
                    host,
                    slices_p50: Vec::new(),
                });
            }
            Ok(Line::Skipped { name, skipped }) => {
                found.1.push(Skipped { name: format!("peer.{name}"), reason: skipped });
            }
            Err(error) => found.1.push(Skipped {
                name: "peers".to_string(),
                reason: format!("{SCRIPT} said what is not understood: {error}"),
            }),
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_either_samples_or_the_reason_why_there_are_none() {
        let line: Line = serde_json::from_str(r#"{"name":"lcm","what":"x","samples_ns":[1,2]}"#).unwrap();
        assert_eq!(line, Line::Measured { name: "lcm".into(), what: "x".into(), samples_ns: vec![1, 2] });
        let line: Line = serde_json::from_str(r#"{"name":"dora","skipped":"not installed"}"#).unwrap();
        assert_eq!(line, Line::Skipped { name: "dora".into(), skipped: "not installed".into() });
    }
}
