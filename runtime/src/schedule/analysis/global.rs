//! Response times of `SCHED_DEADLINE` components under global earliest deadline first, ahead of all
//! priorities.
//!
//! The kernel runs each component in a *reservation* (constant bandwidth server, L. Abeni, G. Buttazzo 1998),
//! which gets its run time in every period, but no more. A set of reservations meets its deadlines on `m`
//! cores if either of two tests succeeds:
//!
//! * density: `sum of d_i <= m - (m - 1) * max d_i`, with `d_i` run time by period (J. Goossens, S. Funk, S.
//!   Baruah, *Priority-driven scheduling of periodic task systems on multiprocessors*, 2003);
//! * response times: the smallest solution of
//!
//! ```text
//! R_k = C_k + floor(1/m * sum over others of min(W_i(R_k), I_i(D_k), R_k - C_k + 1))
//! ```
//!
//! where `W_i` is the longest time another reservation can run in a window of that length, and `I_i` the part
//! of it with an earlier deadline (M. Bertogna, M. Cirinei, *Response-time analysis for globally scheduled
//! symmetric multiprocessor platforms*, 2007). Slack found for one reservation lowers the bounds of the
//! others, so the bounds are iterated.
//!
//! Wake-ups may be late by a jitter; the kernel counts deadlines from the actual wake-up. All times are in
//! ns.

/// Number of rounds after which the iteration stops; the bounds reached so far are valid.
const MOST_ROUNDS: usize = 100;
/// Number of steps of a fixed-point iteration after which there is no bound.
const MOST_STEPS: usize = 100_000;

/// Times of one reservation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::schedule) struct Reserved {
    /// Run time in each period, ns.
    pub runtime: i64,
    /// Period, which is also the relative deadline from the wake-up, ns.
    pub period: i64,
}

/// Reservations that share the same cores.
#[derive(Debug, Clone)]
pub(in crate::schedule) struct Global {
    reserved: Vec<Reserved>,
    cores: i64,
    /// Lateness of a wake-up.
    jitter: i64,
    /// Slack: the time by which each reservation is known to finish before its deadline.
    slack: Vec<i64>,
    in_time: bool,
}

impl Global {
    /// Analyses a set of reservations.
    pub(in crate::schedule) fn analyse(reserved: Vec<Reserved>, cores: usize, jitter: i64) -> Self {
        let slack = vec![0; reserved.len()];
        let cores = i64::try_from(cores.max(1)).unwrap_or(1);
        let mut global = Self { reserved, cores, jitter, slack, in_time: false };
        let dense = global.is_dense_enough();
        for _ in 0..MOST_ROUNDS {
            let found: Vec<Option<i64>> =
                (0..global.reserved.len()).map(|k| global.iterate(k, global.reserved[k].runtime)).collect();
            global.in_time = dense || found.iter().all(Option::is_some);
            let mut changed = false;
            for (k, response) in found.into_iter().enumerate() {
                let slack = response.map_or(0, |response| global.reserved[k].period - response);
                changed |= slack > global.slack[k];
                global.slack[k] = global.slack[k].max(slack);
            }
            if !changed {
                break;
            }
        }
        global
    }

    /// Returns the longest time from the wake-up of a reservation to the end of `work` of its run time;
    /// `None` without a bound.
    pub(in crate::schedule) fn response(&self, index: usize, work: i64) -> Option<i64> {
        let Reserved { runtime, period } = self.reserved[index];
        // The bounds assume that every reservation meets its deadline; only the run time is guaranteed.
        if !self.in_time || work > runtime {
            return None;
        }
        Some(self.iterate(index, work).unwrap_or(period))
    }

    fn is_dense_enough(&self) -> bool {
        let density = |reserved: &Reserved| {
            let between = reserved.period - self.jitter;
            if between > 0 { reserved.runtime as f64 / between as f64 } else { f64::INFINITY }
        };
        let sum: f64 = self.reserved.iter().map(density).sum();
        let most = self.reserved.iter().map(density).fold(0.0, f64::max);
        sum <= self.cores as f64 - (self.cores - 1) as f64 * most && most <= 1.0
    }

    /// Returns the smallest solution of the equation above for a reservation with this work, if it is before
    /// the deadline.
    fn iterate(&self, index: usize, work: i64) -> Option<i64> {
        let deadline = self.reserved[index].period;
        let mut response = work;
        for _ in 0..MOST_STEPS {
            if response > deadline {
                return None;
            }
            let others = (0..self.reserved.len()).filter(|other| *other != index);
            let interference: i64 = others
                .map(|other| {
                    let most = self.workload(other, response).min(self.earlier(other, deadline));
                    most.min(response - work + 1)
                })
                .sum();
            let next = work + interference / self.cores;
            if next <= response {
                return Some(response);
            }
            response = next;
        }
        None
    }

    /// Returns the work of one component in a window of this length, with its first job as late as possible
    /// and the others as soon as possible.
    fn workload(&self, index: usize, length: i64) -> i64 {
        let Reserved { runtime, period } = self.reserved[index];
        let span = (length + self.jitter + period - runtime - self.slack[index]).max(0);
        let whole = span / period;
        whole * runtime + runtime.min(span - whole * period)
    }

    /// Returns the work of one component between a wake-up and the following deadline, counting only jobs
    /// whose own deadline is not later.
    fn earlier(&self, index: usize, deadline: i64) -> i64 {
        let Reserved { runtime, period } = self.reserved[index];
        let span = deadline + self.jitter;
        let whole = span / period;
        whole * runtime + runtime.min((span - whole * period - self.slack[index]).max(0))
    }
}
