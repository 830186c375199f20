//! The protocol, used by a client without knowledge of the viewer: channels, values, parameters, commands,
//! files.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{SystemTime, UNIX_EPOCH};

use motorium::region::Latch;
use motorium::transport::{ParameterTable, Tap};
use motorium_bridges::foxglove::Derived;
use serde_json::{Value as Json, json};

use crate::client::{Client, Heard};
use crate::support::{Run, await_that, is_alive, machine, panda_reach, workspace};
use crate::viewer::{Viewer, installed};

const SUBPROTOCOL: &str = "foxglove.sdk.v1";
const STATE: &str = "panda/joint_state";

/// A running Panda, and a viewer of it.
fn viewed() -> (Run, Viewer) {
    let run = Run::start(&panda_reach(), &["--for", "300s"]);
    let viewer = Viewer::start(&["--run", run.folder.id()], &[]);
    (run, viewer)
}

#[test]
fn subscriptions_match_the_shared_memory_of_the_run() {
    let _machine = machine();
    let (run, viewer) = viewed();
    // A client that connects before the viewer has found the run may get a session that belongs to no run.
    Client::connect(viewer.port, "", SUBPROTOCOL).unwrap().await_channels(&[STATE]);
    let mut client = Client::connect(viewer.port, "", SUBPROTOCOL).unwrap();
    client.await_channels(&[
        STATE,
        "panda/joint_state/joints",
        "panda/true_joint_state/transforms",
        "panda/target/pose",
        "/robot_description",
        "/motorium/graph",
        "/motorium/run",
        "/motorium/top",
    ]);
    let capabilities = client.info["capabilities"].as_array().unwrap().clone();
    for capability in ["parameters", "parametersSubscribe", "services", "assets"] {
        assert!(capabilities.contains(&json!(capability)), "{capabilities:?}");
    }
    assert_eq!(client.info["sessionId"], run.folder.id());
    for (topic, schema) in [
        (STATE, "motorium.v1.JointState"),
        ("panda/joint_state/joints", "foxglove.JointStates"),
        ("panda/true_joint_state/transforms", "foxglove.FrameTransforms"),
        ("panda/target/pose", "foxglove.PoseInFrame"),
    ] {
        let channel = &client.channels[topic];
        assert_eq!((&channel["encoding"], &channel["schemaName"]), (&json!("protobuf"), &json!(schema)));
        assert!(channel["schema"].as_str().unwrap().len() > 100, "{topic} has a schema");
    }
    let plan = run.folder.plan().unwrap();
    let topic = plan.topics.iter().find(|topic| topic.name == STATE).unwrap();
    let mut tap = Tap::open(&run.folder.domain().unwrap(), topic).unwrap();
    let derived = Derived::new(&topic.layout).unwrap();
    let (mut in_run, mut seen): (BTreeMap<u64, Vec<u8>>, BTreeMap<u64, Vec<u8>>) = Default::default();
    let subscription = client.subscribe(STATE);
    let equal = client.hear_until("samples on both sides", |_, heard| {
        while let Some(sample) = tap.next_unread() {
            in_run.insert(sample.stamp.sequence, sample.bytes);
        }
        if let Heard::Message(of, time, message) = heard
            && *of == subscription
        {
            let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
            assert!(now.abs_diff(*time) < 60_000_000_000, "a time of this day, {time} ns");
            let (stamp, bytes) = derived.decode(message).expect("a message of the schema");
            assert_eq!(stamp.restart_count, 0);
            seen.insert(stamp.sequence, bytes);
        }
        let both: Vec<_> = seen
            .iter()
            .filter_map(|(sequence, bytes)| Some((sequence, bytes, in_run.get(sequence)?)))
            .collect();
        for (sequence, bytes, of_run) in &both {
            // Entries beyond the count are undefined.
            let positions = 8..8 + 8 * 8;
            assert_eq!(bytes[positions.clone()], of_run[positions], "sample {sequence}");
        }
        (both.len() >= 5).then_some(both.len())
    });
    assert!(equal >= 5);
    let description = client.next_json("/robot_description");
    assert!(description["data"].as_str().unwrap().contains("<robot name=\"panda\""));
    let graph = client.next_json("/motorium/graph");
    assert_eq!(
        (&graph["graph"], &graph["components"][0]["budget_ns"]),
        (&json!("panda-reach"), &json!(200_000))
    );
    let top = client.next_json("/motorium/top");
    let names: Vec<&str> =
        top["components"].as_array().unwrap().iter().map(|one| one["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["physics", "encoder", "policy", "controller"]);
}

#[test]
fn camera_pictures_arrive_whole_in_the_announced_form() {
    use foxglove::Decode as _;
    let _machine = machine();
    let graph = workspace().join("graphs/camera-servo.toml");
    let run = Run::start(&graph, &["--for", "300s", "--clock", "lockstep", "--pace", "0.5"]);
    let viewer = Viewer::start(&["--run", run.folder.id()], &[]);
    let mut client = Client::connect(viewer.port, "", SUBPROTOCOL).unwrap();
    client.await_channels(&["camera/image/image", "camera/info/calibration"]);
    assert_eq!(client.channels["camera/image/image"]["schemaName"], "foxglove.RawImage");
    // no client requests the form: the viewer reads it itself
    let pictures = client.subscribe("camera/image/image");
    let mut seen = 0;
    client.hear_until("five pictures", |_, heard| {
        if let Heard::Message(of, _, message) = heard
            && *of == pictures
        {
            let image = foxglove::messages::RawImage::decode(&message[..]).expect("a picture");
            assert_eq!((image.width, image.height, image.step), (160, 120, 480));
            assert_eq!((image.encoding.as_str(), image.frame_id.as_str()), ("rgb8", "camera"));
            let red = image.data.as_chunks::<3>().0.iter().filter(|[r, g, _]| *r > 60 && *r / 3 > *g).count();
            assert!(image.data.len() == 57_600 && red > 50, "{red} red pixels");
            seen += 1;
        }
        (seen >= 5).then_some(())
    });
    let calibration = client.subscribe("camera/info/calibration");
    client.hear_until("the calibration", |_, heard| match heard {
        Heard::Message(of, _, message) if *of == calibration => {
            let calibration =
                foxglove::messages::CameraCalibration::decode(&message[..]).expect("a calibration");
            assert_eq!((calibration.width, calibration.k[2], calibration.k[5]), (160, 79.5, 59.5));
            Some(())
        }
        _ => None,
    });
}

#[test]
fn parameters_need_the_token_and_reach_all_clients() {
    let _machine = machine();
    let (run, viewer) = viewed();
    let mut guest = Client::connect(viewer.port, "?token=wrong", SUBPROTOCOL).unwrap();
    let mut owner = Client::connect(viewer.port, &format!("?token={}", viewer.token), SUBPROTOCOL).unwrap();
    guest.await_channels(&["/motorium/graph"]);
    owner.await_channels(&["/motorium/graph"]);
    let graph = guest.next_json("/motorium/graph");
    let parameters = guest.parameters();
    // a parameter of any component with a range
    let (name, min, max) = graph["components"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|component| {
            component["parameters"].as_array().unwrap().iter().map(move |one| (component, one))
        })
        .find_map(|(component, one)| {
            let name = format!("{}.{}", component["name"].as_str()?, one["name"].as_str()?);
            (one["default"].is_f64()).then_some((name, one["min"].as_f64()?, one["max"].as_f64()?))
        })
        .expect("the graph has such a parameter");
    let before =
        parameters.iter().find(|one| one["name"] == name.as_str()).expect("it is sent")["value"].clone();
    let wanted = min + 0.625 * (max - min);
    let refused = guest.set(&name, &json!(wanted)).unwrap_err();
    assert!(refused.contains("token"), "{refused}");
    let value = |name: &str| {
        let table = ParameterTable::open(&run.folder.domain().unwrap(), run.folder.plan().unwrap()).unwrap();
        let found = table
            .list()
            .unwrap()
            .into_iter()
            .find(|(component, plan, _)| format!("{component}.{}", plan.declaration.name) == name);
        serde_json::to_value(found.unwrap().2).unwrap()
    };
    assert_eq!(value(&name), before);
    guest.send(&json!({ "op": "subscribeParameterUpdates", "parameterNames": [name] }));
    // client messages are processed in order: once this one is answered, the subscription is active
    guest.parameters();
    assert_eq!(owner.set(&name, &json!(wanted)), Ok(json!(wanted)));
    assert_eq!(value(&name), json!(wanted));
    let await_value = |client: &mut Client, expected: f64| {
        client.hear_until("the new value", |_, heard| match heard {
            Heard::Text(text) if text["op"] == "parameterValues" => {
                text["parameters"].as_array()?.iter().find(|one| one["name"] == name.as_str())?["value"]
                    .as_f64()
                    .filter(|value| *value == expected)
            }
            _ => None,
        })
    };
    await_value(&mut guest, wanted);
    // values set by others are reported as well
    let table = ParameterTable::open(&run.folder.domain().unwrap(), run.folder.plan().unwrap()).unwrap();
    table.set(&name, min.into()).unwrap();
    await_value(&mut guest, min);
    // beyond its range: rejected, and the value stays unchanged
    let refused = owner.set(&name, &json!(max + 1.0)).unwrap_err();
    assert!(refused.contains("expected from"), "{refused}");
    assert_eq!(value(&name), json!(min));
    // the token may be set as a parameter, as viewers do that cannot put it into the address
    assert!(guest.set("motorium/token", &json!("wrong")).unwrap_err().contains("token"));
    guest.send(&json!({ "op": "setParameters", "parameters": [{ "name": "motorium/token", "value": viewer.token }] }));
    assert_eq!(guest.set(&name, &json!(wanted)), Ok(json!(wanted)));
}

#[test]
fn the_stop_service_stops_the_robot_and_resume_releases_it() {
    let _machine = machine();
    let (run, viewer) = viewed();
    let region = run.folder.region().unwrap();
    let mut guest = Client::connect(viewer.port, "", SUBPROTOCOL).unwrap();
    assert!(guest.call("/motorium/stop").unwrap_err().contains("token"));
    assert_eq!(region.header().latched(), None);
    let mut owner = Client::connect(viewer.port, &format!("?token={}", viewer.token), SUBPROTOCOL).unwrap();
    let outcome = owner.call("/motorium/stop").unwrap();
    assert_eq!(outcome["done"], true, "{outcome}");
    assert_eq!(region.header().latched(), Some(Latch::Stop));
    assert!(run.is_safe("physics"));
    let outcome = owner.call("/motorium/resume").unwrap();
    assert_eq!(outcome["done"], true, "{outcome}");
    assert_eq!(region.header().latched(), None);
    await_that("the robot follows its commands", || !run.is_safe("physics"));
    let refused = owner.call("/motorium/start").unwrap_err();
    assert!(refused.contains("cannot start"), "{refused}");
}

#[test]
fn another_run_of_the_graph_replaces_an_ended_one() {
    let _machine = machine();
    let (run, viewer) = viewed();
    let first = run.folder.id().to_string();
    let mut client = Client::connect(viewer.port, &format!("?token={}", viewer.token), SUBPROTOCOL).unwrap();
    client.await_channels(&[STATE, "/motorium/run"]);
    let about = client.subscribe("/motorium/run");
    let state = |client: &mut Client, wanted: &str| {
        client.hear_until(wanted, |_, heard| match heard {
            Heard::Message(of, _, bytes) if *of == about => {
                serde_json::from_slice::<Json>(bytes).ok().filter(|state| state["state"] == wanted)
            }
            _ => None,
        })
    };
    assert_eq!(state(&mut client, "running")["run"], first.as_str());
    let outcome = client.call("/motorium/end").unwrap();
    assert_eq!(outcome["done"], true, "{outcome}");
    assert_eq!(state(&mut client, "ended")["run"], first.as_str());
    client.hear_until("its channels are gone", |client, _| {
        (!client.channels.contains_key(STATE)).then_some(())
    });
    assert!(run.finish().report.is_some());
    let second = Run::start(&panda_reach(), &["--for", "300s"]);
    let running = state(&mut client, "running");
    assert_eq!(running["run"], second.folder.id());
    client.await_channels(&[STATE]);
    assert_eq!(client.info["sessionId"], second.folder.id());
    let subscription = client.subscribe(STATE);
    client.hear_until("a sample of the second run", |_, heard| {
        matches!(heard, Heard::Message(of, ..) if *of == subscription).then_some(())
    });
    let header = second.folder.region().unwrap();
    assert!(header.header().start_ns.load(Relaxed) > 0);
}

#[test]
fn a_viewer_that_ends_also_ends_the_graph_it_started() {
    let _machine = machine();
    let mut viewer = Viewer::start(&["graphs/panda-reach.toml", "--", "--for", "300s"], &[]);
    await_that("the graph runs", || viewer.descendants().len() > 5);
    let started = viewer.descendants();
    let ended = viewer.end();
    assert!(ended.success(), "{ended}: {}", viewer.said());
    await_that("all processes that it started have ended", || !started.iter().any(|pid| is_alive(*pid)));
}

#[test]
fn a_graph_that_cannot_start_ends_the_viewer_with_its_code() {
    let installed = installed();
    let view = |graph: &str| {
        let output = std::process::Command::new(installed.path().join("motorium"))
            .args(["view", "--port", "0", graph])
            .current_dir(workspace())
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(errors.matches("error: ").count(), 1, "{errors}");
        (output.status.code(), errors)
    };
    let (code, errors) = view("graphs/no-such-graph.toml");
    assert!(code == Some(3) && errors.contains("no-such-graph.toml` cannot be read"), "{errors}");
    let (code, errors) = view("no-such-recording.mcap");
    assert!(code == Some(1) && errors.matches("os error 2").count() == 1, "{errors}");
}

#[test]
fn the_port_serves_only_the_page_and_robot_files() {
    let _machine = machine();
    let packages = tempfile::tempdir().unwrap();
    let mesh = packages.path().join("arm/meshes/hand.stl");
    std::fs::create_dir_all(mesh.parent().unwrap()).unwrap();
    std::fs::write(&mesh, b"solid hand").unwrap();
    let run = Run::start(&panda_reach(), &["--for", "300s"]);
    let viewer = Viewer::start(&["--run", run.folder.id()], &[("ROS_PACKAGE_PATH", packages.path())]);
    let page = viewer.ask("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
    assert!(page.starts_with("HTTP/1.1 200 OK\r\n") && page.contains("<title>motorium</title>"), "{page}");
    let script = viewer.ask("GET /page.js HTTP/1.1\r\nHost: localhost\r\n\r\n");
    assert!(script.contains("text/javascript") && script.len() > 100_000);
    assert!(viewer.ask("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n").starts_with("HTTP/1.1 403 "));
    assert!(viewer.ask("GET /token HTTP/1.1\r\nHost: localhost\r\n\r\n").starts_with("HTTP/1.1 404 "));
    for answer in [&page, &script] {
        assert!(!answer.contains(&viewer.token), "the page does not know the token");
    }
    assert!(Client::connect(viewer.port, "", "foxglove.websocket.v1").is_err(), "an obsolete protocol");
    let mut client = Client::connect(viewer.port, "", SUBPROTOCOL).unwrap();
    client.await_channels(&[STATE]);
    assert_eq!(client.fetch("package://arm/meshes/hand.stl"), Ok(b"solid hand".to_vec()));
    assert!(client.fetch("package://arm/meshes/foot.stl").unwrap_err().contains("not found"));
    assert!(client.fetch("file:///etc/passwd").unwrap_err().contains("is not a file of a robot"));
    assert!(!viewer.said().contains("panicked"));
}

#[test]
fn cost_of_a_viewed_recording_is_measured() {
    let _machine = machine();
    let installed = installed();
    let output = std::process::Command::new(installed.path().join("motorium"))
        .args([
            "bench",
            "recording",
            "graphs/panda-reach.toml",
            "--view",
            "--turns",
            "1",
            "--for",
            "1 s",
            "--json",
        ])
        .current_dir(workspace())
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let report: Json = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&report["view"], &report["turns"]), (&true.into(), &1.into()), "{report}");
    assert!(report["cpu_s"].as_f64() > Some(0.0), "{report}");
    let times = report["times"].as_array().unwrap();
    assert!(times.len() == 5 && times.iter().all(|row| row["p99"]["ratio"].as_f64() > Some(0.0)), "{report}");
}
