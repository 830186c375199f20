//! `motorium can` on a simulated bus that another program offers, here this one.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use motorium_can::bus::offered::{Offer, Place};
use motorium_can::{ErrorState, Frame, Id, Rates, Received, Report};
use serde_json::Value;

use crate::program::{complaint, motorium, printed};

const RATES: Rates = Rates { nominal: 1_000_000, fast: 5_000_000 };

/// Offers a bus while `look` runs, and returns its result. A frame of the drive 0x123 is sent each
/// millisecond, and each received frame is answered with the next identifier.
fn offered<T>(name: &str, look: impl FnOnce(&str) -> T) -> T {
    let name = format!("command-{name}-{}", std::process::id());
    let mut offer = Offer::open(Place::Socket(&name), RATES, true, false).expect("a place");
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut inbox = [Received::default(); 16];
            for step in 0_u16.. {
                if is_over.load(Ordering::Relaxed) {
                    return;
                }
                let count = offer.receive(&mut inbox);
                for received in &inbox[..count] {
                    let Id::Standard(id) = received.frame.id else { continue };
                    let answer = Frame::new(Id::Standard(id + 1), received.frame.form, received.frame.data());
                    offer.deliver(&Received { frame: answer.expect("a frame"), ..*received });
                }
                let frame = Frame::classic(Id::Standard(0x123), &step.to_le_bytes());
                offer.deliver(&Received { frame, time_ns: 0 });
                if step == 100 {
                    let passive = Report {
                        state: Some(ErrorState::Passive),
                        counters: Some([136, 0]),
                        ..Report::default()
                    };
                    offer.report(&passive, 0);
                }
                offer.flush();
                std::thread::sleep(Duration::from_millis(1));
            }
        });
        let result = look(&format!("unix:{name}"));
        is_over.store(true, Ordering::Relaxed);
        result
    })
}

#[test]
fn monitor_shows_the_frames_and_the_state_of_a_simulated_bus() {
    let text = offered("monitor", |bus| {
        printed(&[
            "can",
            "monitor",
            bus,
            "--bitrate",
            "1000000",
            "--interval",
            "500ms",
            "--for",
            "2s",
            "--json",
        ])
    });
    let tables: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let last = &tables.last().expect("a table")[0];
    assert!(
        last["interface"].as_str().is_some_and(|name| name.starts_with("unix:command-monitor")),
        "{last}"
    );
    assert_eq!(last["ids"][0]["id"], "0x123", "{last}");
    assert!(last["ids"][0]["frames"].as_u64().is_some_and(|frames| frames > 10), "{last}");
    assert!(last["load"].as_f64().is_some(), "{last}");
    // the monitor may have started before or after the report
    if last["errors"] != 0 {
        assert_eq!(last["counters"], serde_json::json!([136, 0]), "{last}");
    }
}

#[test]
fn log_and_send_work_on_a_simulated_bus() {
    let text = offered("log", |bus| {
        let log =
            motorium(&["can", "log", bus, "--for", "20s", "--count", "400"]).spawn().expect("it starts");
        // retry until the log has started
        let sent =
            printed(&["can", "send", bus, "200#0102", "00000300##1AA", "--every", "20ms", "--count", "20"]);
        assert_eq!(sent, "");
        let output = log.wait_with_output().expect("it ends");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).expect("text")
    });
    let frames = |text: &str, end: &str| text.lines().filter(|line| line.ends_with(end)).count();
    assert!(text.lines().all(|line| line.contains(" unix:command-log")), "{text}");
    assert!(text.lines().filter(|line| line.contains(" 123#")).count() > 100, "{text}");
    // frames of another program, and the answers
    assert!(frames(&text, " 200#0102") > 0 && frames(&text, " 201#0102") > 0, "{text}");
    assert!(frames(&text, " 00000300##5AA") > 0, "{text}");
}

#[test]
fn missing_bus_and_bad_frame_errors_name_next_step() {
    for (arguments, words) in [
        (
            &["can", "monitor", "unix:nobody-offers-it"][..],
            "no program offers the simulated bus `unix:nobody-offers-it`",
        ),
        (&["can", "log", "unix:nobody-offers-it"], "start the graph whose `can.drive_sim` has this bus"),
        (&["can", "monitor", "pty:/tmp/can0"], "`motorium can attach /tmp/can0`"),
        (&["can", "send", "/dev/ttyACM0", "001#00"], "a serial line, which only one program can use"),
        (&["can", "send", "unix:nobody", "12G#01"], "`G` in the identifier is not a hexadecimal digit"),
        (&["can", "send", "unix:nobody", "123#01", "--every", "0 s"], "`--every` is 0"),
    ] {
        let text = complaint(arguments);
        assert!(text.contains(words), "{arguments:?}: {text}");
    }
}

#[test]
fn can_check_fails_without_an_adapter() {
    let words = "error: graph `panda-reach` has no component of the kind `can.adapter`";
    assert!(complaint(&["can", "check", "--example", "panda-reach"]).contains(words));
    let output = motorium(&["can", "check", "--example", "panda-reach", "--json"]).output().expect("it runs");
    let message: Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert_eq!(
        (&message["valid"], &message["kind"], output.status.code()),
        (&false.into(), &"failed".into(), Some(1))
    );
}

#[test]
fn scan_skips_can_fd_after_classic_frames() {
    let searched = |name: &str, options: &[&str]| {
        let text = offered(name, |bus| {
            let output = motorium(&["can", "scan", bus, "--for", "30ms", "--json"])
                .args(options)
                .output()
                .expect("it ends");
            String::from_utf8(output.stdout).expect("text")
        });
        let value: Value = serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}"));
        value["fd_search"].clone()
    };
    // the report of the bus may precede the scan
    let search = searched("scan-fd", &["--fd"]);
    let outcome = search["outcome"].as_str().expect("an outcome");
    assert!(matches!(outcome, "classic" | "disturbed") && search["asked"] == 0, "{search}");
    assert_eq!(searched("scan", &[]), Value::Null);
}

#[test]
fn ineffective_scan_option_is_refused() {
    for (arguments, words) in [
        (
            &["can", "scan", "can77", "--data-bitrate", "5000000"][..],
            "`--data-bitrate` has no effect on an interface of the kernel",
        ),
        (
            &["can", "scan", "unix:nobody", "--bitrate", "500000"],
            "`--bitrate` has no effect on a simulated bus",
        ),
        (
            &["can", "scan", "can77", "--speed", "115200"],
            "`--speed` has no effect on an interface of the kernel",
        ),
        (&["can", "scan", "pty:/tmp/nobody", "--fd"], "add `--data-bitrate 5000000`"),
        (&["can", "scan", "can77", "--fd"], "`can77` does not carry CAN FD"),
        (&["can", "scan", "--fd"], "<INTERFACE>"),
    ] {
        let text = complaint(arguments);
        assert!(text.contains(words), "{arguments:?}: {text}");
    }
}
