//! Plots of primitive movements, as panels over time.

use std::path::Path;

use motorium_pictures::chart::{self, Panel};
use motorium_primitives::rollout::Trajectory;

use crate::output::write_file;

/// Returns a panel of one dimension of movements, with two standard deviations if known.
pub(super) fn dimension(name: &str, trajectories: &[Trajectory], dimension: usize) -> Panel {
    let mut panel = Panel::new(name);
    for trajectory in trajectories {
        let times = trajectory.time.iter().copied();
        if let Some(deviations) = &trajectory.deviation {
            let edges = trajectory.position.iter().zip(deviations).map(|(place, deviation)| {
                (place[dimension] - 2.0 * deviation[dimension], place[dimension] + 2.0 * deviation[dimension])
            });
            panel.band(times.clone().zip(edges).map(|(time, (low, high))| (time, low, high)).collect());
        }
        panel.line(times.zip(trajectory.position.iter().map(|place| place[dimension])).collect());
    }
    panel
}

/// Draws panels below each other into a file.
pub(super) fn write(path: &Path, panels: &[Panel]) -> anyhow::Result<()> {
    write_file(path, chart::panels(panels, ["recorded", "primitive"]))
}
