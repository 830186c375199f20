//! The score of a run: goals and limits.

use std::fmt::Write as _;

use motorium_bridges::recording::{JointsScore, PoseScore, Score};
use motorium_pictures::escape;

use crate::report::decimal;

/// Returns the goals of all frames that follow targets; nothing without any.
pub(super) fn goals(score: &Score) -> String {
    if score.poses.is_empty() {
        return String::new();
    }
    let mut html = String::from(
        "<h2>Goals</h2>\n<div class=wide><table>\n<tr><th>frame</th><th>target</th><th class=n>reached</th>\
         <th class=n>missed</th><th class=n>worst goal</th><th class=n>path, root mean square</th>\
         <th class=n>path, greatest</th><th class=n>smoothness</th></tr>\n",
    );
    score.poses.iter().for_each(|pose| frame(&mut html, pose));
    html + "</table></div>\n"
}

/// Returns the limits of all joints of each topic of joint states.
pub(super) fn limits(score: &Score) -> String {
    let mut html = String::new();
    score.joints.iter().for_each(|joints| margins(&mut html, joints));
    html
}

fn frame(html: &mut String, pose: &PoseScore) {
    let worst = match (pose.position_error_m, pose.orientation_error_rad) {
        (Some(position), Some(orientation)) => pose.errors(position, orientation),
        _ => "-".to_string(),
    };
    let class = if pose.goals_missed > 0 { "warning" } else { "" };
    let _ = writeln!(
        html,
        "<tr class=\"{class}\"><td>{}</td><td>{}</td><td class=n>{}</td><td class=n>{}</td><td class=n>{worst}</td>\
         <td class=n>{}</td><td class=n>{}</td><td class=n>{}</td></tr>",
        escape(&pose.frame),
        escape(&pose.target),
        pose.goals_reached,
        pose.goals_missed,
        pose.errors(pose.path_position_rms_m, pose.path_orientation_rms_rad),
        pose.errors(pose.path_position_max_m, pose.path_orientation_max_rad),
        pose.smoothness.map_or("-".to_string(), |smoothness| format!("{smoothness:.2}")),
    );
}

fn margins(html: &mut String, score: &JointsScore) {
    let number = |value: Option<f64>| value.map_or("-".to_string(), decimal);
    let share = |value: Option<f64>| value.map_or("-".to_string(), |value| format!("{:.1} %", 100.0 * value));
    let _ = writeln!(
        html,
        "<h2>Limits: {}</h2>\n<div class=wide><table>\n<tr><th>joint</th><th class=n>lowest, rad or m</th><th class=n>highest</th>\
         <th class=n>margin</th><th class=n>velocity</th><th class=n>effort</th><th class=n>samples beyond</th></tr>",
        escape(&score.state)
    );
    for joint in &score.joints {
        let class = if joint.beyond_limits > 0 { "error" } else { "" };
        let _ = writeln!(
            html,
            "<tr class=\"{class}\"><td>{}</td><td class=n>{}</td><td class=n>{}</td><td class=n>{}</td><td class=n>{}</td>\
             <td class=n>{}</td><td class=n>{}</td></tr>",
            escape(&joint.name),
            decimal(joint.position_min),
            decimal(joint.position_max),
            number(joint.position_margin),
            share(joint.velocity_share),
            share(joint.effort_share),
            joint.beyond_limits
        );
    }
    html.push_str("</table></div>\n");
}
