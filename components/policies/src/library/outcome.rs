//! Result of a run, in numbers and as a picture.

use super::episode::Stage;
use super::{LibraryPolicy, messages, picture};
use motorium_library::Superposition;

impl LibraryPolicy {
    /// Returns the entry of the policy under `results` in the report.
    pub(super) fn outcome(&self) -> serde_json::Value {
        let mut by_eigenforces = serde_json::Map::new();
        let mut movements = Vec::new();
        for (planned, trace) in self.planned.iter().zip(&self.traces) {
            let scale = self.end_effector.as_ref().map_or(1.0, |(_, plane)| plane.scale_of(planned.entry));
            let errors = trace.errors(&self.library, planned.entry);
            let [generated, tracking, path] = [errors.generated, errors.tracking, errors.path]
                .map(|error| error.map(|error| error * scale));
            by_eigenforces.insert(planned.eigenforces.to_string(), serde_json::json!(generated));
            movements.push(serde_json::json!({
                "movement": planned.name,
                "eigenforces": planned.eigenforces,
                "generated_error": generated,
                "tracking_error": tracking,
                "path_error": path,
            }));
        }
        let seen: Vec<_> = self
            .seen
            .iter()
            .map(|(movement, label, novelty)| {
                serde_json::json!({ "movement": movement, "label": messages::text(label), "novelty": novelty })
            })
            .collect();
        serde_json::json!({
            "movements_begun": self.begun,
            "finished": self.stage == Stage::Finished,
            "path_error_by_eigenforces": by_eigenforces,
            "movements": movements,
            "recognised": seen,
            "picture": self.picture,
        })
    }

    /// Returns the movements for the picture.
    pub(super) fn panels(&self) -> Vec<picture::Panel> {
        let dofs = self.library.layout().dofs();
        let pairs = self.planned.iter().zip(&self.traces);
        pairs
            .map(|(planned, trace)| {
                let whole = Superposition::from_entry(&self.library, planned.entry, self.library.rank())
                    .path(&self.library);
                let whole =
                    whole.row_iter().map(|row| [row[0], if dofs > 1 { row[1] } else { 0.0 }]).collect();
                let name = format!("{}, n = {}", planned.name, planned.eigenforces);
                picture::Panel { name, paths: [whole, trace.commanded_points(), trace.measured_points()] }
            })
            .collect()
    }
}
