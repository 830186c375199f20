//! The page in a headless browser. Skipped if no Chromium is available.

use std::time::{Duration, Instant};

use motorium::transport::ParameterTable;
use motorium_view::browser::Browser;
use serde_json::Value as Json;

use crate::support::{Run, await_that, machine, panda_reach, workspace};
use crate::viewer::{Viewer, installed};

const WITHIN: Duration = Duration::from_secs(90);

/// Returns `true`, and prints a message, if there is no browser.
pub(crate) fn without_browser() -> bool {
    let missing = Browser::find().is_none();
    if missing {
        eprintln!("skipped: no Chromium on PATH");
    }
    missing
}

pub(crate) fn until(browser: &mut Browser, what: &str, is_so: impl Fn(&Json) -> bool) -> Json {
    let began = Instant::now();
    loop {
        let state = browser.evaluate("globalThis.motorium ? motorium.state() : null").unwrap();
        if is_so(&state) {
            return state;
        }
        assert!(began.elapsed() < WITHIN, "{what}: not within {} s; {state}", WITHIN.as_secs());
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn the_check_compares_the_page_with_the_run() {
    if without_browser() {
        return;
    }
    let _machine = machine();
    let (installed, out) = (installed(), tempfile::tempdir().unwrap());
    let picture = out.path().join("below/view.png");
    let output = std::process::Command::new(installed.path().join("motorium"))
        .args(["view", "graphs/panda-reach.toml", "--port", "0", "--headless-check"])
        .arg(&picture)
        .args(["--", "--for", "300s", "--no-expect"])
        .current_dir(workspace())
        .output()
        .unwrap();
    let (text, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{text}{errors}");
    for words in [
        "first picture of the robot:",
        "the browser asked for the page after",
        "equal on the page and in the run",
        "pictures a second",
        "quality of the pictures",
        "all links within",
    ] {
        assert!(text.contains(words), "{text}");
    }
    let png = std::fs::read(&picture).unwrap();
    assert!(png.starts_with(b"\x89PNG\r\n") && png.len() > 20_000, "{} bytes", png.len());
}

#[test]
fn the_page_commands_the_run_and_survives_its_end() {
    if without_browser() {
        return;
    }
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "600s"]);
    let viewer = Viewer::start(&["--run", run.folder.id()], &[]);
    let mut browser = Browser::open(&viewer.address(), (1280, 860)).unwrap();
    let state = until(&mut browser, "the robot is drawn", |state| {
        state["robots"][0]["drawn"] == true
            && state["components"].as_array().is_some_and(|all| all.len() == 4)
    });
    assert!(state["triangles"].as_u64().unwrap() > 100, "{state}");
    let state =
        until(&mut browser, "the plot has points", |state| state["plot"]["points"].as_u64() > Some(10));
    let plot = &state["plot"];
    assert_eq!((&plot["field"], &plot["unit"]), (&"position".into(), &"rad or m".into()), "{plot}");
    assert_eq!(
        (&plot["names"][0], &plot["names"][7]),
        (&"panda_joint1".into(), &"panda_finger_joint1".into())
    );

    let state = until(&mut browser, "the timeline has measured steps", |state| {
        let lanes = state["timeline"]["lanes"].as_array();
        lanes.is_some_and(|lanes| lanes.len() == 4 && lanes.iter().all(|lane| lane["measured"][0].is_array()))
    });
    for lane in state["timeline"]["lanes"].as_array().unwrap() {
        // [start, end, p99] of the first step, and [start, end, activity] of its prediction
        let (measured, first) = (&lane["measured"][0], &lane["predicted"][0]);
        let times: Vec<f64> = measured.as_array().unwrap().iter().filter_map(Json::as_f64).collect();
        assert!(times.is_sorted() && times[0] < times[1], "{lane}");
        assert!(first[0].as_u64() < first[1].as_u64(), "{lane}");
    }
    assert_eq!(
        browser.evaluate("document.querySelectorAll('#timeline .predicted').length > 4").unwrap(),
        true
    );

    // a slider
    let name = browser
        .evaluate("document.querySelector('[data-parameter]:has(input[type=range])').dataset.parameter");
    let name = name.unwrap().as_str().expect("there is a slider").to_string();
    let wanted = browser
        .evaluate(
            "(() => { const slider = document.querySelector('[data-parameter] input[type=range]'); \
             slider.value = Number(slider.min) + 0.25 * (slider.max - slider.min); \
             slider.dispatchEvent(new Event('input')); \
             return Number(slider.parentElement.querySelector('input[type=number]').value); })()",
        )
        .unwrap();
    let value = || {
        let table = ParameterTable::open(&run.folder.domain().unwrap(), run.folder.plan().unwrap()).unwrap();
        let all = table.list().unwrap().into_iter();
        let mut found =
            all.filter(|(component, plan, _)| format!("{component}.{}", plan.declaration.name) == name);
        serde_json::to_value(found.next().unwrap().2).unwrap().as_f64()
    };
    await_that("the slider's value reaches the component", || value() == wanted.as_f64());
    until(&mut browser, "the value comes back", |state| {
        state["parameters"][&name].as_f64() == wanted.as_f64()
    });

    // the stop button
    browser.evaluate("document.getElementById('stop').click()").unwrap();
    await_that("the robot is in its safe state", || run.is_safe("physics"));
    until(&mut browser, "the page shows the stop", |state| !state["run"]["latched"].is_null());
    let badge = browser.evaluate("document.getElementById('state').textContent").unwrap();
    assert!(badge.as_str().unwrap().starts_with("stopped"), "{badge}");
    browser.evaluate("document.getElementById('resume').click()").unwrap();
    await_that("the robot follows its commands again", || !run.is_safe("physics"));
    until(&mut browser, "the page shows the release", |state| state["run"]["latched"].is_null());

    // the end of the run, and another one
    browser.evaluate("document.getElementById('end').click()").unwrap();
    until(&mut browser, "the page shows the end", |state| state["run"]["state"] == "ended");
    assert!(run.finish().report.is_some());
    let second = Run::start(&panda_reach(), &["--for", "600s"]);
    let id = second.folder.id();
    until(&mut browser, "the page shows the second run", |state| {
        state["run"]["run"] == id
            && state["robots"][0]["drawn"] == true
            && state["robots"][0]["sequence"].as_u64() > Some(1)
    });
    let errors = browser.evaluate("motorium.state().errors").unwrap();
    assert_eq!(errors, serde_json::json!([]));
}

/// Names and values in the legend of the plot.
const LEGEND: &str = "[...document.querySelectorAll('#plot-legend div')].map((line) => [line.dataset.name, line.lastChild.textContent])";

#[test]
fn humanoid_joints_are_plotted_by_group_with_their_values() {
    if without_browser() {
        return;
    }
    let _machine = machine();
    let graph = workspace().join("graphs/humanoid-reach.toml");
    // Slow enough that values and page show the same moment.
    let run = Run::start(&graph, &["--for", "600s", "--clock", "lockstep", "--pace", "0.2"]);
    let viewer = Viewer::start(&["--run", run.folder.id()], &[]);
    let mut browser = Browser::open(&viewer.address(), (1280, 860)).unwrap();
    let drawn =
        |state: &Json| state["robots"][0]["drawn"] == true && state["plot"]["points"].as_u64() > Some(10);
    let state = until(&mut browser, "the robot is drawn and plotted", drawn);
    assert_eq!(state["plot"]["lines"], 8, "{}", state["plot"]);
    let groups = "[...document.querySelectorAll('#plot-entries option')].map((option) => option.textContent)";
    let groups: Vec<String> = serde_json::from_value(browser.evaluate(groups).unwrap()).unwrap();
    assert_eq!(groups.len(), 4, "31 joints in groups of 8: {groups:?}");
    assert!(groups[0].starts_with("left_hip_yaw … ") && groups[3].ends_with("neck_pitch"), "{groups:?}");
    browser
        .evaluate(
            "(() => { const list = document.querySelector('#plot-entries'); list.value = list.options[3].value; \
             list.dispatchEvent(new Event('change')); })()",
        )
        .unwrap();
    let state = until(&mut browser, "the last group is plotted", |state| {
        state["plot"]["lines"] == 7 && state["plot"]["points"].as_u64() > Some(10)
    });
    let (names, newest) = (&state["plot"]["names"], &state["plot"]["newest"]);
    let joints = state["robots"][0]["joints"].as_object().unwrap();
    for (name, value) in names.as_array().unwrap().iter().zip(newest.as_array().unwrap()) {
        let shown = joints[name.as_str().unwrap()].as_f64().unwrap();
        let plotted = value.as_f64().unwrap();
        assert!((shown - plotted).abs() < 0.05, "{name}: {plotted} plotted, {shown} in the table");
    }
    until(&mut browser, "the legend has values", |_| true);
    let legend: Vec<(String, String)> = serde_json::from_value(browser.evaluate(LEGEND).unwrap()).unwrap();
    assert_eq!(legend.len(), 7);
    assert!(legend.iter().all(|(_, value)| value.parse::<f64>().is_ok()), "{legend:?}");
    let rows = browser.evaluate("document.querySelectorAll('#joints tr').length").unwrap();
    assert_eq!(rows, 32, "a head, and a row for each joint");
    let head = browser.evaluate("document.querySelector('#joints tr').textContent").unwrap();
    assert_eq!(head, "jointposition, radvelocity, rad/seffort, N m");
}

/// Three numbers of the state.
fn vector(state: &Json) -> [f64; 3] {
    serde_json::from_value(state.clone()).unwrap_or_else(|error| panic!("{state}: {error}"))
}

fn difference(one: [f64; 3], other: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| one[i] - other[i])
}

#[test]
fn camera_follows_a_walking_quadruped_unless_held() {
    if without_browser() {
        return;
    }
    let _machine = machine();
    let graph = workspace().join("graphs/quadruped-mpc.toml");
    let run = Run::start(&graph, &["--for", "600s", "--clock", "lockstep", "--pace", "1"]);
    let viewer = Viewer::start(&["--run", run.folder.id()], &[]);
    let mut browser = Browser::open(&viewer.address(), (1000, 700)).unwrap();
    let drawn = |state: &Json| state["robots"][0]["drawn"] == true && state["view"]["rate"].is_number();
    until(&mut browser, "the robot is drawn", drawn);
    // After the first camera motion by hand, the page no longer frames what it loads.
    browser
        .evaluate("document.querySelector('#scene canvas').dispatchEvent(new WheelEvent('wheel'))")
        .unwrap();
    let first = until(&mut browser, "the robot is drawn", drawn);
    let offset = |state: &Json| {
        let view = &state["view"];
        difference(vector(&view["position"]), vector(&view["target"]))
    };
    let travelled = |state: &Json, since: &Json| {
        let [x, y, _] = difference(vector(&state["robots"][0]["base"]), vector(&since["robots"][0]["base"]));
        x.hypot(y)
    };
    let later = until(&mut browser, "it has walked", |state| travelled(state, &first) > 0.6);
    let [x, y, _] = difference(vector(&later["view"]["target"]), vector(&later["robots"][0]["base"]));
    assert!(x.hypot(y) < 0.3, "the camera looks {} m beside the robot", x.hypot(y));
    let turned = difference(offset(&later), offset(&first)).map(f64::abs);
    assert!(turned.iter().all(|part| *part < 1e-6), "following turns the camera: {turned:?}");

    browser.evaluate("dispatchEvent(new KeyboardEvent('keydown', { code: 'KeyF' }))").unwrap();
    let held = until(&mut browser, "it does not follow", |state| state["view"]["follows"] == false);
    let away = until(&mut browser, "it walks away", |state| travelled(state, &held) > 0.2);
    // The page recomputes the target for every picture, so its last bit may change.
    let moved = difference(vector(&away["view"]["target"]), vector(&held["view"]["target"])).map(f64::abs);
    assert!(moved.iter().all(|part| *part < 1e-9), "the held camera moves: {moved:?}");
    browser.evaluate("document.getElementById('frame').click()").unwrap();
    browser.evaluate("document.getElementById('follow').click()").unwrap();
    until(&mut browser, "it is in the picture again", |state| {
        let [x, y, _] = difference(vector(&state["view"]["target"]), vector(&state["robots"][0]["base"]));
        x.hypot(y) < 0.5 && state["view"]["follows"] == true
    });
    assert_eq!(browser.evaluate("motorium.state().errors").unwrap(), serde_json::json!([]));
}

#[test]
fn page_changes_between_light_and_dark_and_keeps_the_choice() {
    if without_browser() {
        return;
    }
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "600s"]);
    let viewer = Viewer::start(&["--run", run.folder.id()], &[]);
    let mut browser = Browser::open(&viewer.address(), (1000, 700)).unwrap();
    until(&mut browser, "the robot is drawn", |state| state["robots"][0]["drawn"] == true);
    let brightness = "(() => { const parts = getComputedStyle(document.body).backgroundColor.match(/\\d+/g); \
                      return parts.slice(0, 3).map(Number).reduce((a, b) => a + b) / 3; })()";
    let mut shown = |script: &str| {
        browser.evaluate(script).unwrap();
        let kept = browser.evaluate("localStorage.getItem('motorium-theme')").unwrap();
        (browser.evaluate(brightness).unwrap().as_f64().unwrap(), kept)
    };
    let (light, kept) = shown("0");
    assert!(light > 200.0 && kept.is_null(), "{light}, {kept}");
    let (dark, kept) = shown("document.getElementById('theme').click()");
    assert!(dark < 60.0 && kept == "dark", "{dark}, {kept}");
    // The system's preference is light: with the same choice, nothing is stored.
    let (light, kept) = shown("document.getElementById('theme').click()");
    assert!(light > 200.0 && kept.is_null(), "{light}, {kept}");
}

#[test]
fn a_narrow_window_cuts_nothing_off() {
    if without_browser() {
        return;
    }
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "600s"]);
    let viewer = Viewer::start(&["--run", run.folder.id()], &[]);
    let mut browser = Browser::open(&viewer.address(), (390, 800)).unwrap();
    until(&mut browser, "the robot is drawn", |state| state["robots"][0]["drawn"] == true);
    let width = browser.evaluate("document.documentElement.scrollWidth").unwrap();
    assert!(width.as_u64() <= Some(390), "the page is {width} pixels wide");
    let place = "(() => { scrollTo(0, document.body.scrollHeight); \
        const { top, bottom, right } = document.getElementById('stop').getBoundingClientRect(); \
        return { scrolled: scrollY, top, bottom, right }; })()";
    let place = browser.evaluate(place).unwrap();
    let number = |name: &str| place[name].as_f64().unwrap();
    assert!(number("scrolled") > 200.0, "there is more than one screen of it: {place}");
    assert!(number("top") >= 0.0 && number("bottom") <= 800.0 && number("right") <= 390.0, "{place}");
}
