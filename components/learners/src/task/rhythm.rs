//! The pattern generator of a task: an action commands its frequency, its amplitude and the centre of each
//! joint's oscillation.

use motorium_models::policy::{JointTargets, Pattern, Policy};
use motorium_primitives::cpg::{Gait, NetworkSettings, Node, PhaseNetwork};

use super::TaskError;

/// The pattern generator of a [`Pattern`]: the network of oscillators that `policy.cpg` also uses.
/// Environments and `policy.joint_targets` share this type. Only [`new`](Self::new) and
/// [`clone`](Clone::clone) allocate.
#[derive(Clone, Debug)]
pub struct Rhythm {
    network: PhaseNetwork,
    /// The network at the start of an episode.
    start: PhaseNetwork,
    pattern: Pattern,
    clip: [f64; 2],
    /// Index of each node's joint in the action, and the node's amplitude.
    nodes: Vec<(usize, f64)>,
}

impl Rhythm {
    /// Creates the pattern generator of a policy. Returns `None` if the policy has no pattern.
    ///
    /// # Errors
    ///
    /// [`TaskError`] if the gait is unknown or not defined for the number of legs.
    pub fn new(policy: &Policy) -> Result<Option<Self>, TaskError> {
        let Some(pattern) = policy.pattern.clone() else { return Ok(None) };
        let legs = pattern.legs.len();
        let gaits = Gait::for_legs(legs);
        let phases = gaits.iter().find(|gait| gait.name() == pattern.gait).map(|gait| gait.phases(legs));
        let Some(Ok(phases)) = phases else {
            let names: Vec<&str> = gaits.iter().map(|gait| gait.name()).collect();
            let expected = if names.is_empty() {
                format!("a pattern with two, four or six legs instead of {legs}")
            } else {
                format!("a gait of {legs} legs: {}", names.join(", "))
            };
            return Err(TaskError::value("pattern.gait", format!("\"{}\"", pattern.gait), expected));
        };
        let action = &policy.action;
        let (mut nodes, mut joints) = (Vec::new(), Vec::new());
        for (leg, phase) in pattern.legs.iter().zip(phases) {
            for joint in leg {
                let Some(index) = action.joints.iter().position(|name| *name == joint.joint) else {
                    continue;
                };
                joints.push((index, joint.amplitude));
                nodes.push(Node {
                    amplitude: joint.amplitude,
                    offset: action.default_pose[index],
                    phase: phase + joint.phase,
                });
            }
        }
        let weights = PhaseNetwork::all_to_all(&nodes, pattern.coupling);
        let frequency = f64::midpoint(pattern.frequency[0], pattern.frequency[1]);
        let settings = NetworkSettings { frequency, ..NetworkSettings::default() };
        let network = PhaseNetwork::new(&nodes, weights, settings)
            .map_err(|error| TaskError::value("pattern", error, "a pattern generator"))?;
        let clip = action.clip.unwrap_or([-1.0, 1.0]);
        Ok(Some(Self { start: network.clone(), network, pattern, clip, nodes: joints }))
    }

    /// Resets the network to the start of an episode: at rest, with zero amplitude.
    pub fn reset(&mut self) {
        self.network.clone_from(&self.start);
    }

    /// Applies an action, clamped to its bounds. The action contains one number for each joint, then the
    /// frequency and the amplitude. Returns `false` if a number is not finite.
    ///
    /// # Panics
    ///
    /// If the action has too few entries.
    pub fn command(&mut self, targets: &JointTargets, action: &[f64]) -> bool {
        let outputs = [0, 1].map(|index| action[targets.targets().len() + index]);
        let [frequency, scale] = self.pattern.parameters(outputs, self.clip);
        let Self { network, nodes, .. } = self;
        network.set_frequency(frequency).is_ok()
            && nodes.iter().enumerate().all(|(node, (joint, amplitude))| {
                let centre = targets.target(*joint, action[*joint]);
                network.set_amplitude_offset(node, scale * amplitude, centre).is_ok()
            })
    }

    /// Advances the oscillators by `dt` \[s\].
    pub fn step(&mut self, dt: f64) {
        self.network.step(dt);
    }

    /// Returns the target of each oscillating joint, as pairs of the joint's index in the action and the
    /// target.
    pub fn targets(&self) -> impl Iterator<Item = (usize, f64)> {
        self.nodes.iter().map(|(joint, _)| *joint).zip(self.network.output().iter().copied())
    }
}
