//! Declared parameters and their values.

use serde::{Deserialize, Serialize};

use crate::nearest::{list, suggest};

/// Maximum number of values in all parameters of one component. An array counts as many values as it has
/// entries.
pub const MAX_PARAMETER_NUMBERS: usize = 256;

/// The type of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ParameterKind {
    /// A 64-bit float.
    Float,
    /// A 64-bit signed integer.
    Integer,
    /// True or false.
    Boolean,
    /// One of several names.
    Choice,
    /// An array of 64-bit floats with a fixed length.
    Array,
}

/// The value of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum ParameterValue {
    /// True or false.
    Boolean(bool),
    /// A 64-bit signed integer.
    Integer(i64),
    /// A 64-bit float.
    Float(f64),
    /// The name of a choice.
    Choice(String),
    /// An array of 64-bit floats.
    Array(Vec<f64>),
}

impl ParameterValue {
    /// Returns the kind of this value.
    pub fn kind(&self) -> ParameterKind {
        match self {
            Self::Boolean(_) => ParameterKind::Boolean,
            Self::Integer(_) => ParameterKind::Integer,
            Self::Float(_) => ParameterKind::Float,
            Self::Choice(_) => ParameterKind::Choice,
            Self::Array(_) => ParameterKind::Array,
        }
    }
}

macro_rules! value_from {
    ($($type:ty => $variant:ident),* $(,)?) => { $(
        impl From<$type> for ParameterValue {
            fn from(value: $type) -> Self {
                Self::$variant(value.into())
            }
        }
    )* };
}
value_from!(f64 => Float, i64 => Integer, bool => Boolean, &str => Choice, String => Choice, Vec<f64> => Array, &[f64] => Array);

impl<const N: usize> From<[f64; N]> for ParameterValue {
    fn from(value: [f64; N]) -> Self {
        Self::Array(value.into())
    }
}

impl core::fmt::Display for ParameterValue {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Boolean(value) => write!(f, "{value}"),
            Self::Integer(value) => write!(f, "{value}"),
            Self::Float(value) => write!(f, "{value}"),
            Self::Choice(name) => write!(f, "{name}"),
            Self::Array(values) => {
                let numbers: Vec<String> = values.iter().map(f64::to_string).collect();
                write!(f, "[{}]", numbers.join(", "))
            }
        }
    }
}

/// A declared parameter: a value that may change at run time, applied between two steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ParameterDeclaration {
    /// Name of the parameter, unique in its component.
    pub name: String,
    /// Default value, used unless the graph file sets an initial value. The default defines the type of the
    /// parameter and, for an array, its length.
    pub default: ParameterValue,
    /// Smallest allowed value, or smallest allowed entry of an array; `None` if unbounded.
    pub min: Option<f64>,
    /// Largest allowed value, or largest allowed entry of an array; `None` if unbounded.
    pub max: Option<f64>,
    /// Names to choose from, in order; empty for parameters that are not a choice.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub choices: Vec<String>,
    /// Unit, such as `N m`; empty for values without a unit.
    pub unit: String,
    /// One-line description, which is shown in lists of parameters.
    pub doc: String,
}

impl ParameterDeclaration {
    /// Returns the number of values: the length of an array, otherwise 1.
    pub fn numbers(&self) -> usize {
        match &self.default {
            ParameterValue::Array(values) => values.len(),
            _ => 1,
        }
    }

    /// Checks a value against the declared type, range, choices and length. Returns the value in the declared
    /// type: an integer is converted to a float, and a single number to an array filled with it.
    ///
    /// # Errors
    /// Returns a message with the found value and the expected values.
    pub fn admit(&self, value: ParameterValue) -> Result<ParameterValue, String> {
        let value = match (self.default.kind(), value) {
            (ParameterKind::Float, ParameterValue::Integer(i)) => ParameterValue::Float(i as f64),
            (ParameterKind::Array, ParameterValue::Integer(i)) => self.repeated(i as f64),
            (ParameterKind::Array, ParameterValue::Float(x)) => self.repeated(x),
            (_, value) => value,
        };
        let name = &self.name;
        match (&self.default, &value) {
            (ParameterValue::Boolean(_), ParameterValue::Boolean(_)) => {}
            (ParameterValue::Float(_), ParameterValue::Float(x)) => self.in_range(*x, name)?,
            (ParameterValue::Integer(_), ParameterValue::Integer(i)) => self.in_range(*i as f64, name)?,
            (ParameterValue::Choice(_), ParameterValue::Choice(chosen)) => {
                if !self.choices.contains(chosen) {
                    let names = || self.choices.iter().map(String::as_str);
                    let advice = suggest(chosen, names(), "the choices are");
                    return Err(format!(
                        "parameter `{name}` is \"{chosen}\", not one of its choices; {advice}"
                    ));
                }
            }
            (ParameterValue::Array(own), ParameterValue::Array(values)) if own.len() == values.len() => {
                for (index, number) in values.iter().enumerate() {
                    self.in_range(*number, &format!("{name}[{index}]"))?;
                }
            }
            (own, found) => {
                let expected = match own {
                    ParameterValue::Float(_) => "a number".to_string(),
                    ParameterValue::Integer(_) => "a whole number".to_string(),
                    ParameterValue::Boolean(_) => "true or false".to_string(),
                    ParameterValue::Choice(_) => {
                        format!("one of {}", list(self.choices.iter().map(String::as_str)))
                    }
                    ParameterValue::Array(own) => format!("one number, or an array of {}", own.len()),
                };
                let found = match found {
                    ParameterValue::Array(values) => format!("an array of {}", values.len()),
                    ParameterValue::Choice(text) => format!("\"{text}\""),
                    number => number.to_string(),
                };
                return Err(format!("parameter `{name}` is {found}, expected {expected}"));
            }
        }
        Ok(value)
    }

    /// Returns an array of the default's length, filled with `number`.
    fn repeated(&self, number: f64) -> ParameterValue {
        ParameterValue::Array(vec![number; self.numbers()])
    }

    /// Returns `true` if a number is within the range.
    pub(crate) fn allows(&self, number: f64) -> bool {
        number.is_finite()
            && self.min.is_none_or(|min| number >= min)
            && self.max.is_none_or(|max| number <= max)
    }

    fn in_range(&self, number: f64, name: &str) -> Result<(), String> {
        if self.allows(number) {
            return Ok(());
        }
        let range = match (self.min, self.max) {
            (Some(low), Some(high)) => format!("from {low} to {high}"),
            (Some(low), None) => format!("at least {low}"),
            (None, Some(high)) => format!("at most {high}"),
            (None, None) => "a finite number".to_string(),
        };
        Err(format!("parameter `{name}` is {number}, expected {range}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::declare::Declare;

    fn declared(declare: impl Fn(&mut Declare)) -> ParameterDeclaration {
        let mut collected = Declare::new(None);
        declare(&mut collected);
        collected.into_declaration().parameters.remove(0)
    }

    #[test]
    fn choice_accepts_its_names_and_suggests_similar_ones() {
        let gait = declared(|declare| declare.choice("gait", &["walk", "trot"], "walk", "the gait"));
        assert_eq!(gait.admit("trot".into()), Ok("trot".into()));
        let error = gait.admit("trott".into()).unwrap_err();
        assert_eq!(error, "parameter `gait` is \"trott\", not one of its choices; did you mean `trot`?");
        let error = gait.admit(1_i64.into()).unwrap_err();
        assert!(error.contains("is 1, expected one of"), "{error}");
    }

    #[test]
    fn array_checks_length_and_range() {
        let offsets = declared(|declare| declare.array("offsets", &[0.0; 3], -1.0..=1.0, "rad", "offsets"));
        assert_eq!(offsets.numbers(), 3);
        assert_eq!(offsets.admit([0.5, -1.0, 1.0].into()), Ok([0.5, -1.0, 1.0].into()));
        let error = offsets.admit([0.5, 2.0, 0.0].into()).unwrap_err();
        assert_eq!(error, "parameter `offsets[1]` is 2, expected from -1 to 1");
        let error = offsets.admit([0.5].into()).unwrap_err();
        assert_eq!(error, "parameter `offsets` is an array of 1, expected one number, or an array of 3");
        assert!(offsets.admit([f64::NAN, 0.0, 0.0].into()).is_err());
    }

    #[test]
    fn single_number_fills_an_array() {
        let offsets = declared(|declare| declare.array("offsets", &[0.0; 3], -1.0..=1.0, "rad", "offsets"));
        assert_eq!(offsets.admit(0.5.into()), Ok([0.5; 3].into()));
        assert_eq!(offsets.admit(1_i64.into()), Ok([1.0; 3].into()));
        let error = offsets.admit(2.0.into()).unwrap_err();
        assert_eq!(error, "parameter `offsets[0]` is 2, expected from -1 to 1");
        assert!(offsets.admit(true.into()).is_err());
    }

    #[test]
    fn values_survive_json() {
        let values = [true.into(), 3_i64.into(), 2.0.into(), "walk".into(), [1.0, -2.5].into()];
        for value in values {
            let text = serde_json::to_string(&value).expect("JSON");
            assert_eq!(serde_json::from_str::<ParameterValue>(&text).expect("a value"), value, "{text}");
        }
    }
}
