//! Units of time: named by a column, or recognised by magnitude.

use crate::error::{Place, RecordingError};

/// Unit of the numbers of a time column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Unit {
    /// Unit stated by the name of the column, s.
    Named(f64),
    /// Unit recognised by the magnitude of the numbers.
    Recognised,
}

/// Source of the sample times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Clock {
    /// Index of a column of times, and their unit.
    Time(usize, Unit),
    /// Index of a column of time steps, and their unit.
    Step(usize, Unit),
    /// A number of samples per second.
    Rate(f64),
}

/// Seconds since 1970 of the years 2001 to 2286; ms, us and ns are 10^3, 10^6 and 10^9 times larger.
const SINCE_1970: std::ops::Range<f64> = 1e9..1e10;
/// Interval from which numbers without a unit are not interpreted as seconds, because movements are sampled
/// faster.
const SLOW: f64 = 5.0;
/// Interval and duration from which numbers without a unit are not interpreted as seconds: too few samples
/// for such a long recording.
const SLOW_AND_LONG: (f64, f64) = (1.0, 60.0);
/// Interval below which numbers without a unit are not interpreted as seconds. Movements are not sampled at
/// more than 100 kHz, and times in days have such intervals.
const FAST: f64 = 1e-5;
/// Largest interval in a recording, in typical intervals and in s. A longer one means that the clock was set.
const LARGEST_GAP: (f64, f64) = (1000.0, 60.0);

/// Returns the unit of the numbers \[s\].
fn unit(clock: Clock, numbers: &[(Place, f64)]) -> Result<f64, RecordingError> {
    let unit = match clock {
        Clock::Rate(_) => return Ok(1.0),
        Clock::Time(_, unit) | Clock::Step(_, unit) => unit,
    };
    let Unit::Recognised = unit else {
        let Unit::Named(seconds) = unit else { return Ok(1.0) };
        return named(clock, numbers, seconds).map(|()| seconds);
    };
    let Some((place, last)) = numbers.last() else { return Ok(1.0) };
    if let Clock::Time(..) = clock
        && let Some(seconds) = unit_since_1970(numbers[0].1, *last)
    {
        return Ok(seconds);
    }
    let interval = match clock {
        Clock::Time(..) => median(numbers.windows(2).map(|pair| pair[1].1 - pair[0].1).collect()),
        _ => median(numbers.iter().map(|(_, step)| *step).collect()),
    };
    let length = interval * (numbers.len() - 1) as f64;
    let is_fast = interval > 0.0 && interval < FAST;
    if is_fast || interval >= SLOW || (interval >= SLOW_AND_LONG.0 && length >= SLOW_AND_LONG.1) {
        return Err(RecordingError::Malformed {
            place: Box::new(place.clone()),
            found: format!("times {interval} apart, without a unit"),
            expected: "seconds".into(),
            advice: Some("name the column `time_s`, `time_ms`, `time_us` or `time_ns`"),
        });
    }
    Ok(1.0)
}

/// Returns the unit in which two numbers are times since 1970 \[s\], if any.
fn unit_since_1970(first: f64, last: f64) -> Option<f64> {
    let fits =
        |seconds: &f64| SINCE_1970.contains(&(first * seconds)) && SINCE_1970.contains(&(last * seconds));
    [1.0, 1e-3, 1e-6, 1e-9].into_iter().find(fits)
}

/// Refuses times with a named unit that are after the year 2286 in it, and times since 1970 in a smaller one.
fn named(clock: Clock, numbers: &[(Place, f64)], seconds: f64) -> Result<(), RecordingError> {
    let ([(_, first), ..], Some((place, last)), Clock::Time(..)) = (numbers, numbers.last(), clock) else {
        return Ok(());
    };
    let is_late = first * seconds >= SINCE_1970.end;
    match unit_since_1970(*first, *last).filter(|unit| is_late && unit < &seconds) {
        None => Ok(()),
        Some(_) => Err(RecordingError::Malformed {
            place: Box::new(place.clone()),
            found: format!("the time {last} in units of {seconds} s"),
            expected: "a time before the year 2286".into(),
            advice: Some("name the unit of the numbers: `time_s`, `time_ms`, `time_us` or `time_ns`"),
        }),
    }
}

fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or_default()
}

/// Converts the numbers of a time column to times of samples, s.
///
/// # Errors
/// Times do not increase, the unit of the numbers is unclear, or a gap shows that the clock was set.
pub(crate) fn timed(
    clock: Clock,
    samples: impl Iterator<Item = (Place, Option<f64>)>,
) -> Result<Vec<f64>, RecordingError> {
    let numbers: Vec<(Place, f64)> =
        samples.map(|(place, number)| (place, number.unwrap_or_default())).collect();
    let seconds = unit(clock, &numbers)?;
    let mut times: Vec<f64> = Vec::with_capacity(numbers.len());
    let mut step = 0.0;
    for (k, (place, number)) in numbers.iter().enumerate() {
        let time = match clock {
            Clock::Rate(rate) => k as f64 / rate,
            Clock::Time(..) => number * seconds,
            // the number of a sample is the time until the next one
            Clock::Step(..) => times.last().map_or(0.0, |last| last + step),
        };
        if times.last().is_some_and(|last| time <= *last) {
            let before = times[k - 1];
            return Err(RecordingError::Malformed {
                place: Box::new(place.clone()),
                found: format!("the time {time} s after {before} s"),
                expected: "times that increase".into(),
                advice: Some("sort the recording, or cut it where the clock was reset"),
            });
        }
        times.push(time);
        step = number * seconds;
    }
    let intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let usual = median(intervals.clone());
    let is_gap = |interval: &f64| *interval > LARGEST_GAP.0 * usual && *interval > LARGEST_GAP.1;
    if let Some(k) = intervals.iter().position(is_gap) {
        return Err(RecordingError::Malformed {
            place: Box::new(numbers[k + 1].0.clone()),
            found: format!("{} s since the previous sample, usually {usual} s", intervals[k]),
            expected: "times of one clock".into(),
            advice: Some("cut the recording where the clock was set"),
        });
    }
    Ok(times)
}
