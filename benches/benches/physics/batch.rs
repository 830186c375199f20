//! Many quadrupeds that stand on flat ground in a batch: steps of single robots in a second, and the cost of
//! calls and resets.

use std::path::Path;
use std::time::Instant;

use motorium_physics::randomise::{Draws, Interval, RandomiseConfig};
use motorium_physics::{
    Articulated, ArticulatedSimulator, Batch, Ground, JointSetpoint, Options, RobotSetup, Simulator, World,
};
use motorium_robots::{Loaded, load};

use crate::peers::{Peer, urdf};
use crate::{STEPS, TURNS};

/// Name of the rows.
pub(crate) const NAME: &str = "quadrupeds, batch";

/// Robots, and threads on both sides.
pub(crate) const WORLDS: usize = 64;
const THREADS: usize = 2;

/// Turns: fewer than of a single robot.
const TURNS_OF_BATCH: usize = TURNS / 4;

/// Prints the rows; compared with MuJoCo's `rollout` if `compared`.
pub(crate) fn print(compared: bool) -> Result<(), String> {
    let mut batch = quadrupeds(THREADS, 1e-3);
    let mut peer =
        if compared { Some(Peer::start("mujoco", "batch", WORLDS, &urdf("quadruped"))?) } else { None };
    let (mut ours, mut singly, mut theirs) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..TURNS_OF_BATCH {
        ours.push(steps(&mut batch, 1, STEPS));
        singly.push(steps(&mut batch, STEPS, 1));
        if let Some(peer) = &mut peer {
            theirs.extend(peer.turn()?.map(|micros| micros * 1e-6));
        }
    }
    let rate = 1.0 / median(&mut ours);
    print!("{NAME}: {WORLDS} on {THREADS} threads, {rate:.0} steps of 1 ms a second");
    if theirs.is_empty() {
        println!();
    } else {
        let other = 1.0 / median(&mut theirs);
        println!(", mujoco.rollout {other:.0}: {:.2} x", rate / other);
    }
    let single = 1.0 / median(&mut singly);
    println!(
        "{NAME}: {single:.0} a second with one step in each call, {:.2} of {STEPS} in each",
        single / rate
    );
    resets();
    Ok(())
}

/// Returns the time of a step of one robot \[s\], measured over `calls` calls with `each` steps.
fn steps(batch: &mut Batch<Articulated>, calls: usize, each: usize) -> f64 {
    let start = Instant::now();
    for _ in 0..calls {
        let good = batch.step(1e-3, each).iter().all(Result::is_ok);
        assert!(good, "standing robots do not diverge");
    }
    start.elapsed().as_secs_f64() / (calls * each * WORLDS) as f64
}

/// Passes of resets in a turn; the first is not timed.
const PASSES: u64 = 5;

/// Prints the time of a reset of all robots with sampled masses, friction and starts, by number of threads.
fn resets() {
    let config = RandomiseConfig {
        mass: Some(Interval([0.8, 1.2])),
        friction: Some(Interval([0.6, 1.2])),
        start: Some(Interval([-0.05, 0.05])),
        ..RandomiseConfig::default()
    };
    let sides = [1, THREADS].map(|threads| {
        let batch = quadrupeds(threads, 1e-3);
        let draws = Draws::for_one_robot(&config, batch.world(0)).expect("the ranges are valid");
        (batch.with_data(|world| world as u64), draws)
    });
    let mut sides = sides.map(|(batch, draws)| (batch, draws, Vec::new()));
    // In turns, so that a slow moment of the machine affects both. The threads of a side sleep during the
    // other's turns; the first pass wakes them.
    for turn in 0..TURNS as u64 {
        for (batch, draws, times) in &mut sides {
            let mut start = Instant::now();
            for pass in 0..PASSES {
                batch.each(|_, simulation, world| {
                    let start = draws.draw((turn * PASSES + pass) * WORLDS as u64 + *world, 0);
                    let v = vec![0.0; simulation.velocity().len()];
                    simulation.reset_with(&start.properties, &start.q, &v).expect("a sampled start is valid");
                });
                if pass == 0 {
                    start = Instant::now();
                }
            }
            times.push(start.elapsed().as_secs_f64() / (PASSES - 1) as f64);
        }
    }
    let [one, several] = sides.map(|(.., mut times)| 1e6 * median(&mut times) / WORLDS as f64);
    println!(
        "{NAME}: reset with sampled properties {one:.1} us a robot on one thread, {several:.1} on {THREADS}: {:.2}",
        several / one
    );
}

pub(crate) fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Returns the robot of all rows.
pub(crate) fn quadruped() -> Loaded {
    load("quadruped", Path::new(".")).expect("the catalogue's robots load")
}

/// Returns robots that have stood for a second, in steps of `dt` \[s\].
pub(crate) fn quadrupeds(threads: usize, dt: f64) -> Batch<Articulated> {
    let loaded = quadruped();
    let setup = RobotSetup::from_loaded(&loaded).expect("the catalogue's profiles are whole");
    let profile = loaded.profile.expect("the catalogue's robots have profiles");
    let q = profile.configuration(&loaded.model, &profile.home).expect("home is a pose");
    let gains = profile.gains(&loaded.model).expect("the catalogue's robots have gains");
    let world = World { ground: Some(Ground::default()), ..World::default() };
    let build = |_| ArticulatedSimulator::new(setup.clone(), world.clone(), q.as_slice(), Options::default());
    let mut batch = Batch::new(WORLDS, threads, build).expect("the catalogue's robots can be simulated");
    let home = batch.world(0).positions().to_vec();
    for (index, command) in batch.commands_mut().iter_mut().enumerate() {
        let joint = index % home.len();
        *command = JointSetpoint::hold(home[joint], gains.kp[joint], gains.kd[joint]);
    }
    let second = (1.0 / dt).round() as usize;
    assert!(batch.step(dt, second).iter().all(Result::is_ok), "they stand");
    batch
}
