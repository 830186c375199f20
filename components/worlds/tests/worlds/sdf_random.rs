//! Random worlds in SDF 1.4 to 1.11 compared with closed forms: each is read with equal numbers, or its
//! differences are reported.

mod closed_forms;
mod faults;
mod generator;

use std::collections::BTreeSet;

use motorium_robots::ModelWarning;
use motorium_worlds::{FrictionCombine, Object, ObjectShape, World};
use nalgebra::{Isometry3, Vector3};

use closed_forms::{Frame, Solid};
use generator::{Expected, File, TETRAHEDRON};

/// Number of random files.
const FILES: u64 = 400;
const SAME: f64 = 1e-9;

fn read(file: &File) -> Result<(World, BTreeSet<String>), String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("w.sdf"), &file.text).unwrap();
    std::fs::write(folder.path().join("tetrahedron.obj"), TETRAHEDRON).unwrap();
    let mut world: World = toml::from_str("file = \"w.sdf\"").unwrap();
    let warnings = world.locate(folder.path()).map_err(|error| error.to_string())?;
    world.check(std::iter::empty()).map_err(|error| error.to_string())?;
    // a random mass in a random volume may be denser than every solid
    let of_content = warnings.into_iter().filter(|it| !matches!(it, ModelWarning::Implausible { .. }));
    let named = of_content.map(|warning| match warning {
        ModelWarning::Ignored { what, .. } => what,
        other => other.to_string(),
    });
    Ok((world, named.collect()))
}

/// Returns the larger difference of two frames: between their origins \[m\], or between their axes.
fn apart(found: &Isometry3<f64>, expected: &Frame) -> f64 {
    let turn = found.rotation.to_rotation_matrix().into_inner() - expected.turn;
    (found.translation.vector - expected.origin).amax().max(turn.amax())
}

/// Returns `true` if the parts of an object are these solids.
fn has_solids(object: &Object, solids: &[(Solid, Frame)]) -> bool {
    let parts = object.shape.shapes();
    parts.len() == solids.len()
        && parts.iter().zip(solids).all(|((within, shape), (solid, frame))| {
            let pose = object.pose() * within;
            match (shape, solid) {
                (ObjectShape::Box { size }, Solid::Slope) => {
                    let normal = pose.rotation * Vector3::z();
                    let top = pose.translation.vector + normal * (0.5 * size[2]);
                    (normal - frame.turn.column(2)).amax() < SAME && (top - frame.origin).amax() < SAME
                }
                (ObjectShape::Box { size }, Solid::Box(expected)) => {
                    size == expected && apart(&pose, frame) < SAME
                }
                (ObjectShape::Sphere { radius }, Solid::Sphere(expected)) => {
                    radius == expected && apart(&pose, frame) < SAME
                }
                (ObjectShape::Cylinder { radius, length }, Solid::Cylinder(r, l))
                | (ObjectShape::Capsule { radius, length }, Solid::Capsule(r, l)) => {
                    (radius, length) == (r, l) && apart(&pose, frame) < SAME
                }
                (ObjectShape::Mesh(mesh), Solid::Tetrahedron(scale)) => {
                    mesh.scale == *scale && apart(&pose, frame) < SAME
                }
                _ => false,
            }
        })
}

/// Checks that the mass of an object is distributed evenly over its solids; the reader warns if a file
/// specifies another centre or inertia.
fn check_mass(object: &Object, expected: &Expected, text: &str) {
    let Some(body) = &expected.body else { return assert!(!object.is_dynamic(), "{}\n{text}", object.name) };
    let own = object.mass_properties().unwrap();
    let close = |found: f64, expected: f64| (found - expected).abs() < 1e-9 * expected.abs().max(1.0);
    assert!(close(own.mass, body.mass), "{}: {} kg, expected {}\n{text}", object.name, own.mass, body.mass);
    let frame = object.pose() * own.frame.unwrap_or_default();
    let turn = frame.rotation.to_rotation_matrix().into_inner();
    let tensor = turn * nalgebra::Matrix3::from_diagonal(&own.moments) * turn.transpose();
    let centre = (frame.translation.vector - body.centre).amax();
    assert!(centre < 1e-7, "{}: the centre by {centre} m\n{text}", object.name);
    let inertia = (tensor - body.tensor).amax();
    let bound = 1e-7 * body.tensor.amax();
    assert!(inertia < bound, "{}: the inertia by {inertia} kg m2\n{text}", object.name);
}

fn check(file: &File, world: &World, named: &BTreeSet<String>) {
    let text = &file.text;
    assert_eq!(*named, file.named, "warnings of\n{text}");
    assert_eq!((world.gravity, world.wind), (file.gravity, file.wind), "{text}");
    assert_eq!(world.ground.is_some(), file.ground.is_some(), "{text}");
    if let (Some(found), Some(expected)) = (world.ground, file.ground) {
        assert!(
            (found.height - expected.height).abs() < SAME,
            "{} m, {} m\n{text}",
            found.height,
            expected.height
        );
        assert_eq!((found.friction, found.restitution), (expected.friction, expected.restitution), "{text}");
    }
    let mut left: Vec<&Object> = world.objects.iter().collect();
    for expected in &file.objects {
        let is_it = |object: &&Object| {
            let suffix = object.name.strip_prefix(&expected.name);
            suffix.is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
                && has_solids(object, &expected.solids)
        };
        let found = left.iter().position(is_it);
        let found = found.unwrap_or_else(|| panic!("no object {expected:?} among {left:?}\n{text}"));
        let object = left.swap_remove(found);
        assert_eq!(
            (object.friction, object.restitution),
            (expected.friction, expected.restitution),
            "{text}"
        );
        assert_eq!(world.appearance.colours.get(&object.name), expected.colour.as_ref(), "{text}");
        check_mass(object, expected, text);
    }
    assert!(left.is_empty(), "{left:?} are not in\n{text}");
    let frictions =
        file.objects.iter().map(|object| object.friction).chain(file.ground.map(|ground| ground.friction));
    let frictions: Vec<f64> = frictions.collect();
    let rule = frictions.iter().any(|one| *one != frictions[0]).then_some(FrictionCombine::Min);
    assert!(world.objects.iter().all(|object| object.friction_combine == rule), "{text}");
}

#[test]
fn random_sdf_worlds_equal_closed_forms_or_are_named() {
    let (mut equal, mut warned, mut refused) = (0, 0, BTreeSet::new());
    for seed in 0..FILES {
        let file = generator::file(seed);
        match (read(&file), &file.refused) {
            (Ok((world, named)), None) => {
                check(&file, &world, &named);
                equal += usize::from(named.is_empty());
                warned += usize::from(!named.is_empty());
            }
            (Err(error), Some(expected)) => {
                assert!(
                    error.contains(expected) && error.contains("w.sdf:"),
                    "seed {seed}: {error}\n{}",
                    file.text
                );
                refused.insert(expected.clone());
            }
            (Ok(_), Some(expected)) => panic!("seed {seed}: read, expected \"{expected}\"\n{}", file.text),
            (Err(error), None) => panic!("seed {seed}: {error}\n{}", file.text),
        }
    }
    println!(
        "{equal} files without a warning, {warned} with, {} reasons of refusal: {refused:?}",
        refused.len()
    );
    assert!(equal > 20 && warned > 100 && refused.len() >= 20, "{equal}, {warned}, {}", refused.len());
}
