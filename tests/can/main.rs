//! CAN on a real kernel: an arm under control over SocketCAN, in virtual machines, with every kind of bus
//! fault.
//!
//! Two machines are started once (`vm.sh`) and run all rows (`rows.sh`); the tests check their reports. Their
//! time is virtual, so the tests assert only counts and states. If no machine is available, for example
//! without a network, each test reports that it was skipped.

mod adapters;
mod arms;
mod ends;
mod often;
mod rows;
mod scans;
mod twelve;

use serde_json::Value;

use rows::{drives, machine, number, row};

#[test]
fn the_machine_runs_all_rows_to_their_end() {
    let Some(machine) = machine() else { return };
    println!("{}", machine.times);
    assert_eq!(machine.end, Ok(()), "{:?}", machine.rows.keys());
}

#[test]
fn twelve_joints_at_1_khz_lose_no_reply_in_the_kernel() {
    let Some(row) = row("twelve") else { return };
    let (report, results) = (row.report(), row.results());
    let adapter = &results["adapter"];
    assert!(number(&adapter["cycles"]) > 5_000, "{adapter}");
    row.assert_steady(adapter);
    for bus in ["left", "right"] {
        assert_eq!(adapter["buses"][bus]["condition"], "active");
        assert_eq!(adapter["buses"][bus]["unsent"], 0);
        // six drives with two CAN FD frames each, 98 to 114 us per pair
        let load = adapter["buses"][bus]["load"].as_f64().expect("a number");
        assert!((0.5..0.7).contains(&load), "{bus}: {load}");
        let highest = adapter["buses"][bus]["highest_load"].as_f64().expect("a number");
        assert!(highest >= load && highest < 0.75, "{bus}: {highest}");
    }
    assert!(adapter["joints"].as_object().is_some_and(|joints| joints.len() == 12));
    assert!(adapter["joints"].as_object().expect("joints").values().all(|joint| joint["phase"] == "enabled"));
    let component =
        report["components"].as_array().expect("a list").iter().find(|one| one["name"] == "adapter");
    let component = component.expect("the adapter");
    assert_eq!(component["allocations"], 0, "{component}");
    let misses = &component["misses"];
    let late: u64 = ["late_wake", "long_step", "stolen"].iter().map(|cause| number(&misses[*cause])).sum();
    assert!(late <= 1, "{misses}");
    assert_eq!(number(&results["policy"]["goals_missed"]), 0, "{}", results["policy"]);
}

#[test]
fn a_silent_node_is_lost_in_its_third_cycle() {
    let Some(row) = row("silent") else { return };
    let adapter = &row.results()["adapter"];
    let joint = &adapter["joints"]["panda_joint4"];
    assert_eq!((number(&joint["lost"]), &adapter["tripped"]), (1, &Value::from(true)), "{adapter}");
    // every cycle since the first silent one is missing; `lost_in_cycle` is the third of these
    let since = number(&adapter["cycles"]) - number(&joint["lost_in_cycle"]) + 3;
    let missing = number(&joint["missing_replies"]);
    assert!(missing > 3 && missing <= since, "{missing} of {since}");
    let others =
        adapter["joints"].as_object().expect("joints").iter().filter(|(name, _)| *name != "panda_joint4");
    assert!(
        others.map(|(_, joint)| number(&joint["missing_replies"])).all(|missing| missing == 0),
        "{adapter}"
    );
}

#[test]
fn late_replies_count_as_late_and_missing() {
    let Some(row) = row("late") else { return };
    let adapter = &row.results()["adapter"];
    let joint = &adapter["joints"]["panda_joint4"];
    assert!(number(&joint["missing_replies"]) >= 3 && number(&adapter["late_replies"]) >= 3, "{adapter}");
    assert_eq!(adapter["tripped"], true);
}

#[test]
fn a_duplicate_answer_is_counted_and_trips_nothing() {
    let Some(row) = row("twice") else { return };
    let adapter = &row.results()["adapter"];
    let joint = &adapter["joints"]["panda_joint4"];
    let second = number(&joint["duplicate_replies"]) + number(&joint["late_replies"]);
    assert!(second > 50, "{adapter}");
    row.assert_steady(adapter);
}

#[test]
fn answers_of_a_duplicate_drive_are_ignored() {
    let Some(row) = row("twice") else { return };
    let adapter = &row.results()["adapter"];
    let joint = &adapter["joints"]["panda_joint2"];
    // each cycle of the 0.4 s has one extra reply, whose position is too far away to be accepted
    let second = number(&joint["duplicate_replies"])
        + number(&joint["late_replies"])
        + number(&adapter["implausible_frames"]);
    assert!(second > 100, "{adapter}");
    // accepted as a position, one of them would be a discontinuity of a third of a radian, which no gate
    // passes
    row.assert_steady(adapter);
}

#[test]
fn malformed_and_corrupt_answers_are_refused() {
    let Some(row) = row("refused") else { return };
    let adapter = &row.results()["adapter"];
    // three of each
    let refused = number(&adapter["refused_frames"]) + number(&adapter["stray_frames"]);
    assert!(refused >= 6, "{adapter}");
    assert_eq!(adapter["tripped"], true, "{adapter}");
    for name in ["panda_joint4", "panda_joint2"] {
        assert_eq!(number(&adapter["joints"][name]["lost"]), 1, "{name}: {adapter}");
    }
}

#[test]
fn a_drive_that_lost_its_power_stays_disabled() {
    let Some(row) = row("off") else { return };
    let results = row.results();
    assert_eq!(results["adapter"]["tripped"], true);
    assert_eq!(results["drives"]["drives"]["panda_joint4"]["enabled"], false);
}

#[test]
fn one_resume_releases_a_tripped_adapter() {
    let Some(row) = row("resumed") else { return };
    let results = row.results();
    let adapter = &results["adapter"];
    assert_eq!(
        (number(&adapter["joints"]["panda_joint4"]["lost"]), &adapter["tripped"]),
        (1, &Value::from(false)),
        "{row:?}"
    );
    let adapter = adapter["joints"].as_object().expect("joints");
    assert!(adapter.values().all(|joint| joint["phase"] == "enabled"), "{results}");
}

#[test]
fn command_is_sent_in_the_cycle_of_its_publication() {
    // In virtual time an instruction takes a nanosecond, so these are instructions of a test build. A command
    // that arrived in time but waited for the next cycle would take at least the cycle, of 2 and 1 ms, minus
    // `command_within`.
    for (name, longest_us) in [("twice", 300.0), ("twelve", 550.0)] {
        let Some(row) = row(name) else { return };
        let adapter = &row.results()["adapter"];
        let times = &adapter["command_to_frame_us"];
        // one for nearly every cycle in which the drives follow
        assert!(number(&times["count"]) + 250 > number(&adapter["cycles"]), "{name}: {adapter}");
        assert!(times["p99"].as_f64().is_some_and(|p99| p99 < longest_us), "{name}: {times}");
    }
}

#[test]
fn a_babbling_node_is_counted_and_the_drives_still_answer() {
    let Some(row) = row("disturbed") else { return };
    let adapter = &row.results()["adapter"];
    // one frame every 50 us for 200 ms
    assert!(number(&adapter["stray_frames"]) > 3_000, "{adapter}");
    row.assert_steady(adapter);
}

#[test]
fn error_passive_bus_is_reported_and_stays_in_use() {
    let Some(row) = row("disturbed") else { return };
    let adapter = &row.results()["adapter"];
    let bus = &adapter["buses"]["can0"];
    assert!(number(&bus["errors"]) >= 2, "{bus}");
    assert_eq!(
        (&bus["condition"], &adapter["tripped"]),
        (&Value::from("active"), &Value::from(false)),
        "{adapter}"
    );
}

#[test]
fn bus_off_disables_every_drive_permanently() {
    let Some(row) = row("bus_off") else { return };
    let results = row.results();
    let bus = &results["adapter"]["buses"]["can0"];
    assert_eq!((number(&bus["bus_off"]), &bus["condition"]), (1, &Value::from("active")), "{bus}");
    assert!(number(&bus["unsent"]) >= 8 * 90, "nothing is sent for 200 ms: {bus}");
    assert_eq!(results["adapter"]["tripped"], true);
    assert_eq!(
        drives(&results, |drive| drive["watchdog_trips"] == 1 && drive["enabled"] == false),
        8,
        "{results}"
    );
}

#[test]
fn unacknowledged_frames_are_reported() {
    let Some(row) = row("unacknowledged") else { return };
    let bus = &row.results()["adapter"]["buses"]["can0"];
    assert_eq!(number(&bus["unacknowledged"]), 1, "{bus}");
    assert_eq!(bus["diagnosis"], "nobody acknowledges on `can0`: power, bitrate, termination?");
}

#[test]
fn link_down_trips_and_the_link_is_used_again_when_up() {
    let Some(row) = row("down") else { return };
    let results = row.results();
    let bus = &results["adapter"]["buses"]["can0"];
    assert_eq!((number(&bus["down"]), &bus["condition"]), (1, &Value::from("active")), "{bus}");
    assert!(number(&bus["unsent"]) >= 8 * 100, "{bus}");
    assert_eq!(results["adapter"]["tripped"], true);
    assert_eq!(drives(&results, |drive| drive["watchdog_trips"] == 1), 8, "{results}");
}

#[test]
fn an_interface_plugged_in_again_is_found() {
    let Some(row) = row("gone") else { return };
    let results = row.results();
    let bus = &results["adapter"]["buses"]["can0"];
    assert!(number(&bus["down"]) >= 1, "{bus}");
    assert_eq!(
        (&bus["condition"], &results["adapter"]["tripped"]),
        (&Value::from("active"), &Value::from(true)),
        "{bus}"
    );
    assert_eq!(drives(&results, |drive| drive["enabled"] == true), 0, "{results}");
}

#[test]
fn missing_interface_is_named_with_the_next_step() {
    let Some(row) = row("missing_interface") else { return };
    assert_ne!(row.code, 0);
    let said = row.errors.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        said.contains("the CAN interface `vcan7` does not exist: found vcan0 (vcan, up), vcan1 (vcan, up)"),
        "{said}"
    );
    assert!(said.contains("sudo ip link add vcan7 type vcan"), "{said}");
}

#[test]
fn drives_release_when_the_adapter_is_killed_or_hangs() {
    for name in ["adapter_killed", "adapter_hung"] {
        let Some(row) = row(name) else { return };
        let results = row.results();
        assert_eq!(
            drives(&results, |drive| drive["watchdog_trips"] == 1 && drive["enabled"] == false),
            8,
            "{name}: {results}"
        );
    }
}

#[test]
fn a_lost_controller_leads_to_the_safe_state() {
    for name in ["controller_killed", "controller_stopped"] {
        let Some(row) = row(name) else { return };
        let results = row.results();
        let adapter = &results["adapter"];
        assert!(number(&adapter["cycles_in_safe_state"]) > 200, "{name}: {adapter}");
        row.assert_steady(adapter);
    }
}

#[test]
fn nothing_is_sent_after_the_launcher_is_killed() {
    let Some(row) = row("launcher_killed") else { return };
    // the log is empty after two seconds, and so is the list of processes
    assert_eq!((row.code, row.errors.split_whitespace().collect::<Vec<_>>()), (1, vec!["0", "0"]), "{row:?}");
    assert!(row.text.lines().count() >= 16, "{row:?}");
}

#[test]
fn an_overloaded_bus_is_refused_with_its_arithmetic() {
    let Some(row) = row("saturated") else { return };
    assert_eq!(row.code, 3, "{row:?}");
    assert!(row.errors.contains("8 drives do not fit on bus `can0`"), "{row:?}");
}
