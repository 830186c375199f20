//! Readers for the YAML files of training frameworks.
//!
//! Only the keys that an importer reads are declared. All other keys are ignored, and so are Python tags
//! (`!!python/tuple`, `!!python/object/apply:builtins.slice`).

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, anyhow};
use motorium_models::policy::{
    ActionDescriptor, Actuator, Articulation, Bundle, BundleModel, BundlePort, Descriptors, Environment,
    Gain, HeightGrid, Mark, Numbers, ObservationDescriptor,
};
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};
use serde_saphyr::Spanned;

/// Default of `offset` in `isaaclab.envs.mdp.observations.height_scan` [m].
const HEIGHT_SCAN_OFFSET: f64 = 0.5;

/// Reads a file; errors contain line and column.
fn read<T: DeserializeOwned>(path: &Path) -> anyhow::Result<T> {
    let name = path.display();
    let text = std::fs::read_to_string(path).with_context(|| name.to_string())?;
    // `y` is the name of an axis
    let options = serde_saphyr::options! { strict_booleans: true, with_snippet: false };
    serde_saphyr::from_str_with_options(&text, options).map_err(|error| match error.location() {
        Some(at) => anyhow!("{name}: line {}, column {}: {}", at.line(), at.column(), message(&error)),
        None => anyhow!("{name}: {}", message(&error)),
    })
}

/// Returns the text of an error without its position.
fn message(error: &serde_saphyr::Error) -> String {
    let text = error.without_snippet().to_string();
    let end = text.rfind(" at line ").unwrap_or(text.len());
    text[..end].to_owned()
}

fn mark<T>(spanned: &Spanned<T>) -> Mark {
    Mark { line: spanned.referenced.line() as usize, column: spanned.referenced.column() as usize }
}

/// A number, or lists of numbers.
#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "expected a number, or lists of numbers")]
enum Nested {
    Number(f64),
    List(Vec<Nested>),
}

impl Nested {
    /// Returns the numbers of the innermost first list; files repeat them for each environment.
    fn row(&self) -> Vec<f64> {
        match self {
            Self::Number(number) => vec![*number],
            Self::List(list) => match list.first() {
                Some(first @ Self::List(_)) => first.row(),
                _ => list.iter().flat_map(Self::row).collect(),
            },
        }
    }

    fn numbers(&self) -> Numbers {
        match self {
            Self::Number(number) => Numbers::All(*number),
            Self::List(_) => Numbers::Each(self.row()),
        }
    }

    /// Pairs of bounds.
    fn bounds(&self) -> Vec<[f64; 2]> {
        let Self::List(list) = self else { return Vec::new() };
        match list.first() {
            Some(Self::List(inner)) if matches!(inner.first(), Some(Self::List(_))) => list[0].bounds(),
            _ => list.iter().filter_map(|pair| pair.row().try_into().ok()).collect(),
        }
    }
}

#[derive(Debug, Deserialize)]
struct DescriptorFile {
    actions: Vec<ActionEntry>,
    articulations: BTreeMap<String, ArticulationEntry>,
    observations: BTreeMap<String, Vec<ObservationEntry>>,
    scene: SceneEntry,
}

#[derive(Debug, Deserialize)]
struct SceneEntry {
    dt: Spanned<f64>,
    physics_dt: f64,
    decimation: usize,
}

#[derive(Debug, Deserialize)]
struct ActionEntry {
    full_path: Spanned<String>,
    joint_names: Option<Vec<String>>,
    scale: Option<Nested>,
    offset: Option<Nested>,
    clip: Option<Nested>,
}

#[derive(Debug, Deserialize)]
struct ArticulationEntry {
    joint_names: Vec<String>,
    default_joint_pos: Vec<f64>,
    default_joint_stiffness: Vec<f64>,
    default_joint_damping: Vec<f64>,
}

#[derive(Debug, Deserialize)]
struct ObservationEntry {
    full_path: Spanned<String>,
    shape: Vec<usize>,
    joint_names: Option<Vec<String>>,
    joint_pos_offsets: Option<Nested>,
    joint_vel_offsets: Option<Nested>,
    extras: Option<Extras>,
    overloads: Overloads,
}

#[derive(Debug, Deserialize)]
struct Extras {
    modifiers: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
struct Overloads {
    clip: Option<[f64; 2]>,
    scale: Option<Nested>,
    history_length: Option<usize>,
    flatten_history_dim: Option<bool>,
}

/// Reads an `IO_descriptors.yaml` of Isaac Lab 2.
pub(super) fn descriptors(path: &Path) -> anyhow::Result<Descriptors> {
    let file: DescriptorFile = read(path)?;
    let action = |entry: ActionEntry| ActionDescriptor {
        mark: mark(&entry.full_path),
        class: entry.full_path.value,
        joints: entry.joint_names.unwrap_or_default(),
        scale: entry.scale.as_ref().map(Nested::numbers),
        offset: entry.offset.as_ref().map(Nested::numbers),
        clip: entry.clip.as_ref().map(Nested::bounds),
    };
    let observation = |entry: ObservationEntry| ObservationDescriptor {
        mark: mark(&entry.full_path),
        function: entry.full_path.value,
        width: entry.shape.iter().fold(1, |width: usize, length| width.saturating_mul(*length)),
        joints: entry.joint_names,
        position_offsets: entry.joint_pos_offsets.as_ref().map(Nested::row),
        velocity_offsets: entry.joint_vel_offsets.as_ref().map(Nested::row),
        clip: entry.overloads.clip,
        scale: entry.overloads.scale.as_ref().map(Nested::numbers),
        history: entry.overloads.history_length.unwrap_or(0),
        is_flat: entry.overloads.flatten_history_dim.unwrap_or(true),
        has_modifiers: entry.extras.is_some_and(|extras| extras.modifiers.is_some()),
    };
    let articulation = |(name, entry): (String, ArticulationEntry)| Articulation {
        name,
        joints: entry.joint_names,
        positions: entry.default_joint_pos,
        stiffness: entry.default_joint_stiffness,
        damping: entry.default_joint_damping,
    };
    let group =
        |(name, terms): (String, Vec<ObservationEntry>)| (name, terms.into_iter().map(observation).collect());
    Ok(Descriptors {
        actions: file.actions.into_iter().map(action).collect(),
        observations: file.observations.into_iter().map(group).collect(),
        articulations: file.articulations.into_iter().map(articulation).collect(),
        scene: mark(&file.scene.dt),
        period: file.scene.dt.value,
        time_step: file.scene.physics_dt,
        decimation: file.scene.decimation,
    })
}

#[derive(Debug, Deserialize)]
struct EnvironmentFile {
    decimation: Spanned<usize>,
    sim: Simulation,
    scene: EnvironmentScene,
    observations: Option<EnvironmentObservations>,
}

#[derive(Debug, Deserialize)]
struct EnvironmentObservations {
    policy: Option<PolicyGroup>,
}

#[derive(Debug, Deserialize)]
struct PolicyGroup {
    height_scan: Option<HeightScanTerm>,
}

#[derive(Debug, Deserialize)]
struct HeightScanTerm {
    params: Option<HeightScanParameters>,
}

#[derive(Debug, Deserialize)]
struct HeightScanParameters {
    /// Omitted if it equals the default of `isaaclab.envs.mdp.observations.height_scan`.
    offset: Option<f64>,
}

#[derive(Debug, Deserialize)]
struct HeightScanner {
    pattern_cfg: Option<GridPattern>,
}

/// Ray pattern; patterns other than grids have other keys.
#[derive(Debug, Deserialize)]
struct GridPattern {
    resolution: Option<f64>,
    size: Option<[f64; 2]>,
    ordering: Option<Ordering>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Ordering {
    Xy,
    Yx,
}

#[derive(Debug, Deserialize)]
struct Simulation {
    dt: f64,
}

#[derive(Debug, Deserialize)]
struct EnvironmentScene {
    robot: RobotEntry,
    height_scanner: Option<HeightScanner>,
}

#[derive(Debug, Deserialize)]
struct RobotEntry {
    init_state: InitialState,
    actuators: BTreeMap<String, ActuatorEntry>,
}

#[derive(Debug, Deserialize)]
struct InitialState {
    joint_pos: Spanned<BTreeMap<String, f64>>,
}

#[derive(Debug, Deserialize)]
struct ActuatorEntry {
    joint_names_expr: Spanned<Vec<String>>,
    stiffness: Option<GainEntry>,
    damping: Option<GainEntry>,
}

#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "expected a number, or numbers by joint name")]
enum GainEntry {
    All(f64),
    Each(BTreeMap<String, f64>),
}

impl From<GainEntry> for Gain {
    fn from(entry: GainEntry) -> Self {
        match entry {
            GainEntry::All(value) => Self::All(value),
            GainEntry::Each(values) => Self::Each(values.into_iter().collect()),
        }
    }
}

/// Reads the `params/env.yaml` of a training run of Isaac Lab.
pub(super) fn environment(path: &Path) -> anyhow::Result<Environment> {
    let file: EnvironmentFile = read(path)?;
    let RobotEntry { init_state, actuators } = file.scene.robot;
    let scan = file.observations.and_then(|groups| groups.policy).and_then(|group| group.height_scan);
    let offset = scan.and_then(|term| term.params?.offset).unwrap_or(HEIGHT_SCAN_OFFSET);
    let grid = |scanner: HeightScanner| {
        let GridPattern { resolution, size, ordering } = scanner.pattern_cfg?;
        Some(HeightGrid::new(size?, resolution?, ordering? == Ordering::Xy, offset))
    };
    let actuator = |(name, entry): (String, ActuatorEntry)| Actuator {
        mark: mark(&entry.joint_names_expr),
        name,
        joints: entry.joint_names_expr.value,
        stiffness: entry.stiffness.map(Gain::from),
        damping: entry.damping.map(Gain::from),
    };
    Ok(Environment {
        mark: mark(&file.decimation),
        decimation: file.decimation.value,
        time_step: file.sim.dt,
        pose: mark(&init_state.joint_pos),
        positions: init_state.joint_pos.value.into_iter().collect(),
        actuators: actuators.into_iter().map(actuator).collect(),
        height_grid: file.scene.height_scanner.and_then(grid),
    })
}

#[derive(Debug, Deserialize)]
struct BundleFile {
    models: BTreeMap<String, ModelEntry>,
    pipeline: Spanned<Pipeline>,
}

#[derive(Debug, Deserialize)]
struct ModelEntry {
    inputs: Vec<PortEntry>,
    outputs: Vec<PortEntry>,
    parameters: Parameters,
}

#[derive(Debug, Deserialize)]
struct Parameters {
    backend: Spanned<String>,
    model_path: String,
    sha256sum: Option<String>,
}

#[derive(Debug, Deserialize)]
struct PortEntry {
    name: Spanned<String>,
    dtype: String,
    shape: Vec<usize>,
    kind: Option<String>,
    isaaclab_connection: Option<String>,
    element_names: Option<Vec<Option<Axis>>>,
}

/// Names along an axis. Old files contain the names of the only axis instead of a list of axes.
#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "expected a name, or a list of names")]
enum Axis {
    Name(String),
    Names(Vec<String>),
}

#[derive(Debug, Deserialize)]
struct Pipeline {
    #[serde(default)]
    feedback_flow: BTreeMap<String, Vec<String>>,
    configs: Option<Configs>,
    initial_values: Option<String>,
}

#[derive(Debug, Deserialize)]
struct Configs {
    frequency: Option<f64>,
}

fn port(entry: PortEntry) -> BundlePort {
    let is_time = |axis: &Option<Axis>| matches!(axis, Some(Axis::Name(name)) if name == "__temporal_axis__");
    let axes = entry.element_names.unwrap_or_default();
    let is_temporal = axes.iter().any(is_time);
    let only: Option<Vec<String>> = axes
        .iter()
        .map(|axis| match axis {
            Some(Axis::Name(name)) => Some(name.clone()),
            _ => None,
        })
        .collect();
    let last = match axes.into_iter().next_back() {
        Some(Some(Axis::Names(names))) => Some(names),
        _ => only.filter(|names| !names.is_empty()),
    };
    BundlePort {
        mark: mark(&entry.name),
        name: entry.name.value,
        dtype: entry.dtype,
        shape: entry.shape,
        kind: entry.kind,
        connection: entry.isaaclab_connection,
        elements: last,
        is_temporal,
    }
}

/// Reads the YAML file of a LEAPP bundle.
pub(super) fn bundle(path: &Path) -> anyhow::Result<Bundle> {
    let BundleFile { models, pipeline } = read(path)?;
    let model = |(name, entry): (String, ModelEntry)| BundleModel {
        mark: mark(&entry.parameters.backend),
        name,
        backend: entry.parameters.backend.value,
        path: entry.parameters.model_path,
        sha256: entry.parameters.sha256sum,
        inputs: entry.inputs.into_iter().map(port).collect(),
        outputs: entry.outputs.into_iter().map(port).collect(),
    };
    Ok(Bundle {
        models: models.into_iter().map(model).collect(),
        pipeline: mark(&pipeline),
        feedback: pipeline.value.feedback_flow.into_iter().collect(),
        initial_values: pipeline.value.initial_values,
        frequency: pipeline.value.configs.and_then(|configs| configs.frequency),
    })
}
