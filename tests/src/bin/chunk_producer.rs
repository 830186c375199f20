//! A policy in a separate process outside the graph. Until it is killed, it returns chunks of actions for the
//! Panda late, twice or not at all, with discontinuities.
//!
//! `chunk-producer RUN SEED`

use std::error::Error;
use std::time::{Duration, Instant};

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{Node, NodeBuilder, SignalHandlingMode, ipc_threadsafe};
use motorium::run_folder::RunFolder;
use motorium::state::{ActionChunk, JointState, Stamp};

type Stock = ipc_threadsafe::Service;

/// The pose around which the joints move, rad.
const POSE: [f64; 7] = [0.0, -0.8, 0.0, -2.3, 0.0, 1.6, 0.8];
/// Amplitude \[rad\] and frequency \[rad/s\] of the movement; range of discontinuities in the phase of a
/// chunk \[rad\].
const AMPLITUDE: f64 = 0.3;
const FREQUENCY: f64 = 3.0;
const JUMP: f64 = 6.0;
/// Actions of a chunk, and the time between two, ns.
const ACTIONS: usize = 25;
const PERIOD: u64 = 40_000_000;
/// Time between two chunks, ns.
const EVERY: u64 = 200_000_000;
/// Longest delay, and the time until a chunk is sent again.
const DELAY: Duration = Duration::from_millis(400);
const AGAIN: Duration = Duration::from_millis(30);
/// Fractions of lost and repeated chunks.
const LOST: f64 = 0.25;
const REPEATED: f64 = 0.4;

/// Uniform random numbers below 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Returns the domain of a run, joined as a stock program.
fn join(run: &str) -> Result<Node<Stock>, Box<dyn Error>> {
    let domain = RunFolder::find(run).ok_or("no such run")?.domain()?;
    let mut config = iceoryx2::config::Config::default();
    config.global.set_root_path(domain.config().global.root_path());
    config.global.prefix = domain.config().global.prefix;
    let node = NodeBuilder::new().config(&config).signal_handling_mode(SignalHandlingMode::Disabled);
    Ok(node.create::<Stock>()?)
}

fn subscriber(node: &Node<Stock>) -> Result<Subscriber<Stock, JointState, Stamp>, Box<dyn Error>> {
    let service = node.service_builder(&"out/panda/joint_state".try_into()?);
    let service = service.publish_subscribe::<JointState>().user_header::<Stamp>().open()?;
    Ok(service.subscriber_builder().create()?)
}

fn publisher(node: &Node<Stock>) -> Result<Publisher<Stock, ActionChunk, ()>, Box<dyn Error>> {
    let service = node.service_builder(&"in/panda/chunk".try_into()?);
    Ok(service.publish_subscribe::<ActionChunk>().open()?.publisher_builder().create()?)
}

/// Returns the chunk for an observation.
fn chunk(observed: u64, sequence: u64, jump: f64) -> ActionChunk {
    let mut chunk = ActionChunk::default();
    (chunk.time, chunk.period, chunk.sequence) = (observed, PERIOD, sequence);
    chunk.width = POSE.len() as u64;
    chunk.set_count(ACTIONS * POSE.len());
    let seconds = |step: usize| (observed + step as u64 * PERIOD) as f64 * 1e-9;
    for (step, action) in chunk.value_mut().chunks_exact_mut(POSE.len()).enumerate() {
        for (joint, (value, middle)) in action.iter_mut().zip(POSE).enumerate() {
            *value = middle + AMPLITUDE * (FREQUENCY * seconds(step) + jump + joint as f64).sin();
        }
    }
    chunk
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(run), Some(seed)) = (arguments.next(), arguments.next()) else {
        return Err("usage: chunk-producer RUN SEED".into());
    };
    let mut random = Random(seed.parse()?);
    let node = join(&run)?;
    let (states, chunks) = (subscriber(&node)?, publisher(&node)?);
    // chunks in transit, with their times of arrival
    let mut pending: Vec<(Instant, ActionChunk)> = Vec::new();
    let (mut last, mut sequence) = (0, 0);
    loop {
        let mut observed = None;
        while let Some(state) = states.receive()? {
            observed = Some(state.user_header().state_time);
        }
        if let Some(observed) = observed.filter(|observed| *observed >= last + EVERY) {
            (last, sequence) = (observed, sequence + 1);
            let arrival = Instant::now() + DELAY.mul_f64(random.next());
            let chunk = chunk(observed, sequence, JUMP * (random.next() - 0.5));
            if random.next() >= LOST {
                pending.push((arrival, chunk));
            }
            if random.next() < REPEATED {
                pending.push((arrival + AGAIN, chunk));
            }
        }
        if let Some(index) = pending.iter().position(|(arrival, _)| *arrival <= Instant::now()) {
            chunks.send_copy(pending.swap_remove(index).1)?;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}
