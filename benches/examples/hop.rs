//! The library without the command: floors and hops of one payload, `cargo run --release --example hop -- 512`.

use std::path::Path;
use std::process::ExitCode;

use motorium::component::{ConfigError, Kind, Registry, RobotSource};
use motorium_benches::Part;
use motorium_benches::pair::{Carrier, Throw, measure};

fn no_robots(_: &str, _: &Path) -> Result<Vec<String>, ConfigError> {
    Err(ConfigError::new("this program knows no robots"))
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    // The second process of a measurement is this program again.
    if let Some(part) = Part::from_arguments(&arguments) {
        return part.run();
    }
    let bytes = arguments.get(1).and_then(|text| text.parse().ok()).unwrap_or(512);
    let rounds = arguments.get(2).and_then(|text| text.parse().ok()).unwrap_or(20_000);
    let registry =
        Registry::new(RobotSource { check: no_robots }, [Kind::of::<motorium_benches::relay::Relay>()]);
    let program = std::env::current_exe().expect("a running program has a file");
    for (name, carrier, cores, pace_ns) in [
        ("cache line", Carrier::CacheLine, [0, 1], 0),
        ("futex, same core", Carrier::Futex, [1, 1], 0),
        ("futex, across", Carrier::Futex, [0, 1], 0),
        ("futex, across, 1 kHz", Carrier::Futex, [0, 1], 1_000_000),
        ("blocking, same core", Carrier::Blocking, [1, 1], 0),
        ("blocking, across", Carrier::Blocking, [0, 1], 0),
        ("blocking, across, 1 kHz", Carrier::Blocking, [0, 1], 1_000_000),
        ("polling, across", Carrier::Polling, [0, 1], 0),
        ("polling, same core", Carrier::Polling, [1, 1], 0),
        ("iceoryx2, same core", Carrier::Stock, [1, 1], 0),
        ("iceoryx2, across", Carrier::Stock, [0, 1], 0),
    ] {
        let rounds = if pace_ns > 0 { rounds / 10 } else { rounds };
        let throw = Throw { carrier, bytes, cores, fifo: 80, rounds, warm_up: 1_000, pace_ns };
        match measure(&program, &registry, &throw) {
            Ok(seen) => println!(
                "{name:24} p50 {:6} p99 {:6} p99.9 {:6} max {:8} ns (FIFO {})",
                seen.hop.p50, seen.hop.p99, seen.hop.p99_9, seen.hop.max, seen.fifo
            ),
            Err(error) => println!("{name:24} {error}"),
        }
    }
    ExitCode::SUCCESS
}
