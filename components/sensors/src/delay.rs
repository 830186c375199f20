//! Delay of readings by their latency.

/// A delay line for time-stamped frames of values. A frame sampled at `t` becomes readable at `t + latency`,
/// exact to the nanosecond.
///
/// If several frames become due between two reads, only the newest frame is returned. Memory for all frames
/// in flight is allocated at construction.
#[derive(Clone, Debug)]
pub struct DelayLine {
    latency: u64,
    width: usize,
    /// Ring of frames, oldest first from `head`. After the first read, the oldest frame is the one read last.
    times: Vec<u64>,
    /// A caller-defined value per frame, returned with it.
    notes: Vec<u64>,
    values: Vec<f64>,
    head: usize,
    count: usize,
    lost: u64,
}

impl DelayLine {
    /// Creates a line for frames of `width` values that arrive at least `shortest_period` \[ns\] apart and
    /// are delayed by `latency_ns` \[ns\].
    ///
    /// If frames arrive faster, the oldest frames are discarded and counted by [`lost`](Self::lost).
    pub fn new(latency_ns: u64, width: usize, shortest_period: u64) -> Self {
        // When the last frame was read, its successor was not yet due. One period later, the successor is
        // less than the latency plus two periods old. It, the new frame and all in between must fit.
        let capacity = (latency_ns / shortest_period.max(1)) as usize + 3;
        Self {
            latency: latency_ns,
            width,
            times: vec![0; capacity],
            notes: vec![0; capacity],
            values: vec![0.0; capacity * width],
            head: 0,
            count: 0,
            lost: 0,
        }
    }

    /// Returns the maximum number of frames in flight.
    pub fn capacity(&self) -> usize {
        self.times.len()
    }

    /// Returns the number of frames discarded before they were due because frames arrived closer together
    /// than `shortest_period`.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Removes all frames.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Adds a frame sampled at `time` \[ns\] and returns its slice, which the caller fills. A time earlier
    /// than the last frame's means that the clock was restarted, and clears the line.
    pub fn push(&mut self, time: u64) -> &mut [f64] {
        self.push_noted(time, 0)
    }

    /// Adds a frame like [`push`](Self::push), and attaches `note` to the frame, for example a second time
    /// stamp. [`read_noted`](Self::read_noted) returns the note with the frame.
    pub fn push_noted(&mut self, time: u64, note: u64) -> &mut [f64] {
        if self.count > 0 && time < self.times[self.slot(self.count - 1)] {
            self.clear();
        }
        if self.count == self.capacity() {
            self.lost += 1;
            self.drop_oldest();
        }
        let slot = self.slot(self.count);
        self.count += 1;
        self.times[slot] = time;
        self.notes[slot] = note;
        &mut self.values[slot * self.width..(slot + 1) * self.width]
    }

    /// Returns the newest frame that is due at `now` \[ns\], with its sampling time \[ns\]. A frame stays
    /// readable until the next frame is due. Returns `None` until the first frame is due.
    pub fn read(&mut self, now: u64) -> Option<(u64, &[f64])> {
        self.read_noted(now).map(|(time, _, values)| (time, values))
    }

    /// Reads a frame like [`read`](Self::read), and also returns the note of the frame, which is 0 for a
    /// frame pushed without a note.
    pub fn read_noted(&mut self, now: u64) -> Option<(u64, u64, &[f64])> {
        while self.count > 1 && self.is_due(1, now) {
            self.drop_oldest();
        }
        if self.count == 0 || !self.is_due(0, now) {
            return None;
        }
        let slot = self.slot(0);
        Some((self.times[slot], self.notes[slot], &self.values[slot * self.width..(slot + 1) * self.width]))
    }

    fn is_due(&self, index: usize, now: u64) -> bool {
        self.times[self.slot(index)].saturating_add(self.latency) <= now
    }

    fn drop_oldest(&mut self) {
        self.head = self.slot(1);
        self.count -= 1;
    }

    fn slot(&self, index: usize) -> usize {
        (self.head + index) % self.capacity()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_is_due_at_its_latency_to_the_nanosecond() {
        let mut line = DelayLine::new(1500, 1, 1000);
        line.push(10_000)[0] = 7.0;
        assert_eq!(line.read(11_499), None);
        assert_eq!(line.read(11_500), Some((10_000, &[7.0][..])));
        assert_eq!(line.read(99_000), Some((10_000, &[7.0][..])), "the last reading stays available");
    }

    #[test]
    fn frame_without_latency_is_due_immediately() {
        let mut line = DelayLine::new(0, 2, 1000);
        line.push(5).copy_from_slice(&[1.0, 2.0]);
        assert_eq!(line.read(5), Some((5, &[1.0, 2.0][..])));
    }

    #[test]
    fn newest_of_several_due_frames_is_read() {
        let mut line = DelayLine::new(3000, 1, 1000);
        for time in [0, 1000, 2000, 3000] {
            line.push(time)[0] = time as f64;
        }
        assert_eq!(line.read(5500), Some((2000, &[2000.0][..])));
        assert_eq!(line.lost(), 0);
    }

    #[test]
    fn stream_at_the_announced_rate_loses_no_frame() {
        for latency in [0, 1, 999, 1000, 1001, 7300, 10_000] {
            let mut line = DelayLine::new(latency, 1, 1000);
            for k in 0..200_u64 {
                line.push(1000 * k)[0] = k as f64;
                let expected = (1000 * k).checked_sub(latency).map(|age| age / 1000);
                assert_eq!(line.read(1000 * k).map(|(time, _)| time / 1000), expected, "latency {latency}");
            }
            assert_eq!(line.lost(), 0, "latency {latency}");
        }
    }

    #[test]
    fn excess_frames_discard_the_oldest_and_are_counted() {
        let mut line = DelayLine::new(4000, 1, 1000);
        for time in 0..20 {
            line.push(time)[0] = time as f64;
        }
        assert_eq!(line.lost(), 20 - line.capacity() as u64);
        assert_eq!(line.read(100_000), Some((19, &[19.0][..])));
    }

    #[test]
    fn clock_restart_clears_the_line() {
        let mut line = DelayLine::new(100, 1, 1000);
        line.push(50_000)[0] = 1.0;
        line.push(10)[0] = 2.0;
        assert_eq!(line.read(60), None);
        assert_eq!(line.read(110), Some((10, &[2.0][..])));
    }
}
