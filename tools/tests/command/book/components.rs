//! The book shows the components that are tested here; in graphs they behave as their chapters describe.

use std::path::Path;

use motorium::declare::{ConfigError, RobotReference};
use motorium::launcher::{Options, Report};
use motorium::session;
use motorium::worker::{Kind, Registry, RobotSource};

use super::{blocks, read, workspace};

/// The component of the chapter on writing one, verbatim.
#[allow(dead_code)] // its `main`, which a test does not call
mod circle {
    include!("circle.rs");

    pub(super) fn kind() -> motorium::worker::Kind {
        motorium::worker::Kind::of::<Circle>()
    }
}

/// The component of the chapter on one with a robot, with the test of that chapter.
#[allow(dead_code, unreachable_pub)] // a library to the programs that the chapter describes
#[allow(clippy::approx_constant)] // angles as the profile of the Panda states them
mod admittance {
    pub(super) fn kind() -> motorium::worker::Kind {
        motorium::worker::Kind::of::<Admittance>()
    }

    include!("admittance.rs");
}

#[test]
fn book_and_readme_show_the_tested_component() {
    let code = read("tools/tests/command/book/circle.rs");
    let shown = |page: &str| -> Vec<String> {
        let path = workspace().join(page);
        blocks("rust").into_iter().filter(|(found, _)| *found == path).map(|(_, text)| text).collect()
    };
    assert!(shown("docs/src/writing-a-component.md").contains(&code), "the chapter shows another component");
    let step = shown("README.md").pop().expect("the README shows a step");
    let indented: String = step.lines().map(|line| format!("    {line}\n")).collect();
    assert!(code.contains(&indented), "the README shows another step:\n{step}");
}

#[test]
fn book_component_moves_along_its_circle() {
    let set = ["clock=lockstep", "duration=4 s"];
    let report = run_with(circle::kind(), "toml circle", "circle", &set);
    let error = report.results["controller"]["tasks"]["cartesian"]["last_position_error_m"].as_f64();
    assert!(error.is_some_and(|error| error < 5e-3), "{}", report.results["controller"]);
}

/// Runs the graph of a chapter, with a kind in place of the program that the chapter makes.
fn run_with(kind: Kind, block: &str, program: &str, set: &[&str]) -> Report {
    let check = |robot: &RobotReference| {
        motorium_robots::load(&robot.urdf, &robot.base)
            .map(|_| Vec::new())
            .map_err(|error| ConfigError::new(error.to_string()))
    };
    let kinds = [kind].into_iter().chain(motorium_physics::kinds()).chain(motorium_sensors::kinds());
    let registry = Registry::new(RobotSource { check }, kinds.chain(motorium_control::kinds()));
    let [(page, graph)] = blocks(block).try_into().expect("one graph with the component");
    let exec = format!("exec      = \"target/release/{program}\"");
    assert!(graph.contains(&exec), "{graph}");
    let graph = graph.replace(&exec, &format!("kind = \"{}\"", kind.name));
    let set: Vec<_> = set.iter().map(|setting| setting.parse().expect("an override")).collect();
    let machine = motorium::graph::Machine::detect();
    let checked = motorium::graph::check(&page, graph, &set, &registry, &machine);
    let plan = checked.unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    session::run(plan, &registry, &Options::threads(), &mut |_| ()).expect("it runs")
}

#[test]
fn admittance_of_the_book_is_tested_and_yields() {
    let page = read("docs/src/robot-component.md");
    assert!(
        page.contains(&read("tools/tests/command/book/admittance.rs")),
        "the chapter shows another component"
    );
    let panda = motorium_robots::load("panda", Path::new(".")).expect("a robot of the catalogue");
    let tool = panda.end_effector(None).expect("its hand");
    let mut kinematics = motorium_robots::Kinematics::new(&panda.model);
    let mut place = |duration: &str| {
        let set = ["clock=lockstep", &format!("duration={duration}")];
        let report = run_with(admittance::kind(), "toml admittance", "admittance", &set);
        let physics = &report.results["physics"]["joint_position"];
        let q: Vec<f64> =
            physics.as_array().expect("joints").iter().map(|q| q.as_f64().expect("a number")).collect();
        kinematics.update(&panda.model, &q);
        kinematics.pose(&panda.model, tool).translation.vector
    };
    let (start, pushed, back) = (place("900 ms"), place("2.9 s"), place("5 s"));
    let moved = pushed - start;
    assert!((moved.y - 0.05).abs() < 2e-3 && moved.x.abs() < 2e-3 && moved.z.abs() < 2e-3, "{moved}");
    assert!((back - start).norm() < 2e-3, "{}", back - start);
}
