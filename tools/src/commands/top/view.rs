//! The tables of `motorium top`.

use motorium::launcher::LoggedEvent;
use motorium::plan::ClockKind;
use motorium::region::{EventSeverity, GateState, Misses, Phase};
use motorium::telemetry::Percentiles;

use super::data::{ComponentTop, CoreTop, EdgeTop, LatencyTop, Span, State, Top};
use super::layout::{Cell, Column, Sheet, Tone};
use super::order::Order;
use crate::gate;
use crate::report::microseconds;

/// Selection and order of the displayed data.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct View {
    pub(super) order: Order,
    pub(super) reversed: bool,
    pub(super) span: Span,
}

impl View {
    /// Returns the run and its state, in a line.
    pub(super) fn title(self, top: &Top) -> Vec<Cell> {
        let clock = match top.clock {
            ClockKind::Realtime => "in real time",
            ClockKind::Lockstep => "in lockstep",
        };
        let state = match top.state {
            State::Starting => Cell::new("starting", Tone::Warning),
            State::Running => Cell::text("running"),
            State::SafeStop => Cell::new("safe stop", Tone::Bad),
            State::Stopping => Cell::new("stopping", Tone::Warning),
        };
        let span = match self.span {
            Span::Run => "the whole run".to_string(),
            Span::Interval => format!("the last {:.1} s", top.interval_s),
        };
        vec![
            Cell::new(format!("{} ", top.run), Tone::Strong),
            state,
            Cell::text(format!(" {clock}, {:.1} s; times and counts of ", top.elapsed_s)),
            Cell::new(span, Tone::Strong),
        ]
    }

    /// Returns all tables.
    pub(super) fn sheets(self, top: &Top) -> Vec<Sheet> {
        let mut components: Vec<&ComponentTop> = top.components.iter().collect();
        self.order.sort(&mut components, self.span, self.reversed);
        let mut sheets = vec![self.times(top.clock, &components), self.counts(&components)];
        if !top.events.is_empty() {
            sheets.push(events(&top.events, top.clock));
        }
        if !top.latencies.is_empty() {
            sheets.push(self.latencies(&top.latencies));
        }
        if !top.edges.is_empty() {
            sheets.push(self.edges(&top.edges));
        }
        sheets.push(cores(&top.cores));
        sheets
    }

    fn times(self, clock: ClockKind, components: &[&ComponentTop]) -> Sheet {
        let lateness = clock == ClockKind::Realtime;
        let mut columns = vec![Column::text("component", 0), Column::number("", "Hz", 0)];
        if lateness {
            columns.extend(percentile_columns("lateness us", 2));
        }
        columns.extend(percentile_columns("execution us", 0));
        columns.extend(percentile_columns("CPU us", 5));
        let row = |component: &&ComponentTop| {
            let span = component.over(self.span);
            let mut row = vec![name(component), Cell::text(format!("{:.1}", span.rate_hz))];
            if lateness {
                row.extend(percentiles(&span.lateness_ns));
            }
            row.extend(percentiles(&span.execution_ns));
            row.extend(percentiles(&span.cpu_ns));
            row
        };
        Sheet { columns, rows: components.iter().map(row).collect() }
    }

    fn counts(self, components: &[&ComponentTop]) -> Sheet {
        let columns = vec![
            Column::text("component", 0),
            Column::text("phase", 1),
            Column::number("", "core", 4),
            Column::number("core %", "used", 2),
            Column::number("core %", "steps", 6),
            Column::number("", "spin us", 5),
            Column::number("", "MiB", 3),
            Column::number("missed", "stolen", 0),
            Column::number("missed", "wake", 0),
            Column::number("missed", "long", 0),
            Column::number("missed", "input", 0),
            Column::number("", "skipped", 1),
            Column::number("", "deferred", 7),
            Column::number("", "over budget", 5),
            Column::number("", "restarts", 2),
            Column::number("", "allocs", 3),
            Column::number("", "faults", 3),
        ];
        let row = |component: &&ComponentTop| {
            let (span, restarts) = (component.over(self.span), u64::from(component.restarts));
            let Misses { late_wake, long_step, stolen, late_input, skipped, over_budget } = span.misses;
            vec![
                name(component),
                phase(component),
                Cell::text(component.core.map_or_else(|| "any".to_string(), |core| core.to_string())),
                Cell::text(component.core_share.map_or_else(|| "-".to_string(), percent)),
                Cell::text(percent(component.step_share)),
                spin(component.spin_ns),
                Cell::text(component.resident_bytes.map_or_else(|| "-".to_string(), mebibytes)),
                count(stolen, Tone::Warning),
                count(late_wake, Tone::Warning),
                count(long_step, Tone::Warning),
                count(late_input, Tone::Bad),
                count(skipped, Tone::Warning),
                count(span.deferred, Tone::Plain),
                count(over_budget, Tone::Warning),
                count(restarts, Tone::Bad),
                span.allocations.map_or_else(|| Cell::new("?", Tone::Dim), |own| count(own, Tone::Warning)),
                count(span.page_faults, Tone::Warning),
            ]
        };
        Sheet { columns, rows: components.iter().map(row).collect() }
    }

    fn latencies(self, latencies: &[LatencyTop]) -> Sheet {
        let mut columns = vec![Column::text("latency", 0)];
        columns.extend(percentile_columns("us", 0));
        columns.push(Column::number("us", "budget", 0));
        columns.extend([Column::number("", "missed", 0), Column::number("", "of", 1)]);
        let row = |latency: &LatencyTop| {
            let span = latency.over(self.span);
            let mut row = vec![Cell::text(format!("{} -> {}", latency.from, latency.to))];
            row.extend(percentiles(&span.latency_ns));
            row.push(Cell::text(microseconds(latency.max_ns)));
            row.extend([count(span.missed, Tone::Warning), Cell::text(span.count.to_string())]);
            row
        };
        Sheet { columns, rows: latencies.iter().map(row).collect() }
    }

    fn edges(self, edges: &[EdgeTop]) -> Sheet {
        let mut columns = vec![Column::text("edge", 0)];
        columns.extend(percentile_columns("age us", 0));
        columns.push(Column::number("", "read", 1));
        let row = |edge: &EdgeTop| {
            let span = edge.over(self.span);
            let mut row = vec![Cell::text(format!("{} -> {}", edge.topic, edge.reader))];
            row.extend(percentiles(&span.age_ns));
            row.push(Cell::text(span.read.to_string()));
            row
        };
        Sheet { columns, rows: edges.iter().map(row).collect() }
    }
}

fn events(events: &[LoggedEvent], clock: ClockKind) -> Sheet {
    let columns = vec![
        Column::number("", "s", 0),
        Column::text("severity", 3),
        Column::text("kind", 2),
        Column::text("event", 0),
    ];
    let row = |event: &LoggedEvent| {
        let time_s = match clock {
            ClockKind::Realtime => event.time_s,
            ClockKind::Lockstep => event.simulated_s.unwrap_or(0.0),
        };
        let tone = match event.severity {
            EventSeverity::Information => Tone::Plain,
            EventSeverity::Warning => Tone::Warning,
            EventSeverity::Error => Tone::Bad,
        };
        vec![
            Cell::text(format!("{time_s:.3}")),
            Cell::new(event.severity.name(), tone),
            Cell::new(event.kind.name(), Tone::Dim),
            Cell::new(event.text.clone(), tone),
        ]
    };
    Sheet { columns, rows: events.iter().map(row).collect() }
}

fn cores(cores: &[CoreTop]) -> Sheet {
    let number = |name| Column::number("core %", name, 0);
    let mut columns = vec![Column::text("core", 0)];
    columns.extend(["user", "system", "interrupts", "stolen", "idle"].map(number));
    columns.push(Column::text("components", 0));
    let row = |core: &CoreTop| {
        // The kernel counts in hundredths of a second, so the first one is noise.
        let stolen = if core.stolen > 0.015 { Tone::Warning } else { Tone::Plain };
        vec![
            Cell::text(core.core.to_string()),
            Cell::text(percent(core.user)),
            Cell::text(percent(core.system)),
            Cell::text(percent(core.interrupts)),
            Cell::new(percent(core.stolen), stolen),
            Cell::text(percent(core.idle)),
            Cell::text(core.components.join(" ")),
        ]
    };
    Sheet { columns, rows: cores.iter().map(row).collect() }
}

/// Returns the percentile columns; `rank` is the rank of the first to drop. Maximum and p99 are dropped last.
fn percentile_columns(group: &'static str, rank: u8) -> [Column; 4] {
    let ranked = |more: u8| if rank == 0 { 0 } else { rank + more };
    [
        Column::number(group, "p50", ranked(2)),
        Column::number(group, "p99", ranked(0)),
        Column::number(group, "p99.9", ranked(3)),
        Column::number(group, "max", ranked(1)),
    ]
}

fn percentiles(of: &Percentiles) -> [Cell; 4] {
    [of.p50, of.p99, of.p999, of.max].map(|ns| Cell::text(microseconds(ns)))
}

fn name(component: &ComponentTop) -> Cell {
    let tone = match component.phase {
        Phase::Faulted => Tone::Bad,
        Phase::Stopped => Tone::Dim,
        _ => Tone::Plain,
    };
    Cell::new(component.name.clone(), tone)
}

fn phase(component: &ComponentTop) -> Cell {
    match component.gate.as_ref().map(|gate| (gate.latch, gate.state)) {
        Some((Some(latch), _)) if component.safe => return Cell::new(gate::latch_words(latch), Tone::Bad),
        Some((_, GateState::Resuming)) if component.phase == Phase::Running => {
            return Cell::new("resuming", Tone::Warning);
        }
        _ => {}
    }
    if component.safe {
        return Cell::new("safe state", Tone::Bad);
    }
    match component.phase {
        Phase::Running => Cell::text("running"),
        Phase::Created => Cell::new("created", Tone::Warning),
        Phase::Ready => Cell::new("ready", Tone::Warning),
        Phase::Connected => Cell::new("connected", Tone::Warning),
        Phase::Faulted => Cell::new("faulted", Tone::Bad),
        Phase::Stopped => Cell::new("stopped", Tone::Dim),
    }
}

fn spin(ns: u64) -> Cell {
    if ns == 0 { Cell::new("-", Tone::Dim) } else { Cell::text(microseconds(ns)) }
}

fn count(number: u64, tone: Tone) -> Cell {
    Cell::new(number.to_string(), if number > 0 { tone } else { Tone::Dim })
}

fn percent(share: f64) -> String {
    format!("{:.1}", share * 100.0)
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1}", bytes as f64 / (1024.0 * 1024.0))
}
