//! Import of LEAPP bundles, as Isaac Lab 3 exports them.
//!
//! A bundle is a YAML file, the ONNX file of one network, and the initial values of its recurrent states in
//! safetensors. The network reads measured quantities and writes joint targets: it applies scales and offsets
//! and stores the last action itself. The import rewrites the network to read one observation and to write
//! targets relative to the default pose.
//!
//! Sources: LEAPP 0.7.2 (`leapp.compile_graph`, kinds of `leapp/utils/enums.py`);
//! `isaaclab/utils/leapp/{export_annotator, utils}.py` of Isaac Lab 3.0 (`isaaclab_connection`), and
//! `isaaclab/sensors/ray_caster/base_ray_caster_data.py` for height scans: a network reads the position of
//! the sensor and of each hit in the world, and computes the difference of the two itself.

use super::isaac::{common_number, gains, shortest};
use super::{Articulation, Environment, ImportError, Mark, NETWORK};
use crate::inference::Program;
use crate::onnx::{Adapter, Model, Part};
use crate::policy::{Action, ActionKind, Numbers, Observation, Policy, PolicyNetwork, Term};
use crate::safetensors::Tensors;
use crate::sha256::sha256_hex;

/// Robot properties supported as inputs, identified by the last part of `isaaclab_connection` or by name.
const PROPERTIES: [(&str, Term); 9] = [
    ("joint_pos", Term::JointPositions),
    ("joint_vel", Term::JointVelocities),
    ("root_lin_vel_b", Term::BaseLinearVelocity),
    ("root_com_lin_vel_b", Term::BaseLinearVelocity),
    ("root_ang_vel_b", Term::BaseAngularVelocity),
    ("root_com_ang_vel_b", Term::BaseAngularVelocity),
    ("projected_gravity_b", Term::ProjectedGravity),
    ("root_quat_w", Term::ProjectedGravity),
    ("root_link_quat_w", Term::ProjectedGravity),
];

/// Positions of the hits of a height scanner in the world.
const HITS: &str = "ray_hits_w";
/// Position of a height scanner in the world.
const PLACE: &str = "pos_w";
/// Name of the height scanner whose grid is in an `env.yaml`.
const SCANNER: &str = "height_scanner";

/// Kinds of outputs that are joint commands.
const TARGETS: [(&str, ActionKind); 4] = [
    ("target/joint/position", ActionKind::Position),
    ("target/joint/velocity", ActionKind::Velocity),
    ("target/joint/effort", ActionKind::Effort),
    ("target/joint/torques", ActionKind::Effort),
];

/// Number of runs used to detect a dependence of the actions on an unmeasured quantity.
const RUNS: usize = 16;
/// Relative difference of outputs above which they count as dependent.
const TOLERANCE: f32 = 1e-3;

/// Content of the YAML file of a LEAPP bundle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bundle {
    /// Networks of the bundle.
    pub models: Vec<BundleModel>,
    /// Position of `pipeline` in the file.
    pub pipeline: Mark,
    /// Outputs that are fed back to inputs for the next run. Each entry contains the name of an output, such
    /// as `model/output`, and the names of the inputs.
    pub feedback: Vec<(String, Vec<String>)>,
    /// Path of the file with the initial values of the inputs in `feedback`.
    pub initial_values: Option<String>,
    /// Rate of the policy \[Hz\].
    pub frequency: Option<f64>,
}

/// A network of a bundle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BundleModel {
    /// Position of the key `backend` in the file.
    pub mark: Mark,
    /// Name of the network.
    pub name: String,
    /// File format of the network: `onnx`, `jit` or `pt2`.
    pub backend: String,
    /// Path of the network's file.
    pub path: String,
    /// SHA-256 of the file as hexadecimal digits.
    pub sha256: Option<String>,
    /// Inputs, in the order of the network.
    pub inputs: Vec<BundlePort>,
    /// Outputs, in the order of the network.
    pub outputs: Vec<BundlePort>,
}

/// An input or an output of a network of a bundle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BundlePort {
    /// Position of the name in the file.
    pub mark: Mark,
    /// Name of the tensor.
    pub name: String,
    /// Element type of the tensor.
    pub dtype: String,
    /// Length of each axis.
    pub shape: Vec<usize>,
    /// Physical quantity of the tensor.
    pub kind: Option<String>,
    /// Source or destination of the tensor in Isaac Lab.
    pub connection: Option<String>,
    /// Names of the elements along the last axis.
    pub elements: Option<Vec<String>>,
    /// `true` if one axis represents time.
    pub is_temporal: bool,
}

impl BundlePort {
    fn count(&self) -> usize {
        self.shape.iter().fold(1, |count: usize, length| count.saturating_mul(*length))
    }

    fn wrong(&self, message: impl Into<String>) -> ImportError {
        self.mark.entry(&self.name, message)
    }

    /// Returns the sensor in the scene and its property, if the input is from a sensor.
    fn sensor(&self) -> Option<(&str, &str)> {
        let mut parts = self.connection.as_deref()?.split(':');
        match (parts.next(), parts.next(), parts.next(), parts.next()) {
            (Some("state"), Some(sensor), Some(property), None) => Some((sensor, property)),
            _ => None,
        }
    }

    /// Returns the joint of each value.
    fn joints(&self) -> Result<&[String], ImportError> {
        let found = self.elements.as_deref().unwrap_or(&[]);
        if found.len() != self.count() {
            let message = format!("found {} `element_names`, expected {} joints", found.len(), self.count());
            return Err(self.wrong(message));
        }
        Ok(found)
    }
}

impl Bundle {
    /// Returns the only network of the bundle.
    ///
    /// # Errors
    ///
    /// [`ImportError::Entry`] if the bundle does not have exactly one network, or the network is not an ONNX
    /// file.
    pub fn model(&self) -> Result<&BundleModel, ImportError> {
        let [model] = &self.models[..] else {
            let names: Vec<&str> = self.models.iter().map(|model| &model.name[..]).collect();
            let message = format!("found {} networks ({}), expected one", names.len(), names.join(", "));
            return Err(self.pipeline.entry("models", message));
        };
        if model.backend != "onnx" {
            let message = format!(
                "found \"{}\", expected \"onnx\"; help: export with `--export_method onnx-dynamo`",
                model.backend
            );
            return Err(model.mark.entry("backend", message));
        }
        Ok(model)
    }

    /// Returns the joints commanded by the network, in the order of the action.
    ///
    /// # Errors
    ///
    /// [`ImportError`] if not exactly one output commands joints.
    pub fn joints(&self) -> Result<&[String], ImportError> {
        self.target().and_then(|(port, _)| port.joints())
    }

    /// Returns the output that is the action, and its kind.
    fn target(&self) -> Result<(&BundlePort, ActionKind), ImportError> {
        let model = self.model()?;
        let mut found = None;
        for port in model.outputs.iter().filter(|port| !self.is_state(model, &port.name)) {
            let kind = port.kind.as_deref();
            if matches!(kind, Some("kp" | "kd")) {
                continue;
            }
            let known = TARGETS.iter().find(|(name, _)| Some(*name) == kind);
            let Some((_, kind)) = known.filter(|_| !port.is_temporal) else {
                let expected = TARGETS.map(|(name, _)| name).join(", ");
                return Err(ImportError::Action { mark: port.mark, name: port.name.clone(), expected });
            };
            if let Some((other, _)) = found.replace((port, *kind)) {
                let message = format!("a second action besides `{}`, expected one", other.name);
                return Err(port.wrong(message));
            }
        }
        found.ok_or_else(|| self.pipeline.entry("outputs", "found no joint targets, expected one output"))
    }

    fn is_state(&self, model: &BundleModel, output: &str) -> bool {
        self.feedback.iter().any(|(source, _)| source.split_once('/') == Some((&model.name, output)))
    }

    /// Returns the input and the output of each recurrent state of the network.
    fn states(&self, model: &BundleModel) -> Result<Vec<(String, String)>, ImportError> {
        let mut states = Vec::new();
        for (source, targets) in &self.feedback {
            for (node, port, ports) in [source].into_iter().chain(targets).enumerate().map(|(index, path)| {
                let (node, port) = path.split_once('/').unwrap_or(("", path));
                (node, port, if index == 0 { &model.outputs } else { &model.inputs })
            }) {
                if node != model.name || !ports.iter().any(|other| other.name == port) {
                    let message = format!("found \"{node}/{port}\", expected a tensor of \"{}\"", model.name);
                    return Err(self.pipeline.entry("feedback_flow", message));
                }
            }
            let name = |path: &String| path.split_once('/').map_or(path.clone(), |(_, port)| port.to_owned());
            states.extend(targets.iter().map(|target| (name(target), name(source))));
        }
        // in the order of the network's inputs
        let index = |name: &str| model.inputs.iter().position(|port| port.name == name);
        states.sort_by_key(|(input, _)| index(input));
        Ok(states)
    }
}

/// Source of an input: term, index of each value in the term, factors, offsets, and the order of a
/// quaternion.
struct Source {
    term: Observation,
    width: usize,
    picks: Vec<usize>,
    scale: Vec<f32>,
    add: Vec<f32>,
    orientation: Option<[usize; 4]>,
}

impl Source {
    fn new(term: Term, width: usize, picks: Vec<usize>) -> Self {
        Self {
            term: Observation::new(term),
            width,
            picks,
            scale: Vec::new(),
            add: Vec::new(),
            orientation: None,
        }
    }
}

/// Converts the heights of a scan to positions of hits. Horizontal positions are 0, like the sensor's: the
/// network does not depend on them.
fn hits(port: &BundlePort, environment: Option<&Environment>) -> Result<Source, ImportError> {
    if port.sensor().is_some_and(|(sensor, _)| sensor != SCANNER) {
        let message = format!("a sensor with an unknown grid, expected `{SCANNER}`");
        return Err(port.wrong(message));
    }
    let Some(grid) = environment.and_then(|environment| environment.height_grid.as_ref()) else {
        let message =
            "the grid is unknown; help: pass the env.yaml of the training run, with `scene.height_scanner`";
        return Err(port.wrong(message));
    };
    let rays = grid.count();
    if port.shape.last() != Some(&3) || port.count() != 3 * rays {
        let message = format!("found {:?} numbers, expected {rays} x 3 as in env.yaml", port.shape);
        return Err(port.wrong(message));
    }
    let picks = grid.order().into_iter().flat_map(|index| [index; 3]).collect();
    let term = Observation { rays: Some(rays), ..Observation::new(Term::HeightScan) };
    Ok(Source { term, scale: [0.0, 0.0, 1.0].repeat(rays), ..Source::new(Term::HeightScan, rays, picks) })
}

fn source(
    port: &BundlePort,
    (joints, default_pose): (&[String], &[f64]),
    environment: Option<&Environment>,
) -> Result<Source, ImportError> {
    let unknown = || {
        let mut expected = PROPERTIES.map(|(name, _)| name).join(", ");
        expected += ", the hits of a height scanner, a command of three velocities";
        ImportError::Observation { mark: port.mark, name: port.name.clone(), expected }
    };
    let connection: Vec<&str> = port.connection.iter().flat_map(|text| text.split(':')).collect();
    let (property, is_command) = match connection[..] {
        ["state", _, property] => (property, false),
        ["command", _] => ("", true),
        [] => (&port.name[..], port.kind.as_deref() == Some("command/body/velocity")),
        _ => return Err(unknown()),
    };
    if property == HITS && !is_command && !port.is_temporal {
        return hits(port, environment);
    }
    let term = match PROPERTIES.iter().find(|(name, _)| *name == property) {
        _ if port.is_temporal => return Err(unknown()),
        _ if is_command && port.count() == 3 => Term::Command,
        Some((_, term)) if !is_command => *term,
        _ => return Err(unknown()),
    };
    let count = |expected: usize| match port.count() {
        found if found == expected => Ok(()),
        found => Err(port.wrong(format!("found {found} numbers, expected {expected}"))),
    };
    let all = Source::new(term, 3, vec![0, 1, 2]);
    if matches!(term, Term::JointPositions | Term::JointVelocities) {
        let index = |joint: &String| {
            joints.iter().position(|name| name == joint).ok_or_else(|| {
                let message = format!(
                    "reads joint \"{joint}\", expected the joints of the action, {}",
                    joints.join(", ")
                );
                port.wrong(message)
            })
        };
        let picks = port.joints()?.iter().map(index).collect::<Result<Vec<usize>, _>>()?;
        let add = match term {
            Term::JointPositions => picks.iter().map(|index| default_pose[*index] as f32).collect(),
            _ => Vec::new(),
        };
        return Ok(Source { add, ..Source::new(term, joints.len(), picks) });
    }
    if !property.ends_with("quat_w") {
        count(3)?;
        return Ok(all);
    }
    count(4)?;
    let elements: Vec<&str> =
        port.elements.iter().flatten().map(|name| name.trim_start_matches('q')).collect();
    let index = |name: &&str| ["x", "y", "z", "w"].iter().position(|other| other == name);
    let order: Vec<usize> = elements.iter().filter_map(index).collect();
    match <[usize; 4]>::try_from(order) {
        Ok(order) if (0..4).all(|index| order.contains(&index)) => {
            Ok(Source { orientation: Some(order), ..all })
        }
        _ => Err(port.wrong(format!(
            "found the `element_names` {elements:?}, expected qx, qy, qz and qw in some order"
        ))),
    }
}

/// Returns the next pseudo-random number, from -1 to 1.
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// Returns `true` if the outputs of two runs differ. `change` returns the indices and values of the inputs
/// that are not random, for each run.
fn outputs_differ(
    program: &Program,
    mut change: impl FnMut(&mut u64) -> [Vec<(usize, Vec<f32>)>; 2],
) -> bool {
    let mut program = program.clone();
    let mut state = 38;
    (0..RUNS).any(|_| {
        let lengths = program.inputs().iter().map(|port| port.shape.iter().product::<usize>());
        let values: Vec<Vec<f32>> =
            lengths.map(|length| (0..length).map(|_| random(&mut state) as f32).collect()).collect();
        let [first, second] = change(&mut state).map(|changed| {
            values.iter().enumerate().for_each(|(index, values)| {
                program.input_mut(index).copy_from_slice(values);
            });
            changed.iter().for_each(|(index, values)| program.input_mut(*index).copy_from_slice(values));
            program.run();
            (0..program.outputs().len())
                .flat_map(|index| program.output(index).to_vec())
                .collect::<Vec<f32>>()
        });
        first.iter().zip(second).any(|(a, b)| (*a - b).abs() > TOLERANCE * (1.0 + a.abs()))
    })
}

/// Returns `true` if the outputs change when the base rotates about the vertical.
fn depends_on_heading(program: &Program, input: usize, order: [usize; 4]) -> bool {
    use nalgebra::{Quaternion, UnitQuaternion, Vector3};
    outputs_differ(program, |state| {
        let [x, y, z, w, yaw] = core::array::from_fn(|_| random(state));
        let base = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), core::f64::consts::PI * yaw);
        [base, turn * base]
            .map(|orientation| vec![(input, order.map(|index| orientation.coords[index] as f32).to_vec())])
    })
}

/// Returns `true` if the outputs change when a height scanner and the surface move together, or a hit moves
/// horizontally.
fn depends_on_place(program: &Program, hits: usize, place: Option<usize>) -> bool {
    let rays = program.inputs()[hits].shape.iter().product::<usize>() / 3;
    outputs_differ(program, |state| {
        let heights: Vec<f64> = (0..rays).map(|_| 0.5 * random(state) - 0.5).collect();
        [0.0, 5.0 * random(state)].map(|up| {
            let mut point = |height: f64| [random(state) as f32, random(state) as f32, (height + up) as f32];
            let mut changed = vec![(hits, heights.iter().flat_map(|height| point(*height)).collect())];
            changed.extend(place.map(|place| (place, point(0.0).to_vec())));
            changed
        })
    })
}

/// Returns the constant output of this kind, in the order of the joints; `None` if there is none.
fn constant(
    model: &BundleModel,
    program: &Program,
    kind: &str,
    joints: &[String],
) -> Result<Option<Vec<f64>>, ImportError> {
    let Some(port) = model.outputs.iter().find(|port| port.kind.as_deref() == Some(kind)) else {
        return Ok(None);
    };
    let index = program.outputs().iter().position(|output| output.name == port.name);
    let index = index.ok_or_else(|| port.wrong("not an output of the network"))?;
    if !program.is_constant(index) {
        return Err(port.wrong("the gains change from step to step, expected constant gains"));
    }
    let (names, values) = (port.joints()?, program.output(index));
    let value = |joint: &String| {
        let index = names.iter().position(|name| name == joint);
        let value = index.and_then(|index| values.get(index)).map(|value| shortest(f64::from(*value)));
        value.ok_or_else(|| port.wrong(format!("found no gain of joint \"{joint}\"")))
    };
    joints.iter().map(value).collect::<Result<_, _>>().map(Some)
}

/// Creates a policy and its network from a LEAPP bundle. `default_pose` contains one position \[rad or m\]
/// for each joint of [`Bundle::joints`]. `rate` \[Hz\] is used if the bundle has no `frequency`.
///
/// # Errors
///
/// [`ImportError`] with the line of the bundle, or the node of the network.
///
/// # Panics
///
/// If the length of `default_pose` differs from the number of joints.
pub fn import_leapp(
    bytes: &[u8],
    bundle: &Bundle,
    initial: Option<&Tensors>,
    default_pose: &[f64],
    environment: Option<&Environment>,
    rate: Option<f64>,
) -> Result<(Policy, Vec<u8>), ImportError> {
    let model = bundle.model()?;
    let (target, kind) = bundle.target()?;
    let joints = target.joints()?.to_vec();
    assert_eq!(default_pose.len(), joints.len(), "a position for each joint");
    let Some(rate) = bundle.frequency.or(rate) else {
        let message = "no `frequency`, expected the rate of the policy in Hz; help: pass it with `--rate`";
        return Err(bundle.pipeline.entry("configs", message));
    };
    if let Some(expected) = &model.sha256 {
        let found = sha256_hex(bytes);
        if !found.eq_ignore_ascii_case(expected) {
            let (mark, file, expected) = (model.mark, model.path.clone(), expected.clone());
            return Err(ImportError::Checksum { mark, file, found, expected });
        }
    }
    let states = bundle.states(model)?;
    let network = Model::read(bytes)?;
    let program = network.program(1)?;
    let (mut observations, mut parts, mut width) = (Vec::new(), Vec::new(), 0);
    for port in &model.inputs {
        if !program.inputs().iter().any(|input| input.name == port.name) {
            return Err(port.wrong("not an input of the network"));
        }
        if port.dtype != "float32" {
            return Err(port.wrong(format!("found {}, expected float32", port.dtype)));
        }
        if states.iter().any(|(input, _)| *input == port.name) {
            continue;
        }
        let input = |port: &BundlePort| program.inputs().iter().position(|input| input.name == port.name);
        // position of a height scanner, relative to which its hits are measured
        if let Some((scanner, PLACE)) = port.sensor()
            && model.inputs.iter().any(|other| other.sensor() == Some((scanner, HITS)))
        {
            parts.push(Part { add: vec![0.0; port.count()], ..Part::new(&port.name) });
            continue;
        }
        let Source { term, width: numbers, picks, scale, add, orientation } =
            source(port, (&joints, default_pose), environment)?;
        if let Some(order) = orientation
            && input(port).is_some_and(|input| depends_on_heading(&program, input, order))
        {
            return Err(ImportError::Heading { input: port.name.clone() });
        }
        if term.term == Term::HeightScan {
            let scanner = port.sensor().map(|(scanner, _)| (scanner, PLACE));
            let place = model.inputs.iter().find(|other| scanner.is_some() && other.sensor() == scanner);
            let place = place.and_then(input);
            if input(port).is_some_and(|hits| depends_on_place(&program, hits, place)) {
                return Err(ImportError::Place { input: port.name.clone() });
            }
        }
        let picks = picks.into_iter().map(|index| width + index).collect();
        parts.push(Part { input: port.name.clone(), picks, scale, add, orientation });
        width += numbers;
        observations.push(term);
    }
    let kp = constant(model, &program, "kp", &joints)?;
    let kd = constant(model, &program, "kd", &joints)?;
    let body = Articulation {
        joints: joints.clone(),
        stiffness: kp.clone().unwrap_or_default(),
        damping: kd.clone().unwrap_or_default(),
        ..Articulation::default()
    };
    let is_given = environment.is_some() || kp.is_some() || kd.is_some();
    // early versions export zeros for drives computed by Isaac Lab itself
    let has_gain = |index: usize| [&kp, &kd].into_iter().flatten().any(|gains| gains[index] > 0.0);
    let environment = environment.filter(|_| !(0..joints.len()).all(has_gain));
    let (kp, kd) = match kind {
        ActionKind::Position | ActionKind::Velocity if is_given => {
            let [kp, kd] = gains(&joints, &body, environment)?;
            (Some(common_number(kp)), Some(common_number(kd)))
        }
        _ => (None, None),
    };
    let action = Action {
        joints,
        kind,
        scale: Numbers::All(1.0),
        offset: Numbers::All(0.0),
        default_pose: default_pose.to_vec(),
        clip: None,
        kp,
        kd,
        twist: None,
    };
    let subtract = match kind {
        ActionKind::Position => default_pose.iter().map(|position| *position as f32).collect(),
        _ => Vec::new(),
    };
    let adapter = Adapter { width, parts, action: target.name.clone(), subtract, states };
    let policy = Policy {
        network: NETWORK.to_owned(),
        rate,
        robot: None,
        initial_states: initial_states(bundle, model, &adapter.states, initial)?,
        observations,
        action,
        pattern: None,
        robot_digest: None,
    };
    policy.check()?;
    let bytes = network.adapt(&adapter)?;
    PolicyNetwork::new(&policy, Model::read(&bytes)?.program(1)?)?;
    Ok((policy, bytes))
}

/// Returns the initial values of the recurrent states; empty if all are zero.
fn initial_states(
    bundle: &Bundle,
    model: &BundleModel,
    states: &[(String, String)],
    initial: Option<&Tensors>,
) -> Result<Vec<Vec<f32>>, ImportError> {
    let value = |(input, _): &(String, String)| {
        let name = format!("{}/{input}", model.name);
        let Some(initial) = initial else {
            let message = format!("missing, expected the file with the initial value of \"{name}\"");
            return Err(bundle.pipeline.entry("initial_values", message));
        };
        match initial.tensors.get(&name) {
            Some(tensor) => Ok(tensor.values.clone()),
            None => Err(ImportError::Tensor { name, message: "missing in the initial values".to_owned() }),
        }
    };
    let values = states.iter().map(value).collect::<Result<Vec<Vec<f32>>, _>>()?;
    let are_zeros = values.iter().flatten().all(|value| *value == 0.0);
    Ok(if are_zeros { Vec::new() } else { values })
}

#[cfg(test)]
mod tests {
    use super::super::{Actuator, Gain, HeightGrid};
    use super::*;
    use crate::inference::Unary;
    use crate::onnx::write_mlp;
    use crate::safetensors::Tensor;

    fn port(line: usize, name: &str, count: usize) -> BundlePort {
        BundlePort {
            mark: Mark { line, column: 9 },
            name: name.to_owned(),
            dtype: "float32".to_owned(),
            shape: vec![1, count],
            ..BundlePort::default()
        }
    }

    fn state(line: usize, property: &str, elements: &[&str]) -> BundlePort {
        BundlePort {
            connection: Some(format!("state:robot:{property}")),
            elements: Some(elements.iter().map(|name| (*name).to_owned()).collect()),
            ..port(line, &format!("robot_{property}"), elements.len())
        }
    }

    /// Returns a bundle whose network has one input, for tests of the parts that need no other input.
    fn bundle(input: BundlePort) -> Bundle {
        let target = BundlePort {
            kind: Some("target/joint/position".to_owned()),
            elements: Some(vec!["knee".to_owned(), "hip".to_owned()]),
            ..port(40, "actions", 2)
        };
        Bundle {
            models: vec![BundleModel {
                mark: Mark { line: 50, column: 7 },
                name: "walk".to_owned(),
                backend: "onnx".to_owned(),
                path: "walk.onnx".to_owned(),
                sha256: None,
                inputs: vec![BundlePort { name: "obs".to_owned(), ..input }],
                outputs: vec![target],
            }],
            pipeline: Mark { line: 60, column: 3 },
            frequency: Some(50.0),
            ..Bundle::default()
        }
    }

    fn network(width: usize) -> Vec<u8> {
        let weights = (0..2 * width).map(|k| k as f32 - 1.0).collect();
        write_mlp(width, &[(weights, vec![0.0, 0.0])], Unary::Relu, &[])
    }

    const POSE: [f64; 2] = [0.5, -0.25];

    fn import(bundle: &Bundle, width: usize) -> Result<(Policy, Vec<u8>), ImportError> {
        import_leapp(&network(width), bundle, None, &POSE, None, None)
    }

    #[test]
    fn targets_become_relative_to_the_default_pose() {
        let bundle = bundle(state(10, "joint_pos", &["hip", "knee"]));
        let (policy, bytes) = import(&bundle, 2).expect("a policy");
        assert_eq!((policy.rate, policy.observations[0].term), (50.0, Term::JointPositions));
        let program = Model::read(&bytes).and_then(|model| model.program(1)).expect("a network");
        let mut network = PolicyNetwork::new(&policy, program).expect("it fits");
        // knee 0.6, hip 0.75, relative to the default pose
        network.observation_mut().copy_from_slice(&[0.1, 1.0]);
        let targets = policy.joint_targets(&["hip", "knee"]).expect("joints");
        let action: Vec<f64> = network.run().iter().map(|value| f64::from(*value)).collect();
        let mut found = [0.0; 2];
        targets.apply(&action, &mut found);
        let (hip, knee) = (0.75, 0.6);
        for (found, expected) in found.iter().zip([hip + 2.0 * knee, -hip]) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
    }

    #[test]
    fn networks_that_read_the_heading_are_rejected() {
        let bundle = bundle(state(12, "root_quat_w", &["qx", "qy", "qz", "qw"]));
        assert_eq!(import(&bundle, 4), Err(ImportError::Heading { input: "obs".to_owned() }));
        let blind = write_mlp(4, &[(vec![0.0; 8], vec![0.5, 0.5])], Unary::Relu, &[]);
        let (policy, _) = import_leapp(&blind, &bundle, None, &POSE, None, None).expect("a policy");
        assert_eq!(policy.observations[0].term, Term::ProjectedGravity);
    }

    /// Returns a bundle with a height scanner of 3 x 2 points and its network. Output `k` is the sum of
    /// `0.5 (sensor - hit - 0.5)` over rays `3 k` to `3 k + 2`; `sideways` is a factor of the y of each hit.
    fn scanner(sideways: f32, with_place: bool) -> (Vec<u8>, Bundle) {
        let rows = |index: usize| {
            let row = |ray: usize| [0.0, sideways, if ray / 3 == index { -0.5 } else { 0.0 }];
            let place = if with_place { vec![0.0, 0.0, 1.5] } else { Vec::new() };
            (0..6).flat_map(row).chain(place).collect::<Vec<f32>>()
        };
        let weights: Vec<f32> = (0..2).flat_map(rows).collect();
        let network = write_mlp(weights.len() / 2, &[(weights, vec![-0.75; 2])], Unary::Relu, &[]);
        let sensor = |name: &str, shape: &[usize]| BundlePort {
            connection: Some(format!("state:height_scanner:{name}")),
            shape: shape.to_vec(),
            ..port(30, name, 0)
        };
        let mut inputs = vec![sensor(HITS, &[1, 6, 3])];
        inputs.extend(with_place.then(|| sensor(PLACE, &[1, 3])));
        let shapes: Vec<(&str, &[usize])> =
            inputs.iter().map(|input| (&input.name[..], &input.shape[..])).collect();
        let network = crate::onnx::split_input(&network, &shapes);
        let mut bundle = bundle(port(30, "obs", 1));
        bundle.models[0].inputs = inputs;
        (network, bundle)
    }

    fn environment() -> Environment {
        Environment {
            actuators: vec![Actuator {
                joints: vec![".*".to_owned()],
                stiffness: Some(Gain::All(20.0)),
                damping: Some(Gain::All(0.5)),
                ..Actuator::default()
            }],
            // three points along x, two along y
            height_grid: Some(HeightGrid::new([0.2, 0.1], 0.1, true, 0.5)),
            ..Environment::default()
        }
    }

    #[test]
    fn height_scans_become_hits_below_the_sensor() {
        let (bytes, bundle) = scanner(0.0, true);
        let import =
            |environment: &Environment| import_leapp(&bytes, &bundle, None, &POSE, Some(environment), None);
        let (policy, adapted) = import(&environment()).expect("a policy");
        assert_eq!((policy.observations[0].term, policy.observations[0].rays), (Term::HeightScan, Some(6)));
        let program = Model::read(&adapted).and_then(|model| model.program(1)).expect("a network");
        let mut network = PolicyNetwork::new(&policy, program).expect("it fits");
        // rows from the back, each from right to left
        network.observation_mut().copy_from_slice(&[-0.5, -0.6, -0.7, -0.8, -1.0, 0.3]);
        let (right, left) = (0.5 * (0.5 + 0.7 + 1.0 - 1.5), 0.5 * (0.6 + 0.8 - 0.3 - 1.5));
        let expected = [right - POSE[0] as f32, left - POSE[1] as f32];
        for (found, expected) in network.run().iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
        let line = |result| match result {
            Err(ImportError::Entry { mark, entry, .. }) => (mark.line, entry),
            other => panic!("{other:?}"),
        };
        let unknown = Environment { height_grid: None, ..environment() };
        assert_eq!(line(import(&unknown)), (30, HITS.to_owned()));
        let grid = Some(HeightGrid::new([0.2, 0.2], 0.1, true, 0.5));
        assert_eq!(line(import(&Environment { height_grid: grid, ..environment() })), (30, HITS.to_owned()));
    }

    #[test]
    fn networks_that_read_the_scanner_position_are_rejected() {
        for (sideways, with_place) in [(0.25, true), (0.0, false)] {
            let (bytes, bundle) = scanner(sideways, with_place);
            let found = import_leapp(&bytes, &bundle, None, &POSE, Some(&environment()), None);
            assert_eq!(found, Err(ImportError::Place { input: HITS.to_owned() }), "{sideways}");
        }
    }

    #[test]
    fn changed_network_files_are_rejected() {
        let mut bundle = bundle(state(10, "joint_pos", &["hip", "knee"]));
        bundle.models[0].sha256 = Some(sha256_hex(&network(2)).to_uppercase());
        assert!(import(&bundle, 2).is_ok());
        bundle.models[0].sha256 = Some("0".repeat(64));
        let expected = "0".repeat(64);
        let (mark, file, found) =
            (Mark { line: 50, column: 7 }, "walk.onnx".to_owned(), sha256_hex(&network(2)));
        assert_eq!(import(&bundle, 2), Err(ImportError::Checksum { mark, file, found, expected }));
    }

    #[test]
    fn unsupported_tensors_are_named_with_their_line() {
        let contact = BundlePort { elements: None, ..state(14, "net_forces_w", &["x"]) };
        let found = import(&bundle(contact), 1);
        assert!(matches!(found, Err(ImportError::Observation { mark, .. }) if mark.line == 14), "{found:?}");
        let entry = |bundle: &Bundle, width: usize| match import(bundle, width) {
            Err(ImportError::Entry { mark, entry, .. }) => (mark.line, entry),
            other => panic!("{other:?}"),
        };
        let foot = bundle(state(15, "joint_pos", &["hip", "foot"]));
        assert_eq!(entry(&foot, 2), (15, "obs".to_owned()));
        let unnamed = BundlePort { elements: None, ..state(16, "joint_vel", &["hip", "knee"]) };
        assert_eq!(entry(&bundle(unnamed), 2), (16, "obs".to_owned()));
        let integer = BundlePort { dtype: "int64".to_owned(), ..state(17, "joint_vel", &["hip", "knee"]) };
        assert_eq!(entry(&bundle(integer), 2), (17, "obs".to_owned()));
        let short = bundle(state(18, "root_ang_vel_b", &["x", "y"]));
        assert_eq!(entry(&short, 2), (18, "obs".to_owned()));
        let velocities = || bundle(state(19, "joint_vel", &["hip", "knee"]));
        let mut changed = velocities();
        changed.models[0].backend = "jit".to_owned();
        assert_eq!(entry(&changed, 2), (50, "backend".to_owned()));
        let mut changed = velocities();
        changed.models.push(BundleModel::default());
        assert_eq!(entry(&changed, 2), (60, "models".to_owned()));
        let mut changed = velocities();
        changed.frequency = None;
        assert_eq!(entry(&changed, 2), (60, "configs".to_owned()));
        let mut changed = velocities();
        changed.feedback = vec![("walk/actions".to_owned(), vec!["walk/state".to_owned()])];
        assert_eq!(entry(&changed, 2).0, 60);
        let mut changed = velocities();
        changed.models[0].outputs[0].kind = Some("target/body/position".to_owned());
        assert!(matches!(import(&changed, 2), Err(ImportError::Action { mark, .. }) if mark.line == 40));
    }

    #[test]
    fn initial_states_are_read_by_name() {
        let bundle = bundle(state(10, "joint_pos", &["hip", "knee"]));
        let states = [("h".to_owned(), "h_out".to_owned())];
        let read = |initial: Option<&Tensors>| initial_states(&bundle, &bundle.models[0], &states, initial);
        assert!(matches!(read(None), Err(ImportError::Entry { entry, .. }) if entry == "initial_values"));
        let mut file = Tensors::default();
        assert!(matches!(read(Some(&file)), Err(ImportError::Tensor { name, .. }) if name == "walk/h"));
        let mut give = |values: Vec<f32>| {
            file.tensors.insert("walk/h".to_owned(), Tensor { shape: vec![1, values.len()], values });
            read(Some(&file))
        };
        assert_eq!(give(vec![0.0, 0.0]), Ok(Vec::new()));
        assert_eq!(give(vec![0.0, -1.0]), Ok(vec![vec![0.0, -1.0]]));
    }
}
