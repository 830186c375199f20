//! Distances between links and objects of the world, at rest and moving, in a graph in lockstep.

use std::path::Path;

use motorium::launcher::Report;
use motorium::state::ObjectPoses;
use motorium::testing::{Graph, Source};
use motorium_robots::{CollisionModel, CollisionOptions, Collisions, Geometry, Kinematics, MeshMode, load};
use nalgebra::{Isometry3, Vector3};

use crate::component::number;
use crate::graph::{Targets, checked, controller, graph, run};

/// Radius of the ball in the path of the hand, m.
const RADIUS: f64 = 0.08;
/// Displacement of the hand from the home pose to the centre of the ball, m.
const INTO: [f64; 3] = [0.0, 0.25, 0.0];

/// Centre of the ball, which is the hand's target.
fn middle() -> Vector3<f64> {
    let panda = load("panda", Path::new(".")).unwrap();
    let mut kinematics = Kinematics::new(&panda.model);
    kinematics.update(&panda.model, panda.profile.unwrap().home(&panda.model).unwrap().as_slice());
    let hand = panda.model.frame("panda_hand_tcp").unwrap();
    kinematics.pose(&panda.model, hand).translation.vector + Vector3::from(INTO)
}

/// World with the ball at this position; with a mass it moves.
fn world(at: Vector3<f64>, mass: &str) -> String {
    let [x, y, z] = at.into();
    format!(
        "world = {{ objects = [{{ name = \"ball\", shape = {{ sphere = {{ radius = {RADIUS} }} }}, position = [{x}, {y}, {z}] {mass} }}] }}"
    )
}

/// A Panda whose hand is to reach into the centre of the ball.
fn reaching(config: &str) -> Graph {
    graph("{}", Targets { offsets: vec![INTO], ..Targets::default() }, controller(config))
}

/// Final distance of the robot from a ball at its original position, m.
fn distance(report: &Report) -> f64 {
    distance_from(Geometry::Sphere { radius: RADIUS }, report)
}

/// Final distance of the robot from another shape there, m.
fn distance_from(shape: Geometry, report: &Report) -> f64 {
    let panda = load("panda", Path::new(".")).unwrap().model;
    let q: Vec<f64> = (0..8).map(|joint| number(&report.results["plant"]["q"][joint])).collect();
    let mut kinematics = Kinematics::new(&panda);
    kinematics.update(&panda, &q);
    let options = CollisionOptions { self_collision: false, ..CollisionOptions::default() };
    let mut solids = CollisionModel::new(&panda, &options).unwrap();
    let at = Isometry3::from(middle());
    solids.add_obstacle("ball", at, shape, MeshMode::default()).unwrap();
    let mut workspace = Collisions::new(&solids);
    workspace.update(&solids, &kinematics);
    workspace.nearest(&solids).unwrap().distance
}

#[track_caller]
fn refused(config: &str, words: &[&str]) {
    let error = reaching(config).check().expect_err("it must be refused").render(false);
    for word in words {
        assert!(error.contains(word), "no `{word}` in\n{error}");
    }
}

const LIMIT: &str = "limits = { collision = { distance = 0.03, objects = [\"ball\"] } }";

#[test]
fn arm_keeps_its_distance_from_a_ball_in_its_path() {
    let ball = world(middle(), "");
    for level in ["", "inverse_dynamics = {},"] {
        let through = distance(&checked(run(reaching(&format!("{{ {level} {ball} }}")))));
        assert!(through < -0.03, "{level} without the limit: {through}");
        let kept = distance(&checked(run(reaching(&format!("{{ {level} {ball}, {LIMIT} }}")))));
        assert!((0.028..0.05).contains(&kept), "{level} {kept}");
    }
}

#[test]
fn an_arm_avoids_the_current_position_of_a_ball() {
    let objects = |at: Vector3<f64>| {
        Source::new("objects", "world/objects", move |_| {
            let mut poses = ObjectPoses::default();
            poses.set_count(1);
            poses.position_x_mut()[0] = at.x;
            poses.position_y_mut()[0] = at.y;
            poses.position_z_mut()[0] = at.z;
            poses.orientation_w_mut()[0] = 1.0;
            Some(poses)
        })
    };
    let far = middle() + Vector3::new(0.0, 2.0, 0.0);
    let ended = |level: &str, start: Vector3<f64>, now: Vector3<f64>| {
        let config = format!("{{ {level} {}, {LIMIT} }}", world(start, ", mass = 1.0"));
        let targets = Targets { offsets: vec![INTO], ..Targets::default() };
        let controller = controller(&config).subscribe("object_poses", "world/objects");
        distance(&checked(run(graph("{}", targets, controller).with(objects(now)))))
    };
    for level in ["", "inverse_dynamics = {},"] {
        let rolled_in = ended(level, far, middle());
        assert!((0.028..0.05).contains(&rolled_in), "{level} {rolled_in}");
        let rolled_away = ended(level, middle(), far);
        assert!(rolled_away < -0.03, "{level} {rolled_away}");
    }
    // soft limits follow the moving object as well
    let soft = format!(
        "{{ {}, tasks = [{{ cartesian = {{ level = 2 }} }}, {{ limit = {{ level = 1, collision = {{ objects = \"all\" }} }} }}, {{ posture = {{ level = 3 }} }}] }}",
        world(far, ", mass = 1.0")
    );
    let targets = Targets { offsets: vec![INTO], ..Targets::default() };
    let controller = controller(&soft).subscribe("object_poses", "world/objects");
    let kept = distance(&checked(run(graph("{}", targets, controller).with(objects(middle())))));
    assert!((0.018..0.05).contains(&kept), "{kept}");
}

#[test]
fn invalid_pose_is_reported_and_the_last_valid_one_kept() {
    let at = middle();
    let ended = |level: &str, orientation_w: f64| {
        let objects = Source::new("objects", "world/objects", move |tick| {
            let is_good = tick.time() < 0.2;
            let mut poses = ObjectPoses::default();
            poses.set_count(1);
            // after 0.2 s invalid poses claim that the object is far away
            poses.position_x_mut()[0] = at.x;
            poses.position_y_mut()[0] = if is_good { at.y } else { at.y + 2.0 };
            poses.position_z_mut()[0] = at.z;
            poses.orientation_w_mut()[0] = if is_good { 1.0 } else { orientation_w };
            Some(poses)
        });
        let far = at + Vector3::new(0.0, 2.0, 0.0);
        let config = format!("{{ {level} {}, {LIMIT} }}", world(far, ", mass = 1.0"));
        let targets = Targets { offsets: vec![INTO], ..Targets::default() };
        let controller = controller(&config).subscribe("object_poses", "world/objects");
        let report = checked(run(graph("{}", targets, controller).with(objects)));
        (distance(&report), report.results["controller"]["object_poses_refused"].clone())
    };
    // outputs do not publish numbers that are not finite
    for (level, w) in [("", 0.0), ("", 3.0), ("inverse_dynamics = {},", 0.0)] {
        let (kept, refused) = ended(level, w);
        assert!((0.028..0.05).contains(&kept), "{level} {w}: {kept}");
        assert!(number(&refused["count"]) > 100.0, "{refused}");
        let first = refused["first"].as_str().unwrap();
        assert!(first.contains("`ball`") && first.contains("unit quaternion"), "{first}");
    }
    let (_, refused) = ended("", 1.0);
    assert_eq!((refused["count"].as_u64(), refused["first"].as_str()), (Some(0), None));
}

#[test]
fn hand_stays_above_the_ground_of_the_world() {
    let down = || Targets { offsets: vec![[0.0, 0.0, -0.25]], ..Targets::default() };
    let with = |collision: &str| {
        let ignored = "ignore = [[\"panda_link1\", \"ground\"], [\"panda_link2\", \"ground\"]]";
        let config = format!(
            "{{ world = {{ ground = {{ height = 0.3 }} }}, limits = {{ collision = {{ {collision} {ignored} }} }} }}"
        );
        checked(run(graph("{}", down(), controller(&config)))).state_hash
    };
    assert_eq!(with("ground = \"world\","), with("ground = 0.3,"));
    assert_ne!(with("ground = \"world\","), with("ground = 0.1,"));
}

#[test]
fn missing_or_colliding_objects_and_grounds_are_refused() {
    let ball = world(middle(), "");
    let limit = |keys: &str| format!("{{ {ball}, limits = {{ collision = {{ {keys} }} }} }}");
    refused(&limit("objects = [\"bal\"]"), &["limits.collision.objects", "no object `bal`", "`ball`"]);
    refused(&limit("objects = \"some\""), &["list of names of objects", "all"]);
    refused(&limit("ground = \"world\""), &["limits.collision.ground", "no ground", "height"]);
    refused(&limit("ground = \"sea\""), &["height of the ground", "world"]);
    refused(
        "{ limits = { collision = { objects = \"all\" } } }",
        &["limits.collision.objects", "has no objects", "[world]"],
    );
    refused(
        &limit("objects = \"all\", ignore = [[\"panda_link1\", \"table\"]]"),
        &["limits.collision.ignore", "table", "one of the `objects`"],
    );
    let near = world(middle() - Vector3::from(INTO), "");
    refused(
        &format!("{{ {near}, {LIMIT} }}"),
        &[
            "limits.collision.objects",
            "m from `ball` in the home pose, expected at least 0.03 m",
            "by `start`",
            "ignore = [[",
        ],
    );
    refused(&format!("{{ {}, {LIMIT} }}", world(middle(), ", mass = 1.0")), &["object_poses"]);
    refused(&format!("{{ {}, {LIMIT} }}", world(middle(), ", mass = -1.0")), &["world", "ball", "mass"]);
}

/// Writes a file into a folder, which becomes the folder of the graph.
fn beside(graph: Graph, name: &str, text: &str) -> (Graph, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), text).unwrap();
    (graph.at_path(&folder.path().join("graph.toml")), folder)
}

/// MJCF world: level ground, and a ball far away or, as `ball`, at this position.
fn yard(at: Vector3<f64>) -> String {
    format!(
        "<mujoco model=\"yard\"><worldbody><geom name=\"floor\" type=\"plane\" size=\"0 0 1\" pos=\"0 0 -1\"/>\
         <geom name=\"ball\" type=\"sphere\" size=\"{RADIUS}\" pos=\"{} {} {}\"/></worldbody></mujoco>",
        at.x, at.y, at.z
    )
}

/// An object far away from everything.
const FAR: &str = "{ name = \"far\", shape = { sphere = { radius = 0.1 } }, position = [9.0, 9.0, 9.0] }";

#[test]
fn objects_and_ground_of_a_world_file_are_avoided() {
    for (level, own) in [("", ""), ("", FAR), ("inverse_dynamics = {},", FAR)] {
        let config = format!(
            "{{ {level} world = {{ file = \"yard.xml\", objects = [{own}] }}, limits = {{ collision = {{ distance = 0.03, ground = \"world\", objects = \"all\" }} }} }}"
        );
        let (graph, _folder) = beside(reaching(&config), "yard.xml", &yard(middle()));
        let kept = distance(&checked(run(graph)));
        assert!((0.028..0.05).contains(&kept), "{level} {own} {kept}");
    }
    let (graph, _folder) =
        beside(reaching("{ world = { file = \"yard.xml\" } }"), "yard.xml", "<mujoco><tree/></mujoco>");
    let error = graph.check().expect_err("it must be refused").render(false);
    assert!(error.contains("world") && error.contains("yard.xml:1:9"), "{error}");
}

#[test]
fn moving_objects_are_numbered_after_those_in_the_file() {
    let at = middle();
    let poses = Source::new("objects", "world/objects", move |_| {
        let mut poses = ObjectPoses::default();
        poses.set_count(1);
        // the ball of the file is the first
        poses.object_mut()[0] = 1;
        poses.position_x_mut()[0] = at.x;
        poses.position_y_mut()[0] = at.y;
        poses.position_z_mut()[0] = at.z;
        poses.orientation_w_mut()[0] = 1.0;
        Some(poses)
    });
    let config = format!(
        "{{ world = {{ file = \"yard.xml\", objects = [{{ name = \"rolling\", shape = {{ sphere = {{ radius = {RADIUS} }} }}, mass = 1.0, position = [9.0, 9.0, 9.0] }}] }}, \
         limits = {{ collision = {{ distance = 0.03, objects = \"all\" }} }} }}"
    );
    let targets = Targets { offsets: vec![INTO], ..Targets::default() };
    let controller = controller(&config).subscribe("object_poses", "world/objects");
    let graph = graph("{}", targets, controller).with(poses);
    let (graph, _folder) = beside(graph, "yard.xml", &yard(Vector3::new(-5.0, 0.0, 0.0)));
    let kept = distance(&checked(run(graph)));
    assert!((0.028..0.05).contains(&kept), "{kept}");
}

#[test]
fn mesh_next_to_the_graph_is_avoided_like_its_shape() {
    // a cube around the ball
    let mut cube = String::new();
    for corner in 0..8 {
        let side = |bit: u32| if corner & bit == 0 { -RADIUS } else { RADIUS };
        cube += &format!("v {} {} {}\n", side(1), side(2), side(4));
    }
    cube += "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    let [x, y, z] = middle().into();
    let kept = |shape: &str| {
        let config = format!(
            "{{ world = {{ objects = [{{ name = \"crate\", shape = {shape}, position = [{x}, {y}, {z}] }}] }}, \
             limits = {{ collision = {{ distance = 0.03, objects = \"all\" }} }} }}"
        );
        let (graph, _folder) = beside(reaching(&config), "crate.obj", &cube);
        distance_from(Geometry::Box { size: Vector3::repeat(2.0 * RADIUS) }, &checked(run(graph)))
    };
    let side = 2.0 * RADIUS;
    let (mesh, solid) = (
        kept("{ mesh = { file = \"crate.obj\" } }"),
        kept(&format!("{{ box = {{ size = [{side}, {side}, {side}] }} }}")),
    );
    // the drives of the plant follow to within half a millimetre
    assert!(mesh > 0.0295 && solid > 0.0295 && (mesh - solid).abs() < 1e-3, "{mesh} {solid}");
}
