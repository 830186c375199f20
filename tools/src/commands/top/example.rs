//! A graph of three components for the tests of the display.

use motorium::launcher::LoggedEvent;
use motorium::plan::ClockKind;
use motorium::region::{EventKind, EventSeverity, Misses, Phase, Stalls};
use motorium::telemetry::Percentiles;

use super::data::{
    ComponentSpan, ComponentTop, CoreTop, EdgeSpan, EdgeTop, LatencySpan, LatencyTop, State, TOP_VERSION, Top,
};

fn us(p50: f64, p99: f64, p999: f64, max: f64) -> Percentiles {
    let ns = |us: f64| (us * 1000.0) as u64;
    Percentiles { p50: ns(p50), p99: ns(p99), p999: ns(p999), max: ns(max) }
}

fn span(steps: u64, rate_hz: f64, late: f64, step: f64) -> ComponentSpan {
    ComponentSpan {
        steps,
        rate_hz,
        lateness_ns: us(late / 2.0, late, late * 2.0, late * 3.0),
        execution_ns: us(step * 0.8, step, step * 1.2, step * 2.0),
        cpu_ns: us(step * 0.9, step * 1.1, step * 1.3, step * 1.9),
        misses: Misses::default(),
        deferred: 0,
        errors: 0,
        refused: 0,
        allocations: Some(0),
        allocations_apart: Some(0),
        page_faults: 0,
    }
}

fn component(name: &str, core: Option<usize>, run: ComponentSpan, interval: ComponentSpan) -> ComponentTop {
    ComponentTop {
        name: name.to_string(),
        phase: Phase::Running,
        safe: false,
        gate: None,
        pid: 4711,
        core,
        core_share: Some(0.031),
        step_share: 0.009,
        resident_bytes: Some(14_900_000),
        shared_bytes: Some(9_000_000),
        spin_ns: 0,
        stalls: Stalls::default(),
        restarts: 0,
        run,
        interval,
    }
}

/// Returns a graph after twelve seconds.
pub(super) fn top() -> Top {
    let mut physics =
        component("physics", Some(1), span(12_345, 999.8, 0.025, 85.0), span(1_000, 1000.0, 0.03, 90.0));
    physics.run.misses = Misses { stolen: 3, late_wake: 1, skipped: 4, ..Misses::default() };
    physics.run.deferred = 7;
    (physics.core_share, physics.step_share, physics.spin_ns) = (Some(0.204), 0.104, 100_000);
    let encoder = component("encoder", Some(1), span(12_344, 999.8, 3.5, 8.0), span(1_000, 1000.0, 4.0, 9.0));
    let mut controller =
        component("controller", None, span(6_172, 499.9, 5.5, 230.0), span(500, 500.0, 6.0, 240.0));
    (controller.restarts, controller.run.allocations) = (1, None);
    (controller.phase, controller.safe) = (Phase::Faulted, false);
    let core = |core, user, stolen, components: &[&str]| CoreTop {
        core,
        user,
        system: 0.02,
        interrupts: 0.0,
        idle: 0.98 - user - stolen,
        stolen,
        components: components.iter().map(|name| name.to_string()).collect(),
    };
    let age = |read, age| EdgeSpan { read, age_ns: us(age, age * 1.5, age * 2.0, age * 9.0) };
    let edge = |topic: &str, reader: &str, run, interval| EdgeTop {
        topic: topic.to_string(),
        reader: reader.to_string(),
        run,
        interval,
    };
    Top {
        version: TOP_VERSION,
        run: "arm-0a1b2c3d".to_string(),
        graph: "arm".to_string(),
        clock: ClockKind::Realtime,
        state: State::Running,
        elapsed_s: 12.345,
        interval_s: 1.0,
        components: vec![physics, encoder, controller],
        latencies: vec![LatencyTop {
            from: "arm/state".to_string(),
            to: "arm/command".to_string(),
            max_ns: 600_000,
            run: LatencySpan { count: 6_171, missed: 2, latency_ns: us(250.0, 320.0, 500.0, 900.0) },
            interval: LatencySpan { count: 500, missed: 0, latency_ns: us(250.0, 310.0, 400.0, 450.0) },
        }],
        edges: vec![
            edge("arm/state", "encoder", age(12_344, 4.0), age(1_000, 4.0)),
            edge("arm/command", "physics", age(12_000, 700.0), age(990, 700.0)),
        ],
        events: vec![LoggedEvent {
            time_s: 11.75,
            simulated_s: None,
            episode: None,
            severity: EventSeverity::Warning,
            component: Some("physics".to_string()),
            kind: EventKind::EnteredSafeState,
            value: 0.0,
            text: "`physics` entered its safe state: its commands are stale".to_string(),
        }],
        cores: vec![core(0, 0.5, 0.0, &[]), core(1, 0.25, 0.04, &["physics", "encoder"])],
    }
}
