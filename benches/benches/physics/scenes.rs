//! Simulated scenes: moving or standing robots, and boxes that fall into a pile.

use std::path::{Path, PathBuf};

use motorium_physics::{
    ArticulatedSimulator, Ground, JointSetpoint, Object, ObjectShape, Options, RobotSetup, Simulator, World,
};
use motorium_robots::{Loaded, load};

use crate::peers::urdf;
use crate::talos;

/// Motion commanded to the joints of a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Motion {
    /// Every joint swings by 0.15 rad about home.
    Swing,
    /// Every joint is held at home.
    Hold,
    /// Like `Hold`, with the robot in permanent free fall.
    Fall,
    /// Boxes fall into a pile, from the start again every 1000 steps.
    Drop,
}

impl Motion {
    /// Returns the name of the motion in the peers' driver.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Swing => "swing",
            Self::Hold => "hold",
            Self::Fall => "fall",
            Self::Drop => "drop",
        }
    }
}

/// A simulation and the data its peers need.
pub(crate) struct Scene {
    pub(crate) name: &'static str,
    /// File of the robot, next to its profile.
    pub(crate) urdf: PathBuf,
    pub(crate) motion: Motion,
    /// Boxes that fall into a pile.
    pub(crate) boxes: usize,
    simulation: ArticulatedSimulator,
    home: Vec<f64>,
    gains: Vec<(f64, f64)>,
    steps: usize,
}

const SCENES: [(&str, &str, Motion); 8] = [
    ("ur5e", "ur5e", Motion::Swing),
    ("panda", "panda", Motion::Swing),
    ("quadruped", "quadruped", Motion::Hold),
    ("hexapod", "hexapod", Motion::Hold),
    ("biped", "biped", Motion::Hold),
    ("humanoid", "humanoid", Motion::Hold),
    ("quadruped, free fall", "quadruped", Motion::Fall),
    ("humanoid, free fall", "humanoid", Motion::Fall),
];

/// Scenes of Talos, if available on this machine.
const TALOS: [(&str, Motion); 2] = [("talos", Motion::Hold), ("talos, free fall", Motion::Fall)];

/// Returns the scenes whose names `chosen` accepts.
pub(crate) fn scenes(chosen: impl Fn(&str) -> bool) -> Vec<Scene> {
    let robots = SCENES.into_iter().filter(|(name, ..)| chosen(name));
    let mut scenes: Vec<_> = robots
        .map(|(name, robot, motion)| {
            let loaded = load(robot, Path::new(".")).expect("the catalogue's robots load");
            Scene::of_robot(name, (loaded, urdf(robot)), motion)
        })
        .collect();
    let talos: Vec<_> = TALOS.into_iter().filter(|(name, _)| chosen(name)).collect();
    if !talos.is_empty()
        && let Some(urdf) = talos::files()
    {
        for (name, motion) in talos {
            let loaded = talos::load(&urdf).expect("it was loaded when it was written");
            scenes.push(Scene::of_robot(name, (loaded, urdf.clone()), motion));
        }
    }
    for (name, boxes, motion) in [
        ("20 boxes, falling", 20, Motion::Drop),
        ("100 boxes, falling", 100, Motion::Drop),
        ("20 boxes", 20, Motion::Hold),
        ("100 boxes", 100, Motion::Hold),
    ] {
        if chosen(name) {
            scenes.push(Scene::of_boxes(name, boxes, motion));
        }
    }
    scenes
}

impl Scene {
    fn of_robot(name: &'static str, (loaded, urdf): (Loaded, PathBuf), motion: Motion) -> Self {
        let setup = RobotSetup::from_loaded(&loaded).expect("the profiles are whole");
        let profile = loaded.profile.expect("the robots have profiles");
        let q = profile.configuration(&loaded.model, &profile.home).expect("home is a pose");
        let gains = profile.gains(&loaded.model).expect("the robots have gains");
        let ground = (motion == Motion::Hold).then(Ground::default);
        let world = World { ground, ..World::default() };
        let simulation = ArticulatedSimulator::new(setup, world, q.as_slice(), Options::default())
            .expect("the robots can be simulated");
        let home = simulation.positions().to_vec();
        let gains = gains.kp.iter().copied().zip(gains.kd.iter().copied()).collect();
        let mut scene = Self { name, urdf, motion, boxes: 0, simulation, home, gains, steps: 0 };
        if motion != Motion::Fall {
            scene.advance(1000);
        }
        scene
    }

    /// A pile next to a pendulum that hangs far above.
    fn of_boxes(name: &'static str, boxes: usize, motion: Motion) -> Self {
        let loaded = load("pendulum", Path::new(".")).expect("the catalogue's robots load");
        let objects = (0..boxes)
            .map(|index| {
                let (layer, place) = (index / 5, index % 5);
                let angle = place as f64 * 1.2566 + layer as f64 * 0.3;
                Object {
                    name: format!("box{index}"),
                    shape: ObjectShape::Box { size: [0.1; 3] },
                    mass: Some(0.5),
                    position: [
                        5.0 + 0.12 * angle.cos(),
                        0.12 * angle.sin(),
                        -5.0 + 0.06 + 0.15 * layer as f64,
                    ],
                    rpy: [0.1 * angle, 0.05, 0.2 * layer as f64],
                    friction: 0.6,
                    ..Object::default()
                }
            })
            .collect();
        let ground = Some(Ground { height: -5.0, friction: 0.6, restitution: 0.0, ..Ground::default() });
        let world = World { ground, objects, ..World::default() };
        // The peers' boxes do not sleep either.
        let options = Options { sleeping: false, ..Options::default() };
        let simulation = ArticulatedSimulator::new(loaded.model, world, &[0.0], options)
            .expect("the boxes can be simulated");
        let mut scene = Self {
            name,
            urdf: urdf("pendulum"),
            motion,
            boxes,
            simulation,
            home: vec![0.0],
            gains: vec![(0.0, 0.1)],
            steps: 0,
        };
        if motion == Motion::Hold {
            scene.advance(1000);
        }
        scene
    }

    /// Simulates a number of milliseconds; the joint goals are set at the first one.
    pub(crate) fn advance(&mut self, steps: usize) {
        if self.motion == Motion::Drop && self.steps > 0 && self.steps.is_multiple_of(1000) {
            self.simulation.reset(&[0.0], &[0.0]).expect("the state it was built in");
        }
        let swing = if self.motion == Motion::Swing { 0.15 * (2e-3 * self.steps as f64).sin() } else { 0.0 };
        let commands = self.simulation.commands_mut().iter_mut();
        for ((command, home), (kp, kd)) in commands.zip(&self.home).zip(&self.gains) {
            *command = JointSetpoint::hold(home + swing, *kp, *kd);
        }
        for _ in 0..steps {
            self.simulation.step(1e-3).expect("the scenes do not diverge");
        }
        self.steps += steps;
        if self.motion == Motion::Fall && self.steps.is_multiple_of(1500) {
            // The base would approach the speed at which it counts as diverged.
            let (q, mut v) = (self.simulation.configuration().to_vec(), self.simulation.velocity().to_vec());
            v[..6].fill(0.0);
            self.simulation.reset(&q, &v).expect("it was a state of the simulation");
        }
    }

    /// Returns the contact points of the last step.
    pub(crate) fn contacts(&self) -> String {
        let mut count = 0;
        self.simulation.visit_contacts(&mut |_| count += 1);
        format!("{count} contact points")
    }
}
