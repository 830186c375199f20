//! An adapter that is killed, and that hangs, repeatedly in one run.

use serde_json::Value;

use super::{drives, number, row};

/// Number of times that the adapter is killed, and hung, in one run.
pub(crate) fn kills() -> u64 {
    std::env::var("MOTORIUM_CAN_KILLS").map_or(3, |kills| kills.parse().expect("a number of kills"))
}

#[test]
fn drives_follow_again_after_each_adapter_restart() {
    for name in ["adapter_kill_often", "adapter_stop_often"] {
        let Some(row) = row(name) else { return };
        let results = row.results();
        let trips = |drive: &Value| number(&drive["watchdog_trips"]);
        // and once more if the run ends while the drives still monitor the bus
        let acted = drives(&results, |drive| (kills()..=kills() + 1).contains(&trips(drive)));
        assert_eq!(acted, 8, "{name}: {results}");
        let adapter = &results["adapter"];
        assert_eq!(adapter["tripped"], false, "{name}: {adapter}");
        assert!(adapter["enabled_in_cycle"].is_u64(), "{name}: {adapter}");
    }
}
