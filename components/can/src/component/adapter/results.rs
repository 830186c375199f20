//! Result of `can.adapter`.

use super::CanAdapter;
use crate::adapter::{HomingState, Phase};

/// Minimum number of duplicate answers that suggests another drive with the same number.
const TWIN_ANSWERS: u64 = 10;

impl CanAdapter {
    /// Describes the joint on a bus whose frames are repeatedly answered twice, and the next step.
    fn twins(&self, bus: usize, name: &str) -> Option<String> {
        let links = self.names.iter().zip(self.adapter.links()).filter(|(_, link)| link.bus() == bus);
        let mut twice = links.filter(|(_, link)| link.counts().duplicate >= TWIN_ANSWERS);
        let (joint, link) = twice.next()?;
        Some(format!(
            "{} frames to the drive of `{joint}` were answered twice: do two drives on `{name}` have \
             the same number? `motorium can scan` lists them one at a time",
            link.counts().duplicate
        ))
    }

    /// Returns the counters of buses and joints for the whole run.
    pub(super) fn results(&self) -> serde_json::Value {
        let mut joints = serde_json::Map::new();
        for (name, link) in self.names.iter().zip(self.adapter.links()) {
            let counts = link.counts();
            let value = serde_json::json!({
                "phase": if link.is_found() { phase(link.phase()) } else { "absent" },
                "awaited_replies": counts.awaited,
                "missing_replies": counts.missing,
                "late_replies": counts.late,
                "duplicate_replies": counts.duplicate,
                "refused_frames": counts.refused,
                "implausible_frames": counts.implausible,
                "emergencies": counts.emergencies,
                "clamped_commands": counts.clamped,
                "homing": link.homing().map(homing),
                "homing_fault": match link.homing() {
                    Some(HomingState::Failed(fault)) => Some(fault.to_string()),
                    _ => None,
                },
                "lost": counts.lost,
                "lost_in_cycle": counts.lost_in,
                "faults": counts.faults,
                "fault": link.fault().map(crate::drive::Fault::description),
                "fault_code": link.fault().and_then(crate::drive::Fault::code),
                "temperature_celsius": link.temperature(),
            });
            joints.insert(name.clone(), value);
        }
        let mut buses = serde_json::Map::new();
        let cycles = self.adapter.cycles();
        for (index, bus) in self.buses.iter().enumerate() {
            let value = serde_json::json!({
                "load": bus.counts.load,
                "highest_load": bus.peak,
                "sent": bus.counts.sent,
                "received": bus.counts.received,
                "unsent": bus.counts.unsent,
                "errors": bus.counts.errors,
                "bus_off": bus.counts.bus_off,
                "condition": bus.condition.name(),
                "worst_condition": bus.worst.name(),
                "unacknowledged": bus.events.unacknowledged,
                "queue_full": bus.events.queue_full,
                "down": bus.events.down,
                "lost": bus.events.overflows,
                "diagnosis": bus.diagnosis().or_else(|| self.twins(index, &bus.name)),
            });
            buses.insert(bus.name.clone(), value);
        }
        let sum = |count: fn(&crate::adapter::Counts) -> u64| -> u64 {
            self.adapter.links().iter().map(|link| count(link.counts())).sum()
        };
        serde_json::json!({
            "cycles": cycles,
            "enabled_in_cycle": self.adapter.enabled_in(),
            "tripped": self.adapter.has_tripped(),
            "cycles_in_safe_state": self.safe,
            "command_to_frame_us": self.hand_over.result(),
            "observes": self.drive.is_none(),
            "let_go_at_the_end": self.is_released,
            "refused_position": self.adapter.out_of_range().map(|(joint, wrong)| {
                format!("the drive of `{}` is not enabled again: {wrong}", self.names[joint])
            }),
            "missing_replies": sum(|counts| counts.missing),
            "late_replies": sum(|counts| counts.late),
            "duplicate_replies": sum(|counts| counts.duplicate),
            "refused_frames": sum(|counts| counts.refused),
            "implausible_frames": sum(|counts| counts.implausible),
            "emergencies": sum(|counts| counts.emergencies),
            "stray_frames": self.adapter.stray(),
            "bus_load": self.buses.iter().map(|bus| bus.counts.load).fold(0.0, f64::max),
            "buses": buses,
            "joints": joints,
        })
    }
}

fn phase(phase: Phase) -> &'static str {
    match phase {
        Phase::Checking(_) => "checking",
        Phase::Disabled => "disabled",
        Phase::Homing => "homing",
        Phase::Enabling => "enabling",
        Phase::Enabled => "enabled",
        Phase::Fault => "fault",
    }
}

fn homing(state: HomingState) -> &'static str {
    match state {
        HomingState::Waiting => "waiting",
        HomingState::Running => "running",
        HomingState::Homed => "homed",
        HomingState::Failed(_) => "failed",
    }
}
