//! `--headless-check`: the page in a headless browser, compared with the run.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail, ensure};
use motorium::plan::TopicPlan;
use motorium::run_folder::RunFolder;
use motorium::state::{Decoder, FieldValue, Number};
use motorium::transport::Tap;
use motorium_pictures::png::with_text;
use serde_json::Value as Json;

use crate::browser::Browser;
use crate::page_digest;

/// Size of the picture, pixels.
const SIZE: (u32, u32) = (1280, 860);
/// Time within which the robot must be in the picture.
const PICTURE_WITHIN: Duration = Duration::from_secs(60);
/// Number of samples of each robot to compare, and the time within which they must be seen on both sides.
const SAMPLES: usize = 10;
const COMPARE_WITHIN: Duration = Duration::from_secs(30);
/// Time over which pictures are counted.
const COUNTED: Duration = Duration::from_secs(2);
/// Maximum distance between a link on the page and the run's kinematics, m. The page uses 32-bit floats.
const NEAR: f64 = 1e-5;

/// Opens the page, waits for the first image of the robot, compares values on the page with the run, and
/// writes a screenshot. `began_ms` is the time of the command, ms since 1970.
pub(crate) fn check(
    address: &str,
    picture: &Path,
    began_ms: Option<u64>,
    over: &AtomicBool,
) -> anyhow::Result<()> {
    if let Some(folder) = picture.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    let opened = Instant::now();
    let mut browser = Browser::open(address, SIZE)?;
    await_state(&mut browser, "no picture of a robot", (BEGUN, PICTURE_WITHIN), over, |state| {
        state["first_picture_ms"].is_number()
    })?;
    let state = self::state(&mut browser, STATE)?;
    let on_page = opened.elapsed().as_secs_f64();
    match (began_ms, state["first_picture_ms"].as_f64()) {
        (Some(began), Some(first)) => {
            let since = |time: f64| (time - began as f64) * 1e-3;
            let (asked, first) = (browser.evaluate(ASKED)?.as_f64().map(since), since(first));
            let asked = asked.unwrap_or(f64::NAN);
            println!(
                "first picture of the robot: {first:.2} s after the command; the browser asked for the page after {asked:.2} s, \
                 and drew it {:.2} s later",
                first - asked
            );
        }
        _ => println!("first picture of the robot: {on_page:.2} s after the browser was started"),
    }
    compare(&mut browser, &state, over)?;
    let before = (browser.evaluate("motorium.state().pictures")?, Instant::now());
    std::thread::sleep(COUNTED);
    let after = (browser.evaluate("motorium.state().pictures")?, Instant::now());
    let pictures = after.0.as_f64().unwrap_or(0.0) - before.0.as_f64().unwrap_or(0.0);
    let renderer = browser.evaluate(RENDERER)?;
    let triangles = browser.evaluate("motorium.state().triangles")?;
    let rate = pictures / (after.1 - before.1).as_secs_f64();
    println!("{rate:.1} pictures a second of {triangles} triangles by {}", renderer.as_str().unwrap_or("?"));
    let level = browser.evaluate("motorium.state().view.level")?;
    println!("quality of the pictures, by their rate: {}", level.as_str().unwrap_or("?"));
    // Joints and transforms arrive in two messages, which sometimes belong to the same sample.
    let state = await_state(
        &mut browser,
        "joints and transforms of one sample",
        (STATE, COMPARE_WITHIN),
        over,
        |state| {
            let mut robots = state["robots"].as_array().into_iter().flatten();
            robots.all(|robot| robot["deviation_m"].is_number())
        },
    )?;
    for robot in state["robots"].as_array().into_iter().flatten() {
        let deviation =
            robot["deviation_m"].as_f64().context("the links of a robot are not in the picture")?;
        ensure!(
            deviation < NEAR,
            "{}: a link is drawn {deviation:.1e} m from where the run's kinematics have it",
            robot["name"]
        );
        println!("{}: all links within {deviation:.0e} m of the run's kinematics", name(robot));
    }
    let errors = state["errors"].as_array().map_or(0, Vec::len);
    ensure!(errors == 0, "the page reports errors: {}", state["errors"]);
    browser.evaluate(FINEST)?;
    let made = browser.picture()?;
    let made = with_text(&made, PAGE, &page_digest()).context("the browser has made no PNG file")?;
    std::fs::write(picture, made).with_context(|| picture.display().to_string())?;
    println!("{}: {} x {} pixels", picture.display(), SIZE.0, SIZE.1);
    Ok(())
}

/// Keyword of the text in the screenshot that identifies the page.
const PAGE: &str = "page";

/// Expression for the name of the page's renderer.
const RENDERER: &str = "(() => { const gl = document.createElement('canvas').getContext('webgl2'); \
                        const more = gl.getExtension('WEBGL_debug_renderer_info'); \
                        return gl.getParameter(more ? more.UNMASKED_RENDERER_WEBGL : gl.RENDERER); })()";

/// Expression for the time at which the browser started to load the page, ms since 1970.
const ASKED: &str = "performance.timeOrigin";

/// Draws the page's picture with shadows and smooth edges, at any cost, and waits until it is shown.
const FINEST: &str = "motorium.finest()";

/// Expressions for the state of the page, and for the reduced state of a page that is still loading.
const STATE: &str = "globalThis.motorium ? motorium.state() : null";
const BEGUN: &str = "globalThis.motorium ? motorium.begun() : null";

fn state(browser: &mut Browser, expression: &str) -> anyhow::Result<Json> {
    Ok(browser.evaluate(expression)?)
}

fn await_state(
    browser: &mut Browser,
    what: &str,
    (expression, within): (&str, Duration),
    over: &AtomicBool,
    is_so: impl Fn(&Json) -> bool,
) -> anyhow::Result<Json> {
    let began = Instant::now();
    loop {
        let state = self::state(browser, expression)?;
        if is_so(&state) {
            return Ok(state);
        }
        let ended = over.load(Relaxed) || state["run"]["state"] == "ended";
        ensure!(!ended, "{what}: the run ended before");
        ensure!(began.elapsed() < within, "{what} within {} s; the page shows {state}", within.as_secs());
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn name(robot: &Json) -> &str {
    robot["name"].as_str().unwrap_or_default()
}

/// Positions of joints by the number of their sample.
type Seen = Arc<Mutex<BTreeMap<u64, Vec<f64>>>>;

/// Compares joint positions on the page with the run's shared memory, sample by sample.
fn compare(browser: &mut Browser, state: &Json, over: &AtomicBool) -> anyhow::Result<()> {
    let run = state["run"]["run"].as_str().context("the page shows no run")?;
    let folder = RunFolder::find(run).with_context(|| format!("run {run} is over"))?;
    let plan = folder.plan()?;
    let robots = state["robots"].as_array().context("the page shows no robots")?;
    ensure!(!robots.is_empty(), "the page shows no robots");
    for robot in robots {
        let topic = robot["topic"].as_str().context("a robot without joint states")?;
        let topic = plan.topics.iter().find(|known| known.name == topic).context("an unknown topic")?;
        let done = Arc::new(AtomicBool::new(false));
        let (seen, reader) = read(folder.clone(), topic.clone(), done.clone());
        let (began, mut equal, mut last) = (Instant::now(), Vec::new(), 0);
        while equal.len() < SAMPLES {
            let shown = self::state(browser, STATE)?;
            let found =
                shown["robots"].as_array().and_then(|all| all.iter().find(|it| it["name"] == robot["name"]));
            let found = found.context("the robot is no longer on the page")?;
            let sequence = found["sequence"].as_u64().unwrap_or(0);
            let of_run = seen.lock().unwrap_or_else(PoisonError::into_inner).get(&sequence).cloned();
            if let Some(of_run) = of_run.filter(|_| sequence > last) {
                last = sequence;
                let on_page: Vec<f64> =
                    found["position"].as_array().into_iter().flatten().filter_map(Json::as_f64).collect();
                if on_page != of_run {
                    done.store(true, Relaxed);
                    bail!(
                        "{}, sample {sequence}: {on_page:?} on the page, {of_run:?} in the run",
                        topic.name
                    );
                }
                equal.push(sequence);
            }
            let ended = over.load(Relaxed) || shown["run"]["state"] == "ended";
            ensure!(!ended, "the run ended before its values were compared");
            ensure!(
                began.elapsed() < COMPARE_WITHIN,
                "only {} samples of {} were seen on both sides within {} s",
                equal.len(),
                topic.name,
                COMPARE_WITHIN.as_secs()
            );
        }
        done.store(true, Relaxed);
        let values = equal.len()
            * seen.lock().unwrap_or_else(PoisonError::into_inner).values().next().map_or(0, Vec::len);
        if let Ok(Err(error)) = reader.join() {
            bail!(error);
        }
        println!(
            "{}: {} samples, {} to {}, {values} positions equal on the page and in the run",
            topic.name,
            equal.len(),
            equal.first().unwrap_or(&0),
            equal.last().unwrap_or(&0)
        );
    }
    Ok(())
}

/// Reads all samples of a topic in a thread, by a separate tap.
fn read(
    folder: RunFolder,
    topic: TopicPlan,
    done: Arc<AtomicBool>,
) -> (Seen, std::thread::JoinHandle<anyhow::Result<()>>) {
    let seen = Seen::default();
    let kept = seen.clone();
    let thread = std::thread::spawn(move || {
        let mut tap = Tap::open(&folder.domain()?, &topic)?;
        let decoder = Decoder::new(&topic.layout)?;
        while !done.load(Relaxed) {
            while let Some(sample) = tap.next_unread() {
                let decoded = decoder.decode(&sample.bytes)?;
                let position = decoded.0.iter().find(|(name, _)| *name == "position");
                let numbers = position.map_or(&[][..], |(_, value)| FieldValue::numbers(value));
                let numbers = numbers.iter().map(|number| match number {
                    Number::Double(number) => *number,
                    other => other.to_string().parse().unwrap_or(f64::NAN),
                });
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                kept.insert(sample.stamp.sequence, numbers.collect());
            }
            std::thread::sleep(Duration::from_micros(300));
        }
        Ok(())
    });
    (seen, thread)
}
