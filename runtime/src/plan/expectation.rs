//! Expectations: conditions on values in the report of a finished run.

use core::fmt;
use core::str::FromStr;

use serde::{Deserialize, Serialize};

/// A condition on a value in the report, such as `controller.position_error_m <= 1e-3`.
///
/// ```
/// use motorium::plan::Expectation;
///
/// let expectation: Expectation = "controller.position_error_m <= 1e-3".parse()?;
/// assert!(expectation.is_met_by(&serde_json::json!(2e-4)));
/// assert!(!expectation.is_met_by(&serde_json::json!(null)));
/// assert_eq!(expectation.to_string(), "controller.position_error_m <= 0.001");
/// # Ok::<(), motorium::plan::ExpectationError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Expectation {
    /// Path of the figure (the value) in the report: the name of a component, then the path of the value in
    /// the component's result or in the component's section of the report.
    pub figure: String,
    /// Comparison of the value with the bound.
    pub comparison: Comparison,
    /// Bound: a number, a text, true or false.
    pub bound: serde_json::Value,
}

/// Comparison of a reported value with a bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Comparison {
    /// Operator `<`; numbers only.
    #[serde(rename = "<")]
    Below,
    /// Operator `<=`; numbers only.
    #[serde(rename = "<=")]
    AtMost,
    /// Operator `>`; numbers only.
    #[serde(rename = ">")]
    Above,
    /// Operator `>=`; numbers only.
    #[serde(rename = ">=")]
    AtLeast,
    /// Operator `==`.
    #[serde(rename = "==")]
    Equal,
    /// Operator `!=`.
    #[serde(rename = "!=")]
    NotEqual,
}

/// Error of parsing an expectation.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ExpectationError {
    /// The comparison is missing.
    #[error("`{0}` has no comparison, expected one of `<`, `<=`, `>`, `>=`, `==`, `!=`")]
    NoComparison(String),
    /// The bound after the comparison is missing.
    #[error("`{0}` has no bound, expected a number, text, true or false after the comparison")]
    NoBound(String),
    /// The bound of `<`, `<=`, `>` or `>=` is not a number.
    #[error("`{0}` has a bound that is not a number, expected a number after `<`, `<=`, `>` or `>=`")]
    NoOrder(String),
    /// The figure before the comparison is missing.
    #[error("`{0}` names no figure, expected a condition such as `controller.position_error_m <= 1e-3`")]
    NoFigure(String),
}

/// All comparisons. Those with two characters precede their prefixes.
const COMPARISONS: [Comparison; 6] = [
    Comparison::AtMost,
    Comparison::AtLeast,
    Comparison::Equal,
    Comparison::NotEqual,
    Comparison::Below,
    Comparison::Above,
];

impl Comparison {
    fn sign(self) -> &'static str {
        match self {
            Self::Below => "<",
            Self::AtMost => "<=",
            Self::Above => ">",
            Self::AtLeast => ">=",
            Self::Equal => "==",
            Self::NotEqual => "!=",
        }
    }
}

impl Expectation {
    /// Creates the expectation that a figure satisfies a condition, such as `<= 1e-3`.
    ///
    /// # Errors
    /// The condition does not parse.
    pub fn new(figure: &str, condition: &str) -> Result<Self, ExpectationError> {
        let condition = condition.trim();
        let of = |error: fn(String) -> ExpectationError| error(condition.to_string());
        let figure = figure.trim().to_string();
        if figure.is_empty() {
            return Err(of(ExpectationError::NoFigure));
        }
        let comparison = COMPARISONS.into_iter().find(|comparison| condition.starts_with(comparison.sign()));
        let comparison = comparison.ok_or_else(|| of(ExpectationError::NoComparison))?;
        let text = condition[comparison.sign().len()..].trim();
        if text.is_empty() {
            return Err(of(ExpectationError::NoBound));
        }
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        let bound = match (number, text) {
            (Some(number), text) => text.parse::<i64>().map_or(number.into(), Into::into),
            (None, "true" | "false") => (text == "true").into(),
            (None, text) => text.trim_matches('"').into(),
        };
        if number.is_none() && !matches!(comparison, Comparison::Equal | Comparison::NotEqual) {
            return Err(of(ExpectationError::NoOrder));
        }
        Ok(Self { figure, comparison, bound })
    }

    /// Returns the name of the component to which the figure belongs.
    pub fn component(&self) -> &str {
        self.figure.split('.').next().unwrap_or_default()
    }

    /// Returns the condition without the figure, such as `<= 0.001`.
    pub fn condition(&self) -> String {
        format!("{} {}", self.comparison.sign(), self.bound)
    }

    /// Returns `true` if `value` satisfies the condition. Returns `false` for a missing value, a value that
    /// is not finite, and a value that is not a number where a number is expected.
    pub fn is_met_by(&self, value: &serde_json::Value) -> bool {
        if value.is_null() {
            return false;
        }
        match (self.comparison, value.as_f64(), self.bound.as_f64()) {
            (Comparison::Below, Some(value), Some(bound)) => value < bound,
            (Comparison::AtMost, Some(value), Some(bound)) => value <= bound,
            (Comparison::Above, Some(value), Some(bound)) => value > bound,
            (Comparison::AtLeast, Some(value), Some(bound)) => value >= bound,
            (Comparison::Equal, Some(value), Some(bound)) => value == bound,
            (Comparison::NotEqual, Some(value), Some(bound)) => value != bound,
            (Comparison::Equal, None, _) => *value == self.bound,
            (Comparison::NotEqual, None, _) => *value != self.bound,
            _ => false,
        }
    }
}

impl FromStr for Expectation {
    type Err = ExpectationError;

    fn from_str(text: &str) -> Result<Self, ExpectationError> {
        let at = text
            .find(['<', '>', '=', '!'])
            .ok_or_else(|| ExpectationError::NoComparison(text.to_string()))?;
        if text[..at].trim().is_empty() {
            return Err(ExpectationError::NoFigure(text.to_string()));
        }
        Self::new(&text[..at], &text[at..])
    }
}

impl fmt::Display for Expectation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.figure, self.condition())
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn comparisons_are_true_on_their_side_of_the_bound() {
        let met = |condition: &str| {
            let expectation = Expectation::new("a.b", condition).unwrap();
            [1, 2, 3].map(|value| expectation.is_met_by(&json!(value)))
        };
        assert_eq!(met("< 2"), [true, false, false]);
        assert_eq!(met("<= 2"), [true, true, false]);
        assert_eq!(met("> 2"), [false, false, true]);
        assert_eq!(met(">=2"), [false, true, true]);
        assert_eq!(met("== 2.0"), [false, true, false]);
        assert_eq!(met("!= 2"), [true, false, true]);
    }

    #[test]
    fn text_and_flags_compare_by_equality() {
        let phase = Expectation::new("policy.phase", "== finished").unwrap();
        assert!(phase.is_met_by(&json!("finished")) && !phase.is_met_by(&json!("moving")));
        let flag = Expectation::new("physics.safe", "!= true").unwrap();
        assert!(flag.is_met_by(&json!(false)) && !flag.is_met_by(&json!(true)));
        for condition in ["<= 1", "== 1", "!= 1", "!= text"] {
            assert!(!Expectation::new("a.b", condition).unwrap().is_met_by(&json!(null)), "{condition}");
        }
        assert!(!Expectation::new("a.b", "<= 1").unwrap().is_met_by(&json!("0")));
    }

    #[test]
    fn invalid_expectations_explain_the_error() {
        for (text, reason) in [
            ("controller.error", "has no comparison"),
            ("controller.error <=", "has no bound"),
            ("controller.error < small", "expected a number after"),
            ("<= 3", "names no figure"),
            ("a.b => 3", "has no comparison"),
        ] {
            let error = text.parse::<Expectation>().unwrap_err().to_string();
            assert!(error.contains(reason), "{text}: {error}");
        }
    }

    #[test]
    fn expectation_survives_serialisation() {
        let expectation: Expectation = "a.b.0 >= -1.5e-3".parse().unwrap();
        let text = serde_json::to_string(&expectation).unwrap();
        assert_eq!(serde_json::from_str::<Expectation>(&text).unwrap(), expectation);
        assert_eq!(expectation.component(), "a");
    }
}
