//! `motorium topic info`: one topic in detail.

use std::fmt::Write as _;
use std::process::ExitCode;
use std::time::Duration;

use comfy_table::CellAlignment;
use motorium::state::TypeLayout;
use motorium::units::TimeSpan;
use serde::Serialize;

use super::find::find;
use super::json::Row;
use super::list::rows;
use super::text::{names, readable};
use crate::out::{out, outln};
use crate::report::table;
use crate::runs::RunArg;
use crate::style;

/// Show one topic in detail, with the layout of its samples.
///
/// Example: motorium topic info panda/joint_state
#[derive(Debug, clap::Args)]
pub(super) struct Info {
    /// The topic
    #[arg(add = crate::complete::topics())]
    topic: String,
    #[command(flatten)]
    run: RunArg,
    /// Time over which to measure the rate
    #[arg(long = "for", value_name = "TIME", default_value = "500ms", allow_hyphen_values = true)]
    time: TimeSpan,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// A topic in detail as JSON.
#[derive(Debug, Serialize)]
struct Detail {
    #[serde(flatten)]
    row: Row,
    triggers: Vec<String>,
    layout: TypeLayout,
    layout_hash: String,
}

impl Info {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let run = self.run.look()?;
        let (index, topic) = find(&run.plan, &self.topic)?;
        let row = rows(&run, Duration::from_nanos(self.time.ns)).swap_remove(index);
        let triggers = names(&run.plan, &topic.triggers);
        let (layout, layout_hash) = (topic.layout.clone(), topic.layout.hash());
        let detail = Detail { row, triggers, layout, layout_hash };
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&detail)?);
        } else {
            out!("{}", describe(&detail));
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn describe(detail: &Detail) -> String {
    let row = &detail.row;
    let listed = |names: &[String]| if names.is_empty() { "nobody".to_string() } else { names.join(", ") };
    let mut text = format!("{}\n", style::strong(&row.name));
    let mut line = |name: &str, value: &str| {
        let _ = writeln!(text, "  {name:10} {value}");
    };
    let layout = &detail.layout;
    line(
        "type",
        &format!(
            "{}, {} bytes aligned to {}, layout {}",
            layout.type_name, layout.size, layout.alignment, detail.layout_hash
        ),
    );
    line("pattern", &row.pattern);
    line("writer", &row.writer);
    line("readers", &listed(&row.readers));
    line("triggers", &listed(&detail.triggers));
    line("rate", &row.rate_hz.map_or_else(|| "-".to_string(), |rate| format!("{rate:.1} Hz")));
    line("age", &row.age_ns.map_or_else(|| "-".to_string(), readable));
    line("published", &row.published.to_string());
    line("dropped", &row.dropped.to_string());
    let mut fields = table(["offset", "field", "kind", "bytes"]);
    for field in &layout.fields {
        fields.add_row([
            field.offset.to_string(),
            field.name.clone(),
            field.kind.clone(),
            field.size.to_string(),
        ]);
    }
    for (index, column) in fields.column_iter_mut().enumerate() {
        if index == 0 || index == 3 {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let _ = writeln!(text, "\n{}", fields.trim_fmt());
    text
}
