//! `motorium top` without a screen: tables once, or a line per interval.

use super::data::{ComponentTop, Span, Top};
use super::layout::to_text;
use super::order::Order;
use super::view::View;
use crate::progress::causes;
use crate::report::microseconds;

/// Returns all tables, one below the other.
pub(super) fn tables(top: &Top, view: View) -> String {
    let mut text = to_text(&view.title(top)) + "\n";
    for sheet in view.sheets(top) {
        text.push('\n');
        for line in sheet.lines(None) {
            text += &to_text(&line);
            text.push('\n');
        }
    }
    text
}

/// Prints the interval in one line, with the figures of each component and each chain.
pub(super) fn line(top: &Top, order: Order) -> String {
    let mut components: Vec<&ComponentTop> = top.components.iter().collect();
    order.sort(&mut components, Span::Interval, false);
    let mut parts: Vec<String> = components.into_iter().map(component).collect();
    for latency in &top.latencies {
        let span = latency.over(Span::Interval);
        let p99 = microseconds(span.latency_ns.p99);
        parts.push(format!("{} -> {} p99 {p99} us, missed {}", latency.from, latency.to, span.missed));
    }
    format!("{:7.1} s  {}", top.elapsed_s, parts.join(" | "))
}

fn component(component: &ComponentTop) -> String {
    let span = component.over(Span::Interval);
    format!(
        "{} {:.0} Hz, late p99 {} us, step p99 {} us, missed {}",
        component.name,
        span.rate_hz,
        microseconds(span.lateness_ns.p99),
        microseconds(span.execution_ns.p99),
        causes(&span.misses)
    )
}

#[cfg(test)]
mod tests {
    use super::super::example::top;
    use super::*;

    #[test]
    fn everything_is_in_the_tables() {
        insta::assert_snapshot!(tables(&top(), View::default()));
    }

    #[test]
    fn last_interval_is_printed_on_request() {
        let text = tables(&top(), View { span: Span::Interval, ..View::default() });
        assert!(
            text.starts_with(
                "arm-0a1b2c3d running in real time, 12.3 s; times and counts of the last 1.0 s\n"
            )
        );
    }

    #[test]
    fn an_interval_is_a_line() {
        let mut top = top();
        (top.components[0].interval.misses.stolen, top.components[0].interval.misses.long_step) = (3, 1);
        assert_eq!(
            line(&top, Order::Graph),
            "   12.3 s  physics 1000 Hz, late p99 0.030 us, step p99 90.0 us, missed 4 (3 stolen, 1 long step) | \
             encoder 1000 Hz, late p99 4.0 us, step p99 9.0 us, missed 0 | \
             controller 500 Hz, late p99 6.0 us, step p99 240 us, missed 0 | \
             arm/state -> arm/command p99 310 us, missed 0"
        );
        // sorted by the content of the line
        assert!(line(&top, Order::Execution).starts_with("   12.3 s  controller"));
    }
}
