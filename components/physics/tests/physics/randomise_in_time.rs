//! Sampled actuators, and samples within an episode.

use std::path::Path;

use motorium_physics::{
    ArticulatedSimulator, JointSetpoint, Options, Properties, RapierSimulator, RobotSetup, Simulator, World,
};
use motorium_robots::{ActuatorSettings, BodyFactors, load};
use serde_json::Value;

use crate::randomise::{check, episodes, run_of, text};

const ACTUATORS: &str = r#"
actuator = { delay = "4 ms", lag = "5 ms", rate_limit = 900.0, drivetrain = { motor_inertia = 0.01, stiffness = 300.0, backlash = 0.002 } }

[component.physics.config.randomise.actuator]
gain       = [0.8, 1.2]
strength   = [0.7, 1.0]
delay      = [0.5, 2.0]
lag        = [0.5, 1.5]
rate_limit = [0.9, 1.1]
backlash   = [0.0, 3.0]
stiffness  = [0.5, 1.5]
"#;

fn within(value: &Value, low: f64, high: f64) {
    let value = value.as_f64().unwrap();
    assert!((low..=high).contains(&value), "{value}");
}

#[test]
fn equal_seeds_draw_equal_actuator_factors() {
    let runs = ["seed = 3", "seed = 3", "seed = 4"].map(|seed| run_of("rrbot", ACTUATORS, seed));
    assert_eq!(runs[0].state_hash, runs[1].state_hash);
    assert_ne!(runs[0].state_hash, runs[2].state_hash);
    let drawn = &episodes(&runs[0])[0]["actuator"];
    for (key, low, high) in [
        ("gain", 0.8, 1.2),
        ("strength", 0.7, 1.0),
        ("delay", 0.5, 2.0),
        ("lag", 0.5, 1.5),
        ("rate_limit", 0.9, 1.1),
        ("backlash", 0.0, 3.0),
        ("stiffness", 0.5, 1.5),
    ] {
        let joints = drawn[key].as_object().unwrap_or_else(|| panic!("{key} in {drawn}"));
        assert_eq!(joints.len(), 2, "{key}: {joints:?}");
        joints.values().for_each(|value| within(value, low, high));
    }
    let gains: Vec<_> = drawn["gain"].as_object().unwrap().values().collect();
    assert_ne!(gains[0], gains[1]);
}

#[test]
fn ranges_without_a_matching_actuator_are_rejected() {
    for (config, key) in [
        ("randomise.actuator.lag = [0.5, 1.5]", "randomise.actuator.lag"),
        (
            "actuator = { lag = \"1 ms\" }\nrandomise.actuator.backlash = [0.5, 1.5]",
            "randomise.actuator.backlash",
        ),
        ("randomise.actuator.gain = [-0.5, 1.5]", "randomise.actuator.gain"),
        ("actuator = { delay = \"5 s\" }\nrandomise.actuator.delay = [1.0, 3.0]", "randomise.actuator.delay"),
        ("randomise = { every = \"1 s\", start = [-0.1, 0.1] }", "randomise.every"),
        ("randomise = { every = \"0 s\", gravity = [0.9, 1.1] }", "randomise.every"),
    ] {
        let refused = check(text("rrbot", config, "")).unwrap_err().render(false);
        assert!(refused.contains(key), "{refused}");
    }
}

/// Effort of the first joint in each step of 1 ms with a command of 10 Nm, for actuators with these settings.
fn efforts(settings: &ActuatorSettings, properties: impl Fn(&mut ActuatorSettings)) -> Vec<f64> {
    let model = load("rrbot", Path::new(".")).unwrap().model;
    let q = model.neutral();
    let mut setup = RobotSetup::from(model);
    setup.actuators = vec![Some(settings.clone()); 2];
    let mut simulation = ArticulatedSimulator::new(setup, World::default(), &q, Options::default()).unwrap();
    let mut varied = simulation.properties();
    varied.actuators.iter_mut().flatten().flatten().for_each(&properties);
    simulation.reset_with(&varied, &q, &[0.0; 2]).unwrap();
    let command = JointSetpoint::effort(10.0);
    (0..40)
        .map(|_| {
            simulation.commands_mut().fill(command);
            simulation.step(1e-3).unwrap();
            simulation.efforts()[0]
        })
        .collect()
}

#[test]
fn a_reset_with_other_actuators_equals_a_new_simulation() {
    let settings =
        ActuatorSettings { delay: 4e-3, lag: 5e-3, rate_limit: Some(900.0), ..ActuatorSettings::default() };
    let other =
        ActuatorSettings { delay: 8e-3, lag: 2e-3, rate_limit: Some(700.0), ..ActuatorSettings::default() };
    let built = efforts(&other, |_| ());
    let varied = efforts(&settings, |own| own.clone_from(&other));
    assert_eq!(built, varied);
    assert_eq!(built.iter().filter(|effort| **effort == 0.0).count(), 8, "{built:?}");
    assert_eq!(efforts(&settings, |_| ()).iter().filter(|effort| **effort == 0.0).count(), 4);
}

#[test]
fn properties_changed_in_motion_keep_the_state() {
    let model = load("double-pendulum", Path::new(".")).unwrap().model;
    let q = [0.4, 0.3];
    let mut simulation =
        ArticulatedSimulator::new(model.clone(), World::default(), &q, Options::default()).unwrap();
    let mut twin =
        ArticulatedSimulator::new(model.clone(), World::default(), &q, Options::default()).unwrap();
    let step = |simulation: &mut ArticulatedSimulator| _ = simulation.step(1e-3).unwrap();
    (0..200).for_each(|_| step(&mut simulation));
    (0..200).for_each(|_| step(&mut twin));
    let mut moon = simulation.properties();
    moon.world.gravity = [0.0, 0.0, -1.62];
    simulation.change(&moon).unwrap();
    assert_eq!(simulation.configuration(), twin.configuration());
    assert_eq!(simulation.velocity(), twin.velocity());
    // Equal to a simulation that starts there under that gravity.
    let world = World { gravity: moon.world.gravity, ..World::default() };
    let mut there = ArticulatedSimulator::new(model.clone(), world, &q, Options::default()).unwrap();
    there.reset(twin.configuration(), twin.velocity()).unwrap();
    for _ in 0..200 {
        step(&mut simulation);
        step(&mut there);
    }
    assert_eq!(simulation.configuration(), there.configuration());
    let mut rapier = RapierSimulator::new(model, World::default(), &q, Options::default()).unwrap();
    let refused = rapier.change(&rapier.properties()).unwrap_err().to_string();
    assert!(refused.contains("rapier"), "{refused}");
}

#[test]
fn effort_limits_changed_in_motion_apply_immediately() {
    let model = load("rrbot", Path::new(".")).unwrap().model;
    let (q, limit) = (model.neutral(), model.effort_limit()[0]);
    let mut setup = RobotSetup::from(model.clone());
    setup.actuators = vec![Some(ActuatorSettings { lag: 5e-3, ..ActuatorSettings::default() }); 2];
    let mut simulation = ArticulatedSimulator::new(setup, World::default(), &q, Options::default()).unwrap();
    // Twelve time constants of the lag.
    let saturated = |simulation: &mut ArticulatedSimulator| {
        simulation.commands_mut()[0] = JointSetpoint::effort(10.0 * limit);
        (0..60).for_each(|_| _ = simulation.step(1e-3).unwrap());
        simulation.efforts()[0]
    };
    let effort = saturated(&mut simulation);
    assert!((effort - limit).abs() < 1e-3 * limit, "{effort} Nm of {limit} Nm");
    for share in [0.5, 0.2, 1.0] {
        let factors = BodyFactors { effort_limit: share, ..BodyFactors::default() };
        let factors = vec![factors; model.bodies().len()];
        let varied = model.with_factors(1.0, &factors);
        simulation.change(&Properties { model: varied, ..simulation.properties() }).unwrap();
        let effort = saturated(&mut simulation);
        assert!((effort - share * limit).abs() < 1e-3 * limit, "{effort} Nm of {share} of {limit} Nm");
    }
}

#[test]
fn invalid_actuator_properties_change_nothing() {
    let model = load("rrbot", Path::new(".")).unwrap().model;
    let q = model.neutral();
    let mut setup = RobotSetup::from(model);
    setup.actuators = vec![Some(ActuatorSettings { lag: 5e-3, ..ActuatorSettings::default() }); 2];
    let mut simulation = ArticulatedSimulator::new(setup, World::default(), &q, Options::default()).unwrap();
    let before = simulation.properties();
    let mut wrong = before.clone();
    wrong.world.gravity = [0.0; 3];
    wrong.actuators[0][1] = Some(ActuatorSettings { lag: 11.0, ..ActuatorSettings::default() });
    let refused =
        [simulation.change(&wrong).unwrap_err(), simulation.reset_with(&wrong, &q, &[0.0; 2]).unwrap_err()];
    for refused in refused.map(|refused| refused.to_string()) {
        assert!(refused.contains("lag = 11"), "{refused}");
    }
    assert_eq!(simulation.properties().world.gravity, before.world.gravity);
    assert_eq!(simulation.gravity(), nalgebra::Vector3::from(before.world.gravity));
}

#[test]
fn timed_draws_change_gravity_and_are_reported() {
    let config = r#"
[component.physics.config.randomise]
every   = "30 ms"
gravity = [0.5, 1.5]
start   = [-0.05, 0.05]
actuator = { gain = [0.5, 1.5] }
"#;
    let runs = ["seed = 3", "seed = 3"].map(|seed| run_of("quadruped", config, seed));
    assert_eq!(runs[0].state_hash, runs[1].state_hash);
    let drawn = episodes(&runs[0]);
    let times: Vec<f64> = drawn.iter().map(|draw| draw["from_s"].as_f64().unwrap()).collect();
    let expected = [0.0, 0.03, 0.06, 0.09];
    assert_eq!(times.len(), 4, "{times:?}");
    assert!(times.iter().zip(expected).all(|(time, at)| (time - at).abs() < 1e-12), "{times:?}");
    for later in &drawn[1..] {
        assert_ne!(later["gravity"], drawn[0]["gravity"]);
        assert_ne!(later["actuator"], drawn[0]["actuator"]);
        assert_eq!(later["start"], drawn[0]["start"]);
        within(&later["gravity"], 0.5, 1.5);
    }
    // The first part equals a run without samples within episodes.
    let once = run_of("quadruped", &config.replace("every   = \"30 ms\"", ""), "seed = 3");
    assert_eq!(episodes(&once)[0]["gravity"], drawn[0]["gravity"]);
    let refused = check(text("rrbot", config, "").replace("physics.articulated", "physics.rapier"));
    let refused = refused.unwrap_err().render(false);
    assert!(refused.contains("randomise.every") && refused.contains("rapier"), "{refused}");
}

#[test]
fn start_of_a_connected_object_is_not_sampled() {
    let tied = |ranges: &str, by: &str| {
        let drawn = format!("[component.physics.config.randomise]\nobjects = {{ cube = {ranges} }}");
        let connections = "connections = [{ parts = [\"cube\", \"world\"] }]";
        let text = match by {
            "world" => {
                let text = text("quadruped", &drawn, "");
                let end = "] }\n[component.physics.config.randomise]";
                assert!(text.contains(end));
                text.replacen(end, &end.replacen("] }", &format!("], {connections} }}"), 1), 1)
            }
            _ => text("quadruped", &format!("{connections}\n{drawn}"), ""),
        };
        check(text).map(|_| ()).map_err(|error| error.render(false))
    };
    for by in ["world", "component"] {
        for key in ["x", "y", "z", "yaw"] {
            let refused = tied(&format!("{{ {key} = [-0.2, 0.2] }}"), by).unwrap_err();
            assert!(
                refused.contains("holds `cube` and `world` in their initial poses"),
                "{by}, {key}: {refused}"
            );
        }
        tied("{ mass = [0.5, 2.0], friction = [0.5, 1.0] }", by).unwrap();
    }
}
