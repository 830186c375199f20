//! Tracking of joint commands.

use std::fmt::Write as _;

use motorium::plan::Plan;
use motorium_bridges::foxglove::joints_of_topic;
use motorium_bridges::recording::Tracking;
use motorium_pictures::chart::{Panel, panels};
use motorium_pictures::escape;

/// Returns the errors of the joints of a topic of states, and their curves with the commanded ones.
pub(super) fn section(plan: &Plan, Tracking { command, state, joints }: &Tracking) -> String {
    let index = plan.topics.iter().position(|topic| topic.name == *state);
    let names = index.and_then(|index| joints_of_topic(plan, index)).unwrap_or_default();
    let mut html = format!(
        "<h2>Tracking: {} after {}</h2>\n<table>\n<tr><th>joint</th><th class=n>root mean square, rad or m</th>\
         <th class=n>greatest</th></tr>\n",
        escape(state),
        escape(command)
    );
    let mut curves = Vec::new();
    for (index, joint) in joints.iter().enumerate() {
        let name = names.get(index).cloned().unwrap_or_else(|| index.to_string());
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td class=n>{:.3e}</td><td class=n>{:.3e}</td></tr>",
            escape(&name),
            joint.rms,
            joint.most
        );
        if !joint.commanded.is_empty() {
            let mut panel = Panel::new(&format!("{name}, rad or m"));
            panel.line(joint.measured.clone());
            panel.reference(joint.commanded.clone());
            curves.push(panel);
        }
    }
    html += "</table>\n";
    if !curves.is_empty() {
        let _ = write!(
            html,
            "<details open><summary>Curves</summary>\n{}</details>\n",
            panels(&curves, ["commanded", "measured"])
        );
    }
    html
}
