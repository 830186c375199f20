//! A graph built in code and hosted in this process: a velocity step, a low-pass filter and a probe of its
//! output.
//!
//! ```console
//! $ cargo run --release --example hosted_graph --features testing
//! ```

#[allow(dead_code)] // its `main`
#[path = "low_pass.rs"]
mod low_pass;

use low_pass::LowPass;
use motorium::prelude::*;
use motorium::testing::{Graph, Instance, Probe, RunError, Sample, Source};

/// Simulates 50 ms of the filter's response to a step of 1 rad/s, with a time constant of 10 ms.
pub(crate) fn step_response() -> Result<Vec<Sample<JointState>>, RunError> {
    let filtered = Probe::<JointState>::for_topic("filtered");
    Graph::new("low-pass")
        .with(Source::new("robot", "state", |_| {
            let mut state = JointState::default();
            state.set_count(1);
            state.velocity_mut()[0] = 1.0;
            Some(state)
        }))
        .with(
            Instance::of::<LowPass>("filter")
                .trigger("state")
                .subscribe("state", "state")
                .publish("filtered", "filtered")
                .parameter("time_constant", 0.01)
                .config("joints", 1),
        )
        .with(&filtered)
        .run("50 ms")?;
    Ok(filtered.samples())
}

fn main() -> Result<(), RunError> {
    for sample in step_response()?.iter().step_by(5) {
        println!("{:3} ms  {:.3} rad/s", sample.time_ns / 1_000_000, sample.value.velocity()[0]);
    }
    Ok(())
}
