//! Numbers in options.

/// Numbers as written on the command line: `0.1,-2,3e-2`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Numbers(pub(super) Vec<f64>);

/// Returns the numbers of an option, one per dimension; a single number is used for all dimensions.
pub(in crate::commands) fn per_dimension(
    option: &str,
    given: &[f64],
    names: &[String],
) -> anyhow::Result<Vec<f64>> {
    match given {
        [all] => Ok(vec![*all; names.len()]),
        each if each.len() == names.len() => Ok(each.to_vec()),
        each => anyhow::bail!(
            "{option} has {} numbers, expected one for all, or one for each of {}",
            each.len(),
            names.join(", ")
        ),
    }
}

/// Parses numbers separated by commas.
pub(super) fn numbers(text: &str) -> Result<Numbers, String> {
    let number = |part: &str| match part.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(format!("`{part}` is not a number; expected numbers separated by commas, such as 0.1,-2")),
    };
    text.split(',').map(number).collect::<Result<_, _>>().map(Numbers)
}
