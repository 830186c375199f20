//! The integration tests of the crate as one program. `allocations.rs` is a separate program because it
//! counts allocations.

mod actuator_networks;
mod actuators;
mod axes_near_poles;
mod bases;
mod catalogue;
mod collision;
mod constrained;
mod conventions;
mod derivatives;
mod distances;
mod drivetrains;
mod end_effectors;
mod floating;
mod golden;
mod inverse_kinematics;
mod joint_subsets;
mod lie_groups;
mod loading;
mod manipulability;
mod mass_matrix;
mod meshes;
mod model_edits;
mod mujoco;
mod mutations;
mod other_robots;
mod pinocchio;
mod pinocchio_catalogue;
mod profiles;
mod properties;
mod solids;
mod standing;
mod units;
mod urdf_faults;
mod urdf_reading;
mod urdf_writing;
mod witnesses;

#[path = "../examples/forward_kinematics.rs"]
#[allow(dead_code, reason = "the main function of the example")]
mod forward_kinematics_example;
#[path = "../examples/inverse_dynamics.rs"]
#[allow(dead_code, reason = "the main function of the example")]
mod inverse_dynamics_example;

#[test]
fn examples_run_on_fixed_and_floating_bases() {
    for robot in ["panda", "quadrotor"] {
        inverse_dynamics_example::run(robot).unwrap();
    }
    for robot in ["panda", "planar-3r"] {
        forward_kinematics_example::run(robot).unwrap();
    }
}

#[test]
fn every_file_in_this_folder_is_part_of_a_test_program() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let all = std::fs::read_to_string(folder.join("all.rs")).unwrap();
    for entry in std::fs::read_dir(folder).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let Some(module) = name.strip_suffix(".rs") else { continue };
        let part = all.lines().any(|line| line == format!("mod {module};"));
        assert!(
            part || ["all", "allocations"].contains(&module),
            "tests/{name} is not a module of tests/all.rs"
        );
    }
}
