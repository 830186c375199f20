//! Reports intervals in which nothing ran on a computer. The program repeatedly sleeps for a millisecond, and
//! prints a line whenever the sleep took much longer, until it is terminated.
//!
//! A line contains the seconds since the computer started, the duration of the sleep in milliseconds, and for
//! how many of these milliseconds the processors were idle. At the highest priority, only the kernel can
//! delay this program. If the processor was idle, the kernel did not delay it either: the clock of the
//! machine jumped beyond the release time.

use std::fs::File;
use std::io::Error;
use std::os::unix::fs::FileExt as _;
use std::time::{Duration, Instant};

/// A sleep.
const SLEEP: Duration = Duration::from_millis(1);
/// Sleeps of at least this duration are reported.
const LONG: Duration = Duration::from_millis(3);

/// Returns the seconds since the computer started, and the seconds in which its processors were idle.
fn uptime(file: &File) -> Result<[f64; 2], Error> {
    let mut text = [0; 64];
    let length = file.read_at(&mut text, 0)?;
    let text = String::from_utf8_lossy(&text[..length]);
    let mut numbers = text.split_whitespace().map(|number| number.parse().map_err(Error::other));
    let mut next = || numbers.next().unwrap_or_else(|| Err(Error::other("/proc/uptime is too short")));
    Ok([next()?, next()?])
}

fn main() -> Result<(), Error> {
    let file = File::open("/proc/uptime")?;
    loop {
        let [_, idle_before] = uptime(&file)?;
        let before = Instant::now();
        std::thread::sleep(SLEEP);
        let slept = before.elapsed();
        if slept >= LONG {
            let [now, idle] = uptime(&file)?;
            println!("{now:.2} {:.3} {:.0}", slept.as_secs_f64() * 1e3, (idle - idle_before) * 1e3);
        }
    }
}
