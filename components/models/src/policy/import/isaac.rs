//! Import of policies of Isaac Lab 2: an ONNX file with the descriptions of its inputs and outputs.
//!
//! `IO_descriptors.yaml` (`--export_io_descriptors` of Isaac Lab 2.2 and 2.3,
//! `isaaclab/envs/utils/io_descriptors.py`) lists action and observation terms in order. In this file,
//! stiffness and damping are 0 for actuators that Isaac Lab computes itself. Their values are in
//! `params/env.yaml` of the training run.

use super::names::Pattern;
use super::served::{self, Served};
use super::{HeightGrid, ImportError, Mark, NETWORK};
use crate::onnx::Model;
use crate::policy::{Action, ActionKind, Numbers, Observation, Policy, Term};

/// Observation terms, by the names of their functions in `isaaclab.envs.mdp.observations`.
const TERMS: [(&str, Term); 9] = [
    ("base_lin_vel", Term::BaseLinearVelocity),
    ("base_ang_vel", Term::BaseAngularVelocity),
    ("projected_gravity", Term::ProjectedGravity),
    ("generated_commands", Term::Command),
    ("joint_pos_rel", Term::JointPositions),
    ("joint_vel", Term::JointVelocities),
    ("joint_vel_rel", Term::JointVelocities),
    ("last_action", Term::LastAction),
    ("height_scan", Term::HeightScan),
];

/// Action terms, by the names of their classes in `isaaclab.envs.mdp.actions`.
const ACTIONS: [(&str, ActionKind); 3] = [
    ("JointPositionAction", ActionKind::Position),
    ("JointVelocityAction", ActionKind::Velocity),
    ("JointEffortAction", ActionKind::Effort),
];

/// Group of the observations read by the actor.
const GROUP: &str = "policy";

/// Maximum difference of numbers that should be equal.
const TOLERANCE: f64 = 1e-5;

/// Content of an `IO_descriptors.yaml`, which describes the observations and actions of a policy of Isaac
/// Lab.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Descriptors {
    /// Action terms, in the order of the network's outputs.
    pub actions: Vec<ActionDescriptor>,
    /// Groups of observation terms, each in the order of the network's inputs.
    pub observations: Vec<(String, Vec<ObservationDescriptor>)>,
    /// Articulated bodies of the scene.
    pub articulations: Vec<Articulation>,
    /// Position of the scene's time settings in the file.
    pub scene: Mark,
    /// Period of the policy \[s\].
    pub period: f64,
    /// Time step of the simulation \[s\].
    pub time_step: f64,
    /// Number of simulation steps per period of the policy.
    pub decimation: usize,
}

/// An action term.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ActionDescriptor {
    /// Position of the term's class in the file.
    pub mark: Mark,
    /// Full name of the term's class.
    pub class: String,
    /// Joint of each output.
    pub joints: Vec<String>,
    /// Factor of the output. Default: 1.
    pub scale: Option<Numbers>,
    /// Target of a zero action. Default: 0.
    pub offset: Option<Numbers>,
    /// Minimum and maximum target of each joint.
    pub clip: Option<Vec<[f64; 2]>>,
}

/// An observation term.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObservationDescriptor {
    /// Position of the term's function in the file.
    pub mark: Mark,
    /// Full name of the term's function.
    pub function: String,
    /// Number of values per time step, without history.
    pub width: usize,
    /// Joint of each value, for terms with one value per joint.
    pub joints: Option<Vec<String>>,
    /// Positions that are subtracted from the measured positions \[rad or m\].
    pub position_offsets: Option<Vec<f64>>,
    /// Velocities that are subtracted from the measured velocities \[rad/s or m/s\].
    pub velocity_offsets: Option<Vec<f64>>,
    /// Minimum and maximum value before the factor.
    pub clip: Option<[f64; 2]>,
    /// Factor of the value. Default: 1.
    pub scale: Option<Numbers>,
    /// Number of steps of history; both 0 and 1 mean only the newest step.
    pub history: usize,
    /// `true` if the steps are concatenated to one row, `false` if they form an axis.
    pub is_flat: bool,
    /// `true` if modifier functions are applied to the values, which is not supported.
    pub has_modifiers: bool,
}

/// An articulated body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Articulation {
    /// Name of the body in the scene.
    pub name: String,
    /// Names of the joints.
    pub joints: Vec<String>,
    /// Default position of each joint \[rad or m\].
    pub positions: Vec<f64>,
    /// Stiffness of each joint \[Nm/rad or N/m\]; 0 if unknown.
    pub stiffness: Vec<f64>,
    /// Damping of each joint \[Nms/rad or Ns/m\]; 0 if unknown.
    pub damping: Vec<f64>,
}

/// Description of the robot and of the policy's rate in an `env.yaml`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Environment {
    /// Position of `decimation` in the file.
    pub mark: Mark,
    /// Number of simulation steps per period of the policy.
    pub decimation: usize,
    /// Time step of the simulation \[s\].
    pub time_step: f64,
    /// Position of the default pose in the file.
    pub pose: Mark,
    /// Default positions \[rad or m\] by patterns of joint names. Joints that match no pattern have the
    /// default position 0.
    pub positions: Vec<(String, f64)>,
    /// Actuators of the robot.
    pub actuators: Vec<Actuator>,
    /// Grid of the height scanner.
    pub height_grid: Option<HeightGrid>,
}

/// A group of joints with the same kind of drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Actuator {
    /// Position of the joint patterns in the file.
    pub mark: Mark,
    /// Name of the group.
    pub name: String,
    /// Patterns that select joints by name.
    pub joints: Vec<String>,
    /// Stiffness \[Nm/rad or N/m\].
    pub stiffness: Option<Gain>,
    /// Damping \[Nms/rad or Ns/m\].
    pub damping: Option<Gain>,
}

/// A gain of the joints of an actuator.
#[derive(Clone, Debug, PartialEq)]
pub enum Gain {
    /// One value for all joints.
    All(f64),
    /// Values by patterns of joint names.
    Each(Vec<(String, f64)>),
}

/// Returns the shortest decimal of a number stored in single precision: 0.4 for 0.4000000059604645.
pub(super) fn shortest(number: f64) -> f64 {
    let single = number as f32;
    if f64::from(single) == number { single.to_string().parse().unwrap_or(number) } else { number }
}

/// Returns the rate of a period \[Hz\], rounded to a whole number within 1e-6.
fn rate(period: f64) -> f64 {
    let rate = period.recip();
    if (rate / rate.round() - 1.0).abs() < 1e-6 { rate.round() } else { rate }
}

fn last_part(path: &str) -> &str {
    path.rsplit(['.', ':']).next().unwrap_or(path)
}

/// Returns the value of the pattern that matches `joint`.
fn find(mark: Mark, entry: &str, values: &[(String, f64)], joint: &str) -> Result<Option<f64>, ImportError> {
    let mut found = None;
    for (pattern, value) in values {
        if !parse(mark, pattern)?.matches(joint) {
            continue;
        }
        if let Some((other, _)) = found {
            let message =
                format!("patterns \"{other}\" and \"{pattern}\" match joint \"{joint}\", expected one");
            return Err(mark.entry(entry, message));
        }
        found = Some((pattern, *value));
    }
    Ok(found.map(|(_, value)| value))
}

fn parse(mark: Mark, pattern: &str) -> Result<Pattern, ImportError> {
    Pattern::parse(pattern).map_err(|defect| {
        mark.entry(
            pattern,
            format!("{defect}, expected a pattern of joint names; help: write out the names of the joints"),
        )
    })
}

/// Marks an error as an error of the `env.yaml`.
fn in_environment(error: ImportError) -> ImportError {
    ImportError::Environment(Box::new(error))
}

impl Environment {
    /// Returns the default positions of joints \[rad or m\].
    ///
    /// # Errors
    ///
    /// [`ImportError::Environment`] if a pattern of joint names is invalid or ambiguous.
    pub fn default_pose(&self, joints: &[String]) -> Result<Vec<f64>, ImportError> {
        let position = |joint: &String| {
            let found = find(self.pose, "init_state.joint_pos", &self.positions, joint);
            Ok(found.map_err(in_environment)?.unwrap_or(0.0))
        };
        joints.iter().map(position).collect()
    }

    /// Returns the rate of the policy \[Hz\].
    pub fn rate(&self) -> f64 {
        rate(self.decimation as f64 * self.time_step)
    }

    /// Returns a gain of a joint, or `None` if no actuator has it.
    fn gain(
        &self,
        joint: &str,
        name: &str,
        gain: fn(&Actuator) -> Option<&Gain>,
    ) -> Result<Option<f64>, ImportError> {
        for actuator in &self.actuators {
            let mut is_driven = false;
            for pattern in &actuator.joints {
                is_driven |= parse(actuator.mark, pattern)?.matches(joint);
            }
            if is_driven {
                let entry = format!("actuators.{}.{name}", actuator.name);
                return match gain(actuator) {
                    None => Ok(None),
                    Some(Gain::All(value)) => Ok(Some(*value)),
                    Some(Gain::Each(values)) => find(actuator.mark, &entry, values, joint),
                };
            }
        }
        Ok(None)
    }
}

/// Returns the stiffness and damping of each joint, from the actuators or from the articulation.
pub(super) fn gains(
    joints: &[String],
    articulation: &Articulation,
    environment: Option<&Environment>,
) -> Result<[Vec<f64>; 2], ImportError> {
    let given = |gains: &[f64], joint: &str| {
        let index = articulation.joints.iter().position(|name| name == joint)?;
        gains.get(index).copied().map(shortest)
    };
    let mut all = [Vec::new(), Vec::new()];
    for joint in joints {
        let file = [given(&articulation.stiffness, joint), given(&articulation.damping, joint)];
        // both are 0 for a drive computed by Isaac Lab itself
        let is_known = file.iter().flatten().any(|gain| *gain > 0.0);
        let drives = match environment {
            Some(environment) => {
                let stiffness = environment.gain(joint, "stiffness", |actuator| actuator.stiffness.as_ref());
                let damping = environment.gain(joint, "damping", |actuator| actuator.damping.as_ref());
                [stiffness.map_err(in_environment)?, damping.map_err(in_environment)?]
            }
            None => [None, None],
        };
        let found = drives.into_iter().zip(file).map(|(drive, file)| drive.or(file.filter(|_| is_known)));
        for ((all, found), gain) in all.iter_mut().zip(found).zip(["stiffness", "damping"]) {
            all.push(found.ok_or_else(|| ImportError::Gains { gain, joint: joint.clone() })?);
        }
    }
    Ok(all)
}

/// Returns the common bounds of the outputs of all joints, from the bounds of their targets.
fn clip(term: &ActionDescriptor) -> Result<Option<[f64; 2]>, ImportError> {
    let Some(bounds) = &term.clip else { return Ok(None) };
    let wrong = |message: String| Err(term.mark.entry("clip", message));
    if bounds.len() != term.joints.len() {
        return wrong(format!("found bounds of {} joints, expected {}", bounds.len(), term.joints.len()));
    }
    let mut common: Option<[f64; 2]> = None;
    for (index, bounds) in bounds.iter().enumerate() {
        let number = |numbers: &Option<Numbers>, default| match numbers {
            Some(Numbers::Each(values)) => values.get(index).copied().unwrap_or(default),
            Some(Numbers::All(value)) => *value,
            None => default,
        };
        let (scale, offset) = (number(&term.scale, 1.0), number(&term.offset, 0.0));
        let [low, high] = bounds.map(|bound| (bound - offset) / scale);
        let bounds = [low.min(high), low.max(high)];
        let equals = |[low, high]: [f64; 2]| {
            (low - bounds[0]).abs() < TOLERANCE && (high - bounds[1]).abs() < TOLERANCE
        };
        if common.is_some_and(|common| !equals(common)) {
            return wrong(format!(
                "the outputs of the joints have different bounds, {:?} and {bounds:?}, expected the same for all",
                common.unwrap_or(bounds)
            ));
        }
        common = common.or(Some(bounds));
    }
    Ok(common)
}

/// Combines the action terms into one action.
fn action(descriptors: &Descriptors, environment: Option<&Environment>) -> Result<Action, ImportError> {
    let (mut joints, mut scales, mut offsets) = (Vec::new(), Vec::new(), Vec::new());
    let mut common = None;
    for term in &descriptors.actions {
        let class = last_part(&term.class);
        let kind = ACTIONS.iter().find(|(name, _)| *name == class).map(|(_, kind)| *kind);
        let kind = kind.ok_or_else(|| ImportError::Action {
            mark: term.mark,
            name: class.to_owned(),
            expected: ACTIONS.map(|(name, _)| name).join(", "),
        })?;
        let clip = clip(term)?;
        let (first_kind, first_clip) = *common.get_or_insert((kind, clip));
        if (kind, clip) != (first_kind, first_clip) {
            let message = "the kind or the bounds differ from the previous terms, expected the same kind and \
                 bounds for all joints";
            return Err(term.mark.entry(class, message));
        }
        let count = term.joints.len();
        for (numbers, all, default, entry) in
            [(&term.scale, &mut scales, 1.0, "scale"), (&term.offset, &mut offsets, 0.0, "offset")]
        {
            match numbers {
                None => all.extend(core::iter::repeat_n(default, count)),
                Some(Numbers::All(value)) => all.extend(core::iter::repeat_n(shortest(*value), count)),
                Some(Numbers::Each(values)) if values.len() == count => {
                    all.extend(values.iter().copied().map(shortest));
                }
                Some(Numbers::Each(values)) => {
                    let message = format!("found {} numbers, expected {count}", values.len());
                    return Err(term.mark.entry(entry, message));
                }
            }
        }
        joints.extend(term.joints.iter().cloned());
    }
    let Some((kind, clip)) = common else {
        return Err(descriptors.scene.entry("actions", "found no term, expected one that commands joints"));
    };
    let mark = descriptors.actions.first().map_or(descriptors.scene, |term| term.mark);
    let articulation = articulation(descriptors, mark, &joints)?;
    let position = |joint: &String| {
        let index = articulation.joints.iter().position(|name| name == joint)?;
        articulation.positions.get(index).copied().map(shortest)
    };
    let default_pose: Option<Vec<f64>> = joints.iter().map(position).collect();
    let default_pose = default_pose.ok_or_else(|| {
        let message = "expected a position for each of `joint_names`";
        mark.entry(
            "default_joint_pos",
            format!("found {} positions, {message}", articulation.positions.len()),
        )
    })?;
    if let Some(environment) = environment {
        let other = environment.default_pose(&joints)?;
        let differing =
            joints.iter().zip(&default_pose).zip(&other).find(|((_, a), b)| (**a - **b).abs() > 1e-4);
        if let Some(((joint, found), expected)) = differing {
            let message = format!(
                "joint \"{joint}\" has {found} in the descriptors and {expected} in env.yaml; help: use the files of one training run"
            );
            return Err(mark.entry("default_joint_pos", message));
        }
    }
    if kind == ActionKind::Position {
        for (offset, default) in offsets.iter_mut().zip(&default_pose) {
            let rest = *offset - default;
            *offset = if rest.abs() < TOLERANCE { 0.0 } else { rest };
        }
    }
    let gains = match kind {
        ActionKind::Effort => None,
        _ => Some(gains(&joints, articulation, environment)?),
    };
    let (kp, kd) = match gains {
        Some([stiffness, damping]) => (Some(common_number(stiffness)), Some(common_number(damping))),
        None => (None, None),
    };
    let (scale, offset) = (common_number(scales), common_number(offsets));
    Ok(Action { joints, kind, scale, offset, default_pose, clip, kp, kd, twist: None })
}

/// Returns one number if all numbers are equal, otherwise the list.
pub(super) fn common_number(numbers: Vec<f64>) -> Numbers {
    match numbers.split_first() {
        Some((first, rest)) if rest.iter().all(|number| number == first) => Numbers::All(*first),
        _ => Numbers::Each(numbers),
    }
}

fn articulation<'a>(
    descriptors: &'a Descriptors,
    mark: Mark,
    joints: &[String],
) -> Result<&'a Articulation, ImportError> {
    let has_all = |body: &&Articulation| joints.iter().all(|joint| body.joints.contains(joint));
    descriptors.articulations.iter().find(has_all).ok_or_else(|| {
        let known =
            descriptors.articulations.iter().map(|body| format!("{}: {}", body.name, body.joints.join(", ")));
        let found = known.collect::<Vec<_>>().join("; ");
        mark.entry("joint_names", format!("no articulation has {}; found {found}", joints.join(", ")))
    })
}

fn height_scan(
    term: &ObservationDescriptor,
    environment: Option<&Environment>,
) -> Result<Served, ImportError> {
    let wrong = |entry: &str, message: String| Err(term.mark.entry(&format!("height_scan.{entry}"), message));
    let Some(grid) = environment.and_then(|environment| environment.height_grid.as_ref()) else {
        let message =
            "the grid is unknown; help: pass the env.yaml of the training run, with `scene.height_scanner`";
        return wrong("sensor_cfg", message.to_owned());
    };
    if grid.count() != term.width {
        let message = format!("found {} numbers, expected {} as in env.yaml", term.width, grid.count());
        return wrong("shape", message);
    }
    let scale = match &term.scale {
        None => 1.0,
        Some(Numbers::All(scale)) => shortest(*scale),
        Some(Numbers::Each(_)) => return wrong("scale", "found a list, expected one number".to_owned()),
    };
    Ok(grid.served(scale, term.clip, term.history.max(1)))
}

fn observation(
    term: &ObservationDescriptor,
    action: &Action,
    environment: Option<&Environment>,
) -> Result<Served, ImportError> {
    let name = last_part(&term.function);
    let wrong = |entry: &str, message: String| Err(term.mark.entry(&format!("{name}.{entry}"), message));
    let Some((_, quantity)) = TERMS.iter().find(|(known, _)| *known == name) else {
        let expected = TERMS.map(|(name, _)| name).join(", ");
        return Err(ImportError::Observation { mark: term.mark, name: name.to_owned(), expected });
    };
    if term.has_modifiers {
        return wrong("modifiers", "found modifier functions, which are not supported".to_owned());
    }
    if term.history > 1 && !term.is_flat {
        return wrong(
            "flatten_history_dim",
            "found false, expected a history that is concatenated to one row".to_owned(),
        );
    }
    if *quantity == Term::HeightScan {
        return height_scan(term, environment);
    }
    let count = match quantity {
        Term::JointPositions | Term::JointVelocities | Term::LastAction => action.joints.len(),
        _ => 3,
    };
    if term.width != count {
        return wrong("shape", format!("found {} numbers, expected {count}", term.width));
    }
    let mut order: Vec<usize> = (0..count).collect();
    if let Some(joints) = &term.joints {
        let index = |joint: &String| action.joints.iter().position(|name| name == joint);
        let found: Option<Vec<usize>> = joints.iter().map(index).collect();
        match found.filter(|found| found.len() == count && order.iter().all(|index| found.contains(index))) {
            Some(found) => order = found,
            None => {
                let message = format!(
                    "found {}, expected the joints of the action, {}",
                    joints.join(", "),
                    action.joints.join(", ")
                );
                return wrong("joint_names", message);
            }
        }
    }
    let zeros = vec![0.0; count];
    for (entry, found, expected) in [
        ("joint_pos_offsets", &term.position_offsets, &action.default_pose),
        ("joint_vel_offsets", &term.velocity_offsets, &zeros),
    ] {
        let Some(found) = found else { continue };
        let matches = order.iter().zip(found).all(|(index, found)| (found - expected[*index]).abs() < 1e-4);
        if found.len() != count || !matches {
            return wrong(
                entry,
                format!("found {found:?}, expected the default of each joint, {expected:?}"),
            );
        }
    }
    // factors are in the order of the policy, like the values
    let scale = match &term.scale {
        None => Numbers::All(1.0),
        Some(Numbers::All(scale)) => Numbers::All(shortest(*scale)),
        Some(Numbers::Each(scales)) if scales.len() == count => {
            let mut sorted = vec![0.0; count];
            order.iter().zip(scales).for_each(|(index, scale)| sorted[*index] = shortest(*scale));
            common_number(sorted)
        }
        Some(Numbers::Each(scales)) => {
            return wrong("scale", format!("found {} numbers, expected {count}", scales.len()));
        }
    };
    let history = term.history.max(1);
    let observation = Observation { scale, clip: term.clip, history, ..Observation::new(*quantity) };
    Ok(Served { observation, order, add: 0.0 })
}

/// Creates a policy and its network from an ONNX file of Isaac Lab 2 and its descriptors. Joints are matched
/// by name. If the order of joints in an observation differs from their order in the action, the network is
/// rewritten to read joints in the order of the action.
///
/// # Errors
///
/// [`ImportError`] with the line of the descriptor, or the node of the network.
pub fn import_isaac(
    bytes: &[u8],
    descriptors: &Descriptors,
    environment: Option<&Environment>,
) -> Result<(Policy, Vec<u8>), ImportError> {
    let Descriptors { scene, period, time_step, decimation, .. } = descriptors;
    let steps = *decimation as f64 * time_step;
    if !(*period > 0.0 && (steps / period - 1.0).abs() < 1e-4) {
        let message = format!(
            "found a period of {period} s and {decimation} time steps of {time_step} s, expected the same time above 0 s"
        );
        return Err(scene.entry("scene.dt", message));
    }
    let rate = rate(*period);
    if let Some(environment) =
        environment.filter(|environment| (environment.rate() / rate - 1.0).abs() > 1e-4)
    {
        let message = format!(
            "found {} Hz, expected {rate} Hz as in the descriptors; help: use the files of one training run",
            environment.rate()
        );
        return Err(in_environment(environment.mark.entry("decimation", message)));
    }
    let action = action(descriptors, environment)?;
    let group = descriptors.observations.iter().find(|(name, _)| name == GROUP);
    let Some((_, terms)) = group else {
        let found: Vec<&str> = descriptors.observations.iter().map(|(name, _)| &name[..]).collect();
        let message = format!("found the groups {}, expected \"{GROUP}\"", found.join(", "));
        return Err(scene.entry("observations", message));
    };
    let served = terms.iter().map(|term| {
        let served = observation(term, &action, environment)?;
        if action.clip.is_some() && served.observation.term == Term::LastAction {
            let message =
                "the action has bounds, but its terms observe the action without bounds, expected no bounds";
            return Err(term.mark.entry("last_action", message));
        }
        Ok(served)
    });
    let served = served.collect::<Result<Vec<Served>, ImportError>>()?;
    let observations = served.iter().map(|served| served.observation.clone()).collect();
    let policy = Policy {
        network: NETWORK.to_owned(),
        rate,
        robot: None,
        initial_states: Vec::new(),
        observations,
        action,
        pattern: None,
        robot_digest: None,
    };
    served::finish(policy, &Model::read(bytes)?, bytes, &served)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inference::Unary;
    use crate::onnx::write_mlp;
    use crate::policy::PolicyNetwork;

    fn mark(line: usize) -> Mark {
        Mark { line, column: 5 }
    }

    fn term(line: usize, name: &str, width: usize) -> ObservationDescriptor {
        ObservationDescriptor {
            mark: mark(line),
            function: format!("isaaclab.envs.mdp.observations.{name}"),
            width,
            is_flat: true,
            ..ObservationDescriptor::default()
        }
    }

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    /// The action lists the joints in another order than the articulation and the positions.
    fn descriptors() -> Descriptors {
        let positions = ObservationDescriptor {
            joints: Some(names(&["hip", "knee"])),
            position_offsets: Some(vec![0.1, -0.2]),
            scale: Some(Numbers::Each(vec![2.0, 3.0])),
            history: 2,
            ..term(21, "joint_pos_rel", 2)
        };
        let gravity = ObservationDescriptor { clip: Some([-1.0, 1.0]), ..term(20, "projected_gravity", 3) };
        Descriptors {
            actions: vec![ActionDescriptor {
                mark: mark(10),
                class: "isaaclab.envs.mdp.actions.joint_actions.JointPositionAction".to_owned(),
                joints: names(&["knee", "hip"]),
                scale: Some(Numbers::All(0.25)),
                offset: Some(Numbers::Each(vec![f64::from(-0.2_f32), f64::from(0.4_f32)])),
                clip: None,
            }],
            observations: vec![(GROUP.to_owned(), vec![gravity, positions, term(22, "last_action", 2)])],
            articulations: vec![Articulation {
                name: "robot".to_owned(),
                joints: names(&["hip", "knee"]),
                positions: vec![f64::from(0.1_f32), f64::from(-0.2_f32)],
                stiffness: vec![0.0, 0.0],
                damping: vec![0.0, 0.0],
            }],
            scene: mark(30),
            period: 0.02,
            time_step: 0.005,
            decimation: 4,
        }
    }

    fn environment() -> Environment {
        let each = |values: &[(&str, f64)]| {
            values.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect::<Vec<_>>()
        };
        Environment {
            mark: mark(1),
            decimation: 4,
            time_step: 0.005,
            pose: mark(2),
            positions: each(&[("h.*", 0.1), ("knee", -0.2)]),
            actuators: vec![Actuator {
                mark: mark(3),
                name: "legs".to_owned(),
                joints: names(&["hip|knee"]),
                stiffness: Some(Gain::All(40.0)),
                damping: Some(Gain::Each(each(&[("hip", 1.0), ("kn.+", 2.0)]))),
            }],
            height_grid: None,
        }
    }

    fn network(width: usize) -> Vec<u8> {
        let weights = (0..2 * width).map(|k| ((k * k) as f32).sin()).collect();
        write_mlp(width, &[(weights, vec![0.5, -0.5])], Unary::Elu(1.0), &[])
    }

    fn run(policy: &Policy, bytes: &[u8], input: &[f32]) -> Vec<f32> {
        let program = Model::read(bytes).and_then(|model| model.program(1)).expect("a network");
        let mut network = PolicyNetwork::new(policy, program).expect("it fits");
        network.observation_mut().copy_from_slice(input);
        network.run().to_vec()
    }

    #[test]
    fn descriptors_become_a_policy() {
        let (policy, bytes) =
            import_isaac(&network(9), &descriptors(), Some(&environment())).expect("a policy");
        let action = &policy.action;
        assert_eq!((policy.rate, &action.joints), (50.0, &names(&["knee", "hip"])));
        assert_eq!(action.default_pose, [-0.2, 0.1]);
        assert_eq!((&action.scale, action.kind), (&Numbers::All(0.25), ActionKind::Position));
        let Numbers::Each(offset) = &action.offset else { panic!("{:?}", action.offset) };
        assert!(offset[0] == 0.0 && (offset[1] - 0.3).abs() < 1e-9, "{offset:?}");
        assert_eq!(action.kp, Some(Numbers::All(40.0)));
        assert_eq!(action.kd, Some(Numbers::Each(vec![2.0, 1.0])));
        let terms: Vec<_> = policy.observations.iter().map(|each| (each.term, each.history)).collect();
        let expected = [(Term::ProjectedGravity, 1), (Term::JointPositions, 2), (Term::LastAction, 1)];
        assert_eq!(terms, expected);
        assert_eq!(policy.observations[0].clip, Some([-1.0, 1.0]));
        assert_eq!(policy.observations[1].scale, Numbers::Each(vec![3.0, 2.0]));
        // the file's network reads hip, knee; the policy's reads knee, hip
        let (old, new) =
            ([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0], [1.0, 2.0, 3.0, 5.0, 4.0, 7.0, 6.0, 8.0, 9.0]);
        assert_eq!(run(&policy, &bytes, &new), run(&policy, &network(9), &old));
    }

    #[test]
    fn joints_in_order_leave_the_network_unchanged() {
        let mut descriptors = descriptors();
        descriptors.actions[0].joints.reverse();
        descriptors.actions[0].offset = None;
        let bytes = network(9);
        let (_, written) = import_isaac(&bytes, &descriptors, Some(&environment())).expect("a policy");
        assert_eq!(written, bytes);
    }

    #[test]
    fn height_scans_change_their_sign_and_order() {
        let mut descriptors = descriptors();
        let scan = ObservationDescriptor {
            clip: Some([-1.0, 0.5]),
            scale: Some(Numbers::All(2.0)),
            ..term(24, "height_scan", 6)
        };
        descriptors.observations[0].1 = vec![scan];
        let error = import_isaac(&network(6), &descriptors, Some(&environment()));
        assert!(matches!(error, Err(ImportError::Entry { mark, .. }) if mark.line == 24));
        let mut environment = environment();
        // three points along x, two along y
        environment.height_grid = Some(HeightGrid::new([0.2, 0.1], 0.1, true, 0.5));
        let (policy, bytes) = import_isaac(&network(6), &descriptors, Some(&environment)).expect("a policy");
        assert_eq!(policy.observations[0].rays, Some(6));
        // from the back, each row from right to left
        let heights = [-0.5, -0.6, -0.7, -0.8, -2.0, 0.9];
        let mut assembly = crate::policy::Assembly::new(&policy);
        assembly.push(0, &heights);
        let mut input = [0.0; 6];
        assembly.write(&mut input);
        let found = run(&policy, &bytes, &input);
        let isaac = |x: usize, y: usize| (2.0 * (-heights[2 * x + y] - 0.5).clamp(-1.0, 0.5)) as f32;
        let expected = [isaac(0, 0), isaac(1, 0), isaac(2, 0), isaac(0, 1), isaac(1, 1), isaac(2, 1)];
        for (found, expected) in found.iter().zip(run(&policy, &network(6), &expected)) {
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
        descriptors.observations[0].1[0].width = 5;
        let error = import_isaac(&network(5), &descriptors, Some(&environment));
        assert!(matches!(error, Err(ImportError::Entry { entry, .. }) if entry == "height_scan.shape"));
    }

    #[test]
    fn bounds_of_targets_become_bounds_of_outputs() {
        let mut descriptors = descriptors();
        descriptors.actions[0].offset = Some(Numbers::Each(vec![-0.2, 0.1]));
        descriptors.actions[0].clip = Some(vec![[-0.7, 0.3], [-0.4, 0.6]]);
        let error = import_isaac(&network(9), &descriptors, Some(&environment()));
        assert!(matches!(error, Err(ImportError::Entry { entry, .. }) if entry == "last_action"));
        descriptors.observations[0].1.pop();
        let (policy, _) = import_isaac(&network(7), &descriptors, Some(&environment())).expect("a policy");
        let [low, high] = policy.action.clip.expect("bounds");
        assert!((low + 2.0).abs() < 1e-9 && (high - 2.0).abs() < 1e-9);
        descriptors.actions[0].clip = Some(vec![[-0.7, 0.3], [-0.4, 0.9]]);
        let error = import_isaac(&network(7), &descriptors, Some(&environment()));
        assert!(matches!(error, Err(ImportError::Entry { entry, .. }) if entry == "clip"));
    }

    #[test]
    fn gains_come_from_the_file_that_has_them() {
        let mut descriptors = descriptors();
        let error = import_isaac(&network(9), &descriptors, None).expect_err("no gains");
        assert_eq!(error, ImportError::Gains { gain: "stiffness", joint: "knee".to_owned() });
        let mut environment = environment();
        environment.actuators[0].damping = None;
        let error = import_isaac(&network(9), &descriptors, Some(&environment)).expect_err("no damping");
        assert_eq!(error, ImportError::Gains { gain: "damping", joint: "knee".to_owned() });
        descriptors.articulations[0].stiffness = vec![20.0, 30.0];
        let (policy, _) = import_isaac(&network(9), &descriptors, None).expect("a policy");
        assert_eq!(policy.action.kp, Some(Numbers::Each(vec![30.0, 20.0])));
        assert_eq!(policy.action.kd, Some(Numbers::All(0.0)));
        descriptors.actions[0].class = "mdp:JointEffortAction".to_owned();
        let (policy, _) = import_isaac(&network(9), &descriptors, None).expect("a policy");
        assert_eq!((policy.action.kind, policy.action.kp), (ActionKind::Effort, None));
    }

    #[test]
    fn unsupported_terms_are_named_with_their_line() {
        let error = |change: &dyn Fn(&mut Descriptors)| {
            let mut descriptors = descriptors();
            change(&mut descriptors);
            import_isaac(&network(9), &descriptors, Some(&environment())).expect_err("a mistake")
        };
        let terms = |descriptors: &mut Descriptors, term: ObservationDescriptor| {
            descriptors.observations[0].1[1] = term;
        };
        let found = error(&|it| terms(it, term(21, "joint_effort", 2)));
        assert!(
            matches!(found, ImportError::Observation { mark, name, .. } if mark.line == 21 && name == "joint_effort")
        );
        let found = error(&|it| it.actions[0].class = "a.BinaryJointPositionAction".to_owned());
        assert!(
            matches!(found, ImportError::Action { mark, name, .. } if mark.line == 10 && name == "BinaryJointPositionAction")
        );
        let entry = |change: &dyn Fn(&mut Descriptors)| match error(change) {
            ImportError::Entry { mark, entry, .. } => (mark.line, entry),
            other => panic!("{other:?}"),
        };
        let position =
            |change: &dyn Fn(&mut ObservationDescriptor)| entry(&|it| change(&mut it.observations[0].1[1]));
        assert_eq!(position(&|it| it.width = 3), (21, "joint_pos_rel.shape".to_owned()));
        assert_eq!(position(&|it| it.has_modifiers = true), (21, "joint_pos_rel.modifiers".to_owned()));
        assert_eq!(position(&|it| it.is_flat = false), (21, "joint_pos_rel.flatten_history_dim".to_owned()));
        let found = position(&|it| it.joints = Some(names(&["hip", "foot"])));
        assert_eq!(found, (21, "joint_pos_rel.joint_names".to_owned()));
        let found = position(&|it| it.position_offsets = Some(vec![0.0, 0.0]));
        assert_eq!(found, (21, "joint_pos_rel.joint_pos_offsets".to_owned()));
        let found = position(&|it| it.velocity_offsets = Some(vec![0.0, 0.5]));
        assert_eq!(found, (21, "joint_pos_rel.joint_vel_offsets".to_owned()));
        assert_eq!(entry(&|it| it.period = 0.01), (30, "scene.dt".to_owned()));
        assert_eq!(entry(&|it| it.observations[0].0 = "critic".to_owned()), (30, "observations".to_owned()));
        assert_eq!(entry(&|it| it.articulations.clear()), (10, "joint_names".to_owned()));
        assert_eq!(entry(&|it| it.articulations[0].positions[0] = 0.3).1, "default_joint_pos");
        assert!(matches!(error(&|it| it.observations[0].1.truncate(2)), ImportError::Network(_)));
    }

    #[test]
    fn environments_of_another_run_are_named() {
        let error = |change: &dyn Fn(&mut Environment)| {
            let mut environment = environment();
            change(&mut environment);
            match import_isaac(&network(9), &descriptors(), Some(&environment)) {
                Err(ImportError::Environment(error)) => match *error {
                    ImportError::Entry { mark, entry, .. } => (mark.line, entry),
                    other => panic!("{other:?}"),
                },
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(error(&|it| it.decimation = 8), (1, "decimation".to_owned()));
        let found = error(&|it| it.positions.push((".ip".to_owned(), 0.1)));
        assert_eq!(found, (2, "init_state.joint_pos".to_owned()));
        assert_eq!(error(&|it| it.actuators[0].joints = names(&["(hip"])), (3, "(hip".to_owned()));
    }
}
