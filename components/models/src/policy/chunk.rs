//! Chunks of actions: plans of several consecutive actions, which are executed by time.
//!
//! A policy that plans ahead returns a chunk of consecutive actions, delayed by its inference time. When a
//! chunk arrives, the previous plan remains active for [`frozen`](ChunkTiming::frozen). The plan then blends
//! into the new chunk over [`blend`](ChunkTiming::blend). Actions of the new chunk that are due before the
//! blend are skipped. After the end of a chunk, its last action is held. Source: Black, Galliker and Levine,
//! "Real-Time Execution of Action Chunking Flow Policies" (2025): the frozen prefix. Unlike the paper, which
//! in-paints the rest of the chunk with the network, the plan blends actions.

/// Number of points of the previous plan stored for the blend into a new chunk.
const FADE_POINTS: usize = 64;
/// Maximum time from now to the first action of a chunk \[ns\].
const MOST_AHEAD: u64 = 10_000_000_000;

/// Timing of the transition between chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChunkTiming {
    /// Time for which the previous plan remains active after the arrival of a chunk \[ns\].
    pub frozen: u64,
    /// Duration of the blend into the new chunk \[ns\].
    pub blend: u64,
}

/// A chunk of consecutive actions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chunk<'a> {
    /// Time of the first action \[ns\]; 0 means the time of arrival.
    pub time: u64,
    /// Time between two actions \[ns\], above 0.
    pub period: u64,
    /// Sequence number assigned by the producer.
    pub sequence: u64,
    /// Number of values of an action.
    pub width: usize,
    /// Values of all actions, action by action.
    pub values: &'a [f64],
}

/// Timing of an accepted chunk, relative to the time at which it arrived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChunkArrival {
    /// Number of actions in the chunk.
    pub actions: usize,
    /// Number of actions whose time had passed when the chunk arrived.
    pub late: usize,
    /// Delay of the arrival after the first action \[ns\]; 0 if the chunk arrived before its first action.
    pub delay: u64,
}

/// Error of a chunk that was not accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ChunkError {
    /// The number of values per action differs from the number of joints of the policy.
    #[error("each action has {found} numbers, expected {expected}, one for each joint")]
    Width {
        /// Number of values of an action.
        found: usize,
        /// Number of joints of the policy.
        expected: usize,
    },
    /// The chunk contains no action, or an incomplete action.
    #[error("the chunk has {count} numbers, expected whole actions of {width} numbers")]
    Uneven {
        /// Number of values of the chunk.
        count: usize,
        /// Number of values of an action.
        width: usize,
    },
    /// The chunk has more values than the plan can store.
    #[error("the chunk has {count} numbers, expected at most {most}")]
    Long {
        /// Number of values of the chunk.
        count: usize,
        /// Maximum number of values.
        most: usize,
    },
    /// The period is 0, or the end of the chunk overflows the clock.
    #[error("the period is {period} ns, expected more than 0 and an end within the range of the clock")]
    Period {
        /// Time between two actions \[ns\].
        period: u64,
    },
    /// The first action is too far in the future.
    #[error("the first action is {ahead} ns in the future, expected at most 10 s")]
    Future {
        /// Lead of the first action over the current time \[ns\].
        ahead: u64,
    },
    /// The chunk has already been accepted.
    #[error("the chunk repeats the current chunk")]
    Repeated,
    /// The chunk starts earlier than the current chunk.
    #[error("the chunk starts {by} ns before the current chunk")]
    OutOfOrder {
        /// Difference between the times of the first actions \[ns\].
        by: u64,
    },
    /// The time of the last action has passed.
    #[error("the chunk arrived too late: its last action was due {by} ns earlier")]
    Late {
        /// Time since the last action \[ns\].
        by: u64,
    },
}

/// Evenly spaced actions.
#[derive(Clone, Debug)]
struct Track {
    start: u64,
    period: u64,
    steps: usize,
    values: Vec<f64>,
}

impl Track {
    fn new(numbers: usize) -> Self {
        Self { start: 0, period: 1, steps: 0, values: vec![0.0; numbers] }
    }

    fn end(&self) -> u64 {
        self.start + self.period * (self.steps.saturating_sub(1)) as u64
    }

    /// Returns the indices of the two actions around a time, and the weight of the second.
    fn about(&self, now: u64) -> (usize, usize, f64) {
        let since = now.saturating_sub(self.start);
        let last = self.steps - 1;
        let first = usize::try_from(since / self.period).unwrap_or(usize::MAX);
        if first >= last {
            return (last, last, 0.0);
        }
        (first, first + 1, (since % self.period) as f64 / self.period as f64)
    }

    fn sample(&self, now: u64, width: usize, joint: usize) -> f64 {
        let (first, second, share) = self.about(now);
        let [one, other] = [first, second].map(|step| self.values[step * width + joint]);
        one + share * (other - one)
    }
}

/// A plan of joint targets composed of successive chunks. Only [`new`](Self::new) allocates.
///
/// ```
/// use motorium_models::policy::{Chunk, ChunkPlan, ChunkTiming};
///
/// let mut plan = ChunkPlan::new(1, 8, ChunkTiming { frozen: 0, blend: 0 });
/// plan.start(&[0.0]);
/// let chunk = Chunk { time: 100, period: 10, sequence: 1, width: 1, values: &[1.0, 2.0, 3.0] };
/// let arrival = plan.accept(115, chunk, |_, action| action)?;
/// assert_eq!((arrival.late, arrival.delay), (2, 15)); // the actions for 100 and 110
/// let mut target = [0.0];
/// plan.sample(115, &mut target);
/// assert_eq!(target, [2.5]);
/// plan.sample(900, &mut target);
/// assert_eq!(target, [3.0]);
/// # Ok::<(), motorium_models::policy::ChunkError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ChunkPlan {
    width: usize,
    most: usize,
    timing: ChunkTiming,
    /// Targets before the first chunk.
    rest: Vec<f64>,
    /// The current chunk, its number, and the start and end of its blend.
    current: Track,
    sequence: u64,
    fade: [u64; 2],
    /// The previous plan, until the blend has finished.
    before: Track,
    /// Storage for the next `before`.
    spare: Vec<f64>,
}

impl ChunkPlan {
    /// Creates a plan for `width` joints and chunks of at most `most` values.
    pub fn new(width: usize, most: usize, timing: ChunkTiming) -> Self {
        Self {
            width,
            most,
            timing,
            rest: vec![0.0; width],
            current: Track::new(most),
            sequence: 0,
            fade: [0; 2],
            before: Track::new(FADE_POINTS * width),
            spare: vec![0.0; FADE_POINTS * width],
        }
    }

    /// Discards all chunks and holds `targets`.
    ///
    /// # Panics
    ///
    /// If the number of targets differs from the number of joints.
    pub fn start(&mut self, targets: &[f64]) {
        self.rest.copy_from_slice(targets);
        self.current.steps = 0;
    }

    /// Returns the time of the last action \[ns\]; `None` before the first chunk.
    pub fn end(&self) -> Option<u64> {
        (self.current.steps > 0).then(|| self.current.end())
    }

    /// Accepts a chunk that arrives at the time `now` \[ns\], and blends into the new chunk.
    /// `target(joint, value)` must convert a joint's value in an action to the target of the joint.
    ///
    /// # Errors
    ///
    /// [`ChunkError`] if the chunk is invalid or too late. The plan is then unchanged.
    pub fn accept(
        &mut self,
        now: u64,
        chunk: Chunk<'_>,
        target: impl Fn(usize, f64) -> f64,
    ) -> Result<ChunkArrival, ChunkError> {
        let Chunk { time, period, sequence, width, values } = chunk;
        if width != self.width {
            return Err(ChunkError::Width { found: width, expected: self.width });
        }
        let count = values.len();
        if count == 0 || !count.is_multiple_of(width) {
            return Err(ChunkError::Uneven { count, width });
        }
        if count > self.most {
            return Err(ChunkError::Long { count, most: self.most });
        }
        let steps = count / width;
        let is_current = self.current.steps > 0;
        if is_current && sequence == self.sequence && (time == 0 || time == self.current.start) {
            return Err(ChunkError::Repeated);
        }
        let start = if time == 0 { now } else { time };
        let length = period.checked_mul(steps as u64 - 1).filter(|_| period > 0);
        let end = length.and_then(|length| start.checked_add(length)).ok_or(ChunkError::Period { period })?;
        if start.saturating_sub(now) > MOST_AHEAD {
            return Err(ChunkError::Future { ahead: start - now });
        }
        if is_current && start < self.current.start {
            return Err(ChunkError::OutOfOrder { by: self.current.start - start });
        }
        if end < now {
            return Err(ChunkError::Late { by: now - end });
        }
        let from = now.saturating_add(self.timing.frozen).max(start);
        let until = from.saturating_add(self.timing.blend);
        self.keep(now, until);
        (self.sequence, self.fade) = (sequence, [from, until]);
        let track = &mut self.current;
        (track.start, track.period, track.steps) = (start, period, steps);
        for (action, slots) in values.chunks_exact(width).zip(track.values.chunks_exact_mut(width)) {
            for (joint, (slot, value)) in slots.iter_mut().zip(action).enumerate() {
                *slot = target(joint, *value);
            }
        }
        let delay = now.saturating_sub(start);
        let late = delay.div_ceil(period).min(steps as u64) as usize;
        Ok(ChunkArrival { actions: steps, late, delay })
    }

    /// Stores the current plan between two times.
    fn keep(&mut self, now: u64, until: u64) {
        let mut spare = core::mem::take(&mut self.spare);
        let period = (until.saturating_sub(now) / (FADE_POINTS as u64 - 1)).saturating_add(1);
        for (point, targets) in spare.chunks_exact_mut(self.width).enumerate() {
            self.sample(now.saturating_add(period.saturating_mul(point as u64)), targets);
        }
        self.spare = core::mem::replace(&mut self.before.values, spare);
        (self.before.start, self.before.period, self.before.steps) = (now, period, FADE_POINTS);
    }

    /// Writes the joint targets at the time `now` \[ns\].
    ///
    /// # Panics
    ///
    /// If the number of targets differs from the number of joints.
    pub fn sample(&self, now: u64, targets: &mut [f64]) {
        assert_eq!(targets.len(), self.width, "one target for each joint");
        if self.current.steps == 0 {
            targets.copy_from_slice(&self.rest);
            return;
        }
        let [from, until] = self.fade;
        let share = if now >= until {
            1.0
        } else if now <= from {
            0.0
        } else {
            let share = (now - from) as f64 / (until - from) as f64;
            share * share * (3.0 - 2.0 * share)
        };
        for (joint, target) in targets.iter_mut().enumerate() {
            let [before, new] =
                [&self.before, &self.current].map(|track| track.sample(now, self.width, joint));
            // exactly one of the two outside the blend
            *target = if share >= 1.0 { new } else { before + share * (new - before) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn plan(frozen: u64, blend: u64) -> ChunkPlan {
        let mut plan = ChunkPlan::new(1, 100, ChunkTiming { frozen: frozen * MS, blend: blend * MS });
        plan.start(&[0.0]);
        plan
    }

    fn chunk(time: u64, sequence: u64, values: &[f64]) -> Chunk<'_> {
        Chunk { time: time * MS, period: 20 * MS, sequence, width: 1, values }
    }

    fn target(plan: &ChunkPlan, now: u64) -> f64 {
        let mut target = [f64::NAN];
        plan.sample(now * MS, &mut target);
        target[0]
    }

    #[test]
    fn new_chunk_keeps_the_frozen_prefix_and_fades_in() {
        let mut plan = plan(40, 100);
        let line: Vec<f64> = (0..30).map(f64::from).collect();
        plan.accept(1000 * MS, chunk(1000, 1, &line), |_, value| value).expect("a first chunk");
        assert_eq!(target(&plan, 1040), 0.0, "it fades in from rest");
        assert_eq!(target(&plan, 1140), 7.0);
        let before: Vec<f64> = (1200..1240).map(|now| target(&plan, now)).collect();
        let high = [100.0; 30];
        let arrival =
            plan.accept(1200 * MS, chunk(1150, 2, &high), |_, value| value).expect("a second chunk");
        assert_eq!(arrival, ChunkArrival { actions: 30, late: 3, delay: 50 * MS });
        for (now, before) in (1200..1240).zip(before) {
            assert!((target(&plan, now) - before).abs() < 1e-9, "{now}: frozen");
        }
        assert!((target(&plan, 1290) - 57.25).abs() < 1e-3, "half of each: {}", target(&plan, 1290));
        assert_eq!(target(&plan, 1340), 100.0);
        // a third chunk in the middle of a blend starts at the current plan
        plan.accept(1390 * MS, chunk(1390, 3, &[0.0; 30]), |_, value| value).expect("a third chunk");
        let before: Vec<f64> = (1480..1520).map(|now| target(&plan, now)).collect();
        assert!(before[0] > 40.0 && before[39] < 10.0, "{before:?}");
        plan.accept(1480 * MS, chunk(1480, 4, &high), |_, value| value).expect("a fourth chunk");
        for (now, before) in (1480..1520).zip(before) {
            assert!((target(&plan, now) - before).abs() < 0.05, "{now}");
        }
        assert_eq!(target(&plan, 1620), 100.0);
    }

    #[test]
    fn rejected_chunks_leave_the_plan_unchanged() {
        let mut plan = plan(0, 0);
        plan.accept(100 * MS, chunk(100, 7, &[1.0, 2.0]), |_, value| value).expect("a chunk");
        let line = [3.0; 4];
        for (now, chunk, error) in [
            (110, chunk(100, 7, &[1.0, 2.0]), ChunkError::Repeated),
            (110, chunk(90, 6, &line), ChunkError::OutOfOrder { by: 10 * MS }),
            (200, chunk(110, 8, &line), ChunkError::Late { by: 30 * MS }),
            (110, chunk(20_000, 8, &line), ChunkError::Future { ahead: 19_890 * MS }),
            (110, Chunk { period: 0, ..chunk(110, 8, &line) }, ChunkError::Period { period: 0 }),
            (
                110,
                Chunk { period: u64::MAX / 2, ..chunk(110, 8, &line) },
                ChunkError::Period { period: u64::MAX / 2 },
            ),
            (110, Chunk { width: 2, ..chunk(110, 8, &line) }, ChunkError::Width { found: 2, expected: 1 }),
            (110, chunk(110, 8, &[]), ChunkError::Uneven { count: 0, width: 1 }),
            (110, chunk(110, 8, &[0.0; 101]), ChunkError::Long { count: 101, most: 100 }),
        ] {
            assert_eq!(plan.accept(now * MS, chunk, |_, value| value), Err(error));
            assert_eq!((target(&plan, 110), plan.end()), (1.5, Some(120 * MS)), "{error}");
        }
        assert_eq!(target(&plan, 5000), 2.0, "the last action holds");
    }
}
