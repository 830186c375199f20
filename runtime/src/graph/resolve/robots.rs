//! Look-up of robots by the host program.

use super::context::Context;
use crate::declare::RobotReference;
use crate::graph::diagnostic::Report;
use crate::graph::model::{BaseTable, GraphTable};
use crate::graph::read::good;
use crate::graph::source::Span;
use crate::graph::values::check_robot_name;

/// A robot of the file.
pub(super) struct Robot {
    pub name: String,
    /// Position of the robot's name in the file.
    pub place: Span,
    /// The robot; `None` if its model cannot be used. The error has then been reported.
    pub reference: Option<RobotReference>,
}

/// Resolves all robots of the file, in order.
pub(super) fn resolve(graph: &GraphTable<'_>, context: &Context<'_>, report: &mut Report) -> Vec<Robot> {
    let mut robots = Vec::new();
    for (name, at) in good(&graph.robot).iter().flat_map(|robots| &robots.0) {
        let named = check_robot_name(name, &at.key, report);
        let urdf = at.get().and_then(|table| {
            if let (Some(_), Some(mjcf)) = (&table.urdf, &table.mjcf) {
                report
                    .error(format!("robot `{name}` has two models"))
                    .label(&mjcf.key, "besides `urdf`")
                    .advise("keep one of `urdf` and `mjcf`");
                return None;
            }
            let meant = table.meant.iter().any(|meant| ["urdf", "mjcf"].contains(meant));
            if table.urdf.is_none() && table.mjcf.is_none() && !meant {
                report
                    .error(format!("robot `{name}` has no model"))
                    .label(&at.key, "`urdf` is missing")
                    .advise("add `urdf = \"panda\"`: a name of the catalogue, a folder, or a URDF file");
            }
            table.urdf.as_ref().or(table.mjcf.as_ref())
        });
        let reference = urdf.and_then(|urdf| {
            let model = urdf.get()?;
            let folder = context.sources.folder(&urdf.span);
            let table = at.get()?;
            let profile = table.profile.as_ref().and_then(|at| Some((at.get()?, &at.span)));
            let packages = good(&table.package_path).into_iter().flatten();
            let reference = RobotReference {
                name: name.clone(),
                urdf: model.clone(),
                base: folder.to_path_buf(),
                pose: good(&table.base).map(BaseTable::pose),
                profile: profile.map(|(profile, span)| context.sources.folder(span).join(profile)),
                package_path: packages
                    .filter_map(|at| Some(context.sources.folder(&at.span).join(at.get()?)))
                    .collect(),
                settings: table.settings(),
            };
            let checked = (context.registry.robots().check)(&reference);
            for doubt in checked.iter().flatten() {
                report.warning(format!("robot `{name}`: {doubt}")).label(&urdf.span, "this model");
            }
            if let Err(error) = checked {
                let key = error.key.as_deref();
                let own = match key {
                    Some("profile") => profile.map(|(_, span)| span),
                    Some("joints") => table.joints.as_ref().map(|at| &at.span),
                    Some("fixed") => table.fixed.as_ref().map(|at| &at.span),
                    Some("frame") => table.frame.as_ref().map(|at| &at.span),
                    Some("start") => table.start.as_ref().map(|at| &at.span),
                    Some("gains") => table.gains.as_ref().map(|at| &at.span),
                    _ => None,
                };
                let is_setting = own.is_some() && key != Some("profile");
                let label = match (own, is_setting) {
                    (Some(_), true) => "it does not fit this robot",
                    (Some(_), false) => "this profile cannot be used",
                    (None, _) => "this model cannot be used",
                };
                let place = own.unwrap_or(&urdf.span);
                let diagnostic =
                    report.error(format!("robot `{name}`: {}", error.message)).label(place, label);
                let usual = match is_setting {
                    true => format!("`motorium robot show {model}` lists its joints, frames and poses"),
                    false => {
                        "`urdf` is a name of the catalogue, a folder, or a URDF file beside the graph file"
                            .to_string()
                    }
                };
                diagnostic.advise(error.advice.unwrap_or(usual));
                return None;
            }
            named.then_some(reference)
        });
        robots.push(Robot { name: name.clone(), place: at.key.clone(), reference });
    }
    robots
}
