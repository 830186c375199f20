//! The phase-amplitude network of Ijspeert et al.

use std::f64::consts::TAU;

use nalgebra::DMatrix;

use super::follower::{Commands, check_phases};
use super::gait::Gait;
use super::lags::{Lag, consistent_phases};
use super::phases::{CoupledPhases, Influence};
use super::{CpgError, finite, positive, size};
use crate::dmp::{CriticalSpring, Stride};

/// Target amplitude, offset and phase of one node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Amplitude `A`, unit of the output.
    pub amplitude: f64,
    /// Offset `O`, unit of the output.
    pub offset: f64,
    /// Phase in the pattern, rad.
    pub phase: f64,
}

/// Amplitude and offset of a leg that is driven by a single node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegSettings {
    /// Amplitude, unit of the output.
    pub amplitude: f64,
    /// Centre of the oscillation, unit of the output.
    pub offset: f64,
}

impl Default for LegSettings {
    fn default() -> Self {
        Self { amplitude: 0.3, offset: 0.0 }
    }
}

/// Parameters of the whole network. [`Default`] returns the values documented on each field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetworkSettings {
    /// Frequency `nu` of all nodes, Hz. Default 1.
    pub frequency: f64,
    /// Damping `D` of amplitudes, offsets and frequency, 1/s; the stiffness is `K = D^2 / 4`. Default 20.
    pub damping: f64,
    /// Damping of the pattern phases, which smooths gait changes, 1/s. Default 8, with which most of a change
    /// is complete after half a second.
    pub transition: f64,
}

impl Default for NetworkSettings {
    fn default() -> Self {
        Self { frequency: 1.0, damping: 20.0, transition: 8.0 }
    }
}

/// A network of coupled nodes, each with a phase, an amplitude and an offset (Ijspeert et al. 2007):
///
/// `phi_i' = 2 pi nu + sum_j a_j w_ij sin(phi_j - phi_i - phi_ij)`, `a_i'' = K (A_i - a_i) - D a_i'`, `o_i''
/// = K (O_i - o_i) - D o_i'`, output `y_i = o_i + a_i cos(phi_i)`.
///
/// `nu` follows its command with the same spring (in the publication it changes in a step). Lags are
/// differences of pattern phases, `phi_ij = theta_j - theta_i`. When the gait changes, `theta` takes the
/// shorter direction around the circle. Outputs and their derivatives therefore stay continuous. Amplitudes
/// start at zero, so the rhythm grows out of the offsets.
#[derive(Clone, Debug)]
pub struct PhaseNetwork {
    settings: NetworkSettings,
    phases: CoupledPhases,
    commands: Commands,
    /// Amplitudes at the beginning, middle and end of a step.
    amplitudes: [Vec<f64>; 3],
    theta_now: Vec<f64>,
    omega: Vec<f64>,
    output: Vec<f64>,
    velocity: Vec<f64>,
    /// Width of the last step, and its strides: half and whole step for the springs, whole step for the
    /// pattern.
    strides: (f64, [Stride; 3]),
}

impl PhaseNetwork {
    /// Creates a network from nodes and coupling weights `w` (entry `w_ij`: action of node j on i, rad/s per
    /// unit of amplitude).
    ///
    /// # Errors
    /// [`CpgError`] if sizes do not match, or a number is out of range.
    pub fn new(nodes: &[Node], weights: DMatrix<f64>, settings: NetworkSettings) -> Result<Self, CpgError> {
        let n = nodes.len();
        size("the rows of the weights", weights.nrows(), n)?;
        size("the columns of the weights", weights.ncols(), n)?;
        finite("weights", weights.as_slice())?;
        finite("frequency", &[settings.frequency])?;
        positive("damping", settings.damping)?;
        positive("transition", settings.transition)?;
        for node in nodes {
            finite("a node", &[node.amplitude, node.offset, node.phase])?;
        }
        let zeros = vec![0.0; n];
        let phase = nodes.iter().map(|node| node.phase.rem_euclid(TAU)).collect();
        let still = CriticalSpring::new(settings.damping).stride(0.0);
        let mut network = Self {
            phases: CoupledPhases::new(weights, phase),
            commands: Commands::new(
                settings.frequency,
                nodes.iter().map(|node| (node.amplitude, node.offset)),
                nodes.iter().map(|node| node.phase),
            ),
            amplitudes: std::array::from_fn(|_| zeros.clone()),
            theta_now: nodes.iter().map(|node| node.phase).collect(),
            omega: zeros.clone(),
            output: zeros.clone(),
            velocity: zeros,
            strides: (0.0, [still; 3]),
            settings,
        };
        network.observe();
        Ok(network)
    }

    /// Creates a network with one node per leg. Every leg acts on every other leg with
    /// `weight / (A (n - 1))`, with the amplitude `A` of the acting leg and the number of legs `n`. A
    /// deviation from the gait then decays at about `weight` (1/s), independently of the number of legs and
    /// their amplitude.
    ///
    /// # Errors
    /// [`CpgError`] if the gait is not defined for this number of legs, or a number is out of range.
    pub fn of_gait(gait: Gait, legs: &[LegSettings], weight: f64) -> Result<Self, CpgError> {
        let phases = gait.phases(legs.len())?;
        let nodes: Vec<Node> = legs
            .iter()
            .zip(phases)
            .map(|(leg, phase)| Node { amplitude: leg.amplitude, offset: leg.offset, phase: *phase })
            .collect();
        let weights = Self::all_to_all(&nodes, weight);
        Self::new(&nodes, weights, NetworkSettings::default())
    }

    /// Returns weights that couple all of the `n` nodes with each other: node `j`, with the amplitude `A_j`,
    /// acts on every other node with `weight / (A_j (n - 1))`. A node of zero amplitude acts on no other
    /// node.
    pub fn all_to_all(nodes: &[Node], weight: f64) -> DMatrix<f64> {
        let n = nodes.len();
        DMatrix::from_fn(n, n, |i, j| {
            let amplitude = nodes[j].amplitude.abs();
            if i == j || amplitude < 1e-9 { 0.0 } else { weight / (amplitude * (n - 1) as f64) }
        })
    }

    /// Creates a network whose pattern follows from lags between pairs of nodes. Each pair is coupled in both
    /// directions with `weight`. The phases in `nodes` are ignored.
    ///
    /// # Errors
    /// [`CpgError`] if the lags contradict each other, or a number is out of range.
    pub fn from_lags(
        nodes: &[Node],
        lags: &[Lag],
        weight: f64,
        settings: NetworkSettings,
    ) -> Result<Self, CpgError> {
        let phases = consistent_phases(nodes.len(), lags)?;
        let nodes: Vec<Node> =
            nodes.iter().zip(phases).map(|(node, phase)| Node { phase, ..*node }).collect();
        let mut weights = DMatrix::zeros(nodes.len(), nodes.len());
        for lag in lags {
            weights[(lag.follower, lag.leader)] = weight;
            weights[(lag.leader, lag.follower)] = weight;
        }
        Self::new(&nodes, weights, settings)
    }

    /// Returns the number of nodes.
    pub fn nodes(&self) -> usize {
        self.commands.amplitude.len()
    }

    /// Sets the target frequency, Hz. A negative frequency runs the pattern backwards.
    ///
    /// # Errors
    /// [`CpgError`] if the number is not finite.
    pub fn set_frequency(&mut self, frequency: f64) -> Result<(), CpgError> {
        finite("frequency", &[frequency])?;
        self.commands.frequency.target = frequency;
        Ok(())
    }

    /// Sets the target amplitude and offset of a node.
    ///
    /// # Errors
    /// [`CpgError`] if the node does not exist, or a number is not finite.
    pub fn set_amplitude_offset(&mut self, node: usize, amplitude: f64, offset: f64) -> Result<(), CpgError> {
        self.commands.set_amplitude_offset("the network", node, [amplitude, offset])
    }

    /// Sets the target phase of every node in the pattern, rad. Each phase takes the shorter direction around
    /// the circle.
    ///
    /// # Errors
    /// [`CpgError`] if the length is wrong, or a number is not finite.
    pub fn set_pattern(&mut self, phases: &[f64]) -> Result<(), CpgError> {
        check_phases("the pattern", phases, self.nodes())?;
        self.commands.set_pattern(phases.iter().copied());
        Ok(())
    }

    /// Sets the target gait, for a network with one node per leg.
    ///
    /// # Errors
    /// [`CpgError`] if the gait is not defined for this number of legs.
    pub fn set_gait(&mut self, gait: Gait) -> Result<(), CpgError> {
        self.set_pattern(gait.phases(self.nodes())?)
    }

    /// Sets the phases immediately, rad. This makes the output discontinuous.
    ///
    /// # Errors
    /// [`CpgError`] if the length is wrong, or a number is not finite.
    pub fn set_phases(&mut self, phases: &[f64]) -> Result<(), CpgError> {
        check_phases("phases", phases, self.nodes())?;
        self.phases.phase.copy_from_slice(phases);
        self.observe();
        Ok(())
    }

    /// Sets amplitudes, offsets, frequency and pattern immediately to their targets. This makes the output
    /// discontinuous.
    pub fn settle(&mut self) {
        self.commands.settle();
        self.observe();
    }

    /// Advances by `dt` seconds. No effect if `dt` is zero or negative.
    pub fn step(&mut self, dt: f64) {
        self.step_entrained(dt, &[]);
    }

    /// Advances like [`step`](Self::step), with `pull[i]` (rad/s) added to the rate of each phase; see
    /// [`Entrainment`](super::Entrainment). An empty slice means no entrainment.
    pub fn step_entrained(&mut self, dt: f64, pull: &[f64]) {
        if dt.is_nan() || dt <= 0.0 {
            return;
        }
        if self.strides.0 != dt {
            let spring = CriticalSpring::new(self.settings.damping);
            let pattern = CriticalSpring::new(self.settings.transition);
            self.strides = (dt, [spring.stride(0.5 * dt), spring.stride(dt), pattern.stride(dt)]);
        }
        let [half, whole, pattern] = self.strides.1;
        for (i, amplitude) in self.commands.amplitude.iter_mut().enumerate() {
            self.amplitudes[0][i] = amplitude.state.0;
            self.amplitudes[1][i] = half.advance(amplitude.state, amplitude.target, amplitude.target).0;
            amplitude.step(&whole);
            self.amplitudes[2][i] = amplitude.state.0;
        }
        self.commands.offset.iter_mut().for_each(|offset| offset.step(&whole));
        // the phases advance by the mean frequency over the step, and by the slide of the pattern
        let before = self.commands.frequency.state.0;
        self.commands.frequency.step(&whole);
        self.omega.fill(TAU * 0.5 * (before + self.commands.frequency.state.0));
        for (theta, now) in self.commands.theta.iter_mut().zip(&mut self.theta_now) {
            theta.step(&pattern);
            *now = theta.state.0;
        }
        let amplitude = [&self.amplitudes[0][..], &self.amplitudes[1], &self.amplitudes[2]];
        let (omega, theta) = (&self.omega[..], &self.theta_now[..]);
        self.phases.step(dt, &Influence { omega, pull, theta, amplitude });
        // phases and pattern are wrapped together, so that neither loses digits in a long run
        self.phases.phase.iter_mut().for_each(|phase| *phase = phase.rem_euclid(TAU));
        self.write();
    }

    /// Returns the output `y` of every node.
    pub fn output(&self) -> &[f64] {
        &self.output
    }

    /// Returns the derivative of the output of every node, per second.
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// Returns the phase of every node after the last step, rad in \[0, 2 pi).
    pub fn phases(&self) -> &[f64] {
        &self.phases.phase
    }

    /// Returns the current pattern phase of every node, rad.
    pub fn pattern(&self) -> &[f64] {
        &self.theta_now
    }

    /// Returns the largest deviation of a node from the pattern, rad. Phases are relative to the phase of the
    /// first node.
    pub fn pattern_error(&self) -> f64 {
        self.commands.pattern_error(&self.phases.phase)
    }

    fn observe(&mut self) {
        for (i, amplitude) in self.commands.amplitude.iter().enumerate() {
            self.amplitudes[2][i] = amplitude.state.0;
            self.theta_now[i] = self.commands.theta[i].state.0;
        }
        self.omega.fill(TAU * self.commands.frequency.state.0);
        let amplitude = [&self.amplitudes[2][..]; 3];
        let (omega, theta) = (&self.omega[..], &self.theta_now[..]);
        self.phases.observe(&Influence { omega, pull: &[], theta, amplitude });
        self.write();
    }

    fn write(&mut self) {
        for i in 0..self.nodes() {
            let (sine, cosine) = self.phases.phase[i].sin_cos();
            (self.output[i], self.velocity[i]) = self.commands.output(i, cosine, -sine * self.phases.rate[i]);
        }
    }
}
