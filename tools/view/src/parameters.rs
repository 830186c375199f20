//! Parameters of a run in the form of Foxglove's protocol.

use foxglove::websocket::{Parameter, ParameterType, ParameterValue as Shown};
use motorium::declare::{ParameterDeclaration, ParameterKind, ParameterValue};
use motorium::transport::ParameterTable;

/// Returns all parameters of a run, named `component.parameter`. Empty if the run is over.
pub(crate) fn all(table: &ParameterTable) -> Vec<Parameter> {
    let listed = table.list().unwrap_or_default();
    let shown = listed
        .into_iter()
        .map(|(component, plan, value)| shown(format!("{component}.{}", plan.declaration.name), &value));
    shown.collect()
}

/// Returns a parameter as displayed.
pub(crate) fn shown(name: String, value: &ParameterValue) -> Parameter {
    match value {
        ParameterValue::Boolean(value) => Parameter::bool(name, *value),
        ParameterValue::Integer(value) => Parameter::integer(name, *value),
        ParameterValue::Float(value) => Parameter::float64(name, *value),
        ParameterValue::Choice(value) => Parameter::string(name, value.clone()),
        ParameterValue::Array(values) => Parameter::float64_array(name, values.iter().copied()),
    }
}

/// Converts the value that a viewer sets; a number that fits two types gets the declared one.
pub(crate) fn given(
    declaration: Option<&ParameterDeclaration>,
    parameter: &Parameter,
) -> Result<ParameterValue, String> {
    let kind = declaration.map(|declaration| declaration.default.kind());
    let unknown = || format!("parameter `{}` has no value of a type that parameters have", parameter.name);
    Ok(match parameter.value.as_ref().ok_or_else(unknown)? {
        Shown::Bool(value) => ParameterValue::Boolean(*value),
        Shown::Integer(value) => ParameterValue::Integer(*value),
        // JavaScript does not distinguish integers from other numbers.
        Shown::Float64(value) if kind == Some(ParameterKind::Integer) && value.fract() == 0.0 => {
            ParameterValue::Integer(*value as i64)
        }
        Shown::Float64(value) => ParameterValue::Float(*value),
        Shown::String(_) if parameter.r#type == Some(ParameterType::ByteArray) => return Err(unknown()),
        Shown::String(value) => ParameterValue::Choice(value.clone()),
        Shown::Array(values) => {
            let numbers = values.iter().map(|value| match value {
                Shown::Float64(value) => Some(*value),
                Shown::Integer(value) => Some(*value as f64),
                _ => None,
            });
            ParameterValue::Array(numbers.collect::<Option<_>>().ok_or_else(unknown)?)
        }
        Shown::Dict(_) => return Err(unknown()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn declaration(default: ParameterValue) -> ParameterDeclaration {
        let (name, unit, doc) = ("gain".to_string(), String::new(), String::new());
        ParameterDeclaration { name, default, min: None, max: None, choices: Vec::new(), unit, doc }
    }

    #[test]
    fn displayed_value_is_accepted_unchanged() {
        let values = [true.into(), 3_i64.into(), 2.5.into(), "walk".into(), [1.0, -2.5].into()];
        for value in values {
            let declared = declaration(value);
            let shown = shown("c.gain".to_string(), &declared.default);
            assert_eq!(given(Some(&declared), &shown), Ok(declared.default.clone()), "{shown:?}");
        }
    }

    #[test]
    fn whole_float_is_accepted_for_an_integer() {
        let parameter = Parameter::float64("c.gain", 3.0);
        assert_eq!(given(Some(&declaration(1_i64.into())), &parameter), Ok(3_i64.into()));
        assert_eq!(given(Some(&declaration(1.0.into())), &parameter), Ok(3.0.into()));
        let half = Parameter::float64("c.gain", 3.5);
        assert_eq!(given(Some(&declaration(1_i64.into())), &half), Ok(3.5.into()), "refused with its range");
    }

    #[test]
    fn bytes_and_tables_are_refused() {
        for parameter in [Parameter::empty("c.gain"), Parameter::byte_array("c.gain", b"a")] {
            assert!(given(None, &parameter).unwrap_err().contains("c.gain"));
        }
    }
}
