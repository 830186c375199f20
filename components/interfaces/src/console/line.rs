//! A line to be printed: numbers now, words later.

use core::fmt;

use motorium::state::{ImuSample, JointCommand, JointState, MAX_JOINTS, Phase, PoseTarget, Wrench};

/// Named groups of numbers, without heap memory.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    time: f64,
    pub(super) port: &'static str,
    pub(super) values: Values,
}

impl Line {
    pub(super) fn at(time: f64) -> Self {
        Self { time, port: "", values: Values { groups: [Group::EMPTY; GROUPS], count: 0 } }
    }

    /// The line as text, with so many digits.
    pub(super) fn display(&self, digits: usize) -> impl fmt::Display + '_ {
        Display { line: self, digits }
    }
}

const GROUPS: usize = 4;

/// The groups of one line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Values {
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

impl Values {
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

/// A type that can be put into words.
pub(super) trait Words {
    /// Adds what is worth reading of it.
    fn words(&self, values: &mut Values);
}

impl Words for JointState {
    fn words(&self, values: &mut Values) {
        values.add("q", self.position(), "");
        values.add("v", self.velocity(), "");
        values.add("tau", self.effort(), "");
    }
}

impl Words for JointCommand {
    fn words(&self, values: &mut Values) {
        values.add("q", self.position(), "");
        values.add("v", self.velocity(), "");
        values.add("tau", self.effort(), "");
    }
}

impl Words for PoseTarget {
    fn words(&self, values: &mut Values) {
        values.add("position", &self.position, "m");
        values.add("orientation", &self.orientation, "");
        values.add("velocity", &self.linear_velocity, "m/s");
        values.add("angular", &self.angular_velocity, "rad/s");
    }
}

impl Words for Wrench {
    fn words(&self, values: &mut Values) {
        values.add("force", &self.force, "N");
        values.add("torque", &self.torque, "N m");
    }
}

impl Words for ImuSample {
    fn words(&self, values: &mut Values) {
        values.add("specific force", &self.specific_force, "m/s^2");
        values.add("angular", &self.angular_velocity, "rad/s");
        values.add("orientation", &self.orientation, "");
    }
}

impl Words for Phase {
    fn words(&self, values: &mut Values) {
        values.add("phase", &[self.phase], "");
        values.add("rate", &[self.rate], "");
        values.add("amplitude", &[self.amplitude], "");
    }
}

struct Display<'a> {
    line: &'a Line,
    digits: usize,
}

impl fmt::Display for Display<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Line { time, port, values } = self.line;
        write!(f, "{time:9.3} s  {port}:")?;
        for group in &values.groups[..values.count] {
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
        let mut line = Line::at(1.5);
        line.port = "joint_state";
        state.words(&mut line.values);
        assert_eq!(
            line.display(2).to_string(),
            "    1.500 s  joint_state:  q [0.50 -1.25]  v [0.00 0.00]  tau [0.00 0.00]"
        );
    }
}
