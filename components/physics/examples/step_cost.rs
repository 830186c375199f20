//! Cost of a 1 ms step for the settings that a user can choose.
//!
//! ```sh
//! cargo run --release -p motorium-physics --example step_cost
//! ```

use std::path::Path;
use std::time::Instant;

use motorium_physics::{
    ArticulatedSimulator, Ground, JointSetpoint, Object, ObjectShape, Options, RapierSimulator, Simulator,
    World,
};
use motorium_robots::{Model, Placed, load};
use nalgebra::Isometry3;

const DT: f64 = 1e-3;
const STEPS: usize = 20_000;

enum Engine {
    Articulated,
    Rapier,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("panda, us per 1 ms step over {STEPS} steps: median, 99 %, worst");
    let empty = World::default();
    let ground = World { ground: Some(Ground::default()), ..World::default() };
    let mut cube = Object {
        name: "cube".to_owned(),
        shape: ObjectShape::Box { size: [0.05; 3] },
        mass: Some(0.1),
        position: [0.9, 0.0, 0.025],
        ..Object::default()
    };
    let with_cube = World { objects: vec![cube.clone()], ..ground.clone() };
    // Under the hand, to keep the contact solver active in every step.
    cube.position = [0.55, 0.0, 0.0];
    let block = with_block()?;
    let worlds = [("empty world", &empty, 0.0), ("ground", &ground, 0.0), ("ground, cube", &with_cube, 0.0)];
    for (name, world, lean) in worlds {
        measure(&format!("articulated, {name}"), Engine::Articulated, world, Options::default(), lean, 1)?;
    }
    for count in [2, 4] {
        let name = format!("articulated, empty world, {count} arms");
        measure(&name, Engine::Articulated, &empty, Options::default(), 0.0, count)?;
    }
    for iterations in [1, 2, 4] {
        let options = Options { contact_iterations: iterations, ..Options::default() };
        let name = format!("articulated, hand on a block, {iterations} iterations");
        measure(&name, Engine::Articulated, &block, options, -0.12, 1)?;
    }
    for iterations in [1, 2, 4] {
        let options = Options { contact_iterations: iterations, ..Options::default() };
        let worlds = [("empty world", &empty, 0.0), ("ground, cube", &with_cube, 0.0)];
        for (name, world, lean) in worlds.into_iter().chain([("hand on a block", &block, -0.12)]) {
            let name = format!("rapier, {name}, {iterations} iterations");
            measure(&name, Engine::Rapier, world, options, lean, 1)?;
        }
    }
    Ok(())
}

/// A fixed block whose top is just under the hand at home.
fn with_block() -> Result<World, Box<dyn std::error::Error>> {
    let panda = load("panda", Path::new("."))?;
    let profile = panda.profile.ok_or("the catalogue's panda has a profile")?;
    let mut kinematics = motorium_robots::Kinematics::new(&panda.model);
    kinematics.update(&panda.model, profile.home(&panda.model)?.as_slice());
    let tip = kinematics.pose(&panda.model, panda.model.frame("panda_hand_tcp")?).translation;
    let height = tip.z - 0.02;
    let block = Object {
        name: "block".to_owned(),
        shape: ObjectShape::Box { size: [0.3, 0.3, height] },
        mass: None,
        position: [tip.x, tip.y, 0.5 * height],
        ..Object::default()
    };
    Ok(World { ground: Some(Ground::default()), objects: vec![block], ..World::default() })
}

/// Several Pandas in a row, out of reach of each other.
fn arms(panda: &Model, count: usize) -> Result<Model, Box<dyn std::error::Error>> {
    let prefixes: Vec<String> = (0..count).map(|arm| format!("{arm}/")).collect();
    let placed = prefixes.iter().enumerate().map(|(arm, prefix)| Placed {
        model: panda,
        prefix,
        placement: Isometry3::translation(0.0, 2.5 * arm as f64, 0.0),
    });
    Ok(if count == 1 { panda.clone() } else { Model::world("arms", &placed.collect::<Vec<_>>())? })
}

/// Swings every joint about home, or presses down by bending the shoulder by `-lean`.
fn measure(
    name: &str,
    engine: Engine,
    world: &World,
    options: Options,
    lean: f64,
    count: usize,
) -> Result<(), Box<dyn std::error::Error>> {
    let panda = load("panda", Path::new("."))?;
    let profile = panda.profile.ok_or("the catalogue's panda has a profile")?;
    let home = profile.home(&panda.model)?;
    let gains = profile.gains(&panda.model)?;
    let (model, world, q) = (arms(&panda.model, count)?, world.clone(), &home.as_slice().repeat(count));
    let mut simulation: Box<dyn Simulator> = match engine {
        Engine::Articulated => Box::new(ArticulatedSimulator::new(model, world, q, options)?),
        Engine::Rapier => Box::new(RapierSimulator::new(model, world, q, options)?),
    };
    let mut times = Vec::with_capacity(STEPS);
    let mut near = 0;
    for step in 0..STEPS {
        let swing = if lean == 0.0 { 0.15 * (step as f64 * 2.0 * DT).sin() } else { 0.0 };
        for (i, command) in simulation.commands_mut().iter_mut().enumerate() {
            let i = i % home.len();
            let goal = home[i] + if i < 7 { swing } else { 0.0 } - if i == 1 { lean } else { 0.0 };
            *command = JointSetpoint::hold(goal, gains.kp[i], gains.kd[i]);
        }
        let start = Instant::now();
        near += usize::from(simulation.step(DT)?.near_contact);
        times.push(start.elapsed().as_nanos() as f64 / 1e3);
    }
    times.sort_by(f64::total_cmp);
    println!(
        "{name:44} {:7.2} {:7.2} {:7.2}   contact solver in {:3} % of the steps",
        times[STEPS / 2],
        times[STEPS * 99 / 100],
        times[STEPS - 1],
        100 * near / STEPS
    );
    Ok(())
}
