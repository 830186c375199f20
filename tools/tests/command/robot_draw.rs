//! `motorium robot draw`: coloured faces, and visuals.

use std::fmt::Write as _;

use crate::program::{complaint, printed};

/// A robot whose link has a box for collisions and a bent, non-convex plate as visual.
fn robot(folder: &std::path::Path) -> String {
    let plate =
        "v 0 0 0\nv 1 0 0\nv 1 0 0.1\nv 0 0 0.1\nv 0 1 0\nv 0 1 0.1\nf 1 2 3\nf 1 3 4\nf 1 5 6\nf 1 6 4\n";
    std::fs::write(folder.join("plate.obj"), plate).expect("the folder takes files");
    let mut urdf = String::from(
        "<robot name=\"plate\"><link name=\"base\"/><link name=\"arm\"><inertial><mass value=\"1\"/>",
    );
    urdf += "<inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>";
    urdf += "<visual><geometry><mesh filename=\"plate.obj\"/></geometry><material name=\"m\"><color rgba=\"0.9 0.1 0.1 1\"/></material></visual>";
    urdf += "<collision><geometry><box size=\"1 1 0.1\"/></geometry></collision></link>";
    let _ = write!(
        urdf,
        "<joint name=\"j\" type=\"continuous\"><parent link=\"base\"/><child link=\"arm\"/><axis xyz=\"0 0 1\"/></joint></robot>"
    );
    let path = folder.join("plate.urdf");
    std::fs::write(&path, urdf).expect("the folder takes files");
    path.to_str().expect("a plain path").to_string()
}

/// The faces of a picture: their colours.
fn faces(picture: &str) -> Vec<String> {
    let document = roxmltree::Document::parse(picture).expect("SVG");
    let paths = document.descendants().filter(|node| node.has_tag_name("path"));
    paths.filter_map(|path| Some(path.attribute("fill")?.to_string())).filter(|fill| fill != "none").collect()
}

#[test]
fn every_face_has_its_own_fill() {
    let picture = printed(&["robot", "draw", "panda", "--no-ground"]);
    assert!(!picture.contains("currentColor"));
    let fills = faces(&picture);
    assert!(
        fills.len() > 50 && fills.iter().all(|fill| fill.starts_with('#') && fill.len() == 7),
        "{fills:?}"
    );
}

#[test]
fn visual_meshes_are_drawn_unchanged() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = robot(folder.path());
    let fixed = ["robot", "draw", &file, "--no-ground", "--frames", "none", "--view", "45,30"];
    let collision = faces(&printed(&fixed));
    assert_eq!(collision.len(), 3, "three sides of a box: {collision:?}");
    let visual = faces(&printed(&[&fixed[..], &["--visual"]].concat()));
    // Only the side of the plate that faces the camera: one of two parts, of two triangles.
    assert!((1..=4).contains(&visual.len()), "{visual:?}");
    let red = |fill: &String| {
        let channel = |at: usize| u8::from_str_radix(&fill[at..at + 2], 16).expect("a colour");
        channel(1) > 2 * channel(3)
    };
    assert!(visual.iter().all(red), "{visual:?}");
}

#[test]
fn png_shows_the_shells_and_refuses_marks() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("panda.png");
    let file = file.to_str().expect("a plain path");
    let drawn = |options: &[&str]| {
        printed(
            &[&["robot", "draw", "panda", "--size", "120x120", "--overwrite", "--output", file], options]
                .concat(),
        );
        std::fs::read(file).expect("the picture")
    };
    let (visual, collision) = (drawn(&["--visual"]), drawn(&[]));
    assert!(visual.starts_with(b"\x89PNG") && collision.starts_with(b"\x89PNG") && visual != collision);
    assert!(visual != drawn(&["--visual", "--no-ground"]));
    for option in [&["--com"][..], &["--names"], &["--frames", "all"]] {
        let said =
            complaint(&[&["robot", "draw", "panda", "--overwrite", "--output", file], option].concat());
        assert!(said.contains("write an .svg file"), "{said}");
    }
}
