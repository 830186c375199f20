//! `motorium bench latency`: its table, its file and its picture, from a short real run.

use std::path::Path;
use std::process::Output;

use serde_json::Value as Json;

use crate::program::machine;

fn bench(arguments: &[&str]) -> Output {
    crate::program::run(&[&["bench", "latency"], arguments].concat())
}

fn text(output: &[u8]) -> String {
    String::from_utf8_lossy(output).into_owned()
}

/// Recomputes each percentile from the pairs of the histogram alone.
fn assert_percentiles_match_buckets(name: &str, ns: &Json) {
    let buckets: Vec<(u64, u64)> = serde_json::from_value(ns["buckets"].clone()).expect("pairs");
    let count: u64 = buckets.iter().map(|(_, count)| count).sum();
    let longest = ns["max"].as_u64().expect("a number");
    for (key, share) in [("p50", 0.5), ("p99", 0.99), ("p99_9", 0.999), ("max", 1.0)] {
        let rank = (share * count as f64).ceil() as u64;
        let mut seen = 0;
        let bucket = buckets.iter().find(|(_, count)| {
            seen += count;
            seen >= rank
        });
        let again = bucket.expect("a bucket").0.min(longest);
        let value = ns[key].as_u64().expect("a number");
        // Single samples: exact below 16 us, to 1/8192 above.
        assert!(
            again >= value && again - value <= value / 8_192,
            "{name}: {key} {value}, of the buckets {again}"
        );
        assert!(value >= 16_384 || again == value, "{name}: {key} {value}, of the buckets {again}");
    }
}

/// The file against the schema that the program prints.
fn follows_its_schema(written: &Json) {
    let schema = crate::program::json(&["schema", "bench"]);
    let validator = jsonschema::validator_for(&schema).expect("a schema");
    let errors: Vec<String> = validator.iter_errors(written).map(|error| error.to_string()).collect();
    assert!(errors.is_empty(), "{errors:?}");
    let mut broken = written.clone();
    broken["measurements"][0]["ns"]["p50"] = Json::from("fast");
    assert!(!validator.is_valid(&broken), "a schema must refuse text for a number");
}

#[test]
fn short_bench_writes_samples_picture_and_table() {
    let _machine = machine();
    let folder = tempfile::tempdir().expect("a folder");
    let (json, svg) = (folder.path().join("bench.json"), folder.path().join("bench.svg"));
    let names = ["floor.clock", "floor.futex.same", "hop.blocking.same.512", "iceoryx2.same.512"];
    let mut arguments = vec!["--samples", "2000", "--json", "--output", json.to_str().expect("a plain path")];
    arguments.extend(["--plot", svg.to_str().expect("a plain path"), "--quick", "--only"]);
    arguments.extend(names);
    let output = bench(&arguments);
    let table = text(&output.stdout);
    assert!(output.status.success(), "{table}{}", text(&output.stderr));
    for name in names {
        assert!(table.lines().any(|line| line.starts_with(name)), "no line of {name}:\n{table}");
    }

    let written: Json = serde_json::from_slice(&std::fs::read(json).expect("a file")).expect("it is JSON");
    assert_eq!(written["version"], 2);
    assert_eq!(written["arguments"][1], "latency");
    assert!(written["machine"]["kernel"].as_str().is_some_and(|kernel| !kernel.is_empty()));
    let measurements = written["measurements"].as_array().expect("measurements");
    for name in names {
        let is_it = |m: &&Json| m["name"] == name;
        let ns =
            &measurements.iter().find(is_it).unwrap_or_else(|| panic!("{name} is not in the file"))["ns"];
        let count = ns["count"].as_u64().expect("a count");
        assert!(count >= 2_000, "{name}: {count} samples");
        let buckets = ns["buckets"].as_array().expect("the raw histogram");
        let gathered: u64 = buckets.iter().filter_map(|bucket| bucket[1].as_u64()).sum();
        assert_eq!(gathered, count, "{name}: every sample is in the histogram");
        let percentile = |key: &str| ns[key].as_u64().expect("a percentile");
        assert_percentiles_match_buckets(name, ns);
        let rising = ["p50", "p99", "p99_9", "max"].map(percentile);
        assert!(rising.is_sorted() && rising[0] > 0, "{name}: {rising:?}");
        let last = buckets.last().and_then(|bucket| bucket[0].as_u64()).expect("a last bucket");
        assert!(last >= rising[3], "{name}: the longest of {} is beyond {last}", rising[3]);
    }
    // Compared targets have a verdict, all others are open; the table agrees with the file.
    for target in written["targets"].as_array().expect("targets") {
        let (what, verdict) =
            (target["what"].as_str().expect("words"), target["verdict"].as_str().expect("one"));
        match target["measured"].as_f64() {
            None => assert_eq!(verdict, "not_measured", "{what}"),
            Some(value) => {
                let met = value <= target["at_most"].as_f64().expect("a number");
                assert_eq!(verdict, if met { "met" } else { "missed" }, "{what}");
            }
        }
        assert!(table.contains(what), "{what}");
    }
    let decided = written["targets"].as_array().expect("targets").iter().filter(|t| !t["measured"].is_null());
    assert_eq!(decided.count(), 2, "to the futex and to stock iceoryx2");

    follows_its_schema(&written);
    compares_with_itself_and_with_a_slower_one(&written, folder.path());

    let picture = std::fs::read_to_string(svg).expect("a picture");
    let document = roxmltree::Document::parse(&picture).expect("it is XML");
    let curves = document.descendants().filter(|node| node.has_tag_name("polyline")).count();
    let is_hop = |m: &&Json| m["name"].as_str().is_some_and(|name| name.starts_with("hop."));
    let hops = measurements.iter().filter(is_hop).count();
    assert_eq!(curves, measurements.len() + hops, "a curve for each, and hops in both panels");
}

fn compares_with_itself_and_with_a_slower_one(written: &Json, folder: &Path) {
    let save = |name: &str, content: &Json| {
        let path = folder.join(name).to_str().expect("a plain path").to_string();
        std::fs::write(&path, content.to_string()).expect("a file");
        path
    };
    let before = save("before.json", written);
    let same = crate::program::printed(&["bench", "compare", &before, &before]);
    assert!(same.ends_with("3 compared: 0 slower, 0 faster\n"), "{same}");
    let mut slow = written.clone();
    let measurements = slow["measurements"].as_array_mut().expect("measurements");
    let hop = measurements.iter_mut().find(|m| m["name"] == "hop.blocking.same.512").expect("the hop");
    for turn in hop["slices_p50"].as_array_mut().expect("turns") {
        *turn = Json::from(100 * turn.as_u64().expect("ns"));
    }
    let after = save("after.json", &slow);
    let output = crate::program::run(&["bench", "compare", &before, &after]);
    let table = text(&output.stdout);
    assert_eq!(output.status.code(), Some(6), "{table}");
    let line = table.lines().find(|line| line.contains("hop.blocking.same.512")).expect("a line");
    assert!(line.contains("floor.futex.same") && line.ends_with("+9900 %  slower"), "{table}");
    let output = crate::program::run(&["bench", "compare", &before, &after, "--json"]);
    let seen: Json = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(seen["changes"][0]["direction"], "slower");
    // Files other than benchmarks are refused.
    let output = crate::program::run(&["bench", "compare", &before, "Cargo.toml"]);
    assert_eq!(output.status.code(), Some(3), "{}", text(&output.stderr));
}

#[test]
fn unwritable_output_is_refused_before_measuring() {
    let output = bench(&["--only", "floor.clock", "--json", "--output", "/nowhere/bench.json"]);
    assert!(!output.status.success());
    let error: Json =
        serde_json::from_slice(&output.stdout).expect("one object, and nothing that was measured");
    assert!(error["error"].as_str().expect("text").contains("/nowhere/bench.json"), "{error}");
}

#[test]
fn chain_of_real_processes_is_measured_end_to_end() {
    let _machine = machine();
    let output = bench(&["--quick", "--only", "chain.2", "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("chain.2 "), "the table goes to standard error beside JSON");
    let written: Json = serde_json::from_slice(&output.stdout).expect("nothing but JSON");
    let chain =
        written["measurements"].as_array().expect("measurements").iter().find(|m| m["name"] == "chain.2");
    let chain = chain.expect("the chain");
    follows_its_schema(&written);
    let count = chain["ns"]["count"].as_u64().expect("a count");
    assert!(count > 500, "{count} samples of two seconds at 1 kHz");
}

#[test]
fn unknown_measurement_lists_the_known_ones() {
    let output = bench(&["--only", "hop.teleport"]);
    assert!(!output.status.success());
    let words = text(&output.stderr);
    assert!(
        words.contains("no measurement is named `hop.teleport`") && words.contains("hop.blocking.same.512"),
        "{words}"
    );
}

#[test]
fn ratchet_accepts_no_other_options() {
    let output = bench(&["--ratchet", "--quick"]);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
}
