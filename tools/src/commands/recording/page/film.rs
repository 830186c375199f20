//! The robots and the world at some times of a recording, as a strip of pictures.

use motorium::plan::Plan;
use motorium_bridges::recording::{Recording, film};
use motorium_pictures::animation;
use motorium_pictures::robot::{OBLIQUE, Pictures, View};

use crate::html;

/// Pictures of a strip.
const COUNT: u64 = 5;
/// Width and height of one of them, in dots.
const SIZE: (f64, f64) = (280.0, 280.0);

/// Returns the strip, from the first sample to the last; empty for a recording without joint states of a
/// robot.
pub(super) fn strip(recording: &Recording, plan: &Plan) -> anyhow::Result<String> {
    let (begin_ns, end_ns) = recording.times().unwrap_or_default();
    let times: Vec<u64> = (0..COUNT).map(|index| (end_ns - begin_ns) * index / (COUNT - 1)).collect();
    let film = film(recording, plan, &times)?;
    if film.robots.is_empty() {
        return Ok(String::new());
    }
    let view: View = OBLIQUE.parse()?;
    let pictures = Pictures::new(&film, view, SIZE)?;
    let [width, height] = pictures.dots();
    let mut text = String::from("<h2>Motion</h2>\n<p class=\"strip\">\n");
    for (index, time_s) in film.times_s.iter().enumerate() {
        let file = animation::encode(width, height, 0, &[pictures.paint(index)]);
        let (picture, time) = (html::data_url("image/png", &file), format!("{time_s:.2} s"));
        text += &format!("<span><img src=\"{picture}\" alt=\"at {time}\">{time}</span>\n");
    }
    Ok(text + "</p>\n")
}
