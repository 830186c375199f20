use super::*;

fn log() -> EventLog {
    EventLog { opened_ns: AtomicU64::new(0), rings: core::array::from_fn(|_| Ring::empty()) }
}

fn event(time_ns: u64, severity: EventSeverity, text: &str) -> EventRecord {
    EventRecord {
        time_ns,
        episode: 0,
        simulated_ns: None,
        severity,
        kind: EventKind::Warning,
        component: None,
        value: 0.0,
        text: text.to_string(),
    }
}

use EventSeverity::{Error, Information, Warning};

#[test]
fn event_is_read_as_written() {
    let log = log();
    let written = EventRecord {
        time_ns: 17,
        episode: 3,
        simulated_ns: Some(250_000_000),
        severity: Error,
        kind: EventKind::Failed,
        component: Some(0),
        value: -1.5,
        text: "schräg: ended".to_string(),
    };
    log.write(&written);
    assert_eq!(log.all(), (vec![written], 0));
}

#[test]
fn long_text_is_cut_at_a_character() {
    let log = log();
    log.write(&event(1, Warning, &format!("{}ä", "x".repeat(EVENT_TEXT_BYTES - 1))));
    let (events, _) = log.all();
    assert_eq!(events[0].text, "x".repeat(EVENT_TEXT_BYTES - 1));
}

#[test]
fn events_of_all_severities_are_read_in_order_of_time() {
    let log = log();
    for (time_ns, severity) in [(1, Warning), (2, Information), (3, Error), (4, Information)] {
        log.write(&event(time_ns, severity, ""));
    }
    let times: Vec<u64> = log.all().0.iter().map(|event| event.time_ns).collect();
    assert_eq!(times, [1, 2, 3, 4]);
}

#[test]
fn flood_of_lines_displaces_only_lines() {
    let log = log();
    let line = |time_ns| EventRecord { kind: EventKind::Output, ..event(time_ns, Information, "line") };
    log.write(&event(0, Information, "one"));
    let lines = 3 * RECORDS as u64 + 7;
    (1..=lines).for_each(|time_ns| log.write(&line(time_ns)));
    let (events, lost) = log.all();
    assert_eq!((events.len(), lost), (RECORDS + 1, lines - RECORDS as u64));
    assert_eq!(events[0].text, "one");
    assert_eq!(log.count(), lines + 1);
}

#[test]
fn reader_reads_each_event_once_and_counts_losses() {
    let log = log();
    let mut reader = EventReader::default();
    log.write(&event(1, Information, "a"));
    assert_eq!(reader.read(&log).len(), 1);
    assert_eq!(reader.read(&log), []);
    (0..RECORDS as u64 + 5).for_each(|time_ns| log.write(&event(time_ns, Information, "b")));
    assert_eq!((reader.read(&log).len(), reader.lost()), (RECORDS, 5));
}

#[test]
fn event_of_a_killed_writer_counts_as_lost() {
    let log = log();
    log.rings[Error as usize].write_and_die();
    log.write(&event(1, Error, "after it"));
    let mut reader = EventReader::default();
    assert_eq!(reader.read(&log), []);
    assert_eq!((reader.read(&log).len(), reader.lost()), (1, 1));
    let (events, lost) = log.all();
    assert_eq!((events.len(), lost), (1, 1));
}

#[test]
fn concurrent_writers_lose_and_tear_no_event() {
    let log = log();
    let (writers, each) = (4, 5_000_u64);
    std::thread::scope(|scope| {
        for writer in 0..writers {
            let log = &log;
            scope.spawn(move || {
                for number in 0..each {
                    log.write(&event(writer, Information, &format!("{writer} {number}").repeat(20)));
                }
            });
        }
        let mut reader = EventReader::default();
        let mut read = 0;
        while log.count() < writers * each || read + reader.lost() < log.count() {
            for event in reader.read(&log) {
                read += 1;
                let one = &event.text[..event.text.len() / 20];
                assert_eq!(event.text, one.repeat(20));
                assert!(one.starts_with(&format!("{} ", event.time_ns)));
            }
        }
        assert_eq!(reader.read(&log), []);
    });
}

#[test]
fn damaged_log_is_usable_in_bounded_time() {
    let log = log();
    (0..3).for_each(|severity| log.rings[severity].write_and_die());
    let mut words = [u64::MAX; WORDS];
    assert!(log.rings[0].write(&words));
    words[3] = 0;
    assert!(log.rings[0].write(&words));
    assert_eq!(log.all(), (vec![], 5));
    log.write(&event(1, Information, "still"));
    assert_eq!(log.all().0.len(), 1);
}
