//! Tells when nothing ran on a computer for a while: it sleeps for a millisecond again and again, and prints
//! a line where that took much longer, until it is ended.
//!
//! A line is the seconds since the computer started, the milliseconds that the sleep took, and those of them
//! in which its processors were idle. At the highest priority nothing but the kernel can hold it up, and
//! where the processor was idle meanwhile not even that did: then the clock of the machine leapt over its
//! release.

use std::fs::File;
use std::io::Error;
use std::os::unix::fs::FileExt as _;
use std::time::{Duration, Instant};

/// A sleep.
const SLEEP: Duration = Duration::from_millis(1);
/// Sleeps of at least this duration are reported.
const LONG: Duration = Duration::from_millis(3);

/// The seconds since the computer started, and those in which its processors were idle.
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
