//! States: pinned slots, taps, triggers.

use std::time::Duration;

use super::*;

/// Longer than any wait that ends for another reason.
const LONG: Duration = Duration::from_secs(60);

#[test]
fn second_read_returns_the_newest_value_again() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let (mut output, mut input) = (bench.output::<Wrench>(), bench.input::<Wrench>());
    assert!(input.latest().is_none());
    for x in [1.0, 2.0, 3.0] {
        output.send(&wrench(x)).unwrap();
    }
    for _ in 0..2 {
        let reading = input.latest().unwrap();
        assert_eq!(reading.force[0], 3.0);
        assert_eq!(reading.stamp().sequence, 3);
        assert!(reading.stamp().publish_time > 0);
    }
}

#[test]
fn reader_that_keeps_its_sample_never_blocks_the_writer() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let (mut output, mut input) = (bench.output::<Wrench>(), bench.input::<Wrench>());
    output.send(&wrench(1.0)).unwrap();
    let kept = input.latest().unwrap();
    for x in 0..1_000 {
        output.send(&wrench(f64::from(x))).unwrap();
    }
    assert_eq!(kept.force[0], 1.0);
}

#[test]
fn state_is_read_in_place() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let (mut output, mut input) = (bench.output::<Wrench>(), bench.input::<Wrench>());
    output.send(&wrench(1.0)).unwrap();
    let first = core::ptr::from_ref::<Wrench>(&input.latest().unwrap());
    assert_eq!(core::ptr::from_ref::<Wrench>(&input.latest().unwrap()), first, "no copy is made");
    // One slot for the reader, one for each of the four taps, two for the writer.
    let mut places = std::collections::HashSet::new();
    for x in 0..100 {
        output.send(&wrench(f64::from(x))).unwrap();
        places.insert(core::ptr::from_ref::<Wrench>(&input.latest().unwrap()));
    }
    assert!(places.len() <= 7, "{} places", places.len());
}

#[test]
fn killed_reader_costs_one_slot_until_it_is_replaced() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let mut output = bench.output::<Wrench>();
    output.send(&wrench(1.0)).unwrap();
    let mut killed = bench.input::<Wrench>();
    assert!(killed.latest().is_some());
    std::mem::forget(killed);
    (0..1_000).for_each(|x| output.send(&wrench(f64::from(x))).unwrap());
    let mut successor = bench.input::<Wrench>();
    assert_eq!(successor.latest().unwrap().force[0], 999.0);
}

#[test]
fn writer_killed_while_filling_leaves_the_previous_value() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let (mut killed, mut input) = (bench.output::<Wrench>(), bench.input::<Wrench>());
    killed.send(&wrench(1.0)).unwrap();
    killed.loan().unwrap().force[0] = f64::NAN;
    std::mem::forget(killed);
    assert_eq!(input.latest().unwrap().force[0], 1.0);
    let mut successor = bench.output::<Wrench>();
    successor.send(&wrench(2.0)).unwrap();
    let reading = input.latest().unwrap();
    assert_eq!((reading.force[0], reading.stamp().sequence), (2.0, 2));
}

#[test]
fn has_news_is_true_until_the_value_is_read() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let (mut output, mut input) = (bench.output::<Wrench>(), bench.input::<Wrench>());
    assert!(!input.has_news() && input.next_unread().is_none());
    output.send(&wrench(1.0)).unwrap();
    assert!(input.has_news());
    assert_eq!(input.next_unread().unwrap().force[0], 1.0);
    assert!(!input.has_news() && input.next_unread().is_none());
    assert_eq!(input.current().unwrap().force[0], 1.0);
}

#[test]
fn trigger_is_due_for_publications_before_its_first_wait() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let mut output = bench.output::<Wrench>();
    output.send(&wrench(1.0)).unwrap();
    let trigger = bench.participant(1).trigger(bench.topic()).unwrap();
    assert_eq!(trigger.first_seen(), 0);
    trigger.wait();
    assert_eq!(trigger.newest().0, 1);
    assert!(!trigger.is_due());
    // A restarted component starts with the next publication.
    bench.region.components()[1].restarts.store(1, std::sync::atomic::Ordering::Relaxed);
    assert_eq!(bench.participant(1).trigger(bench.topic()).unwrap().first_seen(), 1);
}

#[test]
fn input_waits_for_the_next_publication_up_to_its_limit() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let (mut output, mut input) = (bench.output::<Wrench>(), bench.input::<Wrench>());
    assert!(!input.wait(Duration::from_millis(1)), "nothing is published");
    output.send(&wrench(1.0)).unwrap();
    assert!(input.wait(LONG), "it was published");
    assert!(input.latest().is_some() && !input.wait(Duration::ZERO), "and is read");
    let (folder, topic) = (&bench.folder, bench.topic());
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let memory = TopicMemory::open(&folder.domain().unwrap().node().unwrap(), topic).unwrap();
            std::thread::sleep(Duration::from_millis(5));
            memory.count(0);
            memory.notify();
        });
        assert!(input.wait(LONG), "published meanwhile");
    });
}

#[test]
fn triggered_components_are_woken_before_the_step_waits() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let participant = bench.participant(0);
    let place = OutputPlace { wakes_late: true, ..bench.output_place() };
    let mut output = Output::<Wrench>::open(&participant, place, "output").unwrap();
    let own =
        InputPlace { index: 0, topic: bench.topic(), port: "input", pin: 0, is_cause: false, edge: None };
    let input = Input::<Wrench>::open(&participant, &own).unwrap();
    let (folder, topic) = (&bench.folder, bench.topic());
    let (says, hears) = std::sync::mpsc::channel();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let memory = TopicMemory::open(&folder.domain().unwrap().node().unwrap(), topic).unwrap();
            let seen = memory.newest();
            says.send("sleeps").unwrap();
            memory.sleep(seen, Some(crate::os::monotonic_ns() + LONG.as_nanos() as u64));
            says.send("woken").unwrap();
        });
        assert_eq!(hears.recv(), Ok("sleeps"));
        std::thread::sleep(Duration::from_millis(5));
        output.send(&wrench(1.0)).unwrap();
        assert!(input.wait(LONG));
        assert_eq!(hears.recv_timeout(LONG / 2), Ok("woken"));
    });
}

#[test]
fn no_publication_is_lost_when_waiting_and_publishing_race() {
    const ROUNDS: u64 = 20_000;
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let (folder, topic) = (&bench.folder, bench.topic());
    let open = || TopicMemory::open(&folder.domain().unwrap().node().unwrap(), topic).unwrap();
    let (there, back) = (std::sync::atomic::AtomicU64::new(0), std::sync::atomic::AtomicU64::new(0));
    let ready = std::sync::Barrier::new(2);
    let play = |begins: bool, mine: &std::sync::atomic::AtomicU64, theirs: &std::sync::atomic::AtomicU64| {
        use std::sync::atomic::Ordering::SeqCst;
        let memory = Rc::new(open());
        let trigger = Trigger::new(memory.clone(), 0);
        ready.wait();
        for round in 0..ROUNDS {
            if begins {
                mine.store(round + 1, SeqCst);
                memory.count(0);
                memory.notify();
            }
            while theirs.load(SeqCst) <= round {
                trigger.wait();
            }
            // The other side only sometimes has time to fall asleep.
            (0..round % 97 * 10).for_each(|_| core::hint::spin_loop());
            if !begins {
                mine.store(round + 1, SeqCst);
                memory.count(0);
                memory.notify();
            }
        }
    };
    std::thread::scope(|scope| {
        scope.spawn(|| play(false, &back, &there));
        play(true, &there, &back);
    });
}

#[test]
fn tap_reads_the_history_and_counts_missed_values() {
    let mut bench = Bench::with_history(32);
    bench.plan.name = "tapped".to_string();
    let domain = bench.folder.domain().unwrap();
    let mut output = bench.output::<Wrench>();
    output.send(&wrench(0.0)).unwrap();
    let mut tap = Tap::open(&domain, bench.topic()).unwrap();
    for round in 0..10 {
        (1..=30).for_each(|x| output.send(&wrench(f64::from(30 * round + x))).unwrap());
        while let Some(sample) = tap.next_unread() {
            let x = f64::from_le_bytes(sample.bytes[..8].try_into().unwrap());
            assert_eq!(sample.stamp.sequence as f64, x + 1.0);
        }
        assert_eq!(tap.missed(), 0, "round {round}");
    }
    (0..100).for_each(|x| output.send(&wrench(f64::from(x))).unwrap());
    let mut read = 0;
    while tap.next_unread().is_some() {
        read += 1;
    }
    assert!(read >= 32 && tap.missed() + read == 100, "{read} read, {} missed", tap.missed());
}

#[test]
fn topic_has_four_tap_places_and_reuses_closed_ones() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let domain = bench.folder.domain().unwrap();
    let mut taps: Vec<_> = (0..4).map(|_| Tap::open(&domain, bench.topic()).unwrap()).collect();
    let error = Tap::open(&domain, bench.topic()).unwrap_err().to_string();
    assert!(error.contains("four programs"), "{error}");
    taps.pop();
    assert!(Tap::open(&domain, bench.topic()).is_ok());
}
