//! One line of output: numbers in the step, text in the thread that prints.

use core::fmt;

use motorium::prelude::*;

/// The numbers of one sample, without heap memory.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    time: f64,
    pub(super) port: &'static str,
    pub(super) groups: Groups,
}

impl Line {
    pub(super) fn at_time(time: f64) -> Self {
        Self { time, port: "", groups: Groups { groups: [Group::EMPTY; GROUPS], count: 0 } }
    }

    /// The line as text, with `digits` after the decimal point.
    pub(super) fn display(&self, digits: usize) -> impl fmt::Display + '_ {
        Display { line: self, digits }
    }
}

/// Groups that one line holds.
const GROUPS: usize = 4;

/// Named groups of numbers with a unit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Groups {
    groups: [Group; GROUPS],
    count: usize,
}

#[derive(Debug, Clone, Copy)]
struct Group {
    name: &'static str,
    unit: &'static str,
    numbers: [f64; MAX_JOINTS],
    count: usize,
}

impl Group {
    const EMPTY: Self = Self { name: "", unit: "", numbers: [0.0; MAX_JOINTS], count: 0 };
}

impl Groups {
    pub(super) fn clear(&mut self) {
        self.count = 0;
    }

    fn add(&mut self, name: &'static str, numbers: &[f64], unit: &'static str) {
        let Some(group) = self.groups.get_mut(self.count) else { return };
        let count = numbers.len().min(MAX_JOINTS);
        group.numbers[..count].copy_from_slice(&numbers[..count]);
        (group.name, group.unit, group.count) = (name, unit, count);
        self.count += 1;
    }
}

/// A state buffer that can be printed.
pub(super) trait Print {
    /// Adds its numbers, at most [`GROUPS`] groups.
    fn print(&self, groups: &mut Groups);
}

impl Print for JointState {
    fn print(&self, groups: &mut Groups) {
        groups.add("q", self.position(), "");
        groups.add("v", self.velocity(), "");
        groups.add("tau", self.effort(), "");
    }
}

impl Print for JointCommand {
    fn print(&self, groups: &mut Groups) {
        groups.add("q", self.position(), "");
        groups.add("v", self.velocity(), "");
        groups.add("tau", self.effort(), "");
    }
}

impl Print for PoseTarget {
    fn print(&self, groups: &mut Groups) {
        groups.add("position", &self.position, "m");
        groups.add("orientation", &self.orientation, "");
        groups.add("velocity", &self.linear_velocity, "m/s");
        groups.add("angular", &self.angular_velocity, "rad/s");
    }
}

impl Print for EmergencyStop {
    fn print(&self, groups: &mut Groups) {
        groups.add("stop", &[self.stop as f64], "");
    }
}

impl Print for BaseState {
    fn print(&self, groups: &mut Groups) {
        groups.add("position", &self.position, "m");
        groups.add("orientation", &self.orientation, "");
        groups.add("velocity", &self.linear_velocity, "m/s");
        groups.add("angular", &self.angular_velocity, "rad/s");
    }
}

impl Print for Wrench {
    fn print(&self, groups: &mut Groups) {
        groups.add("force", &self.force, "N");
        groups.add("torque", &self.torque, "N m");
    }
}

impl Print for ImuSample {
    fn print(&self, groups: &mut Groups) {
        groups.add("specific force", &self.specific_force, "m/s^2");
        groups.add("angular", &self.angular_velocity, "rad/s");
        groups.add("orientation", &self.orientation, "");
    }
}

impl Print for Phase {
    fn print(&self, groups: &mut Groups) {
        groups.add("phase", &[self.phase], "");
        groups.add("rate", &[self.rate], "");
        groups.add("amplitude", &[self.amplitude], "");
    }
}

struct Display<'a> {
    line: &'a Line,
    digits: usize,
}

impl fmt::Display for Display<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Line { time, port, groups } = self.line;
        write!(f, "{time:9.3} s  {port}:")?;
        for group in &groups.groups[..groups.count] {
            write!(f, "  {} [", group.name)?;
            for (i, number) in group.numbers[..group.count].iter().enumerate() {
                let separator = if i == 0 { "" } else { " " };
                write!(f, "{separator}{number:.*}", self.digits)?;
            }
            let space = if group.unit.is_empty() { "" } else { " " };
            write!(f, "]{space}{}", group.unit)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_shows_the_counted_joints_and_no_more() {
        let mut state = JointState::default();
        state.set_count(2);
        state.position_mut().copy_from_slice(&[0.5, -1.25]);
        let mut line = Line::at_time(1.5);
        line.port = "joint_state";
        state.print(&mut line.groups);
        assert_eq!(
            line.display(2).to_string(),
            "    1.500 s  joint_state:  q [0.50 -1.25]  v [0.00 0.00]  tau [0.00 0.00]"
        );
    }
}
