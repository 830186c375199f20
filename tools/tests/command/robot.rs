//! `motorium robot`: robots listed, shown, checked, drawn, timed, evaluated, installed.

use std::path::{Path, PathBuf};

use crate::program::{complaint, json, motorium, printed, run};
use serde_json::{Value, json};

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tools are in the workspace").to_path_buf()
}

/// Pinocchio's results for a robot of the catalogue.
fn golden(robot: &str) -> String {
    let path = workspace().join(format!("robots/tests/golden/catalogue/{robot}.json"));
    path.to_str().expect("a plain path").to_string()
}

fn write(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("the file can be written");
    path.to_str().expect("a plain path").to_string()
}

const LINK: &str = r#"<link name="arm"><inertial><mass value="1"/>
  <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>"#;
const JOINT: &str = r#"<joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" effort="5" velocity="3"/></joint>"#;

fn urdf(body: &str) -> String {
    format!("<robot name=\"own\">\n<link name=\"base\"/>\n{body}\n</robot>\n")
}

#[test]
fn the_list_has_the_whole_catalogue() {
    let listed = json(&["robot", "list", "--json"]);
    let robots = listed["catalogue"].as_array().expect("a list");
    assert!(robots.len() >= 19);
    let find = |name: &str| robots.iter().find(|robot| robot["name"] == name).expect("it is listed");
    assert_eq!((&find("centaur")["joints"], &find("centaur")["base"]), (&json!(44), &json!("floating")));
    assert_eq!((&find("panda")["nv"], &find("panda")["base"]), (&json!(8), &json!("fixed")));
    let table = printed(&["robot", "list"]);
    for robot in robots {
        let name = robot["name"].as_str().expect("a name");
        assert!(table.lines().any(|line| line.split_whitespace().next() == Some(name)), "{name}");
    }
}

#[test]
fn a_robot_is_shown_with_its_joints_poses_and_sources() {
    let panda = json(&["robot", "show", "panda", "--json"]);
    let joints = panda["joints"].as_array().expect("a list");
    assert_eq!(joints.len(), 9);
    assert_eq!(joints[3]["upper"], -0.0698);
    assert_eq!(joints[8]["mimic"]["joint"], "panda_finger_joint1");
    assert_eq!(panda["profile"]["poses"]["ready"].as_array().map(Vec::len), Some(8));
    let text = printed(&["robot", "show", "biped"]);
    for part in ["left_knee", "standing (home): base at 0 0 0.7", "foot left: left_sole, a sole of", "Winter"]
    {
        assert!(text.contains(part), "no `{part}` in:\n{text}");
    }
    let robot = complaint(&["robot", "show", "pandas"]);
    assert!(robot.contains("did you mean \"panda\"?"), "{robot}");
}

#[test]
fn every_defect_of_a_file_is_named_with_its_link() {
    let folder = tempfile::tempdir().expect("a folder");
    let bad = LINK.replace("ixx=\"0.1\"", "ixx=\"0.5\"");
    let mesh = "<link name=\"hand\"><collision><geometry><mesh filename=\"package://own/hand.stl\"/></geometry></collision></link>\
                <joint name=\"fix\" type=\"fixed\"><parent link=\"arm\"/><child link=\"hand\"/></joint>";
    let file = write(folder.path(), "own.urdf", &urdf(&format!("{bad}{JOINT}{mesh}")));
    let output = run(&["robot", "check", &file]);
    assert!(output.status.success());
    let warnings = String::from_utf8(output.stderr).expect("text");
    assert!(
        warnings.contains("link \"arm\": rotational inertia breaks the triangle inequality"),
        "{warnings}"
    );
    assert!(warnings.contains("link \"hand\": mesh \"package://own/hand.stl\" not found"), "{warnings}");
    assert_eq!(run(&["robot", "check", &file, "--strict"]).status.code(), Some(3));

    let package = folder.path().join("elsewhere/own");
    std::fs::create_dir_all(&package).expect("a folder");
    std::fs::write(package.join("hand.stl"), "solid\nendsolid\n").expect("a mesh");
    let elsewhere = folder.path().join("elsewhere");
    let found =
        json(&["robot", "check", &file, "--package-path", elsewhere.to_str().expect("plain"), "--json"]);
    let warnings = found["warnings"].as_array().expect("a list");
    assert!(warnings.iter().all(|warning| !warning.as_str().expect("text").contains("not found")), "{found}");
    assert_eq!((&found["valid"], &found["size"]["joints"]), (&json!(true), &json!(1)));
}

#[test]
fn malformed_xml_gives_line_and_column() {
    let folder = tempfile::tempdir().expect("a folder");
    let file =
        write(folder.path(), "broken.urdf", "<robot name=\"r\">\n  <link name=\"a\">\n  </lin>\n</robot>\n");
    let output = run(&["robot", "check", &file]);
    assert_eq!(output.status.code(), Some(3));
    let error = String::from_utf8(output.stderr).expect("text");
    assert!(error.contains("broken.urdf:3:3: not well-formed XML"), "{error}");
    assert!(error.contains("3 |   </lin>\n  |   ^"), "{error}");
    let answer: Value =
        serde_json::from_slice(&run(&["robot", "check", &file, "--json"]).stdout).expect("JSON");
    assert_eq!((&answer["valid"], &answer["line"], &answer["column"]), (&json!(false), &json!(3), &json!(3)));
    let nowhere = run(&["robot", "check", "no-such-robot"]);
    assert_eq!(nowhere.status.code(), Some(1));
}

/// The elements of this name in an SVG file.
fn count(text: &str, name: &str) -> usize {
    let document = roxmltree::Document::parse(text).expect("XML");
    document.descendants().filter(|node| node.has_tag_name(name)).count()
}

#[test]
fn every_robot_of_the_catalogue_can_be_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    for robot in json(&["robot", "list", "--json"])["catalogue"].as_array().expect("a list") {
        let name = robot["name"].as_str().expect("a name");
        let file = folder.path().join(format!("new/{name}.svg"));
        printed(&["robot", "draw", name, "--output", file.to_str().expect("plain"), "--com"]);
        let picture = std::fs::read_to_string(&file).expect("a picture");
        assert!(count(&picture, "path") > 15, "{name}");
        assert_eq!(count(&picture, "circle"), 1, "{name}: the centre of mass");
        for number in
            picture.split(['"', 'M', 'L', 'l', 'Z', ' ']).filter_map(|part| part.parse::<f64>().ok())
        {
            assert!(number.is_finite() && number.abs() < 4000.0, "{name}: {number}");
        }
    }
}

#[test]
fn pictures_follow_pose_view_and_frames() {
    let draw = |more: &[&str]| printed(&[&["robot", "draw", "panda"], more].concat());
    let home = draw(&[]);
    assert_eq!(home, draw(&["--pose", "ready"]), "home is the default, and drawing is repeatable");
    assert_ne!(home, draw(&["--q", "panda_joint4=-1.0,panda_joint1=0.5"]));
    assert_ne!(home, draw(&["--view", "left"]));
    assert!(count(&draw(&["--frames", "all", "--names"]), "text") >= 12);
    assert!(draw(&["--size", "300x200"]).contains("viewBox=\"0 0 300 200\""));
    let quadruped = printed(&["robot", "draw", "quadruped"]);
    assert_ne!(quadruped, printed(&["robot", "draw", "quadruped", "--base", "0,0,0.3,0,0.3,0"]));
    for (wrong, advice) in [
        (&["--pose", "redy"][..], "did you mean \"ready\"?"),
        (&["--q", "1,2"], "--q has 2 positions, expected 8"),
        (&["--q", "panda_joint9=1"], "no independent joint `panda_joint9`"),
        (&["--base", "0,0,1"], "--floating-base"),
        (&["--view", "above"], "AZIMUTH,ELEVATION"),
        (&["--size", "9x9"], "from 16 to 10000"),
    ] {
        let error = complaint(&[&["robot", "draw", "panda"], wrong].concat());
        assert!(error.contains(advice), "{error}");
    }
}

#[test]
fn a_robot_of_meshes_is_drawn_as_sticks() {
    let folder = tempfile::tempdir().expect("a folder");
    let tip = "<link name=\"tip\"/><joint name=\"end\" type=\"fixed\"><parent link=\"arm\"/><child link=\"tip\"/>\
               <origin xyz=\"0 0 -0.5\"/></joint>";
    let file = write(folder.path(), "own.urdf", &urdf(&format!("{LINK}{JOINT}{tip}")));
    assert!(count(&printed(&["robot", "draw", &file]), "path") > 20);
}

#[test]
fn the_algorithms_of_a_robot_are_timed() {
    let times = json(&["robot", "bench", "double-pendulum", "--samples", "10", "--json"]);
    let rows = times["times"].as_array().expect("a list");
    assert!(rows.len() >= 12);
    for row in rows {
        let time = |key: &str| row[key].as_f64().expect("a number");
        assert!(
            0.0 < time("p50_ns") && time("p50_ns") <= time("p99_ns") && time("p99_ns") <= time("max_ns"),
            "{row}"
        );
    }
    assert!(printed(&["robot", "bench", "pendulum", "--samples", "10"]).contains("forward dynamics (ABA)"));
}

/// All numbers of a value, in order.
fn flatten(value: &Value, numbers: &mut Vec<f64>) {
    match value {
        Value::Array(entries) => entries.iter().for_each(|entry| flatten(entry, numbers)),
        Value::Object(entries) => entries.values().for_each(|entry| flatten(entry, numbers)),
        value => numbers.extend(value.as_f64()),
    }
}

/// Asserts that every number of `theirs` is at the same position in `ours`.
fn assert_holds(ours: &Value, theirs: &Value, place: &str) {
    match theirs {
        Value::Object(entries) => {
            for (key, theirs) in entries {
                assert_holds(&ours[key], theirs, &format!("{place}.{key}"));
            }
        }
        Value::String(_) => assert_eq!(ours, theirs, "{place}"),
        theirs => {
            let (mut a, mut b) = (Vec::new(), Vec::new());
            flatten(ours, &mut a);
            flatten(theirs, &mut b);
            assert_eq!(a.len(), b.len(), "{place}");
            let scale = b.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
            let worst = a.iter().zip(&b).fold(0.0_f64, |most, (x, y)| most.max((x - y).abs()));
            assert!(worst <= 1e-10 * scale, "{place} is off by {worst:.1e}");
        }
    }
}

#[test]
fn golden_states_reproduce_their_results() {
    for robot in ["panda", "pendulum", "quadruped", "mobile-manipulator"] {
        let file = golden(robot);
        let theirs: Value =
            serde_json::from_str(&std::fs::read_to_string(&file).expect("a file")).expect("JSON");
        let ours = json(&["robot", "eval", robot, "--states", &file, "--json"]);
        for key in ["joints", "cases", "nq", "nv", "gravity", "dt", "jacobian_frames", "total_mass"] {
            if let (Value::Array(ours), Value::Array(theirs)) = (&ours[key], &theirs[key]) {
                assert_eq!(ours.len(), theirs.len(), "{robot}: {key}");
                for (index, (ours, theirs)) in ours.iter().zip(theirs).enumerate() {
                    assert_holds(ours, theirs, &format!("{robot}: {key} {index}"));
                }
            } else {
                assert_holds(&ours[key], &theirs[key], key);
            }
        }
        let compared = printed(&["robot", "eval", robot, "--states", &file]);
        assert!(compared.contains("M_upper") && compared.contains("ok: all within"), "{compared}");
    }
}

#[test]
fn wrong_results_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut states: Value =
        serde_json::from_str(&std::fs::read_to_string(golden("rrbot")).expect("a file")).expect("JSON");
    states["cases"][1]["rnea"][0] = json!(17.0);
    let file = write(folder.path(), "states.json", &states.to_string());
    let output = run(&["robot", "eval", "rrbot", "--states", &file]);
    assert_eq!(output.status.code(), Some(1));
    let errors = String::from_utf8(output.stderr).expect("text");
    assert!(errors.contains("rnea differ by more than 1e-8"), "{errors}");
}

#[test]
fn states_may_name_omit_and_reorder_joints() {
    let folder = tempfile::tempdir().expect("a folder");
    let eval = |robot: &str, states: Value, more: &[&str]| {
        let file = write(folder.path(), "states.json", &states.to_string());
        json(&[&["robot", "eval", robot, "--states", &file, "--json"], more].concat())
    };
    let named = eval("panda", json!({ "cases": [{ "joint_positions": { "panda_joint4": -1.5 } }] }), &[]);
    assert_eq!(named["nv"], 9, "mimic joints are independent by default");
    assert_eq!(named["cases"][0]["joint_positions"]["panda_joint4"], -1.5);
    assert_eq!(named["cases"][0]["rnea"], named["cases"][0]["gravity"], "v and a are zero");
    let list = json!({ "joints": ["joint2", "joint1"], "cases": [{ "q": [0.3, 0.1], "v": [1.0, 2.0] }] });
    let swapped = eval("rrbot", list, &["--frame", "tool_link"]);
    assert_eq!(swapped["cases"][0]["joint_positions"], json!({ "joint1": 0.1, "joint2": 0.3 }));
    let columns = &swapped["cases"][0]["frames"]["tool_link"]["J_lwa"];
    assert!(
        columns[0][0].as_f64().expect("a number") < columns[0][1].as_f64().expect("a number"),
        "{columns}"
    );
    assert!(swapped["cases"][0]["frames"]["link3"].get("J_lwa").is_none(), "not requested");
    let floating =
        eval("pendulum", json!({ "cases": [{ "q": [0, 0, 1, 0, 0, 0, 1, 1, 0] }] }), &["--floating-base"]);
    assert_eq!((&floating["nq"], &floating["nv"]), (&json!(9), &json!(7)));
    assert_eq!(floating["joints"][0]["name"], "root_joint");
    assert_eq!(floating["cases"][0]["com"][2], 0.5);
}

#[test]
fn invalid_state_error_names_case_and_key() {
    let folder = tempfile::tempdir().expect("a folder");
    for (states, fault) in [
        (json!({ "states": [] }), "no list `cases`"),
        (json!({ "cases": [{ "q": [1.0, 0.0, 0.0] }] }), "case 0: `q` has 3 entries, expected 4"),
        (json!({ "cases": [{}] }), "neither `q` nor `joint_positions`"),
        (json!({ "cases": [{ "q": [0.1, 0.2], "v": [1.0] }] }), "`v` has 1 entries, expected 2"),
        (json!({ "cases": [{ "q": [0.1, "x"] }] }), "`q` contains \"x\", expected numbers"),
        (json!({ "joints": ["joint1"], "cases": [{ "q": [0.1] }] }), "are missing: joint2"),
        (json!({ "joints": ["joint1", "joint7"], "cases": [] }), "no independent joint `joint7`"),
        (json!({ "joints": ["root_joint", "joint1", "joint2"], "cases": [] }), "add --floating-base"),
    ] {
        let file = write(folder.path(), "states.json", &states.to_string());
        let error = complaint(&["robot", "eval", "rrbot", "--states", &file]);
        assert!(error.contains(fault), "{states}: {error}");
    }
    let file = write(folder.path(), "states.json", "{");
    assert!(complaint(&["robot", "eval", "rrbot", "--states", &file]).contains("is not JSON"));
}

/// A substitute for pip: it unpacks one robot, or fails.
#[cfg(unix)]
fn pip(folder: &Path, script: &str) -> String {
    use std::os::unix::fs::PermissionsExt as _;
    let file = write(folder, "python", &format!("#!/bin/sh\n{script}\n"));
    std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o755)).expect("it can be made to run");
    file
}

#[test]
fn installed_robots_are_found_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = write(folder.path(), "own.urdf", &urdf(&format!("{LINK}{JOINT}")));
    let python = pip(
        folder.path(),
        &format!(
            "if [ \"$3\" = --version ]; then echo pip; exit 0; fi\n\
             while [ \"$1\" != --target ]; do shift; done\n\
             robots=$2/cmeel.prefix/share/example-robot-data/robots/own_description/urdf\n\
             mkdir -p $robots && cp {source} $robots/walker.urdf"
        ),
    );
    let robots = folder.path().join("robots");
    let installed = |arguments: &[&str]| {
        let output = motorium(arguments).env("MOTORIUM_ROBOTS", &robots).output().expect("it runs");
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{arguments:?}: {errors}");
        String::from_utf8(output.stdout).expect("text")
    };
    for _ in 0..2 {
        let message = installed(&["robot", "install", "example-robot-data", "--python", &python]);
        assert!(message.contains("1 robots"), "{message}");
    }
    assert!(installed(&["robot", "list"]).contains("walker"));
    assert!(installed(&["robot", "check", "walker"]).contains("robot `own`"));
    assert!(installed(&["robot", "show", "example-robot-data/walker"]).contains("hinge"));
    let left: Vec<_> =
        std::fs::read_dir(&robots).expect("a folder").flatten().map(|entry| entry.file_name()).collect();
    assert_eq!(left, ["example-robot-data"], "nothing else is left behind");
}

#[test]
fn missing_pip_or_package_error_gives_advice() {
    let folder = tempfile::tempdir().expect("a folder");
    let into = folder.path().join("robots");
    let into = into.to_str().expect("a plain path");
    let install = |python: &str| {
        complaint(&["robot", "install", "example-robot-data", "--python", python, "--into", into])
    };
    let error = install("/nowhere/python");
    assert!(error.contains("pip` does not work") && error.contains("--python"), "{error}");
    let python = pip(folder.path(), "[ \"$3\" = --version ] && exit 0; echo no network >&2; exit 1");
    let error = install(&python);
    assert!(
        error.contains("pip could not download example-robot-data==6.0.0") && error.contains("no network"),
        "{error}"
    );
    let python = pip(folder.path(), "exit 0");
    let error = install(&python);
    assert!(error.contains("its layout changed"), "{error}");
    assert_eq!(std::fs::read_dir(into).expect("a folder").count(), 0, "nothing is left behind");
}

#[test]
fn users_own_robot_file_runs_in_a_graph() {
    let folder = tempfile::tempdir().expect("a folder");
    for suffix in ["urdf", "toml"] {
        let source = workspace().join(format!("robots/catalogue/iiwa14/iiwa14.{suffix}"));
        std::fs::copy(source, folder.path().join(format!("arm.{suffix}"))).expect("it can be copied");
    }
    let graph = std::fs::read_to_string(workspace().join("graphs/panda-reach.toml")).expect("a graph");
    let graph = graph.replace("urdf = \"panda\"", "urdf = \"arm.urdf\"").replace("#:schema", "#");
    let graph = write(folder.path(), "graph.toml", &graph);
    let output = run(&["run", &graph, "--clock", "lockstep", "--for", "300ms", "--in-process", "--json"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let report: Value = serde_json::from_slice(&output.stdout).expect("a report");
    let position = report["results"]["physics"]["joint_position"].as_array().expect("positions");
    assert_eq!(position.len(), 7);
}

#[test]
fn states_of_an_mjcf_robot_name_joints() {
    let folder = tempfile::tempdir().expect("a folder");
    let robot = write(
        folder.path(),
        "two.xml",
        r#"<mujoco><worldbody><body name="b"><joint name="second" axis="0 0 1" range="-90 90"/><geom size="0.1"/>
        <body name="c" pos="1 0 0"><joint name="first" axis="0 0 1" range="-90 90"/><geom size="0.1"/></body></body></worldbody></mujoco>"#,
    );
    let eval = |states: Value, more: &[&str]| {
        let file = write(folder.path(), "states.json", &states.to_string());
        json(&[&["robot", "eval", &robot, "--states", &file, "--json"], more].concat())
    };
    let positions = json!({ "second": 0.3, "first": -0.2 });
    let named = eval(json!({ "cases": [{ "joint_positions": positions }] }), &["--frame", "c"]);
    assert_eq!(named["cases"][0]["joint_positions"], positions);
    assert_eq!(named["cases"][0]["q"], json!([0.3, -0.2]), "the order of the file");
    assert_eq!(named["cases"][0]["frames"]["c"]["p"][0], json!(0.3_f64.cos()));
}

#[test]
fn mass_of_fixed_links_is_printed() {
    let folder = tempfile::tempdir().expect("a folder");
    let heavy = r#"<link name="base"><inertial><mass value="3"/>
        <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>"#;
    let text = urdf(&format!("{LINK}{JOINT}")).replace(r#"<link name="base"/>"#, heavy);
    let file = write(folder.path(), "own.urdf", &text);
    for command in ["check", "show"] {
        let text = printed(&["robot", command, &file]);
        assert!(text.contains("1 kg moving, 4 kg in total"), "{text}");
    }
    let size = &json(&["robot", "check", &file, "--json"])["size"];
    assert_eq!((&size["mass"], &size["total_mass"]), (&json!(1.0), &json!(4.0)));
}

#[test]
fn millimetre_mesh_causes_a_warning() {
    let folder = tempfile::tempdir().expect("a folder");
    write(
        folder.path(),
        "part.obj",
        "v 0 0 0\nv 300 0 0\nv 0 40 0\nv 0 0 40\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    );
    let mesh = |scale: &str| {
        let shape = format!(
            r#"<collision><geometry><mesh filename="part.obj" {scale}/></geometry></collision></link>"#
        );
        let text =
            urdf(&format!("{LINK}{JOINT}")).replacen("</inertial></link>", &format!("</inertial>{shape}"), 1);
        let file = write(folder.path(), "own.urdf", &text);
        json(&["robot", "check", &file, "--json"])["warnings"].clone()
    };
    let doubt = mesh("")[0].as_str().expect("a warning").to_string();
    assert!(doubt.starts_with("link \"arm\": mesh of 300.0 m"), "{doubt}");
    assert_eq!(mesh(r#"scale="0.001 0.001 0.001""#), json!([]));
}
