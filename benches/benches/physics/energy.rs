//! Energy without friction, stops and drives: a pendulum over 100 s, and over 30 s a humanoid that flies
//! freely with all joints turning, by Euler's method and by the midpoint rule. The humanoid's thin links spin
//! up: at a step of 1 ms, the first-order integrators of both engines lose the motion after 40 to 90 s.

use std::path::{Path, PathBuf};

use motorium_physics::{ArticulatedSimulator, Integrator, JointSetpoint, Options, Simulator, World};
use motorium_robots::{BaseMode, Dynamics, LoadOptions, Model, parse_urdf_with};
use nalgebra::Vector3;

use crate::STEPS;
use crate::peers::{Peer, urdf};

/// Name of the rows.
pub(crate) const NAME: &str = "energy";

/// Prints the rows; compared with MuJoCo's Euler integrator if `compared`.
pub(crate) fn print(compared: bool) -> Result<(), String> {
    for (robot, seconds) in [("pendulum", 100), ("humanoid", 30)] {
        let turns = seconds * turns_per_second(1);
        let (text, floats) = (without_losses(robot)?, robot == "humanoid");
        let file = scratch(robot, &text)?;
        let both = |ms: usize| {
            let [euler, midpoint] = [Integrator::Euler, Integrator::Midpoint]
                .map(|integrator| drift(&energies(&text, floats, (seconds, ms), integrator), floats, ms));
            format!("{euler}; midpoint rule: {midpoint}")
        };
        print!("{NAME}, {robot}, {seconds} s: {}", both(1));
        if compared {
            let mut peer = Peer::start("mujoco", "energy", usize::from(floats), &file)?;
            let mut theirs = Vec::with_capacity(turns);
            for _ in 0..turns {
                theirs.extend(peer.turn()?);
            }
            print!("; mujoco (Euler): {}", drift(&theirs, floats, 1));
        }
        println!();
        if floats {
            // Long after Euler's method has lost the motion.
            let midpoint = drift(&energies(&text, floats, (100, 1), Integrator::Midpoint), floats, 1);
            println!("{NAME}, {robot}, 100 s: midpoint rule: {midpoint}");
        } else {
            println!("{NAME}, {robot}, {seconds} s, steps of 5 ms: {}", both(5));
        }
        // A leftover temporary file is harmless.
        let _ = std::fs::remove_file(file);
    }
    Ok(())
}

/// Returns the largest deviation and the change from the first to the last second, relative to the energy
/// that moves.
fn drift(energies: &[f64], floats: bool, ms: usize) -> String {
    let second = turns_per_second(ms);
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let (first, last) = (mean(&energies[..second]), mean(&energies[energies.len() - second..]));
    // A pendulum's potential energy is zero at its hinge: only the energy above its lowest point can be
    // converted.
    let scale = if floats { first } else { first + 0.5 * 9.81 };
    let far = energies.iter().fold(0.0_f64, |most, energy| most.max((energy - first).abs()));
    format!("drift {:+.2e}, largest deviation {:.2e}", (last - first) / scale, far / scale)
}

/// Turns of a second of steps of `ms` \[ms\].
fn turns_per_second(ms: usize) -> usize {
    1000 / (ms * STEPS)
}

/// Returns the URDF of a robot of the catalogue whose joints have no ends, friction or damping.
fn without_losses(robot: &str) -> Result<String, String> {
    let text = std::fs::read_to_string(urdf(robot)).map_err(|error| error.to_string())?;
    let lines = text.replace("type=\"revolute\"", "type=\"continuous\"");
    Ok(lines.lines().filter(|line| !line.contains("<dynamics")).map(|line| format!("{line}\n")).collect())
}

fn scratch(robot: &str, text: &str) -> Result<PathBuf, String> {
    let file = std::env::temp_dir().join(format!("motorium-energy-{robot}-{}.urdf", std::process::id()));
    std::fs::write(&file, text).map_err(|error| format!("{}: {error}", file.display()))?;
    Ok(file)
}

/// Returns the kinetic and potential energy \[J\] after each turn of a number of `seconds` in steps of `ms`
/// \[ms\].
fn energies(text: &str, floats: bool, (seconds, ms): (usize, usize), integrator: Integrator) -> Vec<f64> {
    let base = if floats { BaseMode::Floating } else { BaseMode::Fixed };
    let options = LoadOptions { base, ..LoadOptions::default() };
    let model =
        parse_urdf_with(text, Some(Path::new(".")), &options).expect("the catalogue's robots load").model;
    let gravity = if floats { [0.0; 3] } else { [0.0, 0.0, -9.81] };
    let mut q = model.neutral();
    let mut v = vec![0.0; model.nv()];
    if floats {
        v[3..6].copy_from_slice(&[0.5, -0.3, 0.4]);
        for (name, v) in model.joint_names().iter().zip(&mut v[6..]) {
            *v = rate(name);
        }
    } else {
        q[0] = 1.0;
    }
    let world = World { gravity, ..World::default() };
    let options = Options { self_collision: false, integrator, ..Options::default() };
    let mut simulation =
        ArticulatedSimulator::new(model.clone(), world, &q, options).expect("it can be simulated");
    simulation.reset(&q, &v).expect("a state of the robot");
    simulation.commands_mut().fill(JointSetpoint::default());
    let mut dynamics = Dynamics::new(&model);
    let turn = |_| {
        let dt = 1e-3 * ms as f64;
        (0..STEPS).for_each(|_| _ = simulation.step(dt).expect("it does not diverge"));
        energy(&mut dynamics, &model, &simulation, gravity.into())
    };
    (0..seconds * turns_per_second(ms)).map(turn).collect()
}

/// Returns the initial velocity of the joint `name` \[rad/s\], which the peers' driver uses as well.
fn rate(name: &str) -> f64 {
    0.3 * f64::from(name.bytes().map(u32::from).sum::<u32>()).sin()
}

fn energy(
    dynamics: &mut Dynamics,
    model: &Model,
    simulation: &ArticulatedSimulator,
    gravity: Vector3<f64>,
) -> f64 {
    let (q, v) = (simulation.configuration(), simulation.velocity());
    dynamics.kinetic_energy(model, q, v) + dynamics.potential_energy(model, q, gravity)
}
