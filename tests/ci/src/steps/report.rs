//! Reports of runs: JSON printed by `--json`.

use serde_json::Value;

use crate::call::Call;
use crate::context::Context;
use crate::failure::Failure;

/// Output of a command with `--json`.
#[derive(Debug)]
pub(crate) struct Report {
    command: String,
    json: Value,
}

impl Report {
    /// Runs a command and reads its output.
    ///
    /// # Errors
    /// The command does not start, fails, or prints no JSON.
    pub(crate) fn run(context: &Context<'_>, call: &Call) -> Result<Self, Failure> {
        let text = context.output(call)?;
        Self::parse(call.to_string(), &text)
    }

    /// Reads the output of a command.
    ///
    /// # Errors
    /// The output is not JSON.
    pub(crate) fn parse(command: String, text: &str) -> Result<Self, Failure> {
        match serde_json::from_str(text) {
            Ok(json) => Ok(Self { command, json }),
            Err(error) => Err(Failure::Output { command, expected: format!("JSON: {error}") }),
        }
    }

    /// Value at a JSON pointer such as `/results/recorder`.
    ///
    /// # Errors
    /// There is no such value.
    pub(crate) fn value(&self, pointer: &str) -> Result<&Value, Failure> {
        self.json.pointer(pointer).ok_or_else(|| self.missing(pointer))
    }

    /// Number at a JSON pointer.
    ///
    /// # Errors
    /// There is no such number.
    pub(crate) fn number(&self, pointer: &str) -> Result<f64, Failure> {
        self.value(pointer)?.as_f64().ok_or_else(|| self.missing(pointer))
    }

    /// Text at a JSON pointer.
    ///
    /// # Errors
    /// There is no such text.
    pub(crate) fn text(&self, pointer: &str) -> Result<&str, Failure> {
        self.value(pointer)?.as_str().ok_or_else(|| self.missing(pointer))
    }

    /// The state hash of the run.
    ///
    /// # Errors
    /// The report has no state hash.
    pub(crate) fn state_hash(&self) -> Result<&str, Failure> {
        self.text("/state_hash")
    }

    /// The state hashes of the episodes.
    ///
    /// # Errors
    /// There are no episodes, or one has no hash.
    pub(crate) fn episode_hashes(&self) -> Result<Vec<&str>, Failure> {
        let episodes = self.value("/episodes")?.as_array().ok_or_else(|| self.missing("/episodes"))?;
        (0..episodes.len()).map(|index| self.text(&format!("/episodes/{index}/state_hash"))).collect()
    }

    fn missing(&self, pointer: &str) -> Failure {
        Failure::Output { command: self.command.clone(), expected: format!("`{pointer}` of the right type") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_types() {
        let text = r#"{"state_hash": "1f", "n": 3, "episodes": [{"state_hash": "a"}, {"state_hash": "b"}]}"#;
        let report = Report::parse("motorium run".to_string(), text).expect("JSON");
        assert_eq!(report.state_hash().expect("text"), "1f");
        assert_eq!(report.episode_hashes().expect("texts"), ["a", "b"]);
        assert_eq!(report.number("/n").expect("a number"), 3.0);
        for wrong in [report.text("/n").err(), report.text("/none").err(), report.number("/state_hash").err()]
        {
            assert!(matches!(wrong, Some(Failure::Output { .. })), "{wrong:?}");
        }
        assert!(Report::parse(String::new(), "{").is_err());
    }
}
