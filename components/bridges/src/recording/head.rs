//! First records of a file: facts of the run, plan, machine, graph, robot descriptions, and world.

use std::collections::BTreeMap;

use mcap::McapError;
use motorium::plan::Plan;

use super::file::Writer;
use super::settings::{Settings, unix_ns};
use super::{PLAN, RUN, machine};
use crate::foxglove::{WORLD_SCENE, descriptions, world_scene};

/// Writes the first records, stamped with the start of the run.
pub(super) fn head(
    writer: &mut Writer,
    plan: &Plan,
    settings: &Settings,
    start_ns: u64,
) -> Result<(), McapError> {
    let mut facts = BTreeMap::new();
    let mut fact = |name: &str, value: String| facts.insert(name.to_string(), value);
    fact("version", env!("CARGO_PKG_VERSION").to_string());
    fact("graph", plan.name.clone());
    fact("file", plan.file.display().to_string());
    fact("clock", format!("{:?}", plan.clock).to_lowercase());
    fact("seed", plan.seed.to_string());
    fact("recorded_at_ns", unix_ns().to_string());
    fact("drawn_every_ns", settings.drawn_every_ns.to_string());
    writer.metadata(RUN, facts)?;
    let text = serde_json::to_vec(plan).map_err(std::io::Error::from)?;
    writer.attach(PLAN, "application/json", &text, start_ns)?;
    writer.attach("machine.json", "application/json", machine::facts().to_string().as_bytes(), start_ns)?;
    if let Ok(text) = std::fs::read(&plan.file) {
        let name = plan.file.file_name().map_or_else(|| "graph.toml".into(), |name| name.to_string_lossy());
        writer.attach(&name, "application/toml", &text, start_ns)?;
    }
    for (name, content) in &settings.attachments {
        writer.attach(name, "application/octet-stream", content, start_ns)?;
    }
    for description in descriptions(plan) {
        let texts = [("urdf", Some(&description.plain)), ("mjcf.xml", description.mjcf.as_ref())];
        for (ending, text) in texts {
            let Some(text) = text else { continue };
            let name = format!("{}.{ending}", description.robot);
            writer.attach(&name, "application/xml", text.as_bytes(), start_ns)?;
        }
        let id = writer.channel(&description.topic, &description.schema(), &BTreeMap::new())?;
        writer.message(id, 1, (start_ns, start_ns), &description.encode())?;
    }
    if let Some((schema, message)) = world_scene(plan) {
        let id = writer.channel(WORLD_SCENE, &schema, &BTreeMap::new())?;
        writer.message(id, 1, (start_ns, start_ns), &message)?;
    }
    Ok(())
}
