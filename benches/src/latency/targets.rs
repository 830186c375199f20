//! Targets: upper limits on ratios between the measurements of one run.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Measurement;
use super::miss::Miss;
use super::seen::Seen;

/// Verdict on a target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The target was met.
    Met,
    /// The target was missed.
    Missed,
    /// A value that the target compares was not measured in this run.
    NotMeasured,
}

/// A target and its measured value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Target {
    /// Description of the compared quantities.
    pub what: String,
    /// Largest value that meets the target, in `unit`.
    pub at_most: f64,
    /// Unit; empty for a ratio.
    pub unit: String,
    /// Measured value, in `unit`; `None` if it was not measured.
    pub measured: Option<f64>,
    /// Verdict on the target.
    pub verdict: Verdict,
    /// For a missed target: description of the influence of the machine and its host.
    pub host: Option<String>,
    /// For a missed target: share of the excess that a comparable measurement of the bare machine also shows
    /// in the same run, 0 to 1. `None` without a comparable measurement.
    pub host_share: Option<f64>,
}

type Value = fn(&Seen<'_>) -> Option<f64>;

/// Name, largest value, unit, formula, and the measurement whose host share counts.
const TARGETS: &[(&str, f64, &str, Value, &str)] = &[
    (
        "blocking hop, one core, 512 B, p50 / raw futex hand-off",
        0.95,
        "",
        |seen| seen.ratio("hop.blocking.same.512", "floor.futex.same"),
        "hop.blocking.same.512",
    ),
    (
        "the same / stock iceoryx2 event + publish-subscribe",
        0.5,
        "",
        |seen| seen.ratio("hop.blocking.same.512", "iceoryx2.same.512"),
        "hop.blocking.same.512",
    ),
    (
        "blocking hop across cores, 512 B, p50 / raw futex across cores",
        0.7,
        "",
        |seen| seen.ratio("hop.blocking.across.512", "floor.futex.across"),
        "hop.blocking.across.512",
    ),
    (
        "polling hop across cores, 512 B, p50 / cache-line ping-pong",
        3.0,
        "",
        |seen| seen.ratio("hop.polling.across.512", "floor.cache-line"),
        "hop.polling.across.512",
    ),
    (
        "polling hop across cores, 512 B, p50 / a word and 512 B of plain memory",
        1.15,
        "",
        |seen| seen.ratio("hop.polling.across.512", "floor.plain.512"),
        "hop.polling.across.512",
    ),
    (
        "blocking hop across cores, 64 KiB written and read, p50 / the same in plain memory",
        1.0,
        "",
        |seen| seen.ratio("hop.blocking.across.65536", "floor.plain-blocking.65536"),
        "hop.blocking.across.65536",
    ),
    (
        "blocking hop across cores, 1 MiB written and read, p50 / the same in plain memory",
        1.0,
        "",
        |seen| seen.ratio("hop.blocking.across.1048576", "floor.plain-blocking.1048576"),
        "hop.blocking.across.1048576",
    ),
    (
        "reading the newest state of 1 MiB without touching its bytes, p50",
        0.2,
        "us",
        |seen| seen.p50_us("read.newest.1048576"),
        "read.newest.1048576",
    ),
    (
        "reading the newest state of 512 B from outside the graph, p50",
        0.2,
        "us",
        |seen| seen.p50_us("read.outside.512"),
        "read.outside.512",
    ),
    (
        "reading the newest state of 1 MiB from outside the graph, p50",
        0.2,
        "us",
        |seen| seen.p50_us("read.outside.1048576"),
        "read.outside.1048576",
    ),
    (
        "release lateness at 1 kHz, p99 / p50 of plain clock_nanosleep",
        0.01,
        "",
        |seen| Some(seen.get("release.1khz")?.ns.p99 as f64 / seen.get("floor.timer")?.ns.p50.max(1) as f64),
        "release.1khz",
    ),
    (
        "worker overhead per step beyond hop and user code, p50",
        0.3,
        "us",
        |seen| seen.worker_overhead(),
        "chain.8",
    ),
    (
        "command gate of 7 joints per step beyond a check of numbers and age, p50",
        0.1,
        "us",
        |seen| seen.beyond("gate", "floor.gate", 1.0),
        "gate",
    ),
    (
        "first step of an episode beyond any other step, p50",
        0.3,
        "us",
        |seen| seen.beyond("episode", "floor.episode", 1.0),
        "episode",
    ),
    (
        "chain of 8 processes on one core, each step traced, p50 / without a trace",
        1.05,
        "",
        |seen| seen.ratio("chain.8.traced", "chain.8"),
        "chain.8.traced",
    ),
    (
        "chain of 4 processes on one core, p50 / the bare futex chain of 4",
        1.1,
        "",
        |seen| seen.ratio("chain.4", "floor.chain.4"),
        "chain.4",
    ),
    (
        "chain of 4 processes on one core, p99 / the bare futex chain of 4",
        1.2,
        "",
        |seen| seen.ratio_of_p99("chain.4", "floor.chain.4"),
        "chain.4",
    ),
    (
        "chain of 4 processes on one core, p99 / 4 hops",
        1.5,
        "",
        |seen| {
            let hops = 4.0 * seen.get("hop.blocking.same.512")?.ns.p50.max(1) as f64;
            Some(seen.get("chain.4")?.ns.p99 as f64 / hops)
        },
        "chain.4",
    ),
    (
        "caterpillar of 17 processes, p99 / dora's",
        0.05,
        "",
        |seen| seen.ratio_of_p99("chain.17", "peer.dora.17"),
        "chain.17",
    ),
    (
        "the same / dora's, forced to FIFO on one core",
        0.05,
        "",
        |seen| seen.ratio_of_p99("chain.17", "peer.dora.17.fifo"),
        "chain.17",
    ),
    ("Panda loop, idle, p99.9", 300.0, "us", |seen| seen.p99_9_us("panda"), "panda"),
    ("Panda loop, under load, p99.9", 300.0, "us", |seen| seen.p99_9_us("panda.loaded"), "panda.loaded"),
    (
        "Panda loop, p99.9 with a policy of 54,464 weights / without, idle",
        1.3,
        "",
        |seen| seen.ratio_of_p99_9("panda.policy", "panda"),
        "panda.policy",
    ),
    (
        "step of policy.joint_targets, with its policy at 50 Hz, p50",
        3.0,
        "us",
        |seen| seen.p50_us("joint-targets"),
        "joint-targets",
    ),
    (
        "step of policy.joint_targets, with its policy at 50 Hz, p99.9",
        15.0,
        "us",
        |seen| seen.p99_9_us("joint-targets"),
        "joint-targets",
    ),
    (
        "step of policy.latent for three arms, without allocation, p50",
        20.0,
        "us",
        |seen| seen.p50_us("latent"),
        "latent",
    ),
    (
        "Panda loop, p99.9 under load / idle",
        1.5,
        "",
        |seen| seen.ratio_of_p99_9("panda.loaded", "panda"),
        "panda.loaded",
    ),
];

/// Evaluates all targets with the measurements of one run.
pub fn targets(measured: &[Measurement]) -> Vec<Target> {
    let seen = Seen(measured);
    let fill = |(what, at_most, unit, value, blamed): &(&str, f64, &str, Value, &str)| {
        let measured = value(&seen);
        let verdict = match measured {
            None => Verdict::NotMeasured,
            // Anything not clearly within the target is a miss, including NaN.
            Some(value) if value <= *at_most => Verdict::Met,
            Some(_) => Verdict::Missed,
        };
        let miss = measured
            .filter(|_| verdict == Verdict::Missed)
            .and_then(|measured| Miss::new(&seen, (what, blamed), *at_most, measured));
        Target {
            what: (*what).to_string(),
            at_most: *at_most,
            unit: (*unit).to_string(),
            measured,
            verdict,
            host: miss.as_ref().map(Miss::in_words),
            host_share: miss.as_ref().and_then(|miss| miss.share),
        }
    };
    TARGETS.iter().map(fill).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Distribution;
    use crate::host::HostShare;

    fn measured(name: &str, p50: u64, p99: u64, p99_9: u64) -> Measurement {
        Measurement {
            name: name.to_string(),
            what: String::new(),
            ns: Distribution { count: 1_000, p50, p99, p99_9, max: p99_9, ..Distribution::default() },
            fifo: 80,
            host: HostShare { seconds: 2.0, steal_ms: 40.0, steal_share: 0.01, ..HostShare::default() },
            slices_p50: Vec::new(),
        }
    }

    fn find<'a>(table: &'a [Target], what: &str) -> &'a Target {
        table.iter().find(|target| target.what.contains(what)).unwrap()
    }

    #[test]
    fn ratio_meets_its_target_up_to_the_bound() {
        let good = [measured("hop.blocking.same.512", 950, 0, 0), measured("floor.futex.same", 1_000, 0, 0)];
        let table = targets(&good);
        let target = find(&table, "raw futex hand-off");
        assert_eq!((target.measured, target.verdict), (Some(0.95), Verdict::Met));
        let bad = [measured("hop.blocking.same.512", 960, 0, 0), measured("floor.futex.same", 1_000, 0, 0)];
        let table = targets(&bad);
        assert_eq!(find(&table, "raw futex hand-off").verdict, Verdict::Missed);
    }

    #[test]
    fn alternating_measurements_are_compared_by_turn() {
        let mut hop = measured("hop.polling.across.512", 700, 0, 0);
        let mut floor = measured("floor.cache-line", 280, 0, 0);
        // The host moved the cores apart after the first turn: ratios of 3, 2, 2 instead of 700 to 280.
        hop.slices_p50 = vec![180, 560, 700];
        floor.slices_p50 = vec![60, 280, 350];
        let table = targets(&[hop, floor]);
        assert_eq!(find(&table, "cache-line").measured, Some(2.0));
    }

    #[test]
    fn unmeasured_target_has_no_verdict() {
        let table = targets(&[measured("hop.blocking.same.512", 1, 1, 1)]);
        assert!(
            table.iter().all(|target| target.verdict == Verdict::NotMeasured && target.measured.is_none())
        );
    }

    #[test]
    fn only_a_miss_describes_the_host() {
        let table = targets(&[
            measured("panda", 100_000, 150_000, 500_000),
            measured("panda.loaded", 100_000, 150_000, 200_000),
        ]);
        let missed = find(&table, "Panda loop, idle");
        assert_eq!((missed.verdict, missed.measured), (Verdict::Missed, Some(500.0)));
        assert!(missed.host.as_deref().unwrap().contains("40 ms of 2.0 s (1.00 %)"), "{missed:?}");
        assert_eq!(missed.host_share, None, "there is no bare Panda");
        let met = find(&table, "Panda loop, under load");
        assert_eq!((met.verdict, &met.host, met.host_share), (Verdict::Met, &None, None));
    }

    #[test]
    fn caterpillar_is_compared_with_default_and_tuned_dora() {
        let table = targets(&[
            measured("chain.17", 0, 200, 0),
            measured("peer.dora.17", 0, 5_000, 0),
            measured("peer.dora.17.fifo", 0, 2_000, 0),
        ]);
        let one = |what| (find(&table, what).measured, find(&table, what).verdict);
        assert_eq!(one("p99 / dora's"), (Some(0.04), Verdict::Met));
        assert_eq!(one("forced to FIFO"), (Some(0.1), Verdict::Missed));
    }

    #[test]
    fn gate_cost_is_the_difference_within_a_turn() {
        let turns =
            |name, slices: &[u64]| Measurement { slices_p50: slices.to_vec(), ..measured(name, 0, 0, 0) };
        let table = targets(&[turns("gate", &[390, 700, 410]), turns("floor.gate", &[300, 400, 330])]);
        let target = find(&table, "command gate");
        assert!((target.measured.unwrap() - 0.09).abs() < 1e-9, "{target:?}");
        assert_eq!(target.verdict, Verdict::Met);
    }

    #[test]
    fn worker_overhead_is_chain_time_minus_hops() {
        let turns =
            |name, slices: &[u64]| Measurement { slices_p50: slices.to_vec(), ..measured(name, 0, 0, 0) };
        let chain = turns("chain.8", &[35_000, 60_000, 35_600]);
        let floor = turns("floor.chain.8", &[28_000, 54_400, 30_000]);
        let overhead = |table: Vec<Target>| find(&table, "worker overhead").measured;
        let measured = overhead(targets(&[chain.clone(), floor])).unwrap();
        assert!((measured - 0.8).abs() < 1e-9, "{measured}");
        assert_eq!(overhead(targets(&[chain])), None);
    }
}
