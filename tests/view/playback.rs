//! `motorium view` of a recording, played by third-party viewers and by the page.

use std::path::{Path, PathBuf};

use motorium_bridges::recording::{RecordedSample, Recording, curves as curves_of};
use motorium_view::browser::Browser;
use serde_json::json;

use crate::client::{Client, Heard};
use crate::page::{until, without_browser};
use crate::support::{machine, panda_reach, run};
use crate::viewer::Viewer;

const SUBPROTOCOL: &str = "foxglove.sdk.v1";
const STATE: &str = "panda/joint_state";
const PLAYING: u8 = 0;
const HELD: u8 = 1;
const ENDED: u8 = 3;

/// A recording of two seconds of the Panda, in this folder.
fn recorded(folder: &Path) -> PathBuf {
    let file = folder.join("run.mcap");
    let name = file.to_str().expect("a name in UTF-8");
    let ended =
        run(&panda_reach(), &["--clock", "lockstep", "--for", "2 s", "--no-expect", "--record", name]);
    assert!(ended.report.is_some(), "{}", ended.stderr);
    file
}

/// Returns the newest sample of a topic at a time.
fn sample_at(recording: &Recording, topic: &str, time_ns: u64) -> RecordedSample {
    let index = recording.topic(topic).expect("the topic is recorded");
    let of_topic = recording.sorted().unwrap().into_iter().filter(|sample| sample.topic == index);
    of_topic.take_while(|sample| sample.time_ns <= time_ns).last().expect("a sample")
}

#[test]
fn a_recording_is_played_from_the_requested_time_and_speed() {
    let _machine = machine();
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path());
    let recording = Recording::open(&file).unwrap();
    let (start, end) = recording.times().expect("there are samples");
    let viewer = Viewer::start(&[file.to_str().unwrap()], &[]);
    let mut client = Client::connect(viewer.port, "", SUBPROTOCOL).unwrap();
    client.await_channels(&[
        STATE,
        "panda/true_joint_state/transforms",
        "/robot_description",
        "/motorium/playback",
    ]);
    assert!(client.info["capabilities"].as_array().unwrap().contains(&json!("playbackControl")));
    let time = |ns: u64| json!({ "sec": ns / 1_000_000_000, "nsec": ns % 1_000_000_000 });
    assert_eq!([&client.info["dataStartTime"], &client.info["dataEndTime"]], [&time(start), &time(end)]);

    // paused at a time, it shows the newest sample at that time
    let derived = recording.topics()[recording.topic(STATE).unwrap()].derived();
    let subscription = client.subscribe(STATE);
    let shown = |client: &mut Client, wanted: &RecordedSample| {
        let (stamp, bytes) = client.hear_until("the sample of the recording", |_, heard| match heard {
            Heard::Message(of, time, message) if *of == subscription && *time == wanted.time_ns => {
                Some(derived.decode(message).expect("a message of the schema"))
            }
            _ => None,
        });
        assert_eq!((stamp.sequence, &bytes), (wanted.stamp.sequence, &wanted.bytes));
    };
    for share in [2, 4, 3] {
        let place = start + (end - start) / share;
        let state = client.control(false, 1.0, Some(place));
        assert_eq!((state.status, state.time_ns, state.did_seek), (HELD, place, true));
        shown(&mut client, &sample_at(&recording, STATE, place));
    }
    let place = client.control(false, 1.0, None).time_ns;
    assert_eq!(place, start + (end - start) / 3, "it stays there");

    // to the end, faster than recorded
    let state = client.control(true, 8.0, None);
    assert_eq!((state.status, state.speed), (PLAYING, 8.0));
    let (mut last, mut ended) = (None, None);
    client.hear_until("the end", |_, heard| {
        match heard {
            Heard::Message(of, time, _) if *of == subscription => last = Some(*time),
            Heard::Playback(state) => ended = Some(state.clone()),
            _ => {}
        }
        (last == Some(at_end(&recording)) && ended.is_some()).then_some(())
    });
    let ended = ended.unwrap();
    assert_eq!((ended.status, ended.time_ns, ended.request.as_str()), (ENDED, end, ""));
    assert!(
        client.call("/motorium/play").unwrap_err().contains("plays"),
        "an empty request names the missing field"
    );
}

fn at_end(recording: &Recording) -> u64 {
    sample_at(recording, STATE, u64::MAX).time_ns
}

#[test]
fn curves_of_the_whole_recording_keep_its_extremes() {
    let _machine = machine();
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path());
    let recording = Recording::open(&file).unwrap();
    let viewer = Viewer::start(&[file.to_str().unwrap()], &[]);
    let mut client = Client::connect(viewer.port, "", SUBPROTOCOL).unwrap();
    let request = json!({ "topic": STATE, "field": "position", "first": 1, "count": 3, "points": 100 });
    let answer = client.call_with("/motorium/curves", &request.to_string()).unwrap();
    let curves: Vec<Vec<(f64, f64)>> = serde_json::from_value(answer["curves"].clone()).unwrap();
    let signal = |entry: usize| format!("{STATE}.position[{entry}]").parse().unwrap();
    let exact = curves_of(&recording, &[signal(1), signal(2), signal(3)]).unwrap();
    let entries = curves_of(&recording, &[format!("{STATE}.position").parse().unwrap()]).unwrap().len();
    assert_eq!((answer["entries"].as_u64(), curves.len()), (Some(entries as u64), 3));
    let extremes = |points: &[(f64, f64)]| {
        let values = || points.iter().map(|(_, value)| *value);
        (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
    };
    for (thinned, exact) in curves.iter().zip(&exact) {
        assert!((50..=102).contains(&thinned.len()) && exact.points.len() > 1000, "{}", thinned.len());
        assert_eq!(extremes(thinned), extremes(&exact.points));
        assert!(thinned.iter().all(|point| exact.points.contains(point)), "a point that was not recorded");
    }
    for (request, advice) in [
        (json!({ "topic": "panda/joint_stat", "field": "position" }), "panda/joint_state"),
        (json!({ "topic": STATE, "field": "positions" }), "position"),
        (json!({ "topic": STATE }), "field"),
    ] {
        let error = client.call_with("/motorium/curves", &request.to_string()).unwrap_err();
        assert!(error.contains(advice), "{request}: {error}");
    }
}

#[test]
fn the_plot_shows_the_whole_recording_with_a_cursor() {
    if without_browser() {
        return;
    }
    let _machine = machine();
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path());
    let viewer = Viewer::start(&[file.to_str().unwrap()], &[]);
    let mut browser = Browser::open(&viewer.address(), (1280, 860)).unwrap();
    let state = until(&mut browser, "the whole recording is plotted", |state| {
        state["plot"]["whole"] == true && state["plot"]["lines"] == 8 && state["robots"][0]["drawn"] == true
    });
    let (plot, length) = (&state["plot"], state["playback"]["length_s"].as_f64().unwrap());
    assert!(plot["from"].as_f64() < Some(0.02) && plot["to"].as_f64() > Some(length - 0.02), "{plot}");
    if state["playback"]["plays"] == true {
        browser.evaluate("document.querySelector('#playback button').click()").unwrap();
    }
    until(&mut browser, "it is held", |state| state["playback"]["plays"] == false);
    for share in [0.75, 0.25, 0.5] {
        // A pointer that presses somewhere else and drags to the place.
        let dragged = format!(
            "(() => {{ const over = document.querySelector('#plot .seeks'); \
             const {{ left, width, top }} = over.getBoundingClientRect(); over.setPointerCapture = () => {{}}; \
             over.hasPointerCapture = () => true; \
             const at = (type, share) => over.dispatchEvent(new PointerEvent(type, \
             {{ pointerId: 1, clientX: left + share * width, clientY: top + 5, bubbles: true }})); \
             at('pointerdown', 0.1); at('pointermove', {share}); }})()"
        );
        browser.evaluate(&dragged).unwrap();
        let state = until(&mut browser, "the robot is at the place of the cursor", |state| {
            let place = state["playback"]["place_s"].as_f64().unwrap_or(0.0);
            let shown = |name: &str| state["robots"][0]["joints"][name].as_f64();
            let plotted = |line: usize| state["plot"]["newest"][line].as_f64();
            (place - share * length).abs() < 0.01
                && shown("panda_joint2")
                    .zip(plotted(1))
                    .is_some_and(|(one, other)| (one - other).abs() < 0.02)
        });
        assert_eq!(state["plot"]["cursor"], state["playback"]["place_s"]);
        let line = "parseFloat(document.querySelector('#plot .cursor').style.left)";
        let percent = browser.evaluate(line).unwrap().as_f64().unwrap();
        assert!((percent - 100.0 * share).abs() < 1.0, "the line is at {percent} %");
    }
    assert_eq!(browser.evaluate("motorium.state().errors").unwrap(), json!([]));
}

#[test]
fn the_page_shows_the_recording_at_its_slider() {
    if without_browser() {
        return;
    }
    let _machine = machine();
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path());
    let recording = Recording::open(&file).unwrap();
    let (start, _) = recording.times().expect("there are samples");
    let viewer = Viewer::start(&[file.to_str().unwrap()], &[]);
    let mut browser = Browser::open(&viewer.address(), (1280, 860)).unwrap();
    let state = until(&mut browser, "the robot is drawn", |state| {
        state["run"]["state"] == "playback" && state["robots"][0]["drawn"] == true
    });
    let topic = state["robots"][0]["topic"].as_str().unwrap().to_string();
    assert_eq!(browser.evaluate("document.getElementById('stop').hidden").unwrap(), true);
    if state["playback"]["plays"] == true {
        browser.evaluate("document.querySelector('#playback button').click()").unwrap();
    }
    until(&mut browser, "it is held", |state| state["playback"]["plays"] == false);
    for place in [1.5, 0.25, 1.0] {
        let moved = format!(
            "(() => {{ const slider = document.querySelector('#playback input'); slider.value = {place}; \
             slider.dispatchEvent(new Event('input')); return Number(slider.value); }})()"
        );
        let place = browser.evaluate(&moved).unwrap().as_f64().unwrap();
        let wanted = sample_at(&recording, &topic, start + (place * 1e9) as u64).stamp.sequence;
        until(&mut browser, "the sample at the place of the slider", |state| {
            state["robots"][0]["sequence"] == wanted
        });
    }
    assert_eq!(browser.evaluate("motorium.state().errors").unwrap(), json!([]));
}
