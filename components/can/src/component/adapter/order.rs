//! Order of the operations in a step.

use std::time::Duration;

use motorium::declare::{ConfigError, Declare};

use super::CanAdapterConfig;
use crate::{Budget, Table};

/// Order in which a step sends commands, reads answers and publishes the state.
///
/// | buses | `command_within` | a step |
/// |---|---|---|
/// | simulated over topics | either | reads previous answers, publishes, waits for the command, sends |
/// | real | without | sends the newest command, waits for the answers, publishes |
/// | real | with | reads previous answers, publishes, waits for the command, sends |
///
/// In each case, one cycle elapses between a measured state and the effect of its command. The orders differ
/// in where the step waits: before it sends the command, or before it publishes the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct StepOrder {
    /// Maximum time that a step waits for answers after sending its batch; `None` if it does not wait.
    pub(super) answer_within: Option<Duration>,
    /// Maximum time that a step waits for the command computed from the state that it has just published;
    /// `None` if it does not wait.
    pub(super) command_within: Option<Duration>,
    is_real: bool,
}

impl CanAdapterConfig {
    /// Returns the time that answers on real buses have in a cycle of length `cycle`: from the moment the
    /// batch of commands is sent until the adapter reads the answers. `None` if all buses are simulated over
    /// topics.
    pub fn answers_have(&self, table: &Table, cycle: Duration) -> Option<Duration> {
        let order = StepOrder::from_config(self, table, table.is_real(), Some(cycle)).ok()?;
        table.is_real().then(|| order.answers_have(cycle))
    }
}

impl StepOrder {
    /// Derives the order from a configuration. `is_real` is `true` if the buses of the table are real.
    /// Configured times are only checked if there is a period.
    pub(super) fn from_config(
        config: &CanAdapterConfig,
        table: &Table,
        is_real: bool,
        period: Option<Duration>,
    ) -> Result<Self, ConfigError> {
        let (answer, command) =
            (config.answer_within.map(Duration::from), config.command_within.map(Duration::from));
        // a line without receive timestamps must be read when frames arrive
        let waits_for_answers = is_real && (command.is_none() || !table.tells_times());
        if answer.is_some() && !waits_for_answers {
            let (message, advice) = match is_real {
                false => (
                    "no bus has an interface",
                    "leave `answer_within` out: simulated buses answer between two steps; real buses have an `interface`",
                ),
                true => (
                    "with `command_within`, answers may arrive until the next step",
                    "leave `answer_within` or `command_within` out: a step waits either for the command or for the answers",
                ),
            };
            return Err(ConfigError::key("answer_within", message).advise(advice));
        }
        let answer_within = match (waits_for_answers, period) {
            (false, _) => None,
            (true, Some(period)) => Some(answer.unwrap_or(period / 2)),
            (true, None) => Some(answer.unwrap_or_default()),
        };
        let order = Self { answer_within, command_within: command, is_real };
        order.check(period)?;
        Ok(order)
    }

    fn check(&self, period: Option<Duration>) -> Result<(), ConfigError> {
        let Some(period) = period else { return Ok(()) };
        let refuse =
            |key: &str, message: String, advice: &str| Err(ConfigError::key(key, message).advise(advice));
        let is_out = |within: Duration| within.is_zero() || within >= period;
        if let Some(within) = self.answer_within.filter(|within| is_out(*within)) {
            let advice = "leave time for the commands of the next period: write about half a period";
            return refuse(
                "answer_within",
                format!("the wait for the answers is {within:?}, but the period is {period:?}"),
                advice,
            );
        }
        if let Some(within) = self.command_within.filter(|within| is_out(*within)) {
            let advice = "leave time for the answers: set `command_within` to the time that policy and controller need, such as \"300 us\"";
            return refuse(
                "command_within",
                format!("the wait for the command is {within:?}, but the period is {period:?}"),
                advice,
            );
        }
        if self.waits() >= period {
            let message =
                format!("the total wait per step is {:?}, but the period is {period:?}", self.waits());
            return refuse("command_within", message, "shorten `command_within` or `answer_within`");
        }
        Ok(())
    }

    /// Returns `true` if a step waits for the answers to its own batch, and publishes them.
    pub(super) fn answers_within_step(&self) -> bool {
        self.is_real && self.command_within.is_none()
    }

    /// Returns the maximum total wait of a step.
    pub(super) fn waits(&self) -> Duration {
        self.answer_within.unwrap_or_default() + self.command_within.unwrap_or_default()
    }

    /// Returns the time available to answers in a cycle of this length, from sending the batch until they are
    /// read.
    pub(super) fn answers_have(&self, cycle: Duration) -> Duration {
        match self.answer_within {
            Some(within) => within,
            None if self.is_real => cycle.saturating_sub(self.command_within.unwrap_or_default()),
            // in simulated time, a step has no duration
            None => cycle,
        }
    }
}

/// Refuses a bus whose frames do not fit into a cycle. Warns about a bus whose answers may be too late for
/// this step order.
pub(super) fn check_budget(
    bus: &str,
    budget: &Budget,
    order: &StepOrder,
    declare: &mut Declare,
) -> Result<(), ConfigError> {
    if !budget.fits() {
        let message = format!("{} drives do not fit on bus `{bus}`: {budget}", budget.exchanges.len());
        let advice = format!(
            "at most {} of these drives fit: spread them over more buses, or lower the rate",
            budget.most()
        );
        return Err(ConfigError::key("drives", message).advise(advice));
    }
    let within = order.answers_have(Duration::from_nanos(budget.cycle_ns));
    if (within.as_nanos() as u64) < budget.complete_ns() {
        let message = format!("answers on bus `{bus}` may take longer than the wait of {within:?}: {budget}");
        let advice = "wait longer, raise the bitrate, or lower the rate";
        let key = if order.answer_within.is_some() { "answer_within" } else { "command_within" };
        declare.warn(message).key(key).advise(advice);
    }
    if budget.share() > Budget::COMFORTABLE {
        let warning = declare.warn(format!("bus `{bus}` is nearly full: {budget}"));
        warning
            .key("drives")
            .advise("a single disturbed frame makes other frames miss their cycle: stay below 80 %");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Duration = Duration::from_millis(2);

    fn order(interface: &str, config: &str) -> Result<StepOrder, String> {
        let table = format!(
            "[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\n{interface}\n[[drive]]\njoint = \"a\"\nbus = \"can0\"\n\
             protocol = \"damiao\"\nnode = 1\nwatchdog = \"20 ms\"\n\
             ranges = {{ position = 12.5, velocity = 30.0, torque = 10.0 }}\n"
        );
        let table = Table::parse(&table).unwrap();
        let config: CanAdapterConfig = toml::from_str(config).unwrap();
        StepOrder::from_config(&config, &table, table.is_real(), Some(PERIOD))
            .map_err(|error| error.to_string())
    }

    const KERNEL: &str = "interface = \"can0\"";
    const COMMAND: &str = "command_within = \"400 us\"";

    #[test]
    fn a_step_waits_half_a_period_for_answers_by_default() {
        let order = order(KERNEL, "").unwrap();
        assert!(order.answers_within_step());
        assert_eq!((order.waits(), order.answers_have(PERIOD)), (PERIOD / 2, PERIOD / 2));
    }

    #[test]
    fn a_step_waiting_for_its_command_leaves_time_for_answers() {
        for interface in [KERNEL, "interface = \"unix:can0\""] {
            let order = order(interface, COMMAND).unwrap();
            assert!(!order.answers_within_step());
            assert_eq!(order.waits(), Duration::from_micros(400));
            assert_eq!(order.answers_have(PERIOD), Duration::from_micros(1600));
        }
    }

    #[test]
    fn a_step_on_a_serial_line_waits_for_both() {
        let order = order("interface = \"/dev/ttyACM0\"", COMMAND).unwrap();
        assert!(!order.answers_within_step());
        assert_eq!((order.waits(), order.answers_have(PERIOD)), (Duration::from_micros(1400), PERIOD / 2));
    }

    #[test]
    fn impossible_or_meaningless_waits_are_refused() {
        let refused = |interface: &str, config: &str| order(interface, config).unwrap_err();
        for (interface, config, words) in [
            (KERNEL, "answer_within = \"2 ms\"", "the wait for the answers is 2ms, but the period is 2ms"),
            (KERNEL, "command_within = \"0 s\"", "the wait for the command is 0ns, but the period is 2ms"),
            (KERNEL, "command_within = \"2 ms\"", "the wait for the command is 2ms, but the period is 2ms"),
            (
                KERNEL,
                "command_within = \"1 ms\"\nanswer_within = \"1 ms\"",
                "answers may arrive until the next step",
            ),
            ("", "answer_within = \"1 ms\"", "no bus has an interface"),
            (
                "interface = \"/dev/ttyACM0\"",
                "command_within = \"1 ms\"\nanswer_within = \"1500 us\"",
                "the total wait per step is 2.5ms, but the period is 2ms",
            ),
        ] {
            let found = refused(interface, config);
            assert!(found.contains(words), "{config}: {found}");
        }
    }
}
