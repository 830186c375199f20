//! `motorium can check`: load of a graph's CAN buses, with the calculation.

use std::process::ExitCode;
use std::time::Duration;

use motorium::plan::{ComponentPlan, Plan, Program};
use motorium_can::{Budget, CanAdapterConfig, DriveEntry, HomingBy, HomingProcedure, Table};
use serde_json::{Value, json};

use crate::commands::loading::GraphArgs;
use crate::failure::{Failure, Kind};
use crate::out::{out, outln};
use crate::registry;

/// Check the load of a graph's CAN buses: bits with maximum stuffing, turnaround times, fraction of the
/// cycle.
///
/// The exit code is 3 if the graph is invalid, such as when the frames of a cycle do not fit.
///
/// Example: motorium can check graphs/arm-can.toml --json
#[derive(Debug, clap::Args)]
pub(super) struct Check {
    #[command(flatten)]
    graph: GraphArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The buses of one adapter.
pub(super) struct Found {
    pub(super) component: String,
    period_ns: u64,
    /// Time available for answers on real buses.
    answers_have: Option<Duration>,
    pub(super) table: Table,
}

impl Check {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let checked = match self.graph.load(&registry::registry()) {
            Ok(checked) => checked,
            Err(code) => return Ok(code),
        };
        let found = adapters(&checked.plan)?;
        if found.is_empty() {
            let words = format!("graph `{}` has no component of the kind `can.adapter`", checked.plan.name);
            return Ok(Failure::new(Kind::Failed, words).report());
        }
        if self.json {
            let adapters: Vec<Value> = found.iter().map(value).collect();
            outln!("{}", serde_json::to_string_pretty(&json!({ "adapters": adapters }))?);
        } else {
            found.iter().for_each(|found| out!("{}", describe(found)));
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Returns the adapters of a plan.
pub(super) fn adapters(plan: &Plan) -> anyhow::Result<Vec<Found>> {
    plan.components.iter().filter(|component| is_adapter(component)).map(found).collect()
}

fn is_adapter(component: &ComponentPlan) -> bool {
    matches!(&component.program, Program::Builtin { kind } | Program::Sibling { kind, .. } if kind == "can.adapter")
}

fn found(component: &ComponentPlan) -> anyhow::Result<Found> {
    let config: CanAdapterConfig = serde_json::from_value(component.config.clone())?;
    let table = config.table(&component.folder)?;
    let (component, period_ns) = (component.name.clone(), component.period_ns());
    let answers_have = config.answers_have(&table, Duration::from_nanos(period_ns));
    Ok(Found { component, period_ns, answers_have, table })
}

impl Found {
    fn budgets(&self) -> impl Iterator<Item = (usize, Budget)> {
        (0..self.table.buses.len()).map(|bus| (bus, self.table.budget(bus, self.period_ns)))
    }
}

fn value(found: &Found) -> Value {
    let bits = |shape: &motorium_can::Shape| {
        let (nominal, worst) = (shape.least(), shape.worst());
        json!({ "bytes": shape.bytes, "bits": nominal.nominal + nominal.fast, "bits_with_most_stuffing": worst.nominal + worst.fast })
    };
    let bus = |(index, budget): (usize, Budget)| {
        let entry = &found.table.buses[index];
        let drives = found.table.drives.iter().filter(|drive| drive.bus == entry.name);
        let drives = drives.zip(&budget.exchanges).map(|(drive, (command, answer))| {
            json!({ "joint": drive.joint, "node": drive.node, "command": bits(command), "answer": bits(answer) })
        });
        json!({
            "name": entry.name,
            "interface": entry.interface,
            "bitrate": entry.bitrate,
            "data_bitrate": entry.data_bitrate,
            "cycle_us": budget.cycle_ns as f64 * 1e-3,
            "busy_us": budget.busy_ns() as f64 * 1e-3,
            "turn_round_us": budget.turn_round_ns as f64 * 1e-3,
            "complete_us": budget.complete_ns() as f64 * 1e-3,
            "answers_awaited_us": found.answers_have.map(|time| time.as_secs_f64() * 1e6),
            "share": budget.share(),
            "fits": budget.fits(),
            "most_such_drives": budget.most(),
            "drives": drives.collect::<Vec<_>>(),
            "arithmetic": budget.to_string(),
        })
    };
    let homing: Vec<Value> = homed(&found.table).map(|(order, drive)| homing(order, drive)).collect();
    json!({ "component": found.component, "buses": found.budgets().map(bus).collect::<Vec<_>>(), "homing": homing })
}

/// Returns the drives that are homed before any drive is enabled, in order.
fn homed(table: &Table) -> impl Iterator<Item = (u8, &DriveEntry)> {
    let order = |drive: &DriveEntry| drive.homing.as_ref().and_then(|homing| homing.order).unwrap_or(0);
    let mut drives: Vec<_> = table.drives.iter().filter(|drive| drive.is_homed()).collect();
    drives.sort_by_key(|drive| order(drive));
    drives.into_iter().map(move |drive| (order(drive), drive))
}

fn homing(order: u8, drive: &DriveEntry) -> Value {
    let homing = drive.homing.as_ref();
    json!({
        "joint": drive.joint,
        "order": order,
        "by": homing.map(|homing| if homing.by == HomingBy::Drive { "drive" } else { "stop" }),
        "procedure": describe_homing(drive),
        "timeout_s": homing.map(|homing| homing.timeout().as_secs_f64()),
        "objects": drive.homing_registers().into_iter().map(|(index, subindex, number)| {
            json!({ "object": format!("0x{index:04X}:{subindex:02X}"), "number": number })
        }).collect::<Vec<_>>(),
    })
}

/// Describes the homing of a drive, with numbers in the units of the drive.
fn describe_homing(drive: &DriveEntry) -> String {
    let Some(homing) = &drive.homing else { return String::new() };
    let number = |value: Option<f64>| value.unwrap_or_default();
    match (homing.by, homing.method) {
        (HomingBy::Stop, _) => format!(
            "by the adapter, at velocity {} with effort up to {} against the stop at position {}",
            number(homing.velocity),
            number(homing.effort),
            number(homing.position)
        ),
        (HomingBy::Drive, Some(method)) => {
            let objects = drive.homing_registers().into_iter().skip(1);
            let objects: Vec<String> = objects
                .map(|(index, subindex, number)| format!("0x{index:04X}:{subindex:02X} = {number}"))
                .collect();
            format!("by the drive, method {method}, {}", objects.join(", "))
        }
        (HomingBy::Drive, None) => match homing.procedure.unwrap_or_default() {
            HomingProcedure::Endstop => "by the drive, to its endstop".into(),
            HomingProcedure::Index => "by the drive, to the index of its encoder".into(),
        },
    }
}

fn describe(found: &Found) -> String {
    let mut text = format!("{}\n", found.component);
    for (index, budget) in found.budgets() {
        let entry = &found.table.buses[index];
        let interface =
            entry.interface.as_deref().map_or_else(|| "simulated".into(), |name| format!("interface {name}"));
        let comfortable = if budget.share() > Budget::COMFORTABLE { ", nearly full" } else { "" };
        text += &format!("  {} ({interface}){comfortable}\n    {budget}\n", entry.name);
        text += &format!("    at most {} such drives fit\n", budget.most());
        if let Some(time) = found.answers_have {
            text += &format!("    answers have {:.0} us\n", time.as_secs_f64() * 1e6);
        }
    }
    for (order, drive) in homed(&found.table) {
        let timeout = drive.homing.as_ref().map_or(0.0, |homing| homing.timeout().as_secs_f64());
        text +=
            &format!("  homing {order}: {} {}, within {timeout} s\n", drive.joint, describe_homing(drive));
    }
    text
}
