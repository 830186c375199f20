//! Progress of a training run on a topic.

use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::Duration;

use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::graph::{self, Machine};
use motorium::launcher::Options;
use motorium::session::{Session, SessionError};
use motorium::worker::{Kind, Registry, RobotSource};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::learner;

/// Name of the topic on which progress is published.
pub const PROGRESS_TOPIC: &str = "learn/progress";
/// Name of the component that the training program replaces.
const COMPONENT: &str = "learner";
/// Polling interval of the run, which `motorium stop` may end.
const INTERVAL: Duration = Duration::from_millis(50);

motorium::state_buffer! {
    /// Progress of a training run after an update. Values that the algorithm does not measure, or has not
    /// measured yet, are 0.
    pub struct LearningProgress as "motorium.LearningProgress" {
        /// Number of updates so far.
        pub update: u64,
        /// Number of steps so far, in all worlds together.
        pub steps: u64,
        /// Number of finished episodes so far.
        pub episodes: u64,
        /// Mean return of the last 100 episodes.
        pub mean_return: f64,
        /// Mean length of the last 100 episodes \[steps\].
        pub mean_length: f64,
        /// Mean number of steps per second since the start of the program, in all worlds together.
        pub steps_per_second: f64,
        /// Loss of the policy.
        pub policy_loss: f64,
        /// Squared error of the value function.
        pub value_loss: f64,
        /// Squared error of the critics.
        pub critic_loss: f64,
        /// Mean value estimated by the critics.
        pub value: f64,
        /// Entropy of the policy.
        pub entropy: f64,
        /// Divergence between the policy before and after the update.
        pub divergence: f64,
        /// Learning rate.
        pub rate: f64,
        /// Weight of the entropy bonus.
        pub temperature: f64,
    }
}

impl LearningProgress {
    /// Creates a message from the progress of a learner. `measures` contains the names of the progress
    /// values.
    pub fn new(progress: &learner::Progress, measures: &[&str], steps_per_second: f64) -> Self {
        let finite = |value: f64| if value.is_finite() { value } else { 0.0 };
        let measured = |name: &str| {
            let index = measures.iter().position(|measure| *measure == name);
            finite(index.and_then(|index| progress.values.get(index)).copied().unwrap_or(0.0))
        };
        Self {
            update: progress.update,
            steps: progress.steps,
            episodes: progress.episodes,
            mean_return: finite(progress.mean_return.unwrap_or(0.0)),
            mean_length: finite(progress.mean_length.unwrap_or(0.0)),
            steps_per_second: finite(steps_per_second),
            policy_loss: measured("policy_loss"),
            value_loss: measured("value_loss"),
            critic_loss: measured("critic_loss"),
            value: measured("value"),
            entropy: measured("entropy"),
            divergence: measured("divergence"),
            rate: measured("rate"),
            temperature: measured("temperature"),
        }
    }
}

/// The graph of the run: the topic and its writer.
const GRAPH: &str = r#"
name = "learn"
clock = "realtime"

[component.learner]
kind = "learner.progress"
rate = "10 Hz"
schedule = "normal"
publish = { progress = "learn/progress" }
"#;

#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct NoConfig {}

/// Declares the topic of a training program, which replaces the component.
struct ProgressWriter;

impl Component for ProgressWriter {
    const KIND: &'static str = "learner.progress";
    const SUMMARY: &'static str = "declares the progress of a training program";
    type Config = NoConfig;

    fn declare(_: &NoConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<LearningProgress>("progress", "progress after each update");
        Ok(())
    }

    fn configure(_: NoConfig, _: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self)
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        Err(StepError::failed("only the training program can publish the progress"))
    }
}

// Not inlined, as `Kind::of` asks for.
#[inline(never)]
fn kind() -> Kind {
    Kind::of::<ProgressWriter>()
}

/// Error of publishing progress.
#[derive(Debug, thiserror::Error)]
pub enum FeedError {
    /// The run did not start or has ended.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The thread of the run did not start.
    #[error("the thread of the run did not start")]
    Thread,
}

/// A run of the runtime that publishes the progress of a training program on the topic [`PROGRESS_TOPIC`]. A
/// separate thread drives the run, so training never waits for the run. Dropping the feed ends the run.
#[derive(Debug)]
pub struct ProgressFeed {
    run: String,
    sender: Option<mpsc::Sender<LearningProgress>>,
    thread: Option<JoinHandle<()>>,
}

impl ProgressFeed {
    /// Starts the run. Signals such as Ctrl-C are left to the program.
    ///
    /// # Errors
    ///
    /// [`FeedError`] if the run or its thread does not start.
    pub fn start() -> Result<Self, FeedError> {
        let (sender, receiver) = mpsc::channel();
        let (started, ready) = mpsc::channel();
        let thread = std::thread::Builder::new()
            .name("progress".to_owned())
            .spawn(move || serve(&receiver, &started))
            .map_err(|_| FeedError::Thread)?;
        let run = ready.recv().map_err(|_| FeedError::Thread)??;
        Ok(Self { run, sender: Some(sender), thread: Some(thread) })
    }

    /// Returns the identifier by which the tools find the run.
    pub fn run(&self) -> &str {
        &self.run
    }

    /// Sends progress to the run without waiting. Has no effect once the run has ended.
    pub fn publish(&self, progress: LearningProgress) {
        if let Some(sender) = &self.sender {
            // `motorium stop` may have ended the run; training continues
            let _ = sender.send(progress);
        }
    }
}

impl Drop for ProgressFeed {
    fn drop(&mut self) {
        self.sender = None;
        if let Some(thread) = self.thread.take() {
            // a panic of the thread has already been printed
            let _ = thread.join();
        }
    }
}

/// Launches the run, in the thread to which it belongs.
fn launch() -> Result<Session<'static>, SessionError> {
    let registry = Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, [kind()]);
    let checked = graph::check("learn.toml".as_ref(), GRAPH.to_owned(), &[], &registry, &Machine::detect());
    let plan = checked.expect("the graph of this module").plan;
    Session::launch(plan, &registry, &Options::threads().leaving_signals().standing_in_for(COMPONENT))
}

/// Publishes received progress until the sender is dropped or the run ends.
fn serve(receiver: &mpsc::Receiver<LearningProgress>, started: &mpsc::Sender<Result<String, FeedError>>) {
    let mut session = match launch() {
        Ok(session) => session,
        Err(error) => {
            // the starting thread waits for this
            let _ = started.send(Err(error.into()));
            return;
        }
    };
    let _ = started.send(Ok(session.id().to_owned()));
    loop {
        let is_alive = match receiver.recv_timeout(INTERVAL) {
            Ok(progress) => session.publish(PROGRESS_TOPIC, &progress).is_ok(),
            Err(RecvTimeoutError::Timeout) => session.step_until(session.time()).is_ok(),
            Err(RecvTimeoutError::Disconnected) => false,
        };
        if !is_alive {
            break;
        }
    }
    session.stop();
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;

    fn progress(update: u64) -> LearningProgress {
        let progress = learner::Progress {
            update,
            steps: 64 * update,
            episodes: 0,
            mean_return: None,
            mean_length: None,
            values: vec![0.25, f64::NAN, 1e-3],
        };
        LearningProgress::new(&progress, &["policy_loss", "value_loss", "rate"], 1e4)
    }

    #[test]
    fn measures_have_their_fields() {
        let found = progress(2);
        assert_eq!((found.update, found.steps, found.policy_loss, found.rate), (2, 128, 0.25, 1e-3));
        assert_eq!((found.mean_return, found.value_loss, found.temperature), (0.0, 0.0, 0.0));
    }

    #[test]
    fn every_measure_of_an_algorithm_has_a_field() {
        use motorium::state::StateBuffer as _;
        let fields: Vec<String> =
            LearningProgress::layout().fields.into_iter().map(|field| field.name).collect();
        for names in
            [&crate::ppo::MEASURES[..], &crate::sac::MEASURES, &crate::td3::MEASURES, &crate::dqn::MEASURES]
        {
            for name in names {
                assert!(fields.iter().any(|field| field == name), "{name}");
            }
        }
    }

    #[test]
    fn progress_is_read_from_the_topic_of_a_run() {
        use motorium::run_folder::RunFolder;
        use motorium::transport::Tap;
        let feed = ProgressFeed::start().expect("a run");
        let folder = RunFolder::find(feed.run()).expect("its folder");
        let (domain, plan) = (folder.domain().expect("its domain"), folder.plan().expect("its plan"));
        let topic = plan.topics.iter().find(|topic| topic.name == PROGRESS_TOPIC).expect("the topic");
        let mut tap = Tap::open(&domain, topic).expect("a tap");
        let deadline = Instant::now() + Duration::from_secs(60);
        for update in 1..=3_u64 {
            feed.publish(progress(update));
            let mut seen = None;
            while seen.is_none() {
                assert!(Instant::now() < deadline, "update {update} is not published");
                tap.read(|_, bytes| seen = Some(bytes[..8].to_vec()));
                std::thread::yield_now();
            }
            assert_eq!(seen, Some(update.to_ne_bytes().to_vec()));
        }
        let id = feed.run().to_owned();
        drop(feed);
        assert!(RunFolder::find(&id).is_none(), "a run is left behind");
    }
}
