//! Gaits of Hopf's, Matsuoka's or Kuramoto's oscillators.

use std::f64::consts::TAU;

use super::follower::{Commands, Follower, check_phases};
use super::oscillators::{Oscillator, Oscillators};
use super::{CpgError, Entrainment, finite, positive, size};
use crate::ValueError;
use crate::dmp::{CriticalSpring, Stride};

/// Oscillation of one joint of a leg: `offset + amplitude value(phase of the leg + phase)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointOscillation {
    /// Index of the leg, from 0.
    pub leg: usize,
    /// Amplitude, unit of the output.
    pub amplitude: f64,
    /// Centre of the oscillation, unit of the output.
    pub offset: f64,
    /// Phase lead over the leg, rad.
    pub phase: f64,
}

/// Parameters of an oscillator network. [`Default`] returns the values documented on each field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OscillatorNetworkSettings {
    /// Stride frequency, Hz. Default 1.
    pub frequency: f64,
    /// Rate `k` at which a deviation from the gait decays, 1/s. Default 5.
    pub coupling: f64,
    /// Fraction of the stride spent in stance, in (0, 1). Used by Hopf oscillators only. Default 0.5.
    pub duty_factor: f64,
    /// Damping of amplitudes, offsets, frequency and duty factor, 1/s. Default 20.
    pub damping: f64,
    /// Damping of the gait phases, 1/s. Default 8, with which most of a change is complete after half a
    /// second.
    pub transition: f64,
}

impl Default for OscillatorNetworkSettings {
    fn default() -> Self {
        Self { frequency: 1.0, coupling: 5.0, duty_factor: 0.5, damping: 20.0, transition: 8.0 }
    }
}

/// Range of duty factors that can be commanded.
const DUTY: std::ops::RangeInclusive<f64> = 0.05..=0.95;

/// Legs that move in a gait, with one oscillator per leg (Matsuoka: one per joint).
///
/// Each oscillator runs along its cycle at its own speed, and all models are coupled through these speeds.
/// `chi_i` is the time since oscillator `i` passed its maximum, as a phase that grows by 2 pi per cycle. With
/// the phases `theta_i` of the gait,
///
/// `omega_i = 2 pi nu + p_i + k / (n - 1) sum_j sin((chi_j - theta_j) - (chi_i - theta_i))`.
///
/// For Kuramoto oscillators this is the original model. For Hopf and Matsuoka oscillators, any coupling
/// strength preserves the shape of each cycle and the timing of the gait: legs half a stride apart remain so
/// even if stance lasts longer than swing. `p_i` is feedback. Commands are followed by critically damped
/// springs, so outputs and their derivatives stay continuous. Amplitudes start at 0. The coupling is
/// evaluated at the beginning of each step.
#[derive(Clone, Debug)]
pub struct OscillatorNetwork {
    settings: OscillatorNetworkSettings,
    oscillators: Oscillators,
    /// Oscillator of each joint, with cosine and sine of its phase lead.
    joints: Vec<(usize, f64, f64)>,
    /// Leg of each oscillator, and the oscillator's lead over the leg's phase.
    places: Vec<(usize, f64)>,
    duty_factor: Follower,
    commands: Commands,
    phases: Vec<f64>,
    /// Sine and cosine of `chi - theta`.
    deviation: Vec<(f64, f64)>,
    pull: Vec<f64>,
    output: Vec<f64>,
    velocity: Vec<f64>,
    strides: (f64, [Stride; 2]),
}

impl OscillatorNetwork {
    /// Creates a network of oscillators of this model for the joints in `oscillations`. `gait` contains the
    /// phase of every leg in the gait, rad. The oscillators start in the gait.
    ///
    /// # Errors
    /// [`CpgError`] if a leg does not exist, a number is out of range, or the neurons do not oscillate.
    pub fn new(
        model: Oscillator,
        oscillations: &[JointOscillation],
        gait: &[f64],
        settings: OscillatorNetworkSettings,
    ) -> Result<Self, CpgError> {
        finite("the gait", gait)?;
        finite("frequency", &[settings.frequency])?;
        positive("damping", settings.damping)?;
        positive("transition", settings.transition)?;
        if !(settings.coupling >= 0.0 && settings.coupling.is_finite()) {
            let (name, value) = ("coupling", settings.coupling);
            return Err(CpgError::Value(ValueError::OutOfRange {
                name,
                value,
                expected: "a finite number of at least 0",
            }));
        }
        check_duty(settings.duty_factor)?;
        for oscillation in oscillations {
            finite(
                "the oscillation of a joint",
                &[oscillation.amplitude, oscillation.offset, oscillation.phase],
            )?;
            if oscillation.leg >= gait.len() {
                return Err(CpgError::Value(ValueError::Size {
                    name: "the gait",
                    found: gait.len(),
                    expected: oscillation.leg + 1,
                }));
            }
        }
        let (places, joints): (Vec<_>, Vec<_>) = if Oscillators::has_joint_phases(&model) {
            let joint = |oscillation: &JointOscillation| {
                (oscillation.leg, oscillation.phase.cos(), oscillation.phase.sin())
            };
            ((0..gait.len()).map(|leg| (leg, 0.0)).collect(), oscillations.iter().map(joint).collect())
        } else {
            let assignment = |oscillation: &JointOscillation| (oscillation.leg, oscillation.phase);
            (
                oscillations.iter().map(assignment).collect(),
                (0..oscillations.len()).map(|unit| (unit, 1.0, 0.0)).collect(),
            )
        };
        let start: Vec<f64> = places.iter().map(|(leg, ahead)| gait[*leg] + ahead).collect();
        let spring = CriticalSpring::new(settings.damping).stride(0.0);
        let mut rhythm = Self {
            oscillators: Oscillators::new(&model, &start, settings.duty_factor)?,
            commands: Commands::new(
                settings.frequency,
                oscillations.iter().map(|oscillation| (oscillation.amplitude, oscillation.offset)),
                start.iter().copied(),
            ),
            duty_factor: Follower::resting_at(settings.duty_factor),
            phases: start.iter().map(|theta| theta.rem_euclid(TAU)).collect(),
            deviation: vec![(0.0, 1.0); start.len()],
            pull: vec![0.0; start.len()],
            output: vec![0.0; oscillations.len()],
            velocity: vec![0.0; oscillations.len()],
            strides: (0.0, [spring; 2]),
            joints,
            places,
            settings,
        };
        rhythm.write();
        Ok(rhythm)
    }

    /// Returns the number of joints.
    pub fn joints(&self) -> usize {
        self.joints.len()
    }

    /// Sets the target frequency, Hz, at least 0.
    ///
    /// # Errors
    /// [`CpgError`] if the frequency is negative or not finite.
    pub fn set_frequency(&mut self, frequency: f64) -> Result<(), CpgError> {
        if !(frequency >= 0.0 && frequency.is_finite()) {
            let (name, expected) = ("frequency", "a finite number of at least 0");
            return Err(CpgError::Value(ValueError::OutOfRange { name, value: frequency, expected }));
        }
        self.commands.frequency.target = frequency;
        Ok(())
    }

    /// Sets the target fraction of the stride spent in stance, 0.05 to 0.95. Used by Hopf oscillators only.
    ///
    /// # Errors
    /// [`CpgError`] if the value is out of range.
    pub fn set_duty_factor(&mut self, duty_factor: f64) -> Result<(), CpgError> {
        check_duty(duty_factor)?;
        self.duty_factor.target = duty_factor;
        Ok(())
    }

    /// Sets the target amplitude and offset of a joint.
    ///
    /// # Errors
    /// [`CpgError`] if the joint does not exist, or a number is not finite.
    pub fn set_amplitude_offset(
        &mut self,
        joint: usize,
        amplitude: f64,
        offset: f64,
    ) -> Result<(), CpgError> {
        self.commands.set_amplitude_offset("the network", joint, [amplitude, offset])
    }

    /// Sets the target phase of every leg in the gait, rad. Each phase takes the shorter direction around the
    /// circle.
    ///
    /// # Errors
    /// [`CpgError`] if the length is wrong, or a number is not finite.
    pub fn set_gait(&mut self, gait: &[f64]) -> Result<(), CpgError> {
        let legs = self.places.iter().map(|(leg, _)| leg + 1).max().unwrap_or(0);
        if gait.len() < legs {
            size("the gait", gait.len(), legs)?;
        }
        finite("the gait", gait)?;
        self.commands.set_pattern(self.places.iter().map(|(leg, ahead)| gait[*leg] + ahead));
        Ok(())
    }

    /// Moves every oscillator immediately to a given phase of the oscillator's cycle. `phases` contains one
    /// phase per leg (Matsuoka: one per joint), rad. This makes the output discontinuous.
    ///
    /// # Errors
    /// [`CpgError`] if the length is wrong, or a number is not finite.
    pub fn set_phases(&mut self, phases: &[f64]) -> Result<(), CpgError> {
        check_phases("phases", phases, self.places.len())?;
        for (unit, phase) in phases.iter().enumerate() {
            self.oscillators.set_phase(unit, *phase);
        }
        self.write();
        Ok(())
    }

    /// Advances by `dt` seconds. No effect if `dt` is zero or negative.
    pub fn step(&mut self, dt: f64) {
        self.step_entrained(dt, &[]);
    }

    /// Advances like [`step`](Self::step), with `pull[i]` (rad/s) for each joint; see [`pull`](Self::pull).
    /// The mean over the joints of an oscillator is added to the oscillator's angular velocity. An empty
    /// slice means no entrainment.
    pub fn step_entrained(&mut self, dt: f64, pull: &[f64]) {
        if dt.is_nan() || dt <= 0.0 {
            return;
        }
        if self.strides.0 != dt {
            let [quick, slow] = [self.settings.damping, self.settings.transition]
                .map(|damping| CriticalSpring::new(damping).stride(dt));
            self.strides = (dt, [quick, slow]);
        }
        let [quick, slow] = self.strides.1;
        let Commands { frequency, amplitude, offset, theta } = &mut self.commands;
        let quickly = amplitude.iter_mut().chain(offset).chain([frequency, &mut self.duty_factor]);
        quickly.for_each(|follower| follower.step(&quick));
        theta.iter_mut().for_each(|theta| theta.step(&slow));
        self.oscillators.set_duty_factor(self.duty_factor.state.0);
        self.pull.fill(0.0);
        for (unit, total) in self.pull.iter_mut().enumerate() {
            let own = self.joints.iter().zip(pull).filter(|(joint, _)| joint.0 == unit);
            let (sum, count) = own.fold((0.0, 0), |(sum, count), (_, pull)| (sum + pull, count + 1));
            *total = sum / f64::from(count.max(1));
        }
        let (mut sines, mut cosines) = (0.0, 0.0);
        for ((deviation, phase), theta) in
            self.deviation.iter_mut().zip(&self.phases).zip(&self.commands.theta)
        {
            let (sine, cosine) = (phase - theta.state.0).sin_cos();
            *deviation = (sine, cosine);
            sines += sine;
            cosines += cosine;
        }
        let coupling = self.settings.coupling / (self.places.len().max(2) - 1) as f64;
        let omega = TAU * self.commands.frequency.state.0;
        for (unit, (sine, cosine)) in self.deviation.iter().enumerate() {
            let speed = omega + self.pull[unit] + coupling * (sines * cosine - cosines * sine);
            self.oscillators.advance(unit, dt, speed);
        }
        self.write();
    }

    /// Returns the entrainment of a joint, rad/s, from the joint's measured `position` and `velocity` (per
    /// second). The result is `gain sin(difference)` of the measured and the commanded phase, both treated as
    /// harmonic. The result is zero if the frequency is zero.
    pub fn pull(&self, joint: usize, position: f64, velocity: f64, gain: f64) -> f64 {
        let omega = TAU * self.commands.frequency.state.0;
        if omega <= 0.0 || joint >= self.joints() {
            return 0.0;
        }
        let offset = self.commands.offset[joint].state.0;
        let phase = |q: f64, v: f64| Entrainment::measured_phase(q, v, offset, omega);
        let commanded = phase(self.output[joint], self.velocity[joint]);
        Entrainment { gain, lead: 0.0 }.pull(phase(position, velocity), commanded)
    }

    /// Returns the output of every joint.
    pub fn output(&self) -> &[f64] {
        &self.output
    }

    /// Returns the derivative of the output of every joint, per second.
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// Returns the phase of every oscillator, proportional to time, rad in \[0, 2 pi).
    pub fn phases(&self) -> &[f64] {
        &self.phases
    }

    /// Returns the largest deviation of an oscillator from the gait, rad. Phases are relative to the phase of
    /// the first oscillator.
    pub fn gait_error(&self) -> f64 {
        self.commands.pattern_error(&self.phases)
    }

    fn write(&mut self) {
        for (unit, phase) in self.phases.iter_mut().enumerate() {
            *phase = self.oscillators.phase(unit);
        }
        for (joint, (unit, cosine, sine)) in self.joints.iter().enumerate() {
            let [(value, rate), (later, later_rate)] = self.oscillators.read(*unit);
            let (value, rate) = (cosine * value - sine * later, cosine * rate - sine * later_rate);
            (self.output[joint], self.velocity[joint]) = self.commands.output(joint, value, rate);
        }
    }
}

fn check_duty(value: f64) -> Result<(), CpgError> {
    let expected = "a number from 0.05 to 0.95";
    if DUTY.contains(&value) {
        Ok(())
    } else {
        Err(CpgError::Value(ValueError::OutOfRange { name: "duty_factor", value, expected }))
    }
}
