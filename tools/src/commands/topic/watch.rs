//! Following a topic: its samples as they come, until the wanted number was seen, the run is over, or the
//! user stops it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use motorium::plan::TopicPlan;
use motorium::region::Phase;
use motorium::transport::{Sample, Tap};

use crate::out::errln;
use crate::runs::LivingRun;

/// Interval between two checks that the run is not over.
const LIFE_CHECK: Duration = Duration::from_millis(100);
/// Time without a sample after which possible reasons are printed.
const TIMEOUT: Duration = Duration::from_secs(2);

/// Reason for the end of following a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    /// The caller ended it.
    Enough,
    /// Its time was over.
    Time,
    /// A signal asked for the end.
    Interrupted,
    /// The run is over.
    RunOver,
}

/// A topic being followed.
#[derive(Debug)]
pub(super) struct Watch<'a> {
    run: &'a LivingRun,
    topic: &'a TopicPlan,
    tap: Tap,
    interrupted: Arc<AtomicBool>,
}

impl<'a> Watch<'a> {
    /// Joins a topic as a tap, away from the real-time cores. Signals from now on end the following in good
    /// order, so that the place of the tap becomes free again.
    pub(super) fn open(run: &'a LivingRun, topic: &'a TopicPlan) -> anyhow::Result<Self> {
        run.stand_aside();
        let interrupted = Arc::new(AtomicBool::new(false));
        for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
            signal_hook::flag::register(signal, interrupted.clone()).context("catching signals")?;
        }
        let tap = Tap::open(&run.folder.domain()?, topic)?;
        Ok(Self { run, topic, tap, interrupted })
    }

    /// Reads new samples every `poll` and passes them, or none, to `take` until it returns false.
    pub(super) fn follow(
        &mut self,
        poll: Duration,
        time: Option<Duration>,
        mut take: impl FnMut(Vec<Sample>) -> anyhow::Result<bool>,
    ) -> anyhow::Result<End> {
        let begin = Instant::now();
        let (mut checked, mut silent) = (begin, true);
        loop {
            let samples: Vec<Sample> = core::iter::from_fn(|| self.tap.next_unread()).collect();
            silent &= samples.is_empty();
            if !take(samples)? {
                return Ok(End::Enough);
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

/// Polling interval for samples of this period, short enough that none is overwritten as a rule.
pub(super) fn poll_for(period_ns: u64) -> Duration {
    Duration::from_nanos((period_ns / 4).clamp(100_000, 5_000_000))
}
