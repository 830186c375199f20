//! The report of the recorded run: steps, misses by cause, and the results of its components.

use std::fmt::Write as _;

use motorium::launcher::Report;
use motorium_pictures::escape;

use crate::report::{causes, items, short_percentiles, warnings};

/// Returns the table of components, and the figures of each result.
pub(super) fn section(report: &Report) -> String {
    let mut html = String::from(
        "<h2>Results</h2>\n<div class=wide><table>\n<tr><th>component</th><th class=n>steps</th><th class=n>Hz</th>\
         <th class=n>late p50 / p99 / max, us</th><th class=n>step p50 / p99 / max, us</th><th>misses</th></tr>\n",
    );
    for component in &report.components {
        let causes = causes(component);
        let _ = writeln!(
            html,
            "<tr class=\"{}\"><td>{}</td><td class=n>{}</td><td class=n>{:.1}</td><td class=n>{}</td><td class=n>{}</td>\
             <td>{}</td></tr>",
            if causes.is_empty() { "" } else { "warning" },
            escape(&component.name),
            component.steps,
            component.rate_hz,
            short_percentiles(&component.lateness_ns),
            short_percentiles(&component.execution_ns),
            escape(&causes.join(", "))
        );
    }
    html += "</table></div>\n";
    for (name, result) in &report.results {
        let lines: String =
            items(result).iter().map(|figure| format!("<li>{}</li>\n", escape(figure))).collect();
        let warnings: String =
            warnings(result).map(|text| format!("<li class=warning>{}</li>\n", escape(text))).collect();
        if !lines.is_empty() || !warnings.is_empty() {
            let _ = writeln!(html, "<h3>{}</h3>\n<ul class=columns>\n{warnings}{lines}</ul>", escape(name));
        }
    }
    html
}
