//! Joint targets from single actions or from chunks.

use motorium::component::RunClock;
use motorium::declare::StepError;
use motorium::state::{Action, ActionChunk, MAX_CHUNK};
use motorium::transport::Input;
use motorium_learners::task::Rhythm;
use motorium_models::policy::{Chunk, ChunkArrival, ChunkError, ChunkPlan, ChunkTiming, JointTargets};
use serde_json::json;

use super::ChunksConfig;

/// The source of targets, in the order of the policy's joints.
#[derive(Debug)]
pub(super) enum Source {
    Actions(Actions),
    Chunks(Chunks),
    Pattern(Box<PatternActions>),
}

/// A pattern generator whose parameters are the newest action.
#[derive(Debug)]
pub(super) struct PatternActions {
    input: Input<Action>,
    targets: JointTargets,
    rhythm: Rhythm,
    /// The newest action within its bounds, and its time, ns since the run began.
    newest: Vec<f64>,
    time: Option<u64>,
    received: u64,
}

/// The newest action and the previous one.
#[derive(Debug)]
pub(super) struct Actions {
    input: Input<Action>,
    targets: JointTargets,
    /// Duration of the interpolation between actions, ns; `None` to hold the newest.
    interpolate: Option<f64>,
    /// Time of the newest action, ns since the run began.
    time: Option<u64>,
    before: Vec<f64>,
    newest: Vec<f64>,
    /// Targets interpolated between actions.
    reached: Vec<f64>,
    received: u64,
}

/// A plan made of chunks.
#[derive(Debug)]
pub(super) struct Chunks {
    input: Input<ActionChunk>,
    targets: JointTargets,
    plan: ChunkPlan,
    /// Start of the run on the clock of the plan and of stamps, ns.
    start: u64,
    counts: Counts,
}

/// Counts of chunks.
#[derive(Debug, Default)]
struct Counts {
    played: u64,
    actions: u64,
    late_actions: u64,
    latest: Option<ChunkArrival>,
    worst_delay: u64,
    repeated: u64,
    out_of_order: u64,
    too_late: u64,
    refused: u64,
}

impl Source {
    /// Starts at these positions.
    pub(super) fn start(&mut self, position: &[f64]) {
        match self {
            Self::Actions(actions) => {
                actions.newest.copy_from_slice(position);
                actions.before.copy_from_slice(position);
            }
            Self::Chunks(chunks) => chunks.plan.start(position),
            Self::Pattern(_) => {}
        }
    }

    /// Reads everything that has arrived by `now`, ns since the run began. Returns the time of the newest
    /// action, or of the last action of the current chunk.
    pub(super) fn poll(&mut self, now: u64, clock: &RunClock) -> Result<Option<u64>, StepError> {
        match self {
            Self::Actions(actions) => actions.poll(now),
            Self::Chunks(chunks) => Ok(chunks.poll(now, clock)),
            Self::Pattern(pattern) => pattern.poll(),
        }
    }

    /// Advances a pattern generator that has an action by a time, s.
    pub(super) fn advance(&mut self, dt: f64) {
        if let Self::Pattern(pattern) = self
            && pattern.time.is_some()
        {
            pattern.rhythm.step(dt);
        }
    }

    /// Writes the targets at a time, ns since the run began.
    pub(super) fn sample(&self, now: u64, targets: &mut [f64]) {
        match self {
            Self::Actions(actions) => actions.sample(now, targets),
            Self::Chunks(chunks) => chunks.plan.sample(chunks.start + now, targets),
            Self::Pattern(pattern) => pattern.sample(targets),
        }
    }

    pub(super) fn reset(&mut self) {
        match self {
            Self::Actions(actions) => (actions.time, actions.received) = (None, 0),
            Self::Chunks(chunks) => chunks.counts = Counts::default(),
            Self::Pattern(pattern) => {
                (pattern.time, pattern.received) = (None, 0);
                pattern.rhythm.reset();
            }
        }
    }

    pub(super) fn result(&self) -> serde_json::Value {
        match self {
            Self::Actions(actions) => json!({ "actions": actions.received }),
            Self::Chunks(chunks) => chunks.counts.result(),
            Self::Pattern(pattern) => json!({ "actions": pattern.received }),
        }
    }
}

impl PatternActions {
    pub(super) fn new(input: Input<Action>, targets: JointTargets, rhythm: Rhythm, outputs: usize) -> Self {
        Self { input, targets, rhythm, newest: vec![0.0; outputs], time: None, received: 0 }
    }

    fn poll(&mut self) -> Result<Option<u64>, StepError> {
        let Some(action) = self.input.next_unread() else { return Ok(self.time) };
        if action.count() != self.newest.len() {
            return Err(unexpected_numbers(self.newest.len(), action.count()));
        }
        for (newest, value) in self.newest.iter_mut().zip(action.value()) {
            *newest = self.targets.clipped(*value);
        }
        if !self.rhythm.command(&self.targets, &self.newest) {
            return Err(StepError::failed("the action has a number that is not finite"));
        }
        self.time = Some(action.time_ns());
        self.received += 1;
        Ok(self.time)
    }

    fn sample(&self, targets: &mut [f64]) {
        for (joint, target) in targets.iter_mut().enumerate() {
            *target = self.targets.target(joint, self.newest[joint]);
        }
        for (joint, target) in self.rhythm.targets() {
            targets[joint] = target;
        }
    }
}

impl Actions {
    pub(super) fn new(input: Input<Action>, targets: JointTargets, interpolate: bool, rate: f64) -> Self {
        let zeros = vec![0.0; targets.targets().len()];
        Self {
            input,
            targets,
            interpolate: interpolate.then(|| 1e9 / rate),
            time: None,
            before: zeros.clone(),
            newest: zeros.clone(),
            reached: zeros,
            received: 0,
        }
    }

    fn poll(&mut self, now: u64) -> Result<Option<u64>, StepError> {
        if !self.input.has_news() {
            return Ok(self.time);
        }
        let mut reached = core::mem::take(&mut self.reached);
        self.sample(now, &mut reached);
        self.reached = reached;
        let Some(action) = self.input.next_unread() else { return Ok(self.time) };
        if action.count() != self.newest.len() {
            return Err(unexpected_numbers(self.newest.len(), action.count()));
        }
        self.before.copy_from_slice(&self.reached);
        for (joint, (target, value)) in self.newest.iter_mut().zip(action.value()).enumerate() {
            *target = self.targets.target(joint, *value);
        }
        if self.time.is_none() {
            self.before.copy_from_slice(&self.newest);
        }
        self.time = Some(action.time_ns());
        self.received += 1;
        Ok(self.time)
    }

    fn sample(&self, now: u64, targets: &mut [f64]) {
        let share = match (self.interpolate, self.time) {
            (Some(period), Some(time)) => (now.saturating_sub(time) as f64 / period).min(1.0),
            _ => 1.0,
        };
        if share >= 1.0 {
            targets.copy_from_slice(&self.newest);
            return;
        }
        for ((target, before), newest) in targets.iter_mut().zip(&self.before).zip(&self.newest) {
            *target = before + share * (newest - before);
        }
    }
}

impl Chunks {
    pub(super) fn new(input: Input<ActionChunk>, targets: JointTargets, config: ChunksConfig) -> Self {
        let timing = ChunkTiming { frozen: config.frozen.ns, blend: config.blend.ns };
        let plan = ChunkPlan::new(targets.targets().len(), MAX_CHUNK, timing);
        Self { input, targets, plan, start: 0, counts: Counts::default() }
    }

    fn poll(&mut self, now: u64, clock: &RunClock) -> Option<u64> {
        self.start = clock.stamp_ns(0);
        while let Some(chunk) = self.input.next_unread() {
            let chunk = Chunk {
                time: chunk.time,
                period: chunk.period,
                sequence: chunk.sequence,
                width: usize::try_from(chunk.width).unwrap_or(usize::MAX),
                values: chunk.value(),
            };
            let targets = &self.targets;
            let found =
                self.plan.accept(self.start + now, chunk, |joint, value| targets.target(joint, value));
            self.counts.add(found);
        }
        self.plan.end().map(|end| end.saturating_sub(self.start))
    }
}

/// Error of a step that reads an action of another policy.
#[cold]
fn unexpected_numbers(expected: usize, found: usize) -> StepError {
    StepError::failed(format!("action: expected {expected} numbers, found {found}"))
}

impl Counts {
    fn add(&mut self, found: Result<ChunkArrival, ChunkError>) {
        let count = match found {
            Ok(arrival) => {
                self.actions += arrival.actions as u64;
                self.late_actions += arrival.late as u64;
                self.worst_delay = self.worst_delay.max(arrival.delay);
                self.latest = Some(arrival);
                &mut self.played
            }
            Err(ChunkError::Repeated) => &mut self.repeated,
            Err(ChunkError::OutOfOrder { .. }) => &mut self.out_of_order,
            Err(ChunkError::Late { .. }) => &mut self.too_late,
            Err(_) => &mut self.refused,
        };
        *count += 1;
    }

    fn result(&self) -> serde_json::Value {
        json!({
            "chunks": {
                "played": self.played,
                "actions": self.actions,
                "late_actions": self.late_actions,
                "worst_delay_ms": self.worst_delay as f64 * 1e-6,
                "last": self.latest.map(|last| json!({
                    "actions": last.actions,
                    "late_actions": last.late,
                    "delay_ms": last.delay as f64 * 1e-6,
                })),
                "repeated": self.repeated,
                "out_of_order": self.out_of_order,
                "too_late": self.too_late,
                "refused": self.refused,
            },
        })
    }
}
