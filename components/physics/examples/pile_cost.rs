//! Cost of a 1 ms step while boxes fall into a pile and after they have come to rest. With `awake`, sleeping
//! is disabled.
//!
//! ```sh
//! cargo run --release -p motorium-physics --example pile_cost -- 20 100
//! cargo run --release -p motorium-physics --example pile_cost -- awake 20 100
//! ```

use std::path::Path;
use std::time::Instant;

use motorium_physics::{ArticulatedSimulator, Ground, Object, ObjectShape, Options, Simulator, World};
use motorium_robots::load;

/// Number of steps per measurement, and number of measurements.
const STEPS: usize = 500;
const TURNS: usize = 6;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1).peekable();
    let sleeping = arguments.next_if(|argument| argument == "awake").is_none();
    let counts: Vec<usize> = arguments.map(|count| count.parse()).collect::<Result<_, _>>()?;
    let counts = if counts.is_empty() { vec![20, 100] } else { counts };
    for count in counts {
        let mut simulation = pile(count, sleeping)?;
        for turn in 0..TURNS {
            let start = Instant::now();
            for _ in 0..STEPS {
                simulation.step(1e-3)?;
            }
            let micros = start.elapsed().as_secs_f64() * 1e6 / STEPS as f64;
            let (mut points, mut deepest, mut fastest) = (0, 0.0_f64, 0.0_f64);
            simulation.visit_contacts(&mut |contact| {
                points += 1;
                deepest = deepest.max(contact.depth);
            });
            for index in 0..count {
                let id = simulation.object(&format!("box{index}")).ok_or("no such box")?;
                fastest = fastest.max(simulation.object_velocity(id).0.norm());
            }
            let until = 0.5 * (turn + 1) as f64;
            println!(
                "{count} boxes until {until:.1} s: {micros:8.1} us a step, {points} contact points, deepest {:.3} mm, \
                 fastest {fastest:.5} m/s",
                deepest * 1e3
            );
        }
    }
    Ok(())
}

/// Rings of five boxes on top of each other, with a pendulum hanging far above.
fn pile(count: usize, sleeping: bool) -> Result<ArticulatedSimulator, Box<dyn std::error::Error>> {
    let objects = (0..count).map(|index| {
        let (layer, place) = (index / 5, index % 5);
        let angle = place as f64 * 1.2566 + layer as f64 * 0.3;
        Object {
            name: format!("box{index}"),
            shape: ObjectShape::Box { size: [0.1; 3] },
            mass: Some(0.5),
            position: [5.0 + 0.12 * angle.cos(), 0.12 * angle.sin(), -5.0 + 0.06 + 0.15 * layer as f64],
            rpy: [0.1 * angle, 0.05, 0.2 * layer as f64],
            friction: 0.6,
            ..Object::default()
        }
    });
    let ground = Some(Ground { height: -5.0, friction: 0.6, restitution: 0.0, ..Ground::default() });
    let world = World { ground, objects: objects.collect(), ..World::default() };
    let pendulum = load("pendulum", Path::new("."))?.model;
    Ok(ArticulatedSimulator::new(pendulum, world, &[0.0], Options { sleeping, ..Options::default() })?)
}
