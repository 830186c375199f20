//! Time to render an image of 160 x 120 pixels of the Panda at a table with ten objects, with shadows and
//! noise: `cargo run --release -p motorium-sensors --example picture_cost`.

use std::time::Instant;

use motorium_robots::{CollisionModel, CollisionOptions, Kinematics, load};
use motorium_sensors::pinhole::Pinhole;
use motorium_sensors::rendering::{Looks, Paint, PixelNoise, PixelSensor, Renderer};
use motorium_worlds::{Light, RayScene, World};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

/// Number of timed images.
const PICTURES: usize = 300;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let panda = load("panda", std::path::Path::new("."))?;
    let home = panda.profile.as_ref().ok_or("no profile")?.home(&panda.model)?;
    let mut kinematics = Kinematics::new(&panda.model);
    kinematics.update(&panda.model, home.as_slice());
    let mut scene = RayScene::default();
    let solids = CollisionModel::new(&panda.model, &CollisionOptions::default())?;
    scene.add_solids(&solids);
    for solid in 0..solids.solid_count() {
        if let motorium_robots::Attachment::Body(body) = solids.attachment(solid) {
            scene.set_pose(solid, &(kinematics.body_pose(body) * solids.placement(solid)));
        }
    }
    let mut text = String::from(
        "ground = { height = 0.0 }\nappearance = { checker = { side = 0.2, colour = [0.5, 0.5, 0.5] } }\n\
         objects = [{ name = \"table\", shape = { box = { size = [0.6, 1.2, 0.1] } }, position = [0.6, 0.0, 0.05] },",
    );
    for index in 0..9 {
        let shape = [
            "sphere = { radius = 0.04 }",
            "box = { size = [0.06, 0.05, 0.08] }",
            "cylinder = { radius = 0.03, length = 0.1 }",
        ];
        text += &format!(
            "{{ name = \"thing {index}\", shape = {{ {} }}, position = [{}, {}, 0.15] }},",
            shape[index % 3],
            0.4 + 0.1 * (index % 4) as f64,
            -0.4 + 0.1 * index as f64,
        );
    }
    let world: World = toml::from_str(&(text + "]"))?;
    scene.add_world(&world);
    let paints: Vec<Paint> = (0..scene.len()).map(|_| Paint::solid([0.8, 0.5, 0.2])).collect();
    let turn = UnitQuaternion::from_euler_angles(0.0, 0.5, std::f64::consts::PI);
    let pose = Isometry3::from_parts(Vector3::new(1.6, 0.0, 0.9).into(), turn);
    let mut renderer = Renderer::new(Pinhole::new(160, 120, std::f64::consts::FRAC_PI_3), 100.0);
    let mut picture = vec![[0.0; 3]; renderer.pixels()];
    let noise = PixelNoise { full_well: Some(10_000.0), read_noise: 1.0 };
    println!("{} shapes; us per picture: minimum / median / 99 % of {PICTURES}", scene.len());
    for (name, shadows, noise) in [
        ("light only", false, PixelNoise::default()),
        ("with shadows", true, PixelNoise::default()),
        ("with shadows and noise", true, noise),
    ] {
        let light = Light { shadows, ..Light::default() };
        let looks = Looks { paints: paints.clone().into(), sky: world.appearance.sky, light };
        let mut sensor = PixelSensor::new(&noise, 1)?;
        let mut sum = 0_u64;
        let mut times: Vec<f64> = (0..PICTURES)
            .map(|_| {
                let start = Instant::now();
                renderer.render(&pose, &mut scene, &looks, &mut picture);
                sum += picture.iter().map(|colour| u64::from(sensor.expose(colour)[0])).sum::<u64>();
                start.elapsed().as_nanos() as f64 / 1e3
            })
            .collect();
        times.sort_by(f64::total_cmp);
        let (median, mean) = (times[PICTURES / 2], sum / (PICTURES * picture.len()) as u64);
        println!(
            "{name:<24} {:>8.1} / {median:.1} / {:.1}, {:.0} pictures/s, mean level of red {mean}",
            times[0],
            times[PICTURES * 99 / 100],
            1e6 / median,
        );
    }
    Ok(())
}
