//! Table of measurements, printed line by line, and the table of targets.

use std::fmt::Write as _;

use comfy_table::CellAlignment;
use motorium_benches::latency::{Measurement, Target, Verdict, Written};

use crate::{report, style};

const NAME: usize = 27;
const WHAT: usize = 63;

/// Returns the header of the table.
pub(super) fn header() -> String {
    let columns = ["p50", "p99", "p99.9", "max"].map(|column| format!("{column:>9}")).join(" ");
    let line = format!("{:NAME$} {columns} {:>9}  {:WHAT$} host's share", "name", "samples", "us; what");
    style::strong(line).to_string()
}

/// Returns the row of one measurement, made on this core.
pub(super) fn row(measurement: &Measurement, core: usize) -> String {
    let ns = &measurement.ns;
    // unknown for a peer's own tool
    let known = |percentile: u64| {
        if percentile == 0 && ns.max > 0 { "-".to_string() } else { microseconds(percentile) }
    };
    let columns = [ns.p50, ns.p99, ns.p99_9, ns.max].map(|ns| format!("{:>9}", known(ns))).join(" ");
    let host = measurement.host.in_words(core);
    let line =
        format!("{:NAME$} {columns} {:>9}  {:WHAT$} {host}", measurement.name, ns.count, measurement.what);
    line.trim_end().to_string()
}

/// Returns a duration in microseconds; nanoseconds are shown below ten.
fn microseconds(ns: u64) -> String {
    match ns {
        ..10_000 => format!("{:.3}", ns as f64 * 1e-3),
        10_000..1_000_000 => format!("{:.1}", ns as f64 * 1e-3),
        1_000_000.. => format!("{:.0}", ns as f64 * 1e-3),
    }
}

/// Returns the closing part of the table: denied privileges, omitted measurements, and targets.
pub(super) fn closing(written: &Written) -> String {
    let mut text = String::new();
    for denied in &written.denied {
        let _ = writeln!(text, "\n{} {denied}", style::warning("denied:"));
    }
    for skipped in &written.skipped {
        let _ = writeln!(text, "{} {}: {}", style::dim("not measured:"), skipped.name, skipped.reason);
    }
    let mut table = report::table(["target", "at most", "measured", ""]);
    let mut why = String::new();
    for target in &written.targets {
        let word = match target.verdict {
            Verdict::Met => style::good("met"),
            Verdict::Missed => style::error("missed"),
            Verdict::NotMeasured => style::dim("not measured"),
        };
        let measured = target.measured.map_or("-".to_string(), |value| with_unit(value, target));
        let cells = [target.what.clone(), with_unit(target.at_most, target), measured, word.to_string()];
        table.add_row(cells);
        if let Some(host) = &target.host {
            let _ = writeln!(why, "missed: {}: {host}", target.what);
        }
    }
    for column in table.column_iter_mut().skip(1).take(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let _ = write!(text, "\n{}\n{why}", table.trim_fmt());
    text.push_str(&beside_a_sleeper(written).unwrap_or_default());
    text.push_str(&beside_copper(written).unwrap_or_default());
    let _ = writeln!(text, "took {:.0} s", written.seconds);
    text
}

/// Returns the hop across cores with a sleeping receiver; in a ping-pong without a pause it never sleeps.
fn beside_a_sleeper(written: &Written) -> Option<String> {
    let of = |name: &str| written.get(name).map(|measurement| measurement.ns.p50);
    let (hop, floor) = (of("hop.blocking.across.1khz.512")?, of("floor.futex.across.1khz")?);
    Some(format!(
        "for comparison: blocking hop across cores once a millisecond, so that its receiver sleeps: p50 {} us, {:.2} times the raw futex at that pace\n",
        microseconds(hop),
        hop as f64 / floor.max(1) as f64
    ))
}

/// Compares the chain with calls in one process: the cost of isolation.
fn beside_copper(written: &Written) -> Option<String> {
    let (ours, copper) = (written.get("chain.17")?, written.get("peer.copper.17")?);
    let ratio = |of: u64, to: u64| of as f64 / to.max(1) as f64;
    Some(format!(
        "for comparison: copper's caterpillar, 17 tasks in one process: p50 {} us, p99 {} us; motorium's 17 processes take {:.1} and {:.1} times as long\n",
        microseconds(copper.ns.p50),
        microseconds(copper.ns.p99),
        ratio(ours.ns.p50, copper.ns.p50),
        ratio(ours.ns.p99, copper.ns.p99),
    ))
}

fn with_unit(value: f64, target: &Target) -> String {
    let number = match value.abs() {
        x if x >= 100.0 => format!("{value:.0}"),
        x if x >= 0.1 => format!("{value:.2}"),
        _ => format!("{value:.4}"),
    };
    format!("{number} {}", target.unit).trim_end().to_string()
}

#[cfg(test)]
mod tests {
    use motorium_benches::Distribution;
    use motorium_benches::host::{HostShare, Machine};
    use motorium_benches::latency::{Skipped, VERSION, targets};

    use super::*;

    fn measured(name: &str, p50: u64) -> Measurement {
        Measurement {
            name: name.to_string(),
            what: "something".to_string(),
            ns: Distribution {
                count: 10,
                p50,
                p99: p50,
                p99_9: p50,
                max: 12_345_678,
                ..Distribution::default()
            },
            fifo: 80,
            host: HostShare { seconds: 1.0, steal_ms: 20.0, steal_share: 0.01, ..HostShare::default() },
            slices_p50: Vec::new(),
        }
    }

    #[test]
    fn row_shows_percentiles_maximum_and_stolen_time() {
        let row = row(&measured("hop.x", 1_234), 1);
        let words: Vec<&str> = row.split_whitespace().collect();
        assert_eq!(words[..6], ["hop.x", "1.234", "1.234", "1.234", "12346", "10"]);
        assert!(row.ends_with("steal 1.00 %"), "{row}");
    }

    #[test]
    fn target_table_shows_met_missed_and_unmeasured() {
        let measurements = vec![
            measured("hop.blocking.same.512", 4_000),
            measured("floor.futex.same", 2_000),
            measured("iceoryx2.same.512", 9_000),
            measured("chain.17", 100_000),
            measured("peer.copper.17", 50_000),
            measured("hop.blocking.across.1khz.512", 30_000),
            measured("floor.futex.across.1khz", 24_000),
        ];
        let written = Written {
            version: VERSION,
            motorium: String::new(),
            arguments: Vec::new(),
            began_unix_s: 0,
            machine: Machine::default(),
            load: String::new(),
            seconds: 12.4,
            denied: vec!["SCHED_FIFO 80 was denied".to_string()],
            targets: targets(&measurements),
            measurements,
            skipped: vec![Skipped { name: "peer.lcm".to_string(), reason: "not installed".to_string() }],
        };
        let text = anstream::adapter::strip_str(&closing(&written)).to_string();
        let line = |what: &str| text.lines().find(|line| line.contains(what)).unwrap().to_string();
        assert!(line("raw futex hand-off").ends_with("0.95      2.00  missed"), "{text}");
        assert!(line("stock iceoryx2").ends_with("0.50      0.44  met"), "{text}");
        assert!(line("caterpillar").ends_with("not measured"), "{text}");
        assert!(text.contains("denied: SCHED_FIFO 80 was denied"), "{text}");
        assert!(text.contains("not measured: peer.lcm: not installed"), "{text}");
        assert!(text.contains("missed: blocking hop, one core"), "{text}");
        assert!(text.contains("host took 20 ms"), "{text}");
        assert!(text.contains("receiver sleeps: p50 30.0 us, 1.25 times the raw futex"), "{text}");
        assert!(text.contains("take 2.0 and 2.0 times as long") && text.ends_with("took 12 s\n"), "{text}");
    }
}
