//! `motorium robot show`: joints, limits, frames, poses and sources of a robot.

use std::fmt::Write as _;
use std::process::ExitCode;

use comfy_table::CellAlignment;
use motorium_robots::{Coordinate, Loaded, MimicMode, Model, ModelWarning, Posture, Profile};

use super::facts::{self, short};
use super::source::ProfiledArgs;
use crate::out::{out, outln};
use crate::report::table;
use crate::style;

/// Show joints, limits, frames, poses, feet, gains and sources of a robot.
///
/// Example: motorium robot show panda
#[derive(Debug, clap::Args)]
pub(super) struct Show {
    #[command(flatten)]
    robot: ProfiledArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Show {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let robot = match self.robot.open(MimicMode::Follow) {
            Ok(robot) => robot,
            Err(code) => return Ok(code),
        };
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&facts::all(&robot))?);
        } else {
            out!("{}", describe(&robot));
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Describes the robot in a few lines and tables.
fn describe(robot: &Loaded) -> String {
    let model = &robot.model;
    let mut text = String::new();
    let title = robot.profile.as_ref().map_or(String::new(), |profile| format!(": {}", profile.title));
    let _ = writeln!(text, "{}{title}", style::strong(model.name()));
    if let Some(path) = &robot.path {
        let _ = writeln!(text, "{}", style::dim(path.display()));
    }
    let _ = writeln!(
        text,
        "{} base, {} joints, nq {}, nv {}, {}\n",
        facts::base(model),
        model.joint_count(),
        model.nq(),
        model.nv(),
        facts::mass(model)
    );
    text += &joints(model, robot.profile.as_ref());
    text += &frames(model);
    if let Some(profile) = &robot.profile {
        text += &poses(model, profile);
        text += &parts(profile);
        text += "sources\n";
        for source in &profile.sources {
            let _ = writeln!(text, "  {source}");
        }
    }
    text += &postures(&robot.postures);
    for warning in ModelWarning::summarise(&robot.warnings) {
        let _ = writeln!(text, "{}: {warning}", style::warning("warning"));
    }
    text
}

/// Returns the table with one row per joint, including its gains.
fn joints(model: &Model, profile: Option<&Profile>) -> String {
    if model.bodies().is_empty() {
        return String::new();
    }
    let gains = profile.and_then(|profile| profile.gains(model).ok());
    let mut rows = table(["joint", "type", "moves", "lower", "upper", "velocity", "effort", "kp", "kd", ""]);
    for body in model.bodies() {
        let joint = &body.joint;
        let limits = facts::limits(model, joint);
        let (kp, kd, note) = match joint.coordinate {
            Coordinate::Independent(index) => {
                let gain = |values: &dyn Fn(&motorium_robots::Gains) -> f64| {
                    gains.as_ref().map_or("-".to_string(), |gains| short(values(gains)))
                };
                let passive = profile.is_some_and(|profile| profile.passive.contains(&joint.name));
                let note = if passive { "passive".to_string() } else { String::new() };
                (gain(&|gains| gains.kp[index]), gain(&|gains| gains.kd[index]), note)
            }
            Coordinate::Mimic { of, multiplier, offset } => {
                let follows = format!("= {} {}", short(multiplier), model.joint_names()[of]);
                let offset = if offset == 0.0 { String::new() } else { format!(" + {}", short(offset)) };
                ("-".to_string(), "-".to_string(), follows + &offset)
            }
        };
        rows.add_row([
            joint.name.clone(),
            facts::kind(joint.kind).to_string(),
            body.name.clone(),
            short(limits.lower),
            short(limits.upper),
            short(limits.velocity),
            short(limits.effort),
            kp,
            kd,
            note,
        ]);
    }
    for column in rows.column_iter_mut().skip(3).take(6) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    format!("{}\n\n", rows.trim_fmt())
}

/// Links fixed to a moving link, or without children: frames that a task can name.
fn frames(model: &Model) -> String {
    let mut text = "frames\n".to_string();
    let mut line = |body: Option<usize>, carrier: String| {
        let here = model.frames().iter().filter(|frame| frame.body == body && frame.name != carrier);
        let names: Vec<&str> = here.map(|frame| frame.name.as_str()).collect();
        let rest = if names.is_empty() { String::new() } else { format!(": {}", names.join(", ")) };
        let _ = writeln!(text, "  {carrier}{rest}");
    };
    if let Some(root) = model.frames().first() {
        line(None, root.name.clone());
    }
    for (index, body) in model.bodies().iter().enumerate() {
        line(Some(index), body.name.clone());
    }
    text + "\n"
}

/// Returns all poses, with values in the order of the joints.
fn poses(model: &Model, profile: &Profile) -> String {
    let mut text = "poses\n".to_string();
    for name in profile.poses.keys() {
        let Ok(pose) = profile.pose(model, name) else { continue };
        let values: Vec<String> = pose.iter().map(|value| short(*value)).collect();
        let home = if *name == profile.home { " (home)" } else { "" };
        let at = profile.base_poses.get(name).map_or(String::new(), |base| {
            let numbers: Vec<String> =
                base.position.iter().chain(&base.rpy).map(|value| short(*value)).collect();
            format!(" base at {} turned {}", numbers[..3].join(" "), numbers[3..].join(" "))
        });
        let _ = writeln!(text, "  {name}{home}:{at} {}", values.join(" "));
    }
    text + "\n"
}

/// Poses of the robot's SRDF, in the same form.
fn postures(postures: &[Posture]) -> String {
    let mut text = String::new();
    for posture in postures {
        let values: Vec<String> = posture.joints.iter().map(|value| short(*value)).collect();
        let at = posture.base.map_or(String::new(), |base| {
            let (place, (roll, pitch, yaw)) = (base.translation, base.rotation.euler_angles());
            let numbers = [place.x, place.y, place.z, roll, pitch, yaw].map(short);
            format!(" base at {} turned {}", numbers[..3].join(" "), numbers[3..].join(" "))
        });
        let _ = writeln!(text, "  {}:{at} {}", posture.name, values.join(" "));
    }
    if text.is_empty() { text } else { format!("poses of its SRDF\n{text}\n") }
}

/// Returns the actuated joints, feet, wheels and rotors.
fn parts(profile: &Profile) -> String {
    let mut text = String::new();
    for (name, end) in &profile.end_effectors {
        let fingers = if end.fingers.is_empty() {
            String::new()
        } else {
            format!(", fingers {}", end.fingers.join(" "))
        };
        let _ = writeln!(text, "end effector {name}: {} by {}{fingers}", end.frame, end.joints.join(" "));
    }
    for (name, foot) in &profile.feet {
        let shape = match (foot.radius, foot.sole) {
            (Some(radius), _) => format!("a ball of radius {} m", short(radius)),
            (_, Some([x, y])) => format!("a sole of {} x {} m", short(x), short(y)),
            _ => "a point".to_string(),
        };
        let _ = writeln!(text, "foot {name}: {}, {shape}", foot.frame);
    }
    if let Some(base) = &profile.mobile_base {
        let sizes =
            [("wheel radius", base.wheel_radius), ("track", base.track), ("wheelbase", base.wheelbase)];
        let sizes = sizes.iter().filter_map(|(what, size)| Some(format!(", {what} {} m", short((*size)?))));
        let _ =
            write!(text, "mobile base {}: {}{}", base.frame, base.drive.name(), sizes.collect::<String>());
        for (what, joints) in
            [("joints", &base.joints), ("wheels", &base.wheels), ("steering", &base.steering)]
        {
            if !joints.is_empty() {
                let _ = write!(text, ", {what} {}", joints.join(" "));
            }
        }
        text.push('\n');
    }
    for (name, rotor) in &profile.rotors {
        let spin = format!("{:?}", rotor.spin).to_lowercase();
        let _ = writeln!(text, "rotor {name}: {}, {spin}, up to {} N", rotor.frame, short(rotor.max_thrust));
    }
    if text.is_empty() { text } else { text + "\n" }
}
