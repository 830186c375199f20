//! Rendered images, and detections in them, against closed forms.

use motorium_robots::{Colour, ConvexShape};
use motorium_sensors::blob::{Blob, Hue};
use motorium_sensors::pinhole::Pinhole;
use motorium_sensors::rendering::{Looks, Paint, PixelNoise, PixelSensor, Renderer};
use motorium_worlds::{Checker, Light, RayScene, RayShape};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

const RED: Colour = [0.9, 0.1, 0.1];
const GREEN: Colour = [0.1, 0.8, 0.2];
const SKY: Colour = [0.1, 0.2, 0.9];
const AMBIENT: f64 = 0.3;

/// A scene of coloured shapes.
#[derive(Default)]
struct Scene {
    shapes: RayScene,
    paints: Vec<Paint>,
}

impl Scene {
    fn with(mut self, shape: ConvexShape, place: [f64; 3], paint: Paint) -> Self {
        self.shapes.add(RayShape::new(&shape), &Isometry3::translation(place[0], place[1], place[2]));
        self.paints.push(paint);
        self
    }

    /// Renders an image from a pose, in light from a direction.
    fn picture(mut self, camera: Pinhole, pose: &Isometry3<f64>, direction: [f64; 3]) -> Vec<Colour> {
        let light = Light { direction, ambient: AMBIENT, shadows: true };
        let looks = Looks { paints: self.paints.into(), sky: SKY, light };
        let mut renderer = Renderer::new(camera, 100.0);
        let mut picture = vec![[0.0; 3]; renderer.pixels()];
        renderer.render(pose, &mut self.shapes, &looks, &mut picture);
        picture
    }
}

fn ball(radius: f64) -> ConvexShape {
    ConvexShape::Sphere { radius }
}

/// Levels of an ideal sensor as consecutive bytes.
fn levels(picture: &[Colour]) -> Vec<u8> {
    let mut sensor = PixelSensor::new(&PixelNoise::default(), 0).unwrap();
    picture.iter().flat_map(|colour| sensor.expose(colour)).collect()
}

/// A camera at a position that looks straight down, with the top of its images to +x.
fn from_above(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_euler_angles(0.0, std::f64::consts::FRAC_PI_2, 0.0);
    Isometry3::from_parts(Vector3::new(x, y, z).into(), rotation)
}

#[test]
fn sphere_projection_gives_centre_and_distance() {
    let camera = Pinhole { focal_length: [200.0, 210.0], ..Pinhole::new(160, 120, 1.0) };
    for place in [[2.0, 0.0, 0.0], [1.5, 0.35, -0.2], [3.0, -0.9, 0.6]] {
        let scene = Scene::default().with(ball(0.2), place, Paint::solid(RED));
        let picture = levels(&scene.picture(camera, &Isometry3::identity(), [0.3, 0.4, -1.0]));
        let hue = Hue::new(RED, 0.1, 20.0).unwrap();
        let blob = Blob::find(&hue, &camera, &picture, 480, 8).unwrap();
        assert!(!blob.on_edge);
        let found = camera.project(&Vector3::from(*blob.direction)).unwrap();
        let expected = camera.project(&Vector3::from(place)).unwrap();
        let apart = (found[0] - expected[0]).hypot(found[1] - expected[1]);
        assert!(apart < 0.2, "{found:?}, expected {expected:?}");
        let (distance, expected) = (blob.distance_of_sphere(0.2), Vector3::from(place).norm());
        assert!((distance / expected - 1.0).abs() < 0.01, "{distance}, expected {expected}");
    }
}

#[test]
fn sphere_outline_matches_its_tangent_cone() {
    let camera = Pinhole::new(160, 120, 1.0);
    let centre = Vector3::new(1.5, 0.35, -0.2);
    let scene = Scene::default().with(ball(0.2), centre.into(), Paint::solid(RED));
    let picture = scene.picture(camera, &Isometry3::identity(), [1.0, 0.0, 0.0]);
    // a direction meets the sphere where its angle to the centre is below asin(r / d)
    let edge = (0.2 / centre.norm()).asin();
    let mut on = 0;
    for (pixel, direction) in picture.iter().zip(camera.directions()) {
        let angle = direction.angle(&centre);
        if (angle - edge).abs() > 1e-9 {
            assert_eq!(*pixel != SKY, angle < edge, "{angle} {edge}");
        }
        on += usize::from(angle < edge);
    }
    assert!(on > 500, "{on}");
}

#[test]
fn brightness_follows_lambert_for_any_view() {
    let camera = Pinhole::new(16, 12, 1.0);
    for angle in [0.0_f64, 0.4, 1.2, 1.7] {
        for pose in
            [from_above(0.0, 0.0, 1.0), from_above(0.0, 0.0, 1.0) * Isometry3::rotation(Vector3::y() * 0.4)]
        {
            let scene = Scene::default().with(ConvexShape::HalfSpace, [0.0; 3], Paint::solid(GREEN));
            let picture = scene.picture(camera, &pose, [angle.sin(), 0.0, -angle.cos()]);
            let share = AMBIENT + (1.0 - AMBIENT) * angle.cos().max(0.0);
            for pixel in picture {
                for (found, full) in pixel.iter().zip(GREEN) {
                    assert!((found - full * share).abs() < 1e-12, "{found}, expected {}", full * share);
                }
            }
        }
    }
}

#[test]
fn ball_casts_a_round_shadow_and_occludes() {
    let camera = Pinhole::new(80, 60, 1.2);
    let pose = from_above(0.0, 0.0, 2.0) * Isometry3::rotation(Vector3::y() * -0.35);
    let (radius, height) = (0.3, 1.0);
    let scene = Scene::default().with(ConvexShape::HalfSpace, [0.0; 3], Paint::solid(GREEN)).with(
        ball(radius),
        [0.6, 0.1, height],
        Paint::solid(RED),
    );
    let picture = scene.picture(camera, &pose, [0.0, 0.0, -1.0]);
    let (mut shaded, mut sunny, mut hidden) = (0, 0, 0);
    for (pixel, direction) in picture.iter().zip(camera.directions()) {
        let (from, towards) = (pose.translation.vector, pose.rotation * direction.into_inner());
        // the ball, by the distance of its centre from the line
        let away = Vector3::new(0.6, 0.1, height) - from;
        let across = away - towards * away.dot(&towards);
        if (across.norm() - radius).abs() < 1e-6 {
            continue;
        }
        if across.norm() < radius {
            hidden += 1;
            assert!(pixel[0] > 5.0 * pixel[1], "the red ball: {pixel:?}");
            continue;
        }
        if towards.z > -1e-3 {
            continue;
        }
        let point = from - towards * (from.z / towards.z);
        let off = (point.x - 0.6).hypot(point.y - 0.1);
        if (off - radius).abs() < 1e-3 {
            continue;
        }
        let expected = if off < radius { AMBIENT * GREEN[1] } else { GREEN[1] };
        *(if off < radius { &mut shaded } else { &mut sunny }) += 1;
        assert!((pixel[1] - expected).abs() < 1e-9, "{} at {point}, expected {expected}", pixel[1]);
    }
    assert!(shaded > 50 && sunny > 1000 && hidden > 100, "{shaded} {sunny} {hidden}");
}

#[test]
fn ground_squares_alternate_at_their_side_length() {
    let camera = Pinhole::new(40, 30, 1.2);
    let paint = Paint { colour: RED, checker: Some(Checker { side: 0.25, colour: GREEN }) };
    let pose = from_above(0.37, -0.61, 1.5);
    let picture = Scene::default().with(ConvexShape::HalfSpace, [0.0; 3], paint).picture(
        camera,
        &pose,
        [0.0, 0.0, -1.0],
    );
    let mut red = 0;
    for (pixel, direction) in picture.iter().zip(camera.directions()) {
        let towards = pose.rotation * direction.into_inner();
        let point = Point3::from(pose.translation.vector - towards * (1.5 / towards.z));
        let square = [point.x, point.y].map(|place| (place / 0.25).floor() as i64);
        let expected = if (square[0] + square[1]).rem_euclid(2) == 0 { RED } else { GREEN };
        red += usize::from(expected == RED);
        pixel.iter().zip(expected).for_each(|(found, full)| assert!((found - full).abs() < 1e-12));
    }
    assert!(red > 300 && red < 900, "{red}");
}

#[test]
fn shot_noise_grows_with_the_root_of_the_level() {
    let noise = PixelNoise { full_well: Some(5000.0), read_noise: 2.0 };
    for part in [0.1_f64, 0.4, 0.8] {
        let mut sensor = PixelSensor::new(&noise, 7).unwrap();
        let count = 30_000;
        let all: Vec<f64> = (0..count).flat_map(|_| sensor.expose(&[part; 3])).map(f64::from).collect();
        let n = all.len() as f64;
        let mean = all.iter().sum::<f64>() / n;
        let variance = all.iter().map(|level| (level - mean).powi(2)).sum::<f64>() / n;
        let level = 255.0 * part;
        // rounding adds a variance of one twelfth
        let expected = level * 255.0 / 5000.0 + 4.0 + 1.0 / 12.0;
        assert!((mean - level).abs() < 5.0 * (expected / n).sqrt(), "{mean}, expected {level}");
        assert!(
            (variance / expected - 1.0).abs() < 5.0 * (2.0 / n).sqrt(),
            "{variance}, expected {expected}"
        );
    }
    let of = |seed| PixelSensor::new(&noise, seed).unwrap().expose(&[0.5; 3]);
    assert_eq!(of(3), of(3));
    let mut ideal = PixelSensor::new(&PixelNoise::default(), 0).unwrap();
    assert_eq!(ideal.expose(&[0.0, 0.5, 1.0]), [0, 128, 255]);
}

#[test]
fn objects_of_another_hue_or_too_small_are_not_found() {
    let camera = Pinhole::new(80, 60, 1.0);
    let scene = Scene::default().with(ball(0.2), [2.0, 0.0, 0.0], Paint::solid(GREEN));
    let picture = levels(&scene.picture(camera, &Isometry3::identity(), [1.0, 0.0, 0.0]));
    let find =
        |colour, least| Blob::find(&Hue::new(colour, 0.15, 20.0).unwrap(), &camera, &picture, 240, least);
    assert!(find(RED, 1).is_none());
    let pixels = find(GREEN, 1).unwrap().pixels;
    assert!(find(GREEN, pixels).is_some() && find(GREEN, pixels + 1).is_none());
    assert!(
        Blob::find(&Hue::new(GREEN, 0.15, 20.0).unwrap(), &camera, &picture[..240 * 20], 240, 1).is_none()
    );
}

#[test]
fn settings_out_of_range_are_named() {
    for (colour, tolerance, least, setting) in [
        ([0.0; 3], 0.1, 0.0, "colour"),
        ([2.0, 0.0, 0.0], 0.1, 0.0, "colour"),
        (RED, 0.0, 0.0, "tolerance"),
        (RED, 0.1, 256.0, "least_level"),
    ] {
        assert_eq!(Hue::new(colour, tolerance, least).unwrap_err().setting, setting);
    }
    for (full_well, read_noise, setting) in [(Some(0.0), 0.0, "full_well"), (None, -1.0, "read_noise")] {
        let noise = PixelNoise { full_well, read_noise };
        assert_eq!(PixelSensor::new(&noise, 0).unwrap_err().setting, setting);
    }
}
