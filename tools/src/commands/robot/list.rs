//! `motorium robot list`: the catalogue and the installed robots.

use std::process::ExitCode;

use comfy_table::CellAlignment;
use motorium_robots::{catalogue, installed, load};
use serde_json::json;

use super::facts;
use crate::out::outln;
use crate::report::table;

/// List the robots of the catalogue, and the installed ones.
///
/// Example: motorium robot list --json
#[derive(Debug, clap::Args)]
pub(super) struct List {
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl List {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let robots =
            catalogue().iter().map(|entry| Ok((entry, load(entry.name, std::path::Path::new(""))?.model)));
        let robots: Vec<_> = robots.collect::<Result<_, motorium_robots::LoadError>>()?;
        let others = installed();
        if self.json {
            let ours = robots.iter().map(|(entry, model)| {
                let mut row = facts::size(model);
                row["name"] = json!(entry.name);
                row["title"] = json!(entry.profile.title);
                row
            });
            let theirs = others.iter().map(
                |robot| json!({ "name": robot.name, "collection": robot.collection, "file": robot.urdf }),
            );
            let answer = json!({
                "catalogue": ours.collect::<Vec<_>>(),
                "installed": theirs.collect::<Vec<_>>(),
            });
            outln!("{}", serde_json::to_string_pretty(&answer)?);
            return Ok(ExitCode::SUCCESS);
        }
        let mut listed = table(["robot", "base", "joints", "nv", "mass kg", "what it is"]);
        for (entry, model) in &robots {
            listed.add_row([
                entry.name.to_string(),
                facts::base(model).to_string(),
                model.joint_count().to_string(),
                model.nv().to_string(),
                facts::short(model.mass()),
                entry.profile.title.clone(),
            ]);
        }
        for column in listed.column_iter_mut().skip(2).take(3) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        outln!("{}", listed.trim_fmt());
        if !others.is_empty() {
            let mut listed = table(["installed", "collection", "file"]);
            for robot in &others {
                let file = robot.urdf.display().to_string();
                listed.add_row([robot.name.clone(), robot.collection.clone(), file]);
            }
            outln!("\n{}", listed.trim_fmt());
        }
        Ok(ExitCode::SUCCESS)
    }
}
