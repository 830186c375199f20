//! Tuned parameters.

use core::fmt;
use core::str::FromStr;

use serde::{Deserialize, Serialize};

/// Scale on which the values of a parameter are searched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// Linear scale: equal differences count equally.
    #[default]
    Linear,
    /// Logarithmic scale: equal ratios count equally. Suitable for gains and tolerances that span several
    /// decades.
    Log,
}

/// A number to tune: the configuration keys that are set to this number, and the range of the number.
///
/// ```
/// use motorium_learners::tuning::{Parameter, Scale};
///
/// let frequency: Parameter = "policy.config.frequency=1:4".parse()?;
/// assert_eq!((frequency.name().as_str(), frequency.range), ("policy.config.frequency", [1.0, 4.0]));
/// let gain: Parameter = "left.config.kp, right.config.kp=1:1000:log".parse()?;
/// assert_eq!((gain.keys.len(), gain.scale), (2, Scale::Log));
/// # Ok::<(), motorium_learners::tuning::ParameterError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Configuration keys that receive the value of the parameter. There is at least one key.
    pub keys: Vec<String>,
    /// Lowest and highest value.
    pub range: [f64; 2],
    /// Scale of the search.
    #[serde(default)]
    pub scale: Scale,
}

/// Error of a text that does not describe a parameter.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// The text does not have the expected form.
    #[error("found `{0}`, expected KEY=LOW:HIGH or KEY=LOW:HIGH:log, such as policy.config.frequency=1:4")]
    Form(String),
    /// A bound is not a number.
    #[error("`{key}`: the bound `{bound}` is not a finite number")]
    Bound {
        /// First key of the parameter.
        key: String,
        /// Text of the bound.
        bound: String,
    },
    /// The range is empty.
    #[error("`{key}`: the range {low}:{high} is empty, expected the lower bound first")]
    Empty {
        /// First key of the parameter.
        key: String,
        /// Lower bound.
        low: f64,
        /// Upper bound.
        high: f64,
    },
    /// The lower bound of a logarithmic range is not positive.
    #[error("`{key}`: the lower bound is {low}, expected a number above 0 on a logarithmic scale")]
    Log {
        /// First key of the parameter.
        key: String,
        /// Lower bound.
        low: f64,
    },
    /// Two parameters have the same key.
    #[error("`{0}` is tuned twice, expected one range for each key")]
    Repeated(String),
}

impl Parameter {
    /// Returns the name of the parameter in tables, formed from its keys.
    pub fn name(&self) -> String {
        self.keys.join(",")
    }

    /// Returns the bounds of the search.
    pub(super) fn bounds(&self) -> [f64; 2] {
        match self.scale {
            Scale::Linear => self.range,
            Scale::Log => self.range.map(f64::ln),
        }
    }

    /// Returns the value at a point of the search, within the range.
    pub(super) fn value(&self, x: f64) -> f64 {
        let value = match self.scale {
            Scale::Linear => x,
            Scale::Log => x.exp(),
        };
        value.clamp(self.range[0], self.range[1])
    }

    fn check(&self) -> Result<(), ParameterError> {
        let key = || self.keys.first().cloned().unwrap_or_default();
        let [low, high] = self.range;
        if let Some(bound) = self.range.iter().find(|bound| !bound.is_finite()) {
            return Err(ParameterError::Bound { key: key(), bound: bound.to_string() });
        }
        if low >= high {
            return Err(ParameterError::Empty { key: key(), low, high });
        }
        if self.scale == Scale::Log && low <= 0.0 {
            return Err(ParameterError::Log { key: key(), low });
        }
        Ok(())
    }

    /// Checks the ranges of all parameters, and that no key is tuned twice.
    pub(super) fn check_all(parameters: &[Self]) -> Result<(), ParameterError> {
        let mut seen: Vec<&str> = Vec::new();
        for parameter in parameters {
            parameter.check()?;
            for key in &parameter.keys {
                if seen.contains(&key.as_str()) {
                    return Err(ParameterError::Repeated(key.clone()));
                }
                seen.push(key);
            }
        }
        Ok(())
    }
}

impl FromStr for Parameter {
    type Err = ParameterError;

    fn from_str(text: &str) -> Result<Self, ParameterError> {
        let form = || ParameterError::Form(text.to_owned());
        let (keys, range) = text.split_once('=').ok_or_else(form)?;
        let keys: Vec<String> = keys.split(',').map(|key| key.trim().to_owned()).collect();
        if keys.iter().any(String::is_empty) {
            return Err(form());
        }
        let parts: Vec<&str> = range.split(':').map(str::trim).collect();
        let (bounds, scale) = match parts.as_slice() {
            [low, high] => ([*low, *high], Scale::Linear),
            [low, high, "log"] => ([*low, *high], Scale::Log),
            _ => return Err(form()),
        };
        let number = |bound: &str| {
            let wrong = || ParameterError::Bound { key: keys[0].clone(), bound: bound.to_owned() };
            bound.parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(wrong)
        };
        let range = [number(bounds[0])?, number(bounds[1])?];
        let parameter = Self { keys, range, scale };
        parameter.check()?;
        Ok(parameter)
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ([low, high], scale) = (self.range, if self.scale == Scale::Log { ":log" } else { "" });
        write!(f, "{}={low}:{high}{scale}", self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_printed_as_they_are_read() {
        for text in ["policy.config.frequency=1:4", "a.b,c.d=-2.5:1e-3", "a.kp=0.1:1000:log"] {
            let parameter: Parameter = text.parse().expect("a parameter");
            let again: Parameter = parameter.to_string().parse().expect("a parameter");
            assert_eq!(again, parameter, "{text}");
        }
    }

    #[test]
    fn logarithmic_values_stay_within_their_range() {
        let parameter: Parameter = "kp=0.1:1000:log".parse().expect("a parameter");
        let [low, high] = parameter.bounds();
        for (x, expected) in [(low, 0.1), (high, 1000.0)] {
            let value = parameter.value(x);
            assert!((value / expected - 1.0).abs() < 1e-12 && (0.1..=1000.0).contains(&value), "{value}");
        }
        assert_eq!([low - 1e-9, high + 1e-9].map(|x| parameter.value(x)), [0.1, 1000.0]);
        assert!((parameter.value(0.5 * (low + high)) - 10.0).abs() < 1e-12);
    }

    #[test]
    fn mistakes_in_parameters_are_distinguished() {
        let error = |text: &str| text.parse::<Parameter>().expect_err(text);
        for text in ["frequency", "frequency=1", "=1:2", "a,=1:2", "a=1:2:3", "a=1:2:log:4"] {
            assert_eq!(error(text), ParameterError::Form(text.to_owned()));
        }
        for bound in ["x", "", "inf", "NaN"] {
            let expected = ParameterError::Bound { key: "a".into(), bound: bound.into() };
            assert_eq!(error(&format!("a=0:{bound}")), expected);
        }
        assert_eq!(error("a=2:2"), ParameterError::Empty { key: "a".into(), low: 2.0, high: 2.0 });
        assert_eq!(error("a=0:2:log"), ParameterError::Log { key: "a".into(), low: 0.0 });
        let two: Vec<Parameter> =
            ["a,b=0:1", "c,b=0:1"].map(|text| text.parse().expect("a parameter")).into();
        assert_eq!(Parameter::check_all(&two), Err(ParameterError::Repeated("b".into())));
    }
}
