//! A limit on the idle states of all cores.

use std::fs::File;
use std::io::{self, Write as _};
use std::time::Duration;

/// Kernel file for requests; each is in force while its file is open.
const REQUESTS: &str = "/dev/cpu_dma_latency";

/// A limit on the exit latency of idle states on all cores (Linux, *PM Quality Of Service Interface*). It is
/// in force until this value is dropped or the process ends in any way.
///
/// In a virtual machine whose guest polls before it halts (`haltpoll`), a limit of zero prevents the host
/// from reassigning idle processors. They then wake up in a fraction of the time and with warm caches.
#[derive(Debug)]
pub struct IdleLimit(#[expect(dead_code, reason = "held open")] File);

impl IdleLimit {
    /// Requests a limit, rounded down to microseconds. If there are several requests, the shortest limit
    /// applies.
    ///
    /// # Errors
    /// The process is not permitted to set a limit (only root is), or the system does not support limits.
    pub fn hold(limit: Duration) -> io::Result<Self> {
        let mut requests = File::options().write(true).open(REQUESTS)?;
        let limit_us = i32::try_from(limit.as_micros()).unwrap_or(i32::MAX);
        requests.write_all(&limit_us.to_ne_bytes())?;
        Ok(Self(requests))
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use super::*;

    fn held() -> i32 {
        let mut bytes = [0; 4];
        File::open(REQUESTS).unwrap().read_exact(&mut bytes).unwrap();
        i32::from_ne_bytes(bytes)
    }

    #[test]
    fn limit_is_in_force_until_it_is_dropped() {
        let Ok(before) = File::open(REQUESTS).map(|_| held()) else {
            return eprintln!("skipped: this process may not open {REQUESTS}");
        };
        let Ok(limit) = IdleLimit::hold(Duration::from_micros(3)) else {
            return eprintln!("skipped: this process may not open {REQUESTS}");
        };
        assert!(held() <= 3);
        let shorter = IdleLimit::hold(Duration::from_nanos(900)).unwrap();
        assert_eq!(held(), 0);
        drop((limit, shorter));
        assert_eq!(held(), before);
    }
}
