//! Sums as text.

use crate::plan::Plan;
use crate::units::TimeSpan;

/// Formats a time with its unit.
pub(in crate::schedule) fn time(ns: u64) -> String {
    TimeSpan { ns }.to_string()
}

/// Formats names as a list: "`a`, `b` and `c`".
pub(in crate::schedule) fn names(plan: &Plan, components: &[usize]) -> String {
    let quoted: Vec<String> =
        components.iter().map(|component| format!("`{}`", plan.components[*component].name)).collect();
    match quoted.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} and {last}", rest.join(", ")),
        None => "nothing".to_string(),
    }
}

/// Formats a sum and its comparison with the limit.
pub(in crate::schedule) fn comparison(terms: &[String], total: String, holds: bool, limit: &str) -> String {
    let relation = if holds { "<=" } else { ">" };
    match terms {
        [_] | [] => format!("{} {relation} {limit}", terms.first().unwrap_or(&total)),
        terms => format!("{} = {total} {relation} {limit}", terms.join(" ")),
    }
}

/// Returns the number of digits, at least 3, that distinguishes two shares.
pub(in crate::schedule) fn shares(share: f64, limit: f64) -> usize {
    (3..9)
        .find(|digits| share == limit || format!("{share:.digits$}") != format!("{limit:.digits$}"))
        .unwrap_or(9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn close_shares_are_printed_with_enough_digits() {
        assert_eq!(shares(0.93, 0.95), 3);
        assert_eq!(shares(0.95, 0.95), 3);
        assert_eq!(shares(0.95004, 0.95), 5);
    }

    #[test]
    fn sum_of_one_term_is_not_written_twice() {
        assert_eq!(comparison(&["5 us".into()], "5 us".into(), true, "1 ms"), "5 us <= 1 ms");
        let terms = ["600 us".to_string(), "+ 700 us".to_string()];
        assert_eq!(comparison(&terms, "1.3 ms".into(), false, "1 ms"), "600 us + 700 us = 1.3 ms > 1 ms");
    }
}
