//! Roll-outs: short runs of a graph that are judged by figures in their reports. They run in lockstep in an
//! inline session, or in real time.

mod overlay;
mod safe_states;

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use motorium::graph::{self, GraphError, Machine, Override};
use motorium::launcher::{Event, Exit, LaunchError, Options, Report};
use motorium::plan::{ClockKind, Expectation, Plan};
use motorium::session::{Session, SessionError};
use motorium::worker::Registry;
use motorium_learners::search::{Evaluation, Outcome};
use serde::{Deserialize, Serialize};

pub(crate) use overlay::{OverlayError, overlay};
use safe_states::SafeStates;

/// A figure of the report and its weight in the reward.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub(crate) struct Reward {
    weight: f64,
    figure: String,
}

/// The text does not describe a reward.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum RewardError {
    /// The figure has no component.
    #[error("found `{0}`, expected [WEIGHT*]COMPONENT.FIGURE, such as physics.base_travel_x_m")]
    Form(String),
    /// The weight is not a number.
    #[error("the weight `{0}` is not a finite number other than 0")]
    Weight(String),
}

impl FromStr for Reward {
    type Err = RewardError;

    fn from_str(text: &str) -> Result<Self, RewardError> {
        let (weight, figure) = match text.split_once('*') {
            Some((weight, figure)) => (Some(weight.trim()), figure.trim()),
            None => (None, text.trim()),
        };
        let number = |text: &str| text.parse::<f64>().ok().filter(|value| value.is_finite() && *value != 0.0);
        let weight = match weight {
            Some(text) => number(text).ok_or_else(|| RewardError::Weight(text.to_owned()))?,
            None => 1.0,
        };
        match figure.split_once('.') {
            Some((component, path)) if !component.is_empty() && !path.is_empty() => {
                Ok(Self { weight, figure: figure.to_owned() })
            }
            _ => Err(RewardError::Form(text.to_owned())),
        }
    }
}

impl fmt::Display for Reward {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { weight, figure } = self;
        if *weight == 1.0 { f.write_str(figure) } else { write!(f, "{weight:?}*{figure}") }
    }
}

impl From<Reward> for String {
    fn from(reward: Reward) -> Self {
        reward.to_string()
    }
}

impl TryFrom<String> for Reward {
    type Error = RewardError;

    fn try_from(text: String) -> Result<Self, RewardError> {
        text.parse()
    }
}

/// Error that prevents roll-outs with any parameters.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RolloutError {
    /// A signal ended the run.
    #[error("interrupted")]
    Interrupted,
    /// The session failed.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The program that hosts the components is unknown.
    #[error("the path of this program cannot be determined: {0}")]
    Program(#[from] std::io::Error),
    /// The events of a run cannot be printed.
    #[error("{0}")]
    Printer(String),
    /// The parameters cannot be written as an overlay.
    #[error(transparent)]
    Overlay(#[from] OverlayError),
}

/// A graph with its overlays and overrides, and the judgement of its runs.
pub(crate) struct Rollout {
    /// The graph file and its text.
    pub(crate) graph: PathBuf,
    pub(crate) text: String,
    /// Overlay files, then overrides.
    pub(crate) with: Vec<PathBuf>,
    pub(crate) set: Vec<Override>,
    /// Expectations in addition to the graph's.
    pub(crate) expect: Vec<Expectation>,
    /// `true` if the graph's own expectations are ignored.
    pub(crate) no_expect: bool,
    /// Terms of the reward; without any, the operator of a robot enters it.
    pub(crate) rewards: Vec<Reward>,
    /// Clock of the runs.
    pub(crate) clock: ClockKind,
    pub(crate) machine: Machine,
    /// Set by a signal. A session ends at a signal while it runs; this flag records signals between sessions.
    pub(crate) interrupted: Arc<AtomicBool>,
}

impl Rollout {
    /// Returns the plan with the values in `settings`. Its last expectations are the figures of the reward.
    pub(crate) fn plan(&self, settings: &[(&str, f64)], registry: &Registry) -> Result<Plan, GraphError> {
        let mut overrides = self.set.clone();
        let mut set = |path: &str, value: String| overrides.push(Override { path: path.to_owned(), value });
        set("clock", format!("{:?}", self.clock_name()));
        for (key, value) in settings {
            set(key, format!("{value:?}"));
        }
        let (text, machine) = (self.text.clone(), &self.machine);
        let checked = graph::check_with(&self.graph, text, &self.with, &overrides, registry, machine)?;
        let mut plan = checked.plan;
        if self.no_expect {
            plan.expectations.clear();
        }
        plan.expectations.extend(self.expect.iter().cloned());
        plan.expectations.extend(self.rewards.iter().map(|reward| Expectation {
            figure: reward.figure.clone(),
            comparison: motorium::plan::Comparison::NotEqual,
            bound: serde_json::Value::Null,
        }));
        Ok(plan)
    }

    /// Returns the clock as in a graph file and in options.
    pub(crate) fn clock_name(&self) -> &'static str {
        match self.clock {
            ClockKind::Realtime => "realtime",
            ClockKind::Lockstep => "lockstep",
        }
    }

    /// Runs a plan of this graph in lockstep, on a core.
    pub(crate) fn run(
        &self,
        plan: Plan,
        registry: &Registry,
        core: usize,
    ) -> Result<Evaluation, RolloutError> {
        if self.interrupted.load(Relaxed) {
            return Err(RolloutError::Interrupted);
        }
        let options = Options::inline().on_core(core);
        let mut session = match Session::launch(plan, registry, &options) {
            Ok(session) => session,
            Err(SessionError::Launch(error @ LaunchError::Component { .. })) => {
                return Ok(Evaluation::failed(Outcome::Refused, error.to_string()));
            }
            Err(error) => return Err(error.into()),
        };
        session.run()?;
        self.judge(&session.stop())
    }

    /// Runs a plan of this graph in real time, each component in its own process, as `motorium run` does.
    ///
    /// A run that does not start, ends in a safe state, or does not go as the graph requires is
    /// [`Outcome::Stopped`].
    pub(crate) fn run_in_real_time(
        &self,
        plan: Plan,
        registry: &Registry,
        observe: &mut dyn FnMut(&Event<'_>),
    ) -> Result<Evaluation, RolloutError> {
        if self.interrupted.load(Relaxed) {
            return Err(RolloutError::Interrupted);
        }
        let options = Options::processes(std::env::current_exe()?);
        let mut safe_states = SafeStates::default();
        let mut session = match Session::observed(plan, registry, &options, |event| {
            safe_states.observe(&event);
            observe(&event);
        }) {
            Ok(session) => session,
            Err(_) if self.interrupted.load(Relaxed) => return Err(RolloutError::Interrupted),
            Err(SessionError::Launch(error)) => {
                return Ok(Evaluation::failed(Outcome::Stopped, format!("the graph did not start: {error}")));
            }
            Err(error) => return Err(error.into()),
        };
        let ran = session.run();
        // whatever happened, the actuators go to their safe state before anything else
        let report = session.stop();
        ran?;
        let shortfalls = safe_states.at_the_end().chain(report.warnings.iter().cloned());
        let shortfalls: Vec<String> = shortfalls.collect();
        if report.exit == Exit::Finished && !shortfalls.is_empty() {
            return Ok(Evaluation::failed(Outcome::Stopped, shortfalls.join("; ")));
        }
        self.judge(&report)
    }

    /// Returns the result of a run: the sum of the rewards if it finished and its expectations are met.
    fn judge(&self, report: &Report) -> Result<Evaluation, RolloutError> {
        match &report.exit {
            Exit::Interrupted => return Err(RolloutError::Interrupted),
            Exit::SafeStop { reason } => return Ok(Evaluation::failed(Outcome::Stopped, reason)),
            Exit::Finished => {}
        }
        let judged = report.expectations.len().saturating_sub(self.rewards.len());
        let (expectations, figures) = report.expectations.split_at(judged);
        if let Some(unmet) = expectations.iter().find(|expectation| !expectation.met) {
            return Ok(Evaluation::failed(Outcome::Unmet, unmet.to_string()));
        }
        if self.rewards.is_empty() {
            return Ok(Evaluation::unscored());
        }
        let mut total = 0.0;
        for (reward, found) in self.rewards.iter().zip(figures) {
            let Some(value) = found.found.as_f64() else {
                let problem = reason(report, &reward.figure).or_else(|| found.problem.clone());
                let problem = problem.unwrap_or_else(|| format!("found {}", found.found));
                let reason = format!("`{}`: {problem}, expected a number", reward.figure);
                return Ok(Evaluation::failed(Outcome::NoValue, reason));
            };
            total += reward.weight * value;
        }
        Ok(Evaluation::finished(total))
    }
}

/// Returns the reason that the component of a figure states for figures without a value: `no_value` of its
/// result.
fn reason(report: &Report, figure: &str) -> Option<String> {
    let (component, path) = figure.split_once('.')?;
    let result = report.results.get(component)?;
    // a misspelt figure is reported by its name
    result.get(path).filter(|value| value.is_null())?;
    result.get("no_value")?.as_str().map(str::to_owned)
}

/// Returns the cores of `machine` on which this program may run.
pub fn allowed_cores(machine: &Machine) -> Vec<usize> {
    let online = machine.cores();
    let allowed = rustix::thread::sched_getaffinity(None);
    let is_allowed = |core: &&usize| allowed.as_ref().is_ok_and(|allowed| allowed.is_set(**core));
    let cores: Vec<usize> = online.iter().filter(is_allowed).copied().collect();
    if cores.is_empty() { online.to_vec() } else { cores }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rewards_are_printed_readably() {
        for (text, weight) in [("physics.base_travel_x_m", 1.0), ("-0.5*controller.tasks.0.error_m", -0.5)] {
            let reward: Reward = text.parse().expect("a reward");
            assert_eq!((reward.weight, reward.to_string().as_str()), (weight, text));
        }
        for text in ["physics", "physics.", ".x", "2*physics"] {
            assert_eq!(text.parse::<Reward>(), Err(RewardError::Form(text.to_owned())));
        }
        for weight in ["0", "x", "inf", ""] {
            let found = format!("{weight}*a.b").parse::<Reward>();
            assert_eq!(found, Err(RewardError::Weight(weight.to_owned())));
        }
    }
}
