//! Camera pictures on the page of a run and of a recording, in a headless browser. Skipped if no Chromium is
//! available.

use std::collections::BTreeMap;
use std::fs;

use foxglove::Decode as _;
use foxglove::messages::RawImage;
use motorium_bridges::recording::{RecordedPicture, Recording};
use motorium_view::browser::Browser;
use serde_json::{Value as Json, json};

use crate::client::{Client, Heard};
use crate::page::{until, without_browser};
use crate::support::{Run, machine, run, workspace};
use crate::viewer::Viewer;

/// A camera of depth and brightness next to a colour camera.
const DEPTH: &str = r#"
[component.scene]
kind      = "sensor.depth_camera"
robot     = "panda"
rate      = "20 Hz"
spin      = "0 us"
budget    = "4 ms"
subscribe = { joint_state = "panda/true_joint_state", object_poses = "world/objects" }
publish   = { depth = "scene/depth", grey = "scene/grey", info = "scene/info" }

[component.scene.config]
width  = 64
height = 48
mount  = { frame = "world", position = [1.4, 0.0, 0.8], rpy = [0.0, 0.5, 3.14159] }
"#;

/// Compared pixels, as fractions of the width and the height.
const PLACES: [(f64, f64); 6] = [(0.0, 0.0), (0.3, 0.25), (0.5, 0.5), (0.6, 0.8), (0.99, 0.02), (0.97, 0.99)];

fn places(image: &RawImage) -> impl Iterator<Item = (u32, u32)> {
    let at = |part: f64, size: u32| (part * f64::from(size)) as u32;
    PLACES.iter().map(move |(x, y)| (at(*x, image.width), at(*y, image.height)))
}

/// Returns the bytes of a pixel.
fn pixel(image: &RawImage, (x, y): (u32, u32), bytes: u32) -> &[u8] {
    let from = (y * image.step + x * bytes) as usize;
    &image.data[from..from + bytes as usize]
}

/// Returns a picture as painted by the page: its time, and for each of these pixels the colour of the canvas
/// and the value under the pointer.
fn painted(browser: &mut Browser, topic: &str, places: &[(u32, u32)]) -> Json {
    let script = format!(
        "(() => {{ const canvas = document.querySelector('[data-pictures=\"{topic}\"] canvas'); \
         const of = motorium.state().cameras.find(({{ topic }}) => topic === '{topic}'); \
         return {{ time: of?.time ?? null, encoding: of?.encoding ?? null, caption: of?.caption ?? null, \
         pixels: of?.time ? {}.map(([x, y]) => ({{ colours: [...canvas.getContext('2d').getImageData(x, y, 1, 1).data], \
         value: motorium.pixel('{topic}', x, y) }})) : [] }}; }})()",
        json!(places)
    );
    browser.evaluate(&script).unwrap()
}

fn time_of(image: &RawImage) -> Json {
    image.timestamp.map_or(Json::Null, |time| json!([time.sec(), time.nsec()]))
}

/// Waits until the page shows the picture of a time, and compares its pixels.
fn compare(browser: &mut Browser, topic: &str, image: &RawImage) {
    let all: Vec<(u32, u32)> = places(image).collect();
    let began = std::time::Instant::now();
    let shown = loop {
        let shown = painted(browser, topic, &all);
        if shown["time"] == time_of(image) {
            break shown;
        }
        assert!(began.elapsed().as_secs() < 60, "{topic}: {} is not shown but {shown}", time_of(image));
        std::thread::sleep(std::time::Duration::from_millis(50));
    };
    assert_eq!(shown["encoding"], image.encoding.as_str());
    assert_eq!(shown["pixels"].as_array().unwrap().len(), PLACES.len(), "{shown}");
    let depths = || image.data.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes));
    let near = depths().filter(|depth| *depth > 0.0).fold(f32::INFINITY, f32::min);
    let far = depths().fold(0.0, f32::max);
    for (place, shown) in all.iter().zip(shown["pixels"].as_array().unwrap()) {
        match image.encoding.as_str() {
            "rgb8" => {
                let [red, green, blue] = pixel(image, *place, 3) else { unreachable!() };
                assert_eq!(shown["colours"], json!([red, green, blue, 255]), "{topic} {place:?}");
                assert_eq!(shown["value"], json!([red, green, blue]), "{topic} {place:?}");
            }
            "mono8" => {
                let grey = pixel(image, *place, 1)[0];
                assert_eq!(shown["colours"], json!([grey, grey, grey, 255]), "{topic} {place:?}");
                assert_eq!(shown["value"], json!([grey]), "{topic} {place:?}");
            }
            _ => {
                let depth = f32::from_le_bytes(pixel(image, *place, 4).try_into().unwrap());
                assert_eq!(shown["value"][0].as_f64(), Some(f64::from(depth)), "{topic} {place:?}");
                // Colours of turbo in matplotlib 3.10: of the smallest depth and of the largest.
                let known = [(near, [48, 18, 59, 255]), (far, [122, 4, 3, 255]), (0.0, [40, 40, 40, 255])];
                if let Some((_, colours)) = known.iter().find(|(known, _)| *known == depth) {
                    assert_eq!(shown["colours"], json!(colours), "{topic} {place:?} {depth}");
                }
            }
        }
    }
}

/// Returns the newest picture of a topic at a time.
fn picture_at(recording: &Recording, topic: &str, time_ns: u64) -> RawImage {
    let index = recording.pictures().iter().position(|pictures| pictures.topic == topic).expect(topic);
    let of_topic = recording.images().filter(|picture| picture.pictures == index);
    let newest: Option<RecordedPicture> = of_topic.take_while(|picture| picture.time_ns <= time_ns).last();
    newest.and_then(|picture| picture.image()).expect("a picture")
}

/// One second of a Panda with a camera in its hand and another next to it.
fn recorded(folder: &std::path::Path) -> Recording {
    let (file, overlay) = (folder.join("eyes.mcap"), folder.join("depth.toml"));
    fs::write(&overlay, DEPTH).unwrap();
    let graph = workspace().join("graphs/camera-servo.toml");
    let names = [&file, &overlay].map(|path| path.to_str().expect("a name in UTF-8"));
    let arguments =
        ["--clock", "lockstep", "--for", "1 s", "--no-expect", "--record", names[0], "--with", names[1]];
    let ended = run(&graph, &arguments);
    assert!(ended.report.is_some(), "{}", ended.stderr);
    Recording::open(&file).unwrap()
}

#[test]
fn a_played_recording_shows_its_pictures_and_depths() {
    if without_browser() {
        return;
    }
    let _machine = machine();
    let folder = tempfile::tempdir().unwrap();
    let recording = recorded(folder.path());
    let (start, _) = recording.times().expect("there are samples");
    let viewer = Viewer::start(&[recording.path().to_str().unwrap()], &[]);
    let mut browser = Browser::open(&viewer.address(), (1280, 860)).unwrap();
    until(&mut browser, "the cameras are offered", |state| {
        state["cameras"].as_array().is_some_and(|all| all.len() == 3) && state["playback"].is_object()
    });
    if browser.evaluate("motorium.state().playback.plays").unwrap() == true {
        browser.evaluate("document.querySelector('#playback button').click()").unwrap();
    }
    until(&mut browser, "it is held", |state| state["playback"]["plays"] == false);
    // One is shown; the others are not sent until they are opened.
    let shown = browser.evaluate("motorium.state().cameras.map(({ shown }) => shown)").unwrap();
    assert_eq!(shown, json!([true, false, false]));
    browser
        .evaluate("document.querySelectorAll('[data-pictures]').forEach((it) => (it.open = true))")
        .unwrap();
    for place in [0.5, 0.9, 0.3] {
        let moved = format!(
            "(() => {{ const slider = document.querySelector('#playback input'); slider.value = {place}; \
             slider.dispatchEvent(new Event('input')); return Number(slider.value); }})()"
        );
        let place = browser.evaluate(&moved).unwrap().as_f64().unwrap();
        for topic in ["camera/image", "scene/depth", "scene/grey"] {
            let image = picture_at(&recording, topic, start + (place * 1e9) as u64);
            compare(&mut browser, &format!("{topic}/image"), &image);
        }
    }
    // The extremes of a picture have the colours at the ends of the map, wherever they are.
    let ends = browser
        .evaluate(
            "(() => { const canvas = document.querySelector('[data-pictures=\"scene/depth/image\"] canvas'); \
             const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height); \
             const found = new Set(); \
             for (let at = 0; at < data.length; at += 4) found.add([...data.slice(at, at + 3)].join()); \
             return ['48,18,59', '122,4,3'].map((colour) => found.has(colour)); })()",
        )
        .unwrap();
    assert_eq!(ends, json!([true, true]));
    assert_eq!(browser.evaluate("motorium.state().errors").unwrap(), json!([]));
}

#[test]
fn the_page_follows_the_newest_picture_of_a_run() {
    if without_browser() {
        return;
    }
    let _machine = machine();
    let graph = workspace().join("graphs/camera-servo.toml");
    let run = Run::start(&graph, &["--for", "300s", "--clock", "lockstep", "--pace", "0.5"]);
    let viewer = Viewer::start(&["--run", run.folder.id()], &[]);
    let topic = "camera/image/image";
    // Another client of the same viewer receives the same values as the page.
    let mut client = Client::connect(viewer.port, "", "foxglove.sdk.v1").unwrap();
    client.await_channels(&[topic]);
    let subscription = client.subscribe(topic);
    let mut browser = Browser::open(&viewer.address(), (1280, 860)).unwrap();
    until(&mut browser, "a picture is painted", |state| state["cameras"][0]["time"].is_array());
    let (mut sent, mut seen) = (BTreeMap::new(), Vec::new());
    while seen.len() < 5 {
        let places = [(0, 0), (48, 30), (80, 60), (96, 96), (159, 119)];
        let shown = painted(&mut browser, topic, &places);
        let time: (u32, u32) = serde_json::from_value(shown["time"].clone()).unwrap();
        if seen.last() == Some(&time) {
            continue;
        }
        let image: RawImage = client.hear_until("the picture that the page shows", |_, heard| {
            if let Heard::Message(of, _, message) = heard
                && *of == subscription
            {
                let image = RawImage::decode(&message[..]).expect("a picture");
                let time = image.timestamp.expect("a time");
                sent.insert((time.sec(), time.nsec()), image);
            }
            sent.get(&time).cloned()
        });
        for (place, shown) in places.iter().zip(shown["pixels"].as_array().unwrap()) {
            let [red, green, blue] = pixel(&image, *place, 3) else { unreachable!() };
            assert_eq!(shown["colours"], json!([red, green, blue, 255]), "{place:?} at {time:?}");
        }
        assert!(seen.last().is_none_or(|last| *last < time), "the page goes back from {seen:?} to {time:?}");
        seen.push(time);
    }
}
