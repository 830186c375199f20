//! Motions with a closed form, or compared with the dynamics of the links alone, by both integration methods.

use std::f64::consts::{PI, TAU};

use motorium_physics::{ArticulatedSimulator, Integrator, JointSetpoint, Options, Simulator, World};
use motorium_robots::{Dynamics, MimicMode, Model, PackagePath, parse_urdf};
use nalgebra::Vector3;

const METHODS: [Integrator; 2] = [Integrator::Euler, Integrator::Midpoint];
const G: f64 = 9.81;

fn robot(text: &str) -> Model {
    parse_urdf(text, None, MimicMode::Follow, &PackagePath::default()).unwrap().model
}

fn simulate(model: &Model, q: &[f64], integrator: Integrator) -> ArticulatedSimulator {
    let options = Options { integrator, self_collision: false, ..Options::default() };
    let mut simulation = ArticulatedSimulator::new(model.clone(), World::default(), q, options).unwrap();
    simulation.commands_mut().fill(JointSetpoint::default());
    simulation
}

/// A link of this mass at `length` along -z of a joint, with moments of inertia about its centre.
fn link(name: &str, length: f64, mass: f64, [x, y, z]: [f64; 3]) -> String {
    format!(
        r#"<link name="{name}"><inertial><origin xyz="0 0 {}"/><mass value="{mass}"/>
  <inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial></link>"#,
        -length
    )
}

fn joint(name: &str, [parent, child]: [&str; 2], z: f64, axis: &str) -> String {
    format!(
        r#"<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>
  <origin xyz="0 0 {z}"/><axis xyz="{axis}"/><limit effort="100" velocity="1000"/></joint>"#
    )
}

#[test]
fn a_pendulum_has_the_period_of_the_elliptic_integral() {
    let text = format!(
        r#"<robot name="rod"><link name="base"/>{}{}</robot>"#,
        joint("hinge", ["base", "rod"], 0.0, "0 1 0"),
        link("rod", 0.4, 1.0, [0.02, 0.02, 0.001])
    );
    let (model, inertia, arm) = (robot(&text), 0.02 + 0.16, 0.4);
    for amplitude in [0.3, 1.5, 2.8_f64] {
        // Period: 2 pi / agm(1, cos(a / 2)), divided by the angular frequency of small oscillations.
        let (mut one, mut two) = (1.0, (0.5 * amplitude).cos());
        for _ in 0..30 {
            (one, two) = (0.5 * (one + two), f64::sqrt(one * two));
        }
        let period = TAU / one * (inertia / (G * arm)).sqrt();
        for (method, close, drift) in [(Integrator::Euler, 1e-5, 1e-3), (Integrator::Midpoint, 1e-5, 1e-6)] {
            let mut rod = simulate(&model, &[amplitude], method);
            let energy = |rod: &ArticulatedSimulator| {
                let (q, v) = (rod.positions()[0], rod.velocities()[0]);
                0.5 * inertia * v * v - G * arm * q.cos()
            };
            let mut passes: Vec<f64> = Vec::new();
            let (mut before, mut first, mut last) = (amplitude, 0.0, 0.0);
            for step in 1..=100_000 {
                rod.step(1e-3).unwrap();
                let now = rod.positions()[0];
                if before > 0.0 && now <= 0.0 {
                    passes.push(1e-3 * (f64::from(step) - now / (now - before)));
                }
                before = now;
                // The energy varies within a swing, so its means over the first and the last ten seconds are
                // compared.
                match step {
                    ..=10_000 => first += energy(&rod) / 1e4,
                    90_001.. => last += energy(&rod) / 1e4,
                    _ => {}
                }
            }
            let found = (passes[passes.len() - 1] - passes[0]) / (passes.len() - 1) as f64;
            assert!(
                (found / period - 1.0).abs() < close,
                "{method:?}, {amplitude}: {found} s, expected {period} s"
            );
            let lost = (last - first).abs() / (G * arm * (1.0 - amplitude.cos()));
            assert!(lost < drift, "{method:?}, {amplitude}: {lost} of the energy in 100 s");
        }
    }
}

#[test]
fn gyroscope_precesses_as_in_closed_form() {
    // A disc at 0.2 m along -x from the pivot of a gimbal that rotates about z and y and whose axle is x.
    let text = format!(
        r#"<robot name="gyroscope"><link name="base"/>{}{}{}{}{}
  <link name="disc"><inertial><origin xyz="0.2 0 0"/><mass value="0.5"/>
  <inertia ixx="0.002" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"#,
        joint("turn", ["base", "post"], 0.0, "0 0 1"),
        link("post", 0.0, 1e-6, [1e-9; 3]),
        joint("nod", ["post", "axle"], 0.0, "0 1 0"),
        link("axle", 0.0, 1e-6, [1e-9; 3]),
        joint("spin", ["axle", "disc"], 0.0, "1 0 0"),
    );
    let model = robot(&text);
    let spin = 300.0;
    for method in METHODS {
        // It starts in steady precession: Omega (I_s w) = m g l at the horizontal, to first order in Omega /
        // w.
        let precession = 0.5 * G * 0.2 / (0.002 * spin);
        let mut top = simulate(&model, &[0.0; 3], method);
        top.reset(&[0.0; 3], &[precession, 0.0, spin]).unwrap();
        for _ in 0..2000 {
            top.step(2.5e-4).unwrap();
        }
        let turned = top.positions()[0];
        // The disc extends along x and its spin points there: its weight turns it from x to y.
        assert!((turned / (0.5 * precession) - 1.0).abs() < 0.01, "{method:?}: {turned} rad");
        assert!(top.positions()[1].abs() < 0.01, "{method:?}: it nods by {} rad", top.positions()[1]);
    }
}

#[test]
fn falling_chain_follows_the_dynamics_of_its_links() {
    let (n, names) = (8, (0..=8).map(|index| format!("link{index}")).collect::<Vec<_>>());
    let mut text = String::from(r#"<robot name="chain"><link name="link0"/>"#);
    for index in 0..n {
        let z = if index == 0 { 0.0 } else { -0.2 };
        let axis = if index % 2 == 0 { "0 1 0" } else { "1 0 0" };
        text += &joint(&format!("joint{index}"), [&names[index], &names[index + 1]], z, axis);
        text += &link(&names[index + 1], 0.1, 0.3, [0.001, 0.001, 1e-4]);
    }
    text += "</robot>";
    let model = robot(&text);
    let q0: Vec<f64> = (0..n).map(|index| 0.4 * PI * (1.3 * index as f64 + 0.5).sin()).collect();
    // Fourth-order Runge-Kutta over the articulated-body algorithm.
    let mut dynamics = Dynamics::new(&model);
    let gravity = Vector3::new(0.0, 0.0, -G);
    let mut slope = |state: &[f64]| {
        let (q, v) = state.split_at(n);
        let mut a = vec![0.0; n];
        dynamics.forward(&model, q, v, &vec![0.0; n], gravity, &mut a).unwrap();
        [v, &a].concat()
    };
    let along =
        |x: &[f64], s: &[f64], h: f64| -> Vec<f64> { x.iter().zip(s).map(|(x, s)| x + h * s).collect() };
    let (mut exact, h) = ([q0.clone(), vec![0.0; n]].concat(), 5e-5);
    for _ in 0..10_000 {
        let k1 = slope(&exact);
        let k2 = slope(&along(&exact, &k1, 0.5 * h));
        let k3 = slope(&along(&exact, &k2, 0.5 * h));
        let k4 = slope(&along(&exact, &k3, h));
        for (i, x) in exact.iter_mut().enumerate() {
            *x += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
    }
    for (method, bound) in [(Integrator::Euler, 0.02), (Integrator::Midpoint, 2e-5)] {
        let mut chain = simulate(&model, &q0, method);
        for _ in 0..5000 {
            chain.step(1e-4).unwrap();
        }
        let worst =
            chain.positions().iter().zip(&exact).map(|(q, exact)| (q - exact).abs()).fold(0.0, f64::max);
        println!("{method:?}: {worst:.2e} rad after 0.5 s");
        assert!(worst < bound, "{method:?}: {worst} rad");
    }
}
