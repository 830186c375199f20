//! Bounds of the times in the `[safety]` table.

use crate::graph::diagnostic::Report;
use crate::graph::model::SafetyTable;
use crate::graph::read::At;
use crate::units::TimeSpan;

const MILLISECOND: u64 = 1_000_000;
const SECOND: u64 = 1_000 * MILLISECOND;

/// Longest accepted `stale_after`.
const LONGEST: TimeSpan = TimeSpan { ns: 10 * SECOND };
/// A `stale_after` above which a robot moves far on a dead controller's last command.
const LONG: TimeSpan = TimeSpan { ns: 200 * MILLISECOND };
/// A `settle` time too short for an arm to come to rest.
const SHORT_SETTLE: TimeSpan = TimeSpan { ns: 20 * MILLISECOND };
/// Longest accepted `settle`.
const LONGEST_SETTLE: TimeSpan = TimeSpan { ns: 60 * SECOND };

/// Rejects a time of zero.
pub(super) fn not_zero(key: &str, at: Option<&At<TimeSpan>>, why: &str, report: &mut Report) {
    if let Some(at) = at.filter(|at| at.get() == Some(&TimeSpan { ns: 0 })) {
        report.error(format!("`{key}` is zero")).label(&at.span, why).advise("leave it out for the default");
    }
}

/// Rejects invalid times and warns about doubtful ones.
pub(super) fn check(table: &SafetyTable, stale_after: TimeSpan, chains_ns: u64, report: &mut Report) {
    check_age("stale_after", table.stale_after.as_ref(), 0, report);
    check_age("source_stale_after", table.source_stale_after.as_ref(), chains_ns, report);
    if let Some(at) = &table.source_stale_after
        && let Some(age) = at.get()
        && age.ns < stale_after.ns + chains_ns
    {
        let needed = TimeSpan { ns: stale_after.ns + chains_ns };
        report
            .warning(format!("`source_stale_after` is {age}: commands of a healthy graph may be refused"))
            .label(&at.span, format!("`stale_after` and the periods from sensor to command are {needed}"))
            .advise("leave it out for a default that fits the graph");
    }
    check_settle(table.settle.as_ref(), report);
}

/// Checks the maximum age of a command, or of a measurement that leads to a command through components with
/// these periods, ns.
pub(super) fn check_age(key: &str, at: Option<&At<TimeSpan>>, chains_ns: u64, report: &mut Report) {
    let Some((at, age)) = at.and_then(|at| Some((at, *at.get()?))) else { return };
    let allowed = LONG.ns.max(4 * chains_ns);
    if age > LONGEST {
        report
            .error(format!("`{key}` is {age}: a robot would continue without its controller for this time"))
            .label(&at.span, format!("expected at most {LONGEST}"))
            .advise("a few periods of the component that writes the commands are usual, such as \"5 ms\"");
    } else if age.ns > allowed {
        report
            .warning(format!("`{key}` is {age}: a robot continues without its controller for this time"))
            .label(&at.span, format!("more than {}", TimeSpan { ns: allowed }))
            .advise("a few periods of the component that writes the commands are usual, such as \"5 ms\"");
    }
}

/// Checks the time that actuators stay in the safe state.
pub(super) fn check_settle(at: Option<&At<TimeSpan>>, report: &mut Report) {
    let Some((at, settle)) = at.and_then(|at| Some((at, *at.get()?))) else { return };
    if settle > LONGEST_SETTLE {
        report
            .error(format!("`settle` is {settle}: the end of a run would last this long"))
            .label(&at.span, format!("expected at most {LONGEST_SETTLE}"))
            .advise("leave it out for the default");
    } else if settle < SHORT_SETTLE {
        report
            .warning(format!("`settle` is {settle}: the actuators are stopped while the robot still moves"))
            .label(&at.span, format!("less than {SHORT_SETTLE}"))
            .advise("leave it out for the default");
    }
}
