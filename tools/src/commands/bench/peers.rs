//! Measurements of comparable installed systems (peers): runs `benches/peers/measure` and reads the
//! measurements that it prints.

use std::io::{BufRead as _, BufReader};
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
    /// Samples of a measurement.
    Measured {
        name: String,
        what: String,
        #[serde(default)]
        fifo: u32,
        samples_ns: Vec<u64>,
    },
    /// Percentiles, from a tool that does not print its samples.
    Summary { name: String, what: String, count: u64, mean_ns: u64, p50_ns: u64, p99_ns: u64, max_ns: u64 },
    /// A system that was not measured, with the reason.
    Skipped { name: String, skipped: String },
}

/// Measures the peers in sequence, and reports each result as it arrives, including systems that are not
/// installed. Peers that support it are pinned to `core`.
pub(super) fn measure(core: usize, mut report: impl FnMut(Result<Measurement, Skipped>)) {
    let mut fail = |reason: String| report(Err(Skipped { name: "peers".to_string(), reason }));
    if !Path::new(SCRIPT).is_file() {
        return fail(format!("{SCRIPT} was not found: run this command in a checkout of motorium"));
    }
    let child =
        Command::new(SCRIPT).arg(core.to_string()).stdin(Stdio::null()).stdout(Stdio::piped()).spawn();
    let mut child = match child {
        Ok(child) => child,
        Err(error) => return fail(format!("{SCRIPT} could not be started: {error}")),
    };
    let mut watch = Watch::start();
    for line in child
        .stdout
        .take()
        .into_iter()
        .flat_map(|stdout| BufReader::new(stdout).lines())
        .map_while(Result::ok)
    {
        let host = core::mem::replace(&mut watch, Watch::start()).stop();
        report(match serde_json::from_str(&line) {
            Ok(Line::Measured { name, what, fifo, samples_ns }) => Ok(Measurement {
                name: format!("peer.{name}"),
                what,
                ns: Distribution::from_samples(samples_ns),
                fifo,
                host,
                slices_p50: Vec::new(),
            }),
            Ok(Line::Summary { name, what, count, mean_ns, p50_ns, p99_ns, max_ns }) => Ok(Measurement {
                name: format!("peer.{name}"),
                what,
                // the rest of the distribution is unknown
                ns: Distribution {
                    count,
                    mean: mean_ns as f64,
                    p50: p50_ns,
                    p99: p99_ns,
                    max: max_ns,
                    ..Distribution::default()
                },
                fifo: 0,
                host,
                slices_p50: Vec::new(),
            }),
            Ok(Line::Skipped { name, skipped }) => {
                Err(Skipped { name: format!("peer.{name}"), reason: skipped })
            }
            Err(error) => Err(Skipped {
                name: "peers".to_string(),
                reason: format!("{SCRIPT} printed an unknown format: {error}"),
            }),
        });
    }
    match child.wait() {
        Ok(status) if status.success() => {}
        Ok(status) => {
            report(Err(Skipped { name: "peers".to_string(), reason: format!("{SCRIPT}: {status}") }))
        }
        Err(error) => report(Err(Skipped { name: "peers".to_string(), reason: error.to_string() })),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn line_is_either_samples_or_a_reason_for_their_absence() {
        let line: Line = serde_json::from_str(r#"{"name":"lcm","what":"x","samples_ns":[1,2]}"#).unwrap();
        let measured =
            Line::Measured { name: "lcm".into(), what: "x".into(), fifo: 0, samples_ns: vec![1, 2] };
        assert_eq!(line, measured);
        let summary = r#"{"name":"d","what":"x","count":9,"mean_ns":5,"p50_ns":4,"p99_ns":7,"max_ns":8}"#;
        let line: Line = serde_json::from_str(summary).unwrap();
        assert!(matches!(line, Line::Summary { count: 9, p50_ns: 4, p99_ns: 7, max_ns: 8, .. }), "{line:?}");
        let line: Line = serde_json::from_str(r#"{"name":"dora","skipped":"not installed"}"#).unwrap();
        assert_eq!(line, Line::Skipped { name: "dora".into(), skipped: "not installed".into() });
    }
}
