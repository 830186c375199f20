//! The report of a command gate as text.

use motorium::region::{GateReport, Latch, LimitKind};

/// Maximum number of joints and limits in a line; the rest is in `--json`.
const NAMED: usize = 4;

/// Returns a short reason why a gate stays in its safe state.
pub(crate) fn latch_words(latch: Latch) -> &'static str {
    match latch {
        Latch::Stop => "stopped",
        Latch::EmergencyStop => "emergency stop",
        Latch::SafeState => "latched",
    }
}

/// Returns the summary of a gate as one line; `None` if every command was forwarded unchanged.
pub(crate) fn describe(gate: &GateReport) -> Option<String> {
    let mut parts = Vec::new();
    if let Some(latch) = gate.latch {
        parts.push(format!("ended in its safe state: {}", latch_words(latch)));
    }
    let mut limited: Vec<_> = gate.limited.iter().collect();
    limited.sort_by_key(|limited| core::cmp::Reverse(limited.count));
    let shown: Vec<String> = limited
        .iter()
        .take(NAMED)
        .map(|limited| format!("{} {} {}", limited.count, limited.joint, limit_words(limited.limit)))
        .collect();
    if !shown.is_empty() {
        let rest: u64 = limited.iter().skip(NAMED).map(|limited| limited.count).sum();
        let rest = if rest > 0 { format!(", {rest} others") } else { String::new() };
        parts.push(format!("beyond a limit: {}{rest}", shown.join(", ")));
    }
    let refused: Vec<String> = gate
        .refused
        .iter()
        .map(|refused| format!("{} {}", refused.count, refused.reason.description()))
        .collect();
    if !refused.is_empty() {
        parts.push(format!("commands refused: {}", refused.join(", ")));
    }
    (!parts.is_empty()).then(|| parts.join("; "))
}

fn limit_words(limit: LimitKind) -> &'static str {
    match limit {
        LimitKind::Position => "position",
        LimitKind::PositionRate => "position rate",
        LimitKind::Velocity => "velocity",
        LimitKind::Acceleration => "acceleration",
        LimitKind::Effort => "effort",
        LimitKind::Kp => "kp",
        LimitKind::Kd => "kd",
        LimitKind::EffortRate => "effort rate",
    }
}

#[cfg(test)]
mod tests {
    use motorium::region::{Limited, Refusal, Refused};

    use super::*;

    #[test]
    fn gate_without_interventions_is_not_mentioned() {
        assert_eq!(describe(&GateReport::default()), None);
    }

    #[test]
    fn frequent_limits_are_named_and_others_counted() {
        let limited = |joint: usize, count: u64| Limited {
            joint: format!("joint{joint}"),
            limit: LimitKind::PositionRate,
            count,
        };
        let gate = GateReport {
            latch: Some(Latch::Stop),
            limited: (1..=6).map(|joint| limited(joint, 10 * joint as u64)).collect(),
            refused: vec![Refused { reason: Refusal::Future, count: 7 }],
            ..GateReport::default()
        };
        assert_eq!(
            describe(&gate).expect("it did something"),
            "ended in its safe state: stopped; beyond a limit: 60 joint6 position rate, 50 joint5 position rate, \
             40 joint4 position rate, 30 joint3 position rate, 30 others; commands refused: 7 stamped in the future"
        );
    }
}
