//! Delay of commands and measurements.

use std::collections::VecDeque;

/// A delay line for commands. A command sent at `t` takes effect at `t + delay`, and remains active until the
/// next command takes effect.
///
/// ```
/// use motorium_robots::Delay;
///
/// let mut delay = Delay::new(2e-3, 0);
/// let mut acting = |command: i32| {
///     let now = delay.acting(command);
///     delay.advance(command, 1e-3);
///     now
/// };
/// assert_eq!([acting(1), acting(2), acting(3), acting(4)], [0, 0, 1, 2]);
/// ```
#[derive(Debug, PartialEq)]
pub struct Delay<T> {
    delay_ns: u64,
    now_ns: u64,
    idle: T,
    /// Commands in flight with the time at which they take effect, oldest first; the first may already be
    /// active.
    queue: VecDeque<(u64, T)>,
}

impl<T: Copy> Clone for Delay<T> {
    /// Keeps the capacity, so the copy does not allocate more often.
    fn clone(&self) -> Self {
        let mut queue = VecDeque::with_capacity(self.queue.capacity());
        queue.extend(&self.queue);
        Self { delay_ns: self.delay_ns, now_ns: self.now_ns, idle: self.idle, queue }
    }
}

impl<T: Copy> Delay<T> {
    /// Creates a delay line with the delay `delay` \[s\]. `idle` is active until the first command takes
    /// effect. The queue has room for all delayed commands if a step lasts at least 0.1 ms; shorter steps may
    /// allocate.
    pub fn new(delay: f64, idle: T) -> Self {
        let delay_ns = nanoseconds(delay);
        let queue = VecDeque::with_capacity((delay_ns / 100_000) as usize + 3);
        Self { delay_ns, now_ns: 0, idle, queue }
    }

    /// Sets the delay \[s\] of commands that are sent after this call. If the delay becomes shorter, a new
    /// command replaces earlier commands that would take effect after it.
    pub fn set_delay(&mut self, delay: f64) {
        self.delay_ns = nanoseconds(delay);
        let room = (self.delay_ns / 100_000) as usize + 3;
        self.queue.reserve(room.saturating_sub(self.queue.len()));
    }

    /// Returns the command that is in effect now, assuming that `newest` is sent now.
    pub fn acting(&self, newest: T) -> T {
        if self.delay_ns == 0 {
            return newest;
        }
        let arrived = self.queue.iter().take_while(|(due, _)| *due <= self.now_ns);
        arrived.last().map_or(self.idle, |(_, command)| *command)
    }

    /// Sends the command `newest` now, then advances the time by `dt` \[s\].
    pub fn advance(&mut self, newest: T, dt: f64) {
        if self.delay_ns == 0 {
            return;
        }
        let due = self.now_ns + self.delay_ns;
        // After the delay has been shortened, drop earlier commands that would arrive later.
        while self.queue.back().is_some_and(|(other, _)| *other > due) {
            self.queue.pop_back();
        }
        self.queue.push_back((due, newest));
        self.now_ns += nanoseconds(dt);
        // the active command stays in the queue
        while self.queue.get(1).is_some_and(|(due, _)| *due <= self.now_ns) {
            self.queue.pop_front();
        }
    }

    /// Resets to the initial state, without delayed commands.
    pub fn reset(&mut self) {
        self.queue.clear();
        self.now_ns = 0;
    }
}

fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}
