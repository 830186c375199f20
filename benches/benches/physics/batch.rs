//! Many quadrupeds that stand on flat ground, stepped on two threads: steps of single robots in a second.

use std::path::Path;
use std::time::Instant;

use motorium_physics::{
    Articulated, ArticulatedSimulator, Batch, Ground, JointCommand, Options, RobotSetup, Simulator, World,
};
use motorium_robots::load;

use crate::peers::{Peer, urdf};
use crate::{STEPS, TURNS};

/// Name of the row.
pub(crate) const NAME: &str = "quadrupeds, batch";

/// Robots, and threads on both sides.
const WORLDS: usize = 64;
const THREADS: usize = 2;

/// Turns: fewer than of a single robot.
const TURNS_OF_BATCH: usize = TURNS / 4;

/// Prints the row; compared with MuJoCo's `rollout` if `compared`.
pub(crate) fn print(compared: bool) -> Result<(), String> {
    let mut batch = quadrupeds();
    let mut peer =
        if compared { Some(Peer::start("mujoco", "batch", WORLDS, &urdf("quadruped"))?) } else { None };
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for _ in 0..TURNS_OF_BATCH {
        let start = Instant::now();
        let good = batch.step(1e-3, STEPS).iter().all(Result::is_ok);
        ours.push(start.elapsed().as_secs_f64() / (STEPS * WORLDS) as f64);
        assert!(good, "standing robots do not diverge");
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
    Ok(())
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn quadrupeds() -> Batch<Articulated> {
    let loaded = load("quadruped", Path::new(".")).expect("the catalogue's robots load");
    let setup = RobotSetup::from_loaded(&loaded).expect("the catalogue's profiles are whole");
    let profile = loaded.profile.expect("the catalogue's robots have profiles");
    let q = profile.configuration(&loaded.model, &profile.home).expect("home is a pose");
    let gains = profile.gains(&loaded.model).expect("the catalogue's robots have gains");
    let world = World { ground: Some(Ground::default()), ..World::default() };
    let build = |_| ArticulatedSimulator::new(setup.clone(), world.clone(), q.as_slice(), Options::default());
    let mut batch = Batch::new(WORLDS, THREADS, build).expect("the catalogue's robots can be simulated");
    let home = batch.world(0).positions().to_vec();
    for (index, command) in batch.commands_mut().iter_mut().enumerate() {
        let joint = index % home.len();
        *command = JointCommand::hold(home[joint], gains.kp[joint], gains.kd[joint]);
    }
    assert!(batch.step(1e-3, 1000).iter().all(Result::is_ok), "they stand");
    batch
}
