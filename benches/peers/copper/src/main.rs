//! The caterpillar of 17 tasks on copper: `copper-caterpillar LOG COUNT` prints the latency from the source
//! to the last sink, ns, as a JSON list. Copper is one process: its tasks are calls in an order fixed at
//! compile time.

use std::sync::Mutex;

use cu29::curuntime::LoopRateLimiter;
use cu29::prelude::*;

/// 512 bytes, like the relays of motorium.
type Payload = CuArray<u64, 64>;

/// Number of warm-up iterations.
const WARM_UP: usize = 1_000;

static SAMPLES: Mutex<Vec<u64>> = Mutex::new(Vec::new());

fn now() -> u64 {
    let clock = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    clock.map(|time| time.as_nanos() as u64).unwrap_or(0)
}

/// Every number is read: 0 if they differ.
fn read(payload: Option<&Payload>) -> u64 {
    let values = payload.map(|payload| payload.as_slice()).unwrap_or_default();
    let first = values.first().copied().unwrap_or(0);
    if values.iter().all(|value| *value == first) { first } else { 0 }
}

fn write(payload: &mut Option<Payload>, time: u64) {
    payload.get_or_insert_default().fill_from_iter(std::iter::repeat_n(time, 64));
}

#[derive(Reflect)]
struct Source;
impl Freezable for Source {}
impl CuSrcTask for Source {
    type Resources<'r> = ();
    type Output<'m> = output_msg!(Payload);

    fn new(_: Option<&ComponentConfig>, _: Self::Resources<'_>) -> CuResult<Self> {
        Ok(Self)
    }

    fn process(&mut self, _: &CuContext, output: &mut Self::Output<'_>) -> CuResult<()> {
        let mut payload = None;
        write(&mut payload, now());
        output.set_payload(payload.unwrap_or_default());
        Ok(())
    }
}

#[derive(Reflect)]
struct Relay;
impl Freezable for Relay {}
impl CuTask for Relay {
    type Resources<'r> = ();
    type Input<'m> = input_msg!(Payload);
    type Output<'m> = output_msg!(Payload);

    fn new(_: Option<&ComponentConfig>, _: Self::Resources<'_>) -> CuResult<Self> {
        Ok(Self)
    }

    fn process(&mut self, _: &CuContext, input: &Self::Input<'_>, output: &mut Self::Output<'_>) -> CuResult<()> {
        let mut payload = None;
        write(&mut payload, read(input.payload()));
        output.set_payload(payload.unwrap_or_default());
        Ok(())
    }
}

#[derive(Reflect)]
struct Sink;
impl Freezable for Sink {}
impl CuSinkTask for Sink {
    type Resources<'r> = ();
    type Input<'m> = input_msg!(Payload);

    fn new(_: Option<&ComponentConfig>, _: Self::Resources<'_>) -> CuResult<Self> {
        Ok(Self)
    }

    fn process(&mut self, _: &CuContext, input: &Self::Input<'_>) -> CuResult<()> {
        std::hint::black_box(read(input.payload()));
        Ok(())
    }
}

#[derive(Reflect)]
struct Tail;
impl Freezable for Tail {}
impl CuSinkTask for Tail {
    type Resources<'r> = ();
    type Input<'m> = input_msg!(Payload);

    fn new(_: Option<&ComponentConfig>, _: Self::Resources<'_>) -> CuResult<Self> {
        Ok(Self)
    }

    fn process(&mut self, _: &CuContext, input: &Self::Input<'_>) -> CuResult<()> {
        let sent = read(input.payload());
        let way = now().saturating_sub(sent);
        SAMPLES.lock().expect("nobody panics with it").push(way);
        Ok(())
    }
}

#[copper_runtime(config = "caterpillar.ron")]
struct Caterpillar {}

fn main() -> CuResult<()> {
    let mut arguments = std::env::args().skip(1);
    let log = arguments.next().ok_or_else(|| CuError::from("expected LOG COUNT"))?;
    let count: usize = arguments
        .next()
        .and_then(|count| count.parse().ok())
        .ok_or_else(|| CuError::from("expected a count"))?;
    // No allocation during the measurement.
    SAMPLES.lock().expect("nobody panics with it").reserve(count + WARM_UP);
    let clock = RobotClock::new();
    let app = Caterpillar::builder()
        .with_clock(clock.clone())
        .with_log_path(&log, Some(64 * 1024 * 1024))?
        .build()?;
    let mut running = app.start()?;
    let mut limiter = LoopRateLimiter::from_rate_target_hz(1_000, &clock)?;
    for _ in 0..count + WARM_UP {
        limiter.limit(&clock);
        running.run_one_iteration()?;
    }
    drop(running.stop()?);
    let samples = SAMPLES.lock().expect("nobody panics with it");
    let texts: Vec<String> = samples[WARM_UP.min(samples.len())..].iter().map(u64::to_string).collect();
    println!("[{}]", texts.join(","));
    Ok(())
}
