//! Parameters as a table and as JSON.

use comfy_table::CellAlignment;
use motorium::declare::{ParameterKind, ParameterValue};
use motorium::plan::ParameterPlan;
use serde::Serialize;

/// A parameter of a running graph, as JSON.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    /// `component.parameter`.
    pub(super) name: String,
    pub(super) component: String,
    pub(super) parameter: String,
    #[serde(rename = "type")]
    pub(super) kind: ParameterKind,
    pub(super) value: ParameterValue,
    /// Value at the start of the run.
    pub(super) initial: ParameterValue,
    /// Default value if the graph file sets none.
    pub(super) default: ParameterValue,
    pub(super) min: Option<f64>,
    pub(super) max: Option<f64>,
    /// Names to choose from, for a choice only.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) choices: Vec<String>,
    pub(super) unit: String,
    pub(super) doc: String,
}

impl Row {
    pub(super) fn new(component: String, plan: ParameterPlan, value: ParameterValue) -> Self {
        let declaration = plan.declaration;
        Self {
            name: format!("{component}.{}", declaration.name),
            component,
            parameter: declaration.name,
            kind: declaration.default.kind(),
            value,
            initial: plan.initial,
            default: declaration.default,
            min: declaration.min,
            max: declaration.max,
            choices: declaration.choices,
            unit: declaration.unit,
            doc: declaration.doc,
        }
    }

    /// Formats a value of this parameter with its unit.
    pub(super) fn with_unit(&self, value: &ParameterValue) -> String {
        if self.unit.is_empty() { value.to_string() } else { format!("{value} {}", self.unit) }
    }

    /// Describes the range.
    fn range(&self) -> String {
        let length = match &self.default {
            ParameterValue::Array(values) => format!("{} numbers, ", values.len()),
            _ => String::new(),
        };
        let range = match (self.min, self.max) {
            _ if self.kind == ParameterKind::Choice => self.choices.join(", "),
            (Some(min), Some(max)) => format!("{min} to {max}"),
            (Some(min), None) => format!("from {min}"),
            (None, Some(max)) => format!("to {max}"),
            (None, None) if self.kind == ParameterKind::Boolean => "true, false".to_string(),
            (None, None) => "any".to_string(),
        };
        length + &range
    }
}

/// Parameters as a table.
pub(super) fn table(rows: &[Row]) -> String {
    let mut table = crate::report::table(["parameter", "type", "value", "unit", "range", "meaning"]);
    for row in rows {
        table.add_row([
            row.name.clone(),
            format!("{:?}", row.kind).to_lowercase(),
            row.value.to_string(),
            row.unit.clone(),
            row.range(),
            row.doc.clone(),
        ]);
    }
    if let Some(column) = table.column_mut(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table.trim_fmt()
}

#[cfg(test)]
mod tests {
    use motorium::declare::ParameterDeclaration;

    use super::*;

    fn row(default: impl Into<ParameterValue>, min: Option<f64>, max: Option<f64>) -> Row {
        let default: ParameterValue = default.into();
        let declaration = ParameterDeclaration {
            name: "gain".into(),
            default: default.clone(),
            min,
            max,
            choices: Vec::new(),
            unit: "1/s".into(),
            doc: "how fast".into(),
        };
        Row::new("controller".into(), ParameterPlan { declaration, initial: default.clone() }, default)
    }

    #[test]
    fn ranges_are_written_without_open_ends() {
        let float = 1.0;
        assert_eq!(row(float, Some(0.0), Some(2.5)).range(), "0 to 2.5");
        assert_eq!(row(float, Some(0.5), None).range(), "from 0.5");
        assert_eq!(row(float, None, None).range(), "any");
        assert_eq!(row(ParameterValue::Boolean(true), None, None).range(), "true, false");
        assert_eq!(row([1.0, 2.0], Some(0.0), Some(3.0)).range(), "2 numbers, 0 to 3");
        let choices = vec!["walk".to_string(), "trot".to_string()];
        assert_eq!(Row { choices, ..row("walk", None, None) }.range(), "walk, trot");
    }

    #[test]
    fn json_parameter_has_everything_needed_to_set_it() {
        let json = serde_json::to_value(row(ParameterValue::Float(2.0), Some(0.0), None)).unwrap();
        assert_eq!(json["name"], "controller.gain");
        assert_eq!(json["type"], "float");
        assert_eq!(json["value"], 2.0);
        assert_eq!(json["min"], 0.0);
        assert!(json["max"].is_null());
    }
}
