//! Damaged files: reading always ends in a model or in an error with a position inside the text.

use std::path::Path;

use motorium_robots::{
    BaseMode, Dynamics, Kinematics, LoadOptions, MimicMode, Model, Position, parse_mjcf, parse_urdf_with,
};
use nalgebra::DMatrix;
use proptest::prelude::*;
use serde_json::Value;

/// Replacement tokens: extreme numbers, attribute values, pieces of XML.
const WORDS: [&str; 24] = [
    "0",
    "-0.0",
    "-1",
    "1e308",
    "-1e308",
    "1e-320",
    "nan",
    "inf",
    "",
    "1 2",
    "0 0 0",
    "1e300 1e300 1e300",
    "true",
    "false",
    "free",
    "ball",
    "mesh",
    "plane",
    "xyz",
    "<",
    "\"",
    "&lt;",
    "/>",
    "\u{1F916}",
];

/// Returns the files to damage.
fn texts() -> Vec<String> {
    let document: Value = serde_json::from_str(include_str!("mujoco/traps.json")).unwrap();
    let traps = document["files"].as_array().unwrap();
    let mut texts: Vec<_> = traps.iter().map(|file| file["text"].as_str().unwrap().to_owned()).collect();
    for text in [
        include_str!("mujoco/arm.xml"),
        include_str!("mujoco/walker.xml"),
        include_str!("mujoco/runner.xml"),
        include_str!("fixtures/branching.urdf"),
        include_str!("../catalogue/rrbot/rrbot.urdf"),
    ] {
        // as often as all small files together
        texts.extend(std::iter::repeat_n(text.to_owned(), 60));
    }
    texts
}

/// Returns the bounds of the tokens of a text: names, attribute values, and single characters of the rest.
fn tokens(text: &str) -> Vec<std::ops::Range<usize>> {
    let mut words: Vec<std::ops::Range<usize>> = Vec::new();
    let mut inside = false;
    for (at, letter) in text.char_indices() {
        let part = letter.is_alphanumeric() || "._-".contains(letter);
        match words.last_mut() {
            Some(last) if part && inside => last.end = at + letter.len_utf8(),
            _ if !letter.is_whitespace() => words.push(at..at + letter.len_utf8()),
            _ => {}
        }
        inside = part;
    }
    words
}

/// Returns a text with some of its tokens replaced, removed, repeated or swapped.
fn damaged(mut text: String, damages: &[(u8, prop::sample::Index, prop::sample::Index)]) -> String {
    for (kind, first, second) in damages {
        let words = tokens(&text);
        if words.is_empty() {
            break;
        }
        let (here, there) =
            (words[first.index(words.len())].clone(), words[second.index(words.len())].clone());
        match kind % 5 {
            0 => text.replace_range(here, WORDS[second.index(WORDS.len())]),
            1 => text.replace_range(here.start.min(there.start)..here.end.max(there.start), ""),
            2 => text = [&text[..here.start], &text[there], &text[here.start..]].concat(),
            3 => {
                let word = text[there].to_owned();
                text.replace_range(here, &word);
            }
            // a piece of the text, duplicated
            _ => {
                let piece = text[here.start.min(there.start)..here.end.max(there.end)].to_owned();
                text.insert_str(here.start.min(there.start), &piece[..piece.floor_char_boundary(400)]);
            }
        }
    }
    text
}

/// Exercises a model that was read.
fn walk(model: &Model) {
    let q = model.neutral();
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, &q);
    let mut mass = DMatrix::zeros(model.nv(), model.nv());
    Dynamics::new(model).crba(model, &q, &mut mass);
}

fn inside(text: &str, at: Position) -> bool {
    let lines = text.split('\n').count().max(1) as u32;
    (1..=lines).contains(&at.line) && at.column >= 1
}

fn read(text: &str, base: BaseMode, mimic: MimicMode) -> Result<(), TestCaseError> {
    let options = LoadOptions { base, mimic, ..LoadOptions::default() };
    match parse_mjcf(text, Some(Path::new("robot.xml")), &options) {
        Ok(robot) => walk(&robot.model),
        Err(error) => prop_assert!(inside(text, error.at), "{error}\n{text}"),
    }
    match parse_urdf_with(text, Some(Path::new("robot.urdf")), &options) {
        Ok(robot) => walk(&robot.model),
        Err(error) => prop_assert!(error.at.is_none_or(|at| inside(text, at)), "{error}\n{text}"),
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files_are_read_or_rejected_with_a_position(
        file in any::<prop::sample::Index>(),
        damages in prop::collection::vec(any::<(u8, prop::sample::Index, prop::sample::Index)>(), 0..6),
        base in prop::sample::select(vec![BaseMode::AsFile, BaseMode::Floating, BaseMode::Fixed]),
        mimic in prop::sample::select(vec![MimicMode::Follow, MimicMode::Independent]),
    ) {
        thread_local!(static TEXTS: Vec<String> = texts());
        let text = TEXTS.with(|texts| texts[file.index(texts.len())].clone());
        read(&damaged(text, &damages), base, mimic)?;
    }
}

#[test]
fn nested_bodies_are_limited_to_the_stack_size() {
    let chain = |depth: usize| {
        let bodies = "<body><joint/><geom size=\".1\"/>\n".repeat(depth);
        let text = format!("<mujoco><worldbody>\n{bodies}{}</worldbody></mujoco>", "</body>".repeat(depth));
        parse_mjcf(&text, None, &LoadOptions::default()).map(|robot| robot.model.nv())
    };
    // half of a thread's stack
    let thread = std::thread::Builder::new().stack_size(1 << 20).spawn(move || {
        assert_eq!(chain(140), Ok(140));
        for depth in [150, 1000, 50_000] {
            let message = chain(depth).unwrap_err().to_string();
            assert_eq!(message, "MJCF:149:1: more than 150 nested bodies and frames are not supported");
        }
    });
    thread.unwrap().join().unwrap();
}
