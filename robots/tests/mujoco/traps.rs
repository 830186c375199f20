//! Small files with one rule of MJCF each. Every file is read as in MuJoCo, or rejected with its position and
//! a reason.
//!
//! `traps.py` writes `traps.json`. A number agrees if it differs from MuJoCo's by at most 1e-10 of the
//! largest entry of its vector or matrix, or of 1e-3 if that is larger. An angle between two orientations is
//! compared with 0.

use std::collections::BTreeSet;

use motorium_robots::{
    Coordinate, JointKind, Limits, LoadOptions, MimicMode, Model, ModelWarning, parse_mjcf,
};
use serde_json::Value;

use super::compare::{case, error, numbers};

const TOLERANCE: f64 = 1e-10;

/// Files that are rejected: line, column, and a part of the message that names the faulty attribute or
/// element.
const REFUSED: &[(&str, u32, u32, &str)] = &[
    ("joint_range_zero_limited", 5, 7, "range=\""),
    ("joint_range_without_autolimits", 5, 7, "range=\""),
    ("joint_limited_without_range", 5, 7, "\"range\""),
    ("joint_effort_limited_without_range", 5, 7, "\"actuatorfrcrange\""),
    ("joint_damping_polynomial", 5, 7, "damping=\""),
    ("joint_springdamper_half", 5, 7, "springdamper=\""),
    ("joint_ball", 5, 7, "type=\""),
    ("joint_axis_missing", 5, 7, "the axis is zero"),
    ("joint_in_frame", 5, 29, "<joint> of <frame"),
    ("free_type_class_armature", 4, 5, "armature=\""),
    ("free_type_armature", 5, 7, "armature=\""),
    ("free_type_damping", 5, 7, "damping=\""),
    ("free_type_friction", 5, 7, "frictionloss=\""),
    ("free_type_springdamper", 5, 7, "springdamper=\""),
    ("free_align", 5, 7, "align=\""),
    ("free_alignfree", 2, 3, "alignfree=\""),
    ("free_alignfree_joint_class", 2, 3, "alignfree=\""),
    ("free_two", 8, 5, "next to a body with a free joint, no other body may move in the"),
    ("orientation_two_ways", 4, 5, "euler=\""),
    ("class_renamed_root", 3, 3, "class=\""),
    ("class_repeated", 4, 53, "a second class is named \"c\""),
    ("class_unknown", 5, 39, "<geom>"),
    ("class_unknown_attribute", 4, 5, "densty=\""),
    ("class_include", 4, 5, "<include> of \"x.xml\""),
    ("geom_ellipsoid", 7, 41, "type=\""),
    ("geom_shell", 7, 41, "shellinertia=\""),
    ("geom_size_of_four", 7, 41, "size=\""),
    ("geom_negative_mass", 7, 41, "mass=\""),
    ("geom_hfield", 8, 41, "type=\""),
    ("geom_plane", 7, 41, "type=\""),
    ("geom_fromto_and_pos", 7, 41, "fromto=\""),
    ("geom_class_shell", 4, 5, "shellinertia=\""),
    ("geom_class_fromto_own_pos", 4, 25, "fromto=\""),
    ("geom_mesh_inertia", 8, 41, "type=\""),
    ("geom_mesh_refpos", 3, 10, "refpos=\""),
    ("geom_mesh_builtin", 3, 10, "builtin=\""),
    ("geom_fitted_to_mesh", 8, 41, "mesh=\""),
    ("inertial_full_and_quat", 5, 39, "quat=\""),
    ("inertial_full_and_euler", 5, 39, "euler=\""),
    ("inertial_full_and_diagonal", 5, 39, "diaginertia=\""),
    ("inertial_without_pos", 5, 39, "\"pos\""),
    ("inertial_without_inertia", 5, 39, "\"diaginertia\""),
    ("inertial_twice", 5, 95, "a body has one <inertial>"),
    ("inertial_in_frame", 5, 58, "<inertial> of <frame"),
    ("boundmass", 2, 3, "boundmass=\""),
    ("boundinertia", 2, 3, "boundinertia=\""),
    ("balanceinertia", 2, 3, "balanceinertia=\""),
    ("compiler_global", 2, 3, "coordinate=\""),
    ("compiler_unknown", 2, 3, "angel=\""),
    ("body_gravcomp", 4, 5, "gravcomp=\""),
    ("body_mocap", 4, 5, "mocap=\""),
    ("body_class", 4, 5, "class=\""),
    ("frame_free_of_class", 7, 41, "class=\""),
    ("replicate", 7, 58, "<replicate>"),
    ("attach", 7, 58, "<attach>"),
    ("composite", 7, 58, "<flexcomp>"),
    ("equality_quadratic", 12, 5, "polycoef=\""),
    ("equality_flag_off", 3, 11, "equality=\""),
    ("equality_single", 12, 5, "\"joint2\""),
    ("equality_weld", 12, 5, "<weld> of <equality"),
    ("equality_connect", 12, 5, "<connect> of <equality"),
    ("equality_unknown_joint", 12, 5, "<joint>"),
    ("actuator_damping_polynomial", 12, 5, "damping=\""),
    ("actuator_tendon_armature", 15, 5, "armature=\""),
    ("actuator_site_armature", 12, 5, "armature=\""),
    ("actuator_free_armature", 11, 5, "armature=\""),
    ("actuator_unknown_attribute", 12, 5, "amrature=\""),
    ("actuator_unknown_joint", 12, 5, "<motor>"),
    ("tendon_armature", 12, 5, "armature=\""),
    ("tendon_class_armature", 4, 5, "armature=\""),
    ("tendon_unknown_attribute", 12, 5, "amrature=\""),
    ("option_flag_limit", 3, 11, "limit=\""),
    ("option_flag_damper", 3, 11, "damper=\""),
    ("option_flag_frictionloss", 3, 11, "frictionloss=\""),
    ("option_flag_constraint", 3, 11, "constraint=\""),
    ("option_unknown", 3, 3, "gravitty=\""),
    ("section_extension", 3, 3, "<extension>"),
    ("section_deformable", 3, 3, "<deformable>"),
    ("include_root", 3, 3, "<include>"),
    ("include_in_asset", 3, 10, "<include>"),
    ("include_in_actuator", 11, 13, "<include>"),
    ("number_malformed", 5, 7, "axis=\""),
    ("number_infinite", 5, 7, "armature=\""),
    ("number_missing", 5, 7, "axis=\""),
    ("xml_broken", 4, 11, "not well-formed XML: expected 'body' tag, not 'bdy'"),
];

/// Files read with a warning about ignored values.
const IGNORED: &[(&str, &[&str])] = &[
    ("joint_effort_one_sided", &["actuatorfrcrange of <joint>"]),
    ("joint_stiffness_polynomial", &["stiffness of <joint>"]),
    ("joint_springyield", &["springyield of <joint>"]),
    ("free_type_stiffness", &["stiffness of <joint>"]),
    ("geom_fluid", &["fluidshape of <geom>"]),
    ("geom_adhesion", &["adhesion of <geom>"]),
    ("geom_surfacevel", &["surfacevel of <geom>"]),
    ("site_named_like_a_body", &["site \"lower\""]),
    ("actuator_plain", &["<motor> of <actuator>"]),
    ("actuator_armature", &["<motor> of <actuator>"]),
    ("actuator_armature_twice", &["<motor> of <actuator>"]),
    ("actuator_armature_class", &["<motor> of <actuator>"]),
    ("actuator_armature_childclass", &["<motor> of <actuator>"]),
    ("actuator_armature_zero", &["<motor> of <actuator>"]),
    ("actuator_jointinparent", &["<motor> of <actuator>"]),
    ("actuator_damping", &["<motor> of <actuator>"]),
    ("actuator_kv", &["<velocity> of <actuator>"]),
    ("actuator_forcerange", &["<motor> of <actuator>"]),
    ("actuator_dcmotor", &["<dcmotor> of <actuator>"]),
    ("actuator_tendon", &["<motor> of <actuator>"]),
    ("actuator_adhesion", &["<adhesion> of <actuator>"]),
    ("tendon_damping", &["damping of <fixed>"]),
    ("tendon_stiffness", &["stiffness of <fixed>"]),
    ("tendon_range", &["range of <fixed>"]),
    ("tendon_friction", &["frictionloss of <fixed>"]),
    ("option_gravity", &["gravity of <option>"]),
    ("option_fluid", &["density of <option>", "viscosity of <option>"]),
    ("option_flag_gravity", &["gravity of <flag>"]),
    ("option_flag_contact", &["contact of <flag>"]),
    ("contact_pair", &["<pair> of <contact>"]),
];

/// Files that MuJoCo rejects but that are read with a separate warning.
const READ_NEVERTHELESS: &[&str] = &["inertia_triangle"];

fn files() -> Vec<Value> {
    let document: Value = serde_json::from_str(include_str!("traps.json")).unwrap();
    document["files"].as_array().unwrap().clone()
}

fn options(mimic: MimicMode) -> LoadOptions {
    LoadOptions { mimic, ..LoadOptions::default() }
}

/// Returns the largest error of a file that is read, with its warnings, or the error message. The error is
/// infinite if the structure differs.
fn outcome(file: &Value) -> Result<(f64, Vec<ModelWarning>), String> {
    let text = file["text"].as_str().unwrap();
    let robot =
        parse_mjcf(text, None, &options(MimicMode::Independent)).map_err(|error| error.to_string())?;
    let coupled = parse_mjcf(text, None, &options(MimicMode::Follow)).map_err(|error| error.to_string())?;
    let model = &robot.model;
    let floating = usize::from(model.base().floating);
    let same_joints = |joints: &Vec<Value>| joints.len() == model.joint_count() + floating;
    let Some(joints) = file.get("joints").and_then(Value::as_array).filter(|joints| same_joints(joints))
    else {
        return Ok((f64::INFINITY, robot.warnings));
    };
    let mut worst = 0.0_f64;
    let mut check = |_: &str, ours: &[f64], theirs: &[f64]| {
        // NaN is wrong, too
        let error = error(ours, theirs);
        worst = if error.is_nan() { f64::INFINITY } else { worst.max(error) };
    };
    let mut same = |what: &str, yes: bool| check(what, &[f64::from(u8::from(!yes))], &[0.0]);
    for (index, joint) in joints[floating..].iter().enumerate() {
        let Limits { lower, upper, effort, .. } = model.joint(index).limits;
        let name = &model.joint(index).name;
        same("name", joint["name"].as_str().unwrap_or(name) == name);
        same("limited", (lower.is_finite() && upper.is_finite()) == joint.get("range").is_some());
        same("effort limited", effort.is_finite() == joint.get("effort").is_some());
        same("kind", (model.joint(index).kind == JointKind::Continuous) <= joint.get("range").is_none());
    }
    let couplings = file["couplings"].as_array().unwrap();
    let followers =
        coupled.model.bodies().iter().filter(|body| mimic(&coupled.model, &body.joint.name).is_some());
    same("number of couplings", followers.count() == couplings.len());
    let frames = file["cases"][0]["frames"].as_object().unwrap();
    same("frames", frames.keys().all(|name| model.frame(name).is_ok()));
    let free = 6 * floating;
    let (damping, friction) = (numbers(&file["damping"]), numbers(&file["friction"]));
    check(
        "damping and friction of the base",
        &[damping[..free].iter().chain(&friction[..free]).sum()],
        &[0.0],
    );
    for (index, joint) in joints[floating..].iter().enumerate() {
        let Limits { lower, upper, effort, .. } = model.joint(index).limits;
        let passive = model.joint(index).dynamics;
        check("damping", &[passive.damping], &[damping[free + index]]);
        check("friction", &[passive.friction], &[friction[free + index]]);
        if let Some(range) = joint.get("range").map(numbers) {
            check("range", &[lower, upper], &range);
        }
        if let Some(range) = joint.get("effort").map(numbers) {
            // the smaller of two different limits is used, with a warning
            check("effort", &[effort], &[range[1].min(-range[0])]);
        }
    }
    for state in file["cases"].as_array().unwrap() {
        case(model, state, &mut check);
    }
    for coupling in couplings {
        let follower = coupling[0].as_str().unwrap();
        let factors: Vec<f64> =
            coupling.as_array().unwrap()[2..].iter().map(|x| x.as_f64().unwrap()).collect();
        match mimic(&coupled.model, follower) {
            Some((leader, ours)) if coupling[1] == leader.as_str() => {
                check("coupling", &[ours[0], ours[1], 0.0, 0.0, 0.0], &factors);
            }
            _ => check("coupling", &[1.0], &[0.0]),
        }
    }
    Ok((worst, robot.warnings))
}

/// Returns the joint that another follows, with multiplier and offset.
fn mimic(model: &Model, name: &str) -> Option<(String, [f64; 2])> {
    let body = model.bodies().iter().find(|body| body.joint.name == name)?;
    match body.joint.coordinate {
        Coordinate::Independent(_) => None,
        Coordinate::Mimic { of, multiplier, offset } => {
            Some((model.joint(of).name.clone(), [multiplier, offset]))
        }
    }
}

#[test]
fn every_trap_is_read_like_mujoco_or_rejected() {
    let mut read = 0;
    let mut faults: Vec<String> = Vec::new();
    for file in files() {
        let name = file["file"].as_str().unwrap();
        let refused = REFUSED.iter().find(|(refused, ..)| *refused == name);
        match (outcome(&file), refused) {
            (Ok((error, warnings)), None) => {
                read += 1;
                let ignored: Vec<&str> = warnings
                    .iter()
                    .filter_map(|warning| match warning {
                        ModelWarning::Ignored { what, .. } => Some(what.as_str()),
                        _ => None,
                    })
                    .collect();
                let expected =
                    IGNORED.iter().find(|(ignored, _)| *ignored == name).map_or(&[][..], |(_, what)| what);
                if ignored != expected {
                    faults.push(format!("{name}: ignores {ignored:?} instead of {expected:?}"));
                }
                let nevertheless = READ_NEVERTHELESS.contains(&name);
                if nevertheless && warnings.is_empty() || nevertheless != error.is_infinite() {
                    faults.push(format!("{name}: {warnings:?}, error {error:e}"));
                }
                if !nevertheless && error.partial_cmp(&TOLERANCE) != Some(std::cmp::Ordering::Less) {
                    faults.push(format!("{name}: off by {error:e}"));
                }
            }
            (Err(message), Some((_, line, column, words))) => {
                if !message.starts_with(&format!("MJCF:{line}:{column}: ")) || !message.contains(words) {
                    faults.push(format!("{name}: {message}"));
                }
            }
            (Ok((error, _)), Some(_)) => {
                faults.push(format!("{name}: read (error {error:e}) instead of refused"))
            }
            (Err(message), None) => faults.push(format!("{name}: refused: {message}")),
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    println!("{read} read, {} refused", REFUSED.len());
}

#[test]
fn tables_name_existing_files_once() {
    let files = files();
    let names: BTreeSet<&str> = files.iter().map(|file| file["file"].as_str().unwrap()).collect();
    assert_eq!(names.len(), files.len());
    let refused = REFUSED.iter().map(|(name, ..)| *name);
    let listed: Vec<&str> = refused.chain(IGNORED.iter().map(|(name, _)| *name)).collect();
    assert!(listed.iter().all(|name| names.contains(name)), "{listed:?}");
    assert_eq!(listed.iter().collect::<BTreeSet<_>>().len(), listed.len());
    assert!(REFUSED.len() < files.len() / 2);
}
