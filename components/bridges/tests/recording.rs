//! Recordings of graphs that run in the process of the test: writing, reading, truncation, repair and replay.

mod walk;

use std::path::Path;

use motorium::graph::{self, Machine};
use motorium::launcher::{Exit, Options, Report};
use motorium::session;
use motorium::state::{JointState, Stamp, from_bytes};
use motorium::testing::machine;
use motorium_bridges::recording::{
    self, Dataset, Recording, Signal, What, recover, replayed, verify, write_lerobot,
};

use walk::{GRAPH, recorder, registry, run};

fn record(file: &Path, extra: &str) -> Report {
    run(&format!("{extra}{GRAPH}{}", recorder(file)), &Options::inline())
}

#[test]
fn lockstep_recording_is_complete_and_has_no_effect() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("new/a.mcap");
    let report = record(&file, "");
    assert_eq!(report.results["recorder"]["samples"], 2000);
    assert_eq!(report.results["recorder"]["lost"], 0);
    assert_eq!(report.state_hash, run(GRAPH, &Options::inline()).state_hash);

    let recording = Recording::open(&file).unwrap();
    assert!(recording.is_whole());
    assert_eq!((recording.fact("seed"), recording.fact("clock")), (Some("7"), Some("lockstep")));
    assert_eq!(recording.plan().unwrap().components.len(), 3);
    assert!(recording.attachments().any(|name| name == "machine.json"));
    assert_eq!(recording.lost("sum"), Some(0));
    for name in ["wrench", "sum"] {
        let topic = recording.topic(name).unwrap();
        let of_topic = recording.samples().map(Result::unwrap).filter(|sample| sample.topic == topic);
        let stamps: Vec<Stamp> = of_topic.map(|sample| sample.stamp).collect();
        assert_eq!(stamps.len(), 1000);
        for (stamp, number) in stamps.iter().zip(1..) {
            assert_eq!((stamp.sequence, stamp.publish_time), (number, (number - 1) * 1_000_000), "{name}");
        }
    }
    let events = recording.topic("motorium/events").unwrap();
    assert!(recording.topics()[events].samples >= 2, "created and started");
}

#[test]
fn verification_is_bitwise_and_finds_one_damaged_value() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    record(&file, "");
    let check = |file: &Path, replace: &[String]| {
        verify(&Recording::open(file).unwrap(), &registry(), &Options::inline(), replace).unwrap()
    };
    let verified = check(&file, &[]);
    assert_eq!((verified.samples, verified.difference), (2000, None));
    // the recording replaces the source, so its numbers come from the file
    let verified = check(&file, &["walk".to_string()]);
    assert_eq!((verified.samples, verified.difference), (2000, None));

    // Flips the lowest bit of one number in one sample of the sum.
    let recording = Recording::open(&file).unwrap();
    let topic = recording.topic("sum").unwrap();
    let sample =
        recording.samples().map(Result::unwrap).filter(|sample| sample.topic == topic).nth(639).unwrap();
    let mut message = Vec::new();
    recording.topics()[topic].derived().encode(&sample.stamp, &sample.bytes, &mut message);
    let value = from_bytes::<JointState>(&sample.bytes).unwrap().position()[0].to_le_bytes();
    let mut bytes = std::fs::read(&file).unwrap();
    let place = find(&bytes, &message) + find(&message, &value);
    drop(recording);
    bytes[place] ^= 1;
    assert_eq!(Recording::open(&file).unwrap().faults(), [""; 0]);
    std::fs::write(&file, &bytes).unwrap();
    let faults = Recording::open(&file).unwrap().faults();
    assert!(faults[0].starts_with("is damaged: 1 chunk, between 0.000 s and "), "{faults:?}");
    let difference = check(&file, &[]).difference.expect("a difference");
    assert_eq!((difference.topic.as_str(), difference.sequence, difference.tick), ("sum", 640, 639));
    let What::Field { field, .. } = &difference.what else { panic!("{difference}") };
    assert_eq!(field, "position[0]");
    assert!(difference.to_string().starts_with("topic `sum`, tick 639 (0.639000 s, sample 640), field"));
}

fn find(bytes: &[u8], part: &[u8]) -> usize {
    bytes.windows(part.len()).position(|window| window == part).expect("it is there")
}

#[test]
fn episodes_are_recorded_to_their_ends_and_verified() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    // the recorder steps every 100 ms, so an episode of 155 ms ends between two steps
    let text = GRAPH.replace("\"1 s\"", "\"155 ms\"") + &recorder(&file);
    run(&format!("episodes = {{ count = 3, vary_seed = true }}\n{text}"), &Options::inline());
    let recording = Recording::open(&file).unwrap();
    let sum = recording.topic("sum").unwrap();
    assert_eq!(recording.topics()[sum].samples, 3 * 155);
    let times: Vec<u64> = recording.sorted().unwrap().iter().map(|sample| sample.time_ns).collect();
    assert!(times.last().unwrap() >= &460_000_000, "the episodes follow on one another");
    let verified = verify(&recording, &registry(), &Options::inline(), &[]).unwrap();
    assert_eq!((verified.samples, verified.difference), (2 * 3 * 155, None));
}

#[test]
fn real_time_episodes_are_exported_one_by_one() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    let _machine = machine(env!("CARGO_TARGET_TMPDIR"));
    // Two rates: after the fast component has entered an episode, the slow one still publishes in the
    // previous episode.
    let slow = "[component.slow]\nkind = \"test.walk\"\nrate = \"50 Hz\"\nschedule = \"normal\"\npublish = { wrench = \"slow\" }\n";
    let text = GRAPH
        .replace("lockstep", "realtime")
        .replace("\"1 s\"", "\"300 ms\"\nepisodes = { count = 3 }")
        .replace("rate    = \"1 kHz\"", "rate = \"200 Hz\"\nschedule = \"normal\"")
        .replace("trigger   = \"wrench\"", "trigger = \"wrench\"\nschedule = \"normal\"");
    let report = run(&(text + slow + &recorder(&file)), &Options::threads().leaving_signals());
    assert_eq!(report.episodes.len(), 3);
    let recording = Recording::open(&file).unwrap();
    let signal = |text: &str| text.parse::<Signal>().unwrap();
    let dataset = Dataset {
        state: vec![signal("sum.position[0]"), signal("slow.force")],
        action: vec![signal("wrench.force")],
        cameras: Vec::new(),
        fps: 20,
        task: "walk".to_string(),
        robot: None,
        names: [Vec::new(), Vec::new()],
    };
    let counts = write_lerobot(&recording, &dataset, &folder.path().join("three")).unwrap();
    assert_eq!(counts.episodes, 3);
    assert!(counts.frames >= 3, "each has a frame: {counts:?}");
    // Without resets, a replay repeats the whole recording as one span, or a single episode.
    let whole = replayed(&recording, &[], None).unwrap();
    let last = replayed(&recording, &[], Some(2)).unwrap();
    assert!(whole.episodes.is_none() && last.episodes.is_none());
    assert!(whole.duration_ns.unwrap() > 2 * last.duration_ns.unwrap(), "{whole:?}");
    let missing = replayed(&recording, &[], Some(3)).unwrap_err().to_string();
    assert!(missing.contains("the recording has no episode 3; it has 3"), "{missing}");
}

#[test]
fn a_truncated_file_is_read_up_to_the_damage_and_repaired() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    let text = GRAPH.replace("\"1 s\"", "\"30 s\"") + &recorder(&file);
    run(&text, &Options::inline());
    let bytes = std::fs::read(&file).unwrap();
    std::fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
    let torn = Recording::open(&file).unwrap();
    assert!(!torn.is_whole());
    assert!(
        matches!(&torn.faults()[..], [fault] if fault.starts_with("is incomplete")),
        "{:?}",
        torn.faults()
    );
    let read = torn.samples().map(Result::unwrap).count();
    assert!(read > 20_000, "{read} samples in half of the file");
    let verified = verify(&torn, &registry(), &Options::inline(), &[]).unwrap();
    assert_eq!(verified.difference, None);

    let whole = folder.path().join("whole.mcap");
    let recovered = recover(&file, &whole).unwrap();
    assert!(!recovered.was_whole && recovered.messages >= read as u64, "{recovered:?}");
    let full = recover(&file, "/dev/full".as_ref()).unwrap_err().to_string();
    assert!(full.contains("No space left on device"), "{full}");
    let repaired = Recording::open(&whole).unwrap();
    assert!(repaired.is_whole());
    assert_eq!(repaired.samples().count(), read);
    assert_eq!(repaired.plan().unwrap(), torn.plan().unwrap());
    // no file is created without content
    let nothing = folder.path().join("nothing.mcap");
    for (length, expected) in
        [(0, "the file is empty"), (8, "cut off after 8 bytes"), (60, "cut off after 60 bytes")]
    {
        std::fs::write(&file, &bytes[..length]).unwrap();
        let refused = recover(&file, &nothing).unwrap_err().to_string();
        assert!(refused.contains(expected) && !nothing.exists(), "{length}: {refused}");
        let opened = Recording::open(&file).and_then(|recording| recording.plan()).unwrap_err().to_string();
        assert!(opened.contains(expected) && !opened.contains("motorium recover"), "{length}: {opened}");
        assert_eq!(recording::open(&file).err().map(|error| error.to_string()), Some(refused), "{length}");
    }
    // a file truncated anywhere is read or rejected without a panic
    for length in (0..4096).chain([bytes.len() / 3, bytes.len() - 1]) {
        std::fs::write(&file, &bytes[..length]).unwrap();
        if let Ok(recording) = Recording::open(&file) {
            let _ = recording.samples().count();
        }
    }
}

#[test]
fn real_time_samples_are_recorded_or_counted_as_lost() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    let _machine = machine(env!("CARGO_TARGET_TMPDIR"));
    let text = GRAPH.replace("lockstep", "realtime") + &recorder(&file);
    let report = run(&text, &Options::threads());
    let recording = Recording::open(&file).unwrap();
    let topic = recording.topic("wrench").unwrap();
    let last = recording.samples().map(Result::unwrap).filter(|sample| sample.topic == topic).last().unwrap();
    let there = recording.topics()[topic].samples + recording.lost("wrench").unwrap();
    assert_eq!(there, last.stamp.sequence);
    assert_eq!(report.results["recorder"]["ended"], serde_json::Value::Null);
    assert!(last.time_ns > 1_600_000_000_000_000_000, "time since 1970");
    let error = verify(&recording, &registry(), &Options::inline(), &[]).unwrap_err().to_string();
    assert!(error.contains("recorded in real time"), "{error}");
}

#[test]
fn topics_are_selected_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    let chosen = recorder(&file).replace("config = {", "config = { topics = [\"s*\"],");
    run(&format!("{GRAPH}{chosen}"), &Options::inline());
    let recording = Recording::open(&file).unwrap();
    assert!(recording.topic("sum").is_some() && recording.topic("wrench").is_none());
    let text = format!("{GRAPH}{}", chosen.replace("s*", "x*"));
    let error = graph::check("walk.toml".as_ref(), text, &[], &registry(), &Machine::detect()).unwrap_err();
    assert!(
        error.render(false).contains("reads `x*`, which no component publishes"),
        "{}",
        error.render(false)
    );
}

#[test]
fn black_box_keeps_only_the_end_of_failed_runs() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.mcap");
    let kept = recorder(&file).replace("config = {", "config = { last = \"100 ms\",");
    run(&format!("{GRAPH}{kept}"), &Options::inline());
    assert!(!file.exists(), "the run was good");

    let text = format!("{GRAPH}{}", kept.replace("100 ms", "0 ms"));
    let error = graph::check("walk.toml".as_ref(), text, &[], &registry(), &Machine::detect()).unwrap_err();
    assert!(error.render(false).contains("expected a time above 0"), "{}", error.render(false));

    let failing = format!("{GRAPH}{kept}[component.failing]\nkind = \"test.failing\"\nrate = \"1 kHz\"\n");
    let registry = registry();
    let checked = graph::check("walk.toml".as_ref(), failing, &[], &registry, &Machine::detect());
    let plan = checked.unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    let report = session::run(plan, &registry, &Options::inline(), &mut |_| {}).unwrap();
    assert!(matches!(report.exit, Exit::SafeStop { .. }), "{:?}", report.exit);
    let recording = Recording::open(&file).unwrap();
    assert!(recording.is_whole());
    let times: Vec<u64> =
        recording.sorted().unwrap().iter().map(|sample| sample.stamp.publish_time).collect();
    let (first, last) = (times[0], times[times.len() - 1]);
    assert!(last >= 400_000_000 && last - first <= 100_000_000, "{first} to {last}");
}
