//! Recordings from text and files.

use motorium_recordings::{Recording, RecordingError, Selection, read, read_all, read_text};

fn all() -> Selection {
    Selection::default()
}

fn selection(rate: f64) -> Selection {
    Selection { rate: Some(rate), ..all() }
}

fn channels(names: &[&str]) -> Selection {
    Selection { channels: names.iter().map(ToString::to_string).collect(), ..all() }
}

fn refusal(name: &str, text: &str, selection: &Selection) -> String {
    read_text(name, text, selection).unwrap_err().to_string()
}

fn column(recording: &Recording, channel: usize) -> Vec<f64> {
    recording.values().column(channel).iter().copied().collect()
}

#[test]
fn tables_accept_any_cell_separator() {
    for separator in [",", ";", "\t", " , "] {
        for end in ["\n", "\r\n"] {
            let text = "# by hand\ntime_s,a,b\n0.0,1,2\n# half way\n0.5,3,4e-1\n\n";
            let text = text.replace(',', separator).replace('\n', end);
            let recording = read_text("x.csv", &text, &all()).unwrap();
            assert_eq!(recording.names(), ["a", "b"]);
            assert_eq!(recording.times(), [0.0, 0.5]);
            assert_eq!(column(&recording, 1), [2.0, 0.4]);
        }
    }
    let recording = read_text("x.tsv", "t\ta,b\n0\t1\n1\t2\n", &all()).unwrap();
    assert_eq!(recording.names(), ["a,b"]);
}

#[test]
fn byte_order_mark_is_not_part_of_the_first_name() {
    let recording = read_text("x.csv", "\u{feff}t,a\n0,1\n1,2\n", &all()).unwrap();
    assert_eq!((recording.names(), recording.times()), (&["a".to_string()][..], &[0.0, 1.0][..]));
    let recording = read_text("x.json", "\u{feff}[[1], [2]]", &selection(1.0)).unwrap();
    assert_eq!(column(&recording, 0), [1.0, 2.0]);
}

#[test]
fn quotes_protect_separators_in_names_and_enclose_numbers() {
    let text = "\"time\";\"force, \"\"x\"\"\";\"y; left\"\n\"0\";\"1\";2\n1;3;4\n";
    let recording = read_text("x.csv", text, &all()).unwrap();
    assert_eq!(recording.names(), ["force, \"x\"", "y; left"]);
    assert_eq!(column(&recording, 1), [2.0, 4.0]);
    // spaces before quotes
    let recording = read_text("x.csv", "\"t\", \"a\"\n\"0\", \"1\"\n1, 2\n", &all()).unwrap();
    assert_eq!((recording.names(), column(&recording, 0)), (&["a".to_string()][..], vec![1.0, 2.0]));
}

#[test]
fn channels_are_selected_in_order() {
    let text = "clip,t,arm_b,arm_a,leg\nwalk,0,1,2,3\nwalk,1,4,5,6\n";
    let recording = read_text("x.csv", text, &channels(&["leg", "arm_*"])).unwrap();
    assert_eq!(recording.names(), ["leg", "arm_b", "arm_a"]);
    assert_eq!(column(&recording, 0), [3.0, 6.0]);
    let error = refusal("x.csv", text, &channels(&["tail"]));
    assert_eq!(error, "x.csv: found no channel `tail`; known: clip, arm_b, arm_a, leg");
    let error = refusal("x.csv", text, &all());
    assert_eq!(error, "x.csv, line 2, column 1 (`clip`): found `walk`, expected a number");
}

#[test]
fn velocities_are_channels_only_on_request() {
    let text = "time_s,a,b,a_velocity,b_velocity,wind_velocity\n0,1,2,3,4,5\n1,6,7,8,9,10\n";
    let recording = read_text("x.csv", text, &all()).unwrap();
    assert_eq!(recording.names(), ["a", "b", "wind_velocity"]);
    let velocity = Selection { field: Some("velocity".into()), ..all() };
    let recording = read_text("x.csv", text, &velocity).unwrap();
    assert_eq!(recording.names(), ["a", "b", "wind"]);
    assert_eq!(column(&recording, 1), [4.0, 9.0]);
    assert_eq!(read_text("x.csv", text, &channels(&["a_velocity"])).unwrap().names(), ["a_velocity"]);
    let effort = Selection { field: Some("effort".into()), ..all() };
    assert!(refusal("x.csv", text, &effort).contains("found no channel `NAME_effort`"));
}

#[test]
fn time_comes_from_named_columns_steps_or_a_rate() {
    for name in ["time_s", "time", "t", "timestamp"] {
        let recording = read_text("x.csv", &format!("a,{name}\n1,0.5\n2,1.5\n"), &all()).unwrap();
        assert_eq!((recording.times(), recording.names()), (&[0.5, 1.5][..], &["a".to_string()][..]));
    }
    for name in ["dt_s", "dt", "frame_dt"] {
        let text = format!("{name},a\n0.5,1\n0.25,2\n0.5,3\n");
        assert_eq!(read_text("x.csv", &text, &all()).unwrap().times(), [0.0, 0.5, 0.75]);
    }
    // of two clocks, one is the time and the other is not a channel
    let recording = read_text("x.csv", "timestamp,t,a\n7,0,1\n8,2,3\n", &all()).unwrap();
    assert_eq!((recording.times(), recording.names().len()), (&[0.0, 2.0][..], 1));
    assert_eq!(read_text("x.csv", "a\n1\n2\n", &selection(50.0)).unwrap().times(), [0.0, 0.02]);
    assert!(matches!(read_text("x.csv", "a\n1\n2\n", &all()), Err(RecordingError::NoTime { .. })));
    assert!(refusal("x.csv", "a\n1\n2\n", &selection(0.0)).starts_with("rate = 0: expected"));
}

#[test]
fn invalid_tables_are_rejected_with_line_and_column() {
    let error = |text: &str| refusal("x.csv", text, &all());
    assert_eq!(error("t,a\n0,1\n1\n"), "x.csv, line 3: found 1 cell, expected 2, as in the header");
    assert_eq!(
        error("# c\n\nt,a\n0,1\n1,one\n"),
        "x.csv, line 5, column 2 (`a`): found `one`, expected a number"
    );
    assert_eq!(
        error("t;a\n0;1\n1;0,5\n"),
        "x.csv, line 3, column 2 (`a`): found `0,5`, expected a number; write decimals with a point"
    );
    assert!(error("t,a\n0,1\n1,\n").contains("column 2 (`a`): found nothing, expected a number; cut"));
    let text = error("t a\n0 1\n1 2\n");
    assert!(
        text.ends_with("found `0 1`, expected a number; separate columns by commas, semicolons or tabs"),
        "{text}"
    );
    let text = error(&format!("t,a\n0,1\n1,{}\n", "1".repeat(4000)));
    assert!(text.contains(&format!("found `{}...`, expected a finite number", "1".repeat(40))), "{text}");
    assert!(error("t,a\n0,1\n\u{0}1,2\n").contains("found `\\u{0}1`, expected a number"));
    assert!(error("1,2\n3,4\n").contains("line 1: found numbers only, expected a header"));
    assert!(error("t,a,a\n0,1,2\n").contains("column 3 (`a`): found a second column `a`"));
    assert!(error("t,a\n0,1\n").contains("found 1 samples, expected at least 2"));
    assert!(error("t,a\n0,1\n2,2\n1,3\n").contains("line 4: found the time 1 s after 2 s"));
    assert!(error("dt,a\n0.1,1\n0,2\n0.1,3\n").contains("line 4: found the time 0.1 s after 0.1 s"));
    assert!(error("").contains("found nothing, expected a header"));
}

#[test]
fn non_finite_values_are_rejected_with_their_position() {
    for cell in ["NaN", "nan", "inf", "-inf", "1e999"] {
        let error = refusal("x.csv", &format!("t,a,b\n0,1,2\n1,2,{cell}\n"), &all());
        let expected = format!("x.csv, line 3, column 3 (`b`): found `{cell}`, expected a finite number; ");
        assert!(error.starts_with(&expected), "{error}");
        let error = refusal("x.csv", &format!("t,a\n0,1\n{cell},2\n"), &all());
        assert!(error.contains("line 3, column 1 (`t`)"), "{error}");
    }
    let error = refusal("x.jsonl", "{\"t\":0,\"a\":1}\n{\"t\":1,\"a\":[null]}\n", &all());
    assert!(error.contains("x.jsonl, line 2: found `null`, expected a finite number"), "{error}");
    let error = refusal("x.json", "[{\"x\":[1,2]},{\"x\":[1,null]}]", &selection(1.0));
    assert!(error.contains("x.json, item 2: found `null`"), "{error}");
}

#[test]
fn printed_topic_is_read_by_field() {
    let line = |t: f64, x: f64| {
        format!(
            r#"{{"topic":"arm/joint_state","sequence":7,"time_s":{t},"publisher":"encoder","value":{{"count":2,"position":[{x},2.0],"velocity":[9.0,{x}]}}}}"#
        )
    };
    let text = format!("{}\n{}\n", line(1.5, 0.25), line(1.75, 0.5));
    let recording = read_text("x.jsonl", &text, &all()).unwrap();
    assert_eq!((recording.times(), recording.names().len()), (&[1.5, 1.75][..], 2));
    assert_eq!(column(&recording, 0), [0.25, 0.5]);
    let velocity = Selection { field: Some("velocity".into()), ..all() };
    assert_eq!(column(&read_text("x.jsonl", &text, &velocity).unwrap(), 0), [9.0, 9.0]);
    let wrong = Selection { field: Some("torque".into()), ..all() };
    let error = refusal("x.jsonl", &text, &wrong);
    assert_eq!(error, "x.jsonl, line 1: found no channel `torque`; known: count, position, velocity");
}

#[test]
fn lists_are_samples_and_objects_with_arrays_are_recordings() {
    let recording = read_text("x.json", "[[1, 2], [3, 4], [5, 6]]", &selection(50.0)).unwrap();
    assert_eq!(recording.times(), [0.0, 0.02, 0.04]);
    assert_eq!((recording.id(), recording.names()), ("x", &["0".to_string(), "1".to_string()][..]));
    let recording =
        read_text("c.json", r#"{"names":["a"],"positions":[[1],[2],[4]]}"#, &selection(10.0)).unwrap();
    assert_eq!((recording.names(), column(&recording, 0)), (&["a".to_string()][..], vec![1.0, 2.0, 4.0]));
    let recording = read_text("c.json", r#"{"x":[1,2,4],"t":[0,1,3]}"#, &all()).unwrap();
    assert_eq!((recording.times(), column(&recording, 0)), (&[0.0, 1.0, 3.0][..], vec![1.0, 2.0, 4.0]));
    let text = "{\"id\":1,\"x\":[1,2]}\n{\"t\":0,\"x\":1}\n";
    assert!(refusal("x.jsonl", text, &selection(1.0)).contains("line 2: found a sample among recordings"));
}

#[test]
fn recordings_per_line_keep_name_label_and_duration() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jsonl");
    let lines = [
        r#"{"id":1,"label":"l","n":3,"rate":10,"vx":[1,2,3],"vy":[0,0,1]}"#,
        r#"{"letter":"A","demo":3,"duration":2,"vx":[1,2],"vy":[3,4]}"#,
    ];
    std::fs::write(&path, lines.join("\n")).unwrap();
    let all_of_it = read_all(&path, &selection(100.0)).unwrap();
    let described: Vec<_> =
        all_of_it.iter().map(|r| (r.id(), r.label(), r.duration(), r.names().join(" "))).collect();
    assert_eq!(described, [("1", Some("l"), 0.2, "x y".into()), ("A-3", Some("A"), 2.0, "x y".into())]);
    // velocities times the 0.1 s or 2 s between their samples, accumulated
    let sums = column(&all_of_it[0], 0);
    assert!(sums.iter().zip([0.1, 0.3, 0.6]).all(|(sum, expected)| (sum - expected).abs() < 1e-12));
    assert_eq!(column(&all_of_it[1], 1), [6.0, 14.0]);
    let error = read(&path, &all()).unwrap_err().to_string();
    assert!(error.ends_with("found 2 recordings, expected one"), "{error}");
}

#[test]
fn folder_is_read_in_file_name_order() {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in
        [("b.csv", "t,a\n0,1\n1,2\n"), ("a.json", "{\"recordings\":[{\"a\":[5,6]}]}"), ("c.txt", "no")]
    {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let recordings = read_all(folder.path(), &selection(1.0)).unwrap();
    assert_eq!(recordings.iter().map(Recording::id).collect::<Vec<_>>(), ["0", "b"]);
    let error = read_all(&folder.path().join("c.txt"), &all()).unwrap_err().to_string();
    assert!(error.contains("expected a name that ends in .csv, .tsv, .json"), "{error}");
    let empty = tempfile::tempdir().unwrap();
    assert!(matches!(read_all(empty.path(), &all()), Err(RecordingError::Count { found: 0, .. })));
    let missing = read_all(&folder.path().join("none.csv"), &all());
    assert!(matches!(missing, Err(RecordingError::System { .. })));
}

#[test]
fn truncated_or_non_utf8_text_is_rejected_with_its_line() {
    let error = refusal("x.jsonl", "{\"t\": 0, \"x\": 1}\n{\"t\": 1, \"x\":", &all());
    assert!(error.starts_with("x.jsonl, line 2, column 13: found EOF"), "{error}");
    assert!(error.ends_with("expected JSON; the text is truncated"), "{error}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.csv");
    std::fs::write(&path, b"t,a\n0,1\n1,\xff\n").unwrap();
    let error = read(&path, &all()).unwrap_err().to_string();
    assert!(error.ends_with("line 3: found invalid bytes, expected UTF-8 text"), "{error}");
}

#[test]
fn units_of_time_are_named_or_recognised() {
    let epoch = 1_795_734_000.0_f64;
    for (name, unit) in [("timestamp", 1.0), ("time", 1e3), ("t", 1e6), ("timestamp", 1e9), ("log_time", 1e9)]
    {
        let line = |k: i32| format!("{},{k}\n", (epoch + 0.01 * f64::from(k)) * unit);
        let text = format!("{name},a\n{}", (0..100).map(line).collect::<String>());
        let recording = read_text("x.csv", &text, &all()).unwrap();
        assert!((recording.duration() - 0.99).abs() < 1e-5, "{name}, {unit}: {} s", recording.duration());
        assert_eq!(recording.names(), ["a"]);
    }
    for (name, unit) in [("time_ms", 1e3), ("timestamp_us", 1e6), ("t_ns", 1e9), ("timestamp_s", 1.0)] {
        let line = |k: i32| format!("{},{k}\n", 0.01 * f64::from(k) * unit);
        let text = format!("{name},a\n{}", (0..100).map(line).collect::<String>());
        let recording = read_text("x.csv", &text, &all()).unwrap();
        assert!((recording.duration() - 0.99).abs() < 1e-9, "{name}: {} s", recording.duration());
    }
    let json = r#"{"timestamp": 1795734000000000000, "x": 0.0}
{"timestamp": 1795734000010000000, "x": 0.1}"#;
    assert!((read_text("x.jsonl", json, &all()).unwrap().duration() - 0.01).abs() < 1e-6);
}

#[test]
fn units_and_case_of_time_columns_have_many_spellings() {
    for (name, unit) in [
        ("Time", 1.0),
        ("Timestamp", 1.0),
        ("TIME_MS", 1e3),
        ("Time [ms]", 1e3),
        ("time (us)", 1e6),
        ("t[s]", 1.0),
        ("t_s", 1.0),
        ("Time (sec)", 1.0),
        ("timestamp [ns]", 1e9),
    ] {
        let line = |k: i32| format!("{},{k}\n", 0.01 * f64::from(k) * unit);
        let text = format!("{name},a\n{}", (0..100).map(line).collect::<String>());
        let recording = read_text("x.csv", &text, &all()).unwrap();
        assert!((recording.duration() - 0.99).abs() < 1e-9, "{name}: {} s", recording.duration());
        assert_eq!(recording.names(), ["a"]);
    }
    // a temperature and a torque
    let recording = read_text("x.csv", "time,T,T [N m]\n0,20,1\n1,21,2\n", &all()).unwrap();
    assert_eq!(recording.names(), ["T", "T [N m]"]);
}

#[test]
fn words_starting_with_v_are_not_velocities() {
    let text = r#"{"rate": 10, "voltage": [1, 2, 3], "valve": [0, 0, 1]}"#;
    let recording = read_text("x.json", text, &all()).unwrap();
    assert_eq!(recording.names(), ["valve", "voltage"]);
    assert_eq!(column(&recording, 1), [1.0, 2.0, 3.0]);
    for names in [["vx", "vy"], ["v_x", "v_y"], ["v0", "v1"], ["vq1", "vq2"]] {
        let text = format!(r#"{{"rate": 10, "{}": [1, 2, 3], "{}": [0, 0, 1]}}"#, names[0], names[1]);
        let recording = read_text("x.json", &text, &all()).unwrap();
        let expected = names.map(|name| name.trim_start_matches(['v', '_']).to_string());
        assert_eq!(recording.names(), expected);
        assert!((column(&recording, 0)[2] - 0.6).abs() < 1e-12);
    }
}

#[test]
fn times_of_unknown_unit_are_rejected() {
    let table = |name: &str, step: f64| {
        let lines: String = (0..100).map(|k| format!("{},{k}\n", step * f64::from(k))).collect();
        format!("{name},a\n{lines}")
    };
    // the last one is a spreadsheet date, in days
    for (name, step) in [("time", 10.0), ("t", 1.0), ("timestamp", 1e4), ("time", 1e7), ("time", 1e-7)] {
        let error = refusal("x.csv", &table(name, step), &all());
        assert!(error.contains("without a unit") && error.contains("time_ms"), "{error}");
    }
    let error =
        refusal("x.csv", &"dt,a\n".chars().chain("10,1\n".repeat(9).chars()).collect::<String>(), &all());
    assert!(error.contains("without a unit"), "{error}");
    assert!((read_text("x.csv", &table("time_s", 10.0), &all()).unwrap().duration() - 990.0).abs() < 1e-9);
    // a name that contradicts the numbers
    let late: String = (0..50).map(|k| format!("{},{k}\n", 1_764_300_000_000_i64 + 20 * k)).collect();
    let error = refusal("x.csv", &format!("time_s,a\n{late}"), &all());
    assert!(
        error.contains("found the time 1764300000980 in units of 1 s, expected a time before the year 2286"),
        "{error}"
    );
    let named = read_text("x.csv", &format!("time_ms,a\n{late}"), &all()).unwrap();
    assert!((named.duration() - 0.98).abs() < 1e-6);
    // a clock that was set
    let late: String = (0..50).map(|k| format!("{},{k}\n", 1_764_300_000.0 + 0.01 * f64::from(k))).collect();
    let error = refusal("x.csv", &format!("t,x\n0,0\n{late}"), &all());
    assert!(error.starts_with("x.csv, line 3: found 1764300000 s since the previous sample"), "{error}");
}

#[test]
fn motorium_export_table_is_read() {
    let text = "time_ns,sequence,publish_time_ns,source_time_ns,episode,count,position[0],position[1],velocity[0]\n\
                0,1,0,0,0,2,1,2,9\n1000000,2,1000000,1000000,0,2,3,4,9\n2000000,3,2000000,2000000,0,2,5,6,9\n";
    let recording = read_text("x.csv", text, &all()).unwrap();
    assert_eq!(recording.names(), ["position[0]", "position[1]"]);
    assert!((recording.duration() - 0.002).abs() < 1e-12);
    let velocity = Selection { field: Some("velocity".into()), ..all() };
    assert_eq!(read_text("x.csv", text, &velocity).unwrap().names(), ["velocity[0]"]);
    assert_eq!(read_text("x.csv", text, &channels(&["position[1]"])).unwrap().names(), ["position[1]"]);
}

#[test]
fn cutoff_far_below_the_duration_is_rejected() {
    let recording = read_text("x.csv", "t,a\n0,1\n1,2\n", &all()).unwrap();
    assert!(recording.evenly(10, Some(1e-9)).unwrap_err().to_string().starts_with("cutoff = "));
}

#[test]
fn contradictory_rates_and_durations_are_refused() {
    let recording = |rate: f64, duration: f64| {
        let text = format!(r#"{{"rate": {rate}, "duration": {duration}, "x": [0, 1, 2, 3]}}"#);
        read_text("x.json", &text, &all())
    };
    assert!((recording(1.0, 3.0).unwrap().duration() - 3.0).abs() < 1e-12);
    // some writers count the last interval as well
    assert!((recording(1.0, 4.0).unwrap().duration() - 4.0).abs() < 1e-12);
    let error = recording(100.0, 3.0).unwrap_err().to_string();
    assert!(error.contains("a `rate` of 100 Hz and a `duration` of 3 s"), "{error}");
}
