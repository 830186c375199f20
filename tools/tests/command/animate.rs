//! `motorium animate`, and the moving picture of the README.

use std::path::Path;

use motorium_pictures::animation;

use crate::program::{complaint, printed};

/// A second of the Panda that reaches past a post, in lockstep.
pub(crate) fn recorded(folder: &Path) -> String {
    let file = folder.join("a.mcap").to_str().expect("a plain path").to_string();
    let graph = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/panda-obstacles.toml");
    printed(&["run", graph, "--clock", "lockstep", "--hosting", "inline", "--for", "1s", "--record", &file]);
    file
}

/// The colours of a picture.
fn palette(file: &[u8]) -> Vec<[u8; 3]> {
    let start = file.windows(4).position(|kind| kind == b"PLTE").expect("a palette");
    let length = u32::from_be_bytes(file[start - 4..start].try_into().expect("four bytes")) as usize;
    file[start + 4..][..length].chunks_exact(3).map(|colour| [colour[0], colour[1], colour[2]]).collect()
}

#[test]
fn same_recording_gives_the_same_moving_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = recorded(folder.path());
    let drawn = |name: &str, options: &[&str]| {
        let output = folder.path().join(name);
        let output = output.to_str().expect("a plain path");
        printed(&[&["animate", &file, "--size", "96x72", "--output", output], options].concat());
        std::fs::read(output).expect("the picture")
    };
    let picture = drawn("one.png", &[]);
    assert!(picture == drawn("two.png", &[]), "two pictures of one recording differ");
    // 12.5 pictures a second from 0 to 0.999 s.
    assert_eq!(animation::frames(&picture), Some(13));
    assert_eq!(animation::frames(&drawn("fast.png", &["--speed", "4", "--from", "0.5s"])), Some(2));
    assert!(picture != drawn("top.png", &["--view", "top"]));
    // The picture shows the world: the ball is its only orange object.
    let orange = |[r, g, b]: &[u8; 3]| *r > 150 && u16::from(*r) > 2 * u16::from(*b) && r > g;
    assert!(palette(&picture).iter().any(orange), "{:?}", palette(&picture));

    let refused = |options: &[&str]| complaint(&[&["animate", file.as_str()], options].concat());
    assert!(refused(&["--from", "2s"]).contains("`--from` is 2 s, expected a time before"));
    assert!(refused(&["--speed", "0"]).contains("`--speed` is 0, expected above 0"));
    assert!(refused(&["--fps", "60"]).contains("`--fps` is 60, expected 1 to 50"));
    assert!(refused(&["--speed", "0.001", "--fps", "50"]).contains("million dots, expected at most 200;"));
    assert!(refused(&["--speed", "10", "--size", "9000x900"]).contains("expected at most 4 million dots"));
}

#[test]
fn readme_opens_with_a_moving_picture() {
    let workspace = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    let picture = "docs/src/images/panda-obstacles.png";
    let file = std::fs::read(workspace.join(picture)).expect("the picture");
    assert!(animation::frames(&file) > Some(20) && file.len() <= 1_000_000, "{} bytes", file.len());
    let readme = std::fs::read_to_string(workspace.join("README.md")).expect("README");
    let start = readme.split("\n## ").next().expect("its start");
    assert!(start.contains(&format!("src=\"{picture}\"")), "{start}");
    let commands = std::fs::read_to_string(workspace.join("docs/src/commands.md")).expect("a page");
    assert!(commands.contains(&format!("--output {picture}")), "the command that draws {picture}");
}
