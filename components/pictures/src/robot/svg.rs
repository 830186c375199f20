//! A robot as SVG: ground, shadow, faces and marks.

use std::fmt::Write as _;

use nalgebra::{Point3, Vector3};

use super::camera::Camera;
use super::marks::Marks;
use super::order::back_to_front;
use super::scene::Scene;
use super::solid::Face;
use crate::text::escape;

/// Direction of the light.
const LIGHT: Vector3<f64> = Vector3::new(0.3, -0.45, 0.84);

/// Returns the picture as an SVG document.
pub(super) fn svg(name: &str, scene: &Scene, marks: &Marks, camera: &Camera, ground: bool) -> String {
    let (width, height) = (camera.width, camera.height);
    let mut text = String::new();
    let _ = writeln!(
        text,
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" font-family="sans-serif">"##
    );
    let _ = writeln!(text, "<title>{}</title>", escape(name));
    let _ = writeln!(text, r##"<rect width="{width}" height="{height}" fill="#ffffff"/>"##);
    robot(scene, camera, ground, &mut text);
    overlay(marks, camera, &mut text);
    text + "</svg>\n"
}

/// Draws the ground and the robot.
fn robot(scene: &Scene, camera: &Camera, ground: bool, text: &mut String) {
    if ground && camera.eye.z > 0.05 {
        self::ground(scene, camera, text);
    }
    let _ = writeln!(text, r#"<g stroke-width="0.6" stroke-linejoin="round">"#);
    for face in back_to_front(scene.visible(&camera.eye), &camera.eye) {
        let colour = shade(&face, &camera.eye);
        // Explicit fill, because not every program supports `currentColor`.
        let outline = path(&face.points, camera);
        let _ = writeln!(text, r#"<path fill="{colour}" stroke="{colour}" d="{outline}"/>"#);
    }
    text.push_str("</g>\n");
}

/// Draws a grid under the robot and its shadow, if the whole robot is above the plane z = 0 and not far away.
fn ground(scene: &Scene, camera: &Camera, text: &mut String) {
    let (mut low, mut high) = (Point3::from([f64::INFINITY; 3]), Point3::from([f64::NEG_INFINITY; 3]));
    for point in scene.points() {
        low = low.inf(&point);
        high = high.sup(&point);
    }
    let extent = (high - low).max();
    let near = (-0.02 * extent)..(0.5 * extent);
    if !extent.is_finite() || !near.contains(&low.z) {
        return;
    }
    // Ten to thirty lines, a round number of metres apart.
    let rough = extent / 8.0;
    let decade = 10_f64.powf(rough.log10().floor());
    let step = decade * [1.0, 2.0, 5.0, 10.0].into_iter().find(|by| by * decade >= rough).unwrap_or(10.0);
    let from = |x: f64| (x / step).floor() * step - step;
    let to = |x: f64| (x / step).ceil() * step + step;
    let (x0, x1, y0, y1) = (from(low.x), to(high.x), from(low.y), to(high.y));
    let _ = writeln!(text, r##"<g stroke="#e3e6ea" stroke-width="1" fill="none">"##);
    let mut line = |a: (f64, f64), b: (f64, f64)| {
        let (a, b) = (Point3::new(a.0, a.1, 0.0), Point3::new(b.0, b.1, 0.0));
        let _ = writeln!(text, r#"<path d="{}"/>"#, path(&[a, b], camera).trim_end_matches('Z'));
    };
    for index in 0..=((x1 - x0) / step).round() as usize {
        let x = x0 + step * index as f64;
        line((x, y0), (x, y1));
    }
    for index in 0..=((y1 - y0) / step).round() as usize {
        let y = y0 + step * index as f64;
        line((x0, y), (x1, y));
    }
    text.push_str("</g>\n<g fill=\"#cfd4da\" stroke=\"none\">\n");
    for solid in &scene.solids {
        let fall = |point: &Point3<f64>| point - LIGHT * (point.z / LIGHT.z);
        let points: Vec<_> =
            solid.faces().iter().flat_map(|face| face.points.iter().map(fall).collect::<Vec<_>>()).collect();
        let _ = writeln!(text, r#"<path d="{}"/>"#, path(&hull(points), camera));
    }
    text.push_str("</g>\n");
}

/// Returns the convex hull of points in the plane z = 0 (Andrew's monotone chain).
fn hull(mut points: Vec<Point3<f64>>) -> Vec<Point3<f64>> {
    points.sort_by(|a, b| (a.x, a.y).partial_cmp(&(b.x, b.y)).unwrap_or(std::cmp::Ordering::Equal));
    let turn = |a: &Point3<f64>, b: &Point3<f64>, c: &Point3<f64>| (b - a).xy().perp(&(c - a).xy());
    let half = |points: &mut dyn Iterator<Item = Point3<f64>>| {
        let mut chain: Vec<Point3<f64>> = Vec::new();
        for point in points {
            while chain.len() > 1 && turn(&chain[chain.len() - 2], &chain[chain.len() - 1], &point) <= 1e-12 {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut outline = half(&mut points.iter().copied());
    outline.extend(half(&mut points.iter().rev().copied()));
    outline
}

/// Returns the outline in picture coordinates, rounded to a tenth; relative steps are shorter than
/// coordinates.
fn path(points: &[Point3<f64>], camera: &Camera) -> String {
    let mut text = String::new();
    let mut last: Option<(i64, i64)> = None;
    for point in points {
        let (x, y) = camera.project(point);
        // In tenths, so that rounding errors do not accumulate.
        let (x, y) = ((10.0 * x).round() as i64, (10.0 * y).round() as i64);
        let (letter, dx, dy) = match last {
            None => ("M", x, y),
            Some(last) if last == (x, y) => continue,
            Some((x0, y0)) => ("l", x - x0, y - y0),
        };
        let _ = write!(text, "{letter}{} {}", dx as f64 / 10.0, dy as f64 / 10.0);
        last = Some((x, y));
    }
    text + "Z"
}

/// Returns the colour of a lit face: mostly from above, partly from the camera.
fn shade(face: &Face, eye: &Vector3<f64>) -> String {
    let bright =
        0.45 + 0.4 * face.normal.dot(&LIGHT.normalize()).max(0.0) + 0.2 * face.normal.dot(eye).max(0.0);
    let channel = |colour: f64| (255.0 * (colour * bright).clamp(0.0, 1.0)).round() as u8;
    let [r, g, b] = face.colour.map(channel);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Draws frames, names and the centre of mass on top.
fn overlay(marks: &Marks, camera: &Camera, text: &mut String) {
    let length = camera.metres(0.06 * camera.width.min(camera.height));
    text.push_str("<g stroke-width=\"2\" stroke-linecap=\"round\">\n");
    for (_, pose) in &marks.frames {
        let (x0, y0) = camera.project(&Point3::from(pose.translation.vector));
        for (axis, colour) in
            [(Vector3::x(), "#d62728"), (Vector3::y(), "#2ca02c"), (Vector3::z(), "#1f5fd0")]
        {
            let (x1, y1) = camera.project(&(pose * Point3::from(axis * length)));
            let _ = writeln!(text, r#"<path d="M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}" stroke="{colour}"/>"#);
        }
    }
    text.push_str("</g>\n");
    if marks.names {
        for (name, pose) in &marks.frames {
            let (x, y) = camera.project(&Point3::from(pose.translation.vector));
            let _ = writeln!(
                text,
                r##"<text x="{:.1}" y="{:.1}" font-size="11" fill="#222222" stroke="#ffffff" stroke-width="3" paint-order="stroke">{}</text>"##,
                x + 6.0,
                y - 6.0,
                escape(name)
            );
        }
    }
    if let Some(com) = marks.com {
        let (x, y) = camera.project(&Point3::from(com));
        let _ = writeln!(
            text,
            r##"<g stroke="#222222" stroke-width="1"><circle cx="{x:.1}" cy="{y:.1}" r="8" fill="#ffd400"/><path d="M{x:.1} {y:.1}v-8a8 8 0 0 1 8 8zM{x:.1} {y:.1}v8a8 8 0 0 1 -8 -8z" fill="#222222"/></g>"##
        );
    }
}
