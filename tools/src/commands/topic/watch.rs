//! Follows a topic until enough samples were seen, the run ends, or the user stops.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use motorium::plan::TopicPlan;
use motorium::region::Phase;
use motorium::session::TopicReader;
use motorium::transport::Tap;

use crate::interrupt::interrupted;
use crate::out::errln;
use crate::runs::LivingRun;

/// Interval between two checks whether the run has ended.
const LIFE_CHECK: Duration = Duration::from_millis(100);
/// Time without a sample after which possible reasons are printed.
const TIMEOUT: Duration = Duration::from_secs(2);

/// Reason for the end of following a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    /// The caller has seen enough.
    Enough,
    /// The time limit was reached.
    Time,
    /// A signal requested the end.
    Interrupted,
    /// The run has ended.
    RunOver,
}

/// Result of polling a topic once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Look {
    /// There was no new sample.
    Nothing,
    /// There was a sample.
    Seen,
    /// Enough samples were seen.
    Enough,
}

/// A topic being followed.
#[derive(Debug)]
pub(crate) struct Watch<'a> {
    run: &'a LivingRun,
    topic: &'a TopicPlan,
    interrupted: Arc<AtomicBool>,
}

impl<'a> Watch<'a> {
    /// Prepares to follow a topic, outside the real-time cores. From now on, signals end the following
    /// gracefully, so that the slot of its reader becomes free again.
    pub(crate) fn open(run: &'a LivingRun, topic: &'a TopicPlan) -> anyhow::Result<Self> {
        run.stand_aside();
        let interrupted = interrupted()?;
        Ok(Self { run, topic, interrupted })
    }

    /// Returns a reader of every sample of the topic.
    pub(crate) fn tap(&self) -> anyhow::Result<Tap> {
        Ok(Tap::open(&self.run.folder.domain()?, self.topic)?)
    }

    /// Returns a reader of the newest sample of the topic.
    pub(crate) fn reader(&self) -> anyhow::Result<TopicReader> {
        Ok(TopicReader::open(&self.run.folder.domain()?, self.topic)?)
    }

    /// Calls `look` every `poll`, until it has seen enough.
    pub(crate) fn follow(
        &self,
        poll: Duration,
        time: Option<Duration>,
        mut look: impl FnMut() -> anyhow::Result<Look>,
    ) -> anyhow::Result<End> {
        let begin = Instant::now();
        let (mut checked, mut silent) = (begin, true);
        loop {
            match look()? {
                Look::Enough => return Ok(End::Enough),
                Look::Seen => silent = false,
                Look::Nothing => {}
            }
            if self.interrupted.load(Relaxed) {
                return Ok(End::Interrupted);
            }
            let now = Instant::now();
            if time.is_some_and(|time| now - begin >= time) {
                return Ok(End::Time);
            }
            if now - checked >= LIFE_CHECK {
                checked = now;
                if self.run.has_ended() {
                    return Ok(End::RunOver);
                }
                if silent && now - begin >= TIMEOUT {
                    silent = false;
                    self.explain_silence();
                }
            }
            std::thread::sleep(poll);
        }
    }

    fn explain_silence(&self) {
        let writer = &self.run.plan.components[self.topic.writer];
        let block = &self.run.region.components()[self.topic.writer];
        let why = match block.phase() {
            Phase::Running => "runs, but has published nothing so far".to_string(),
            phase => format!("is {}", format!("{phase:?}").to_lowercase()),
        };
        errln!("no sample of `{}` yet: its writer `{}` {why}", self.topic.name, writer.name);
    }
}

/// Returns the polling interval for samples of this period, usually short enough that none is overwritten.
pub(super) fn poll_for(period_ns: u64) -> Duration {
    Duration::from_nanos((period_ns / 4).clamp(100_000, 5_000_000))
}
