//! Measurements; run alone and optimised: `cargo test --release -p motorium-models timing -- --ignored
//! --nocapture`.

use motorium_models::gp::GaussianProcess;
use motorium_models::gplvm::{BackForm, LatentModel, Settings, SpaceData};
use motorium_models::kernel::Kernel;
use motorium_models::optimise::Options;

/// Processor time of this thread, s: on a busy machine the wall clock includes other programs.
fn processor() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("the kernel counts");
    text.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).expect("nanoseconds") * 1e-9
}

/// Shortest wall time of a short operation, ms.
fn shortest(mut run: impl FnMut()) -> f64 {
    let times = (0..300).map(|_| {
        let start = std::time::Instant::now();
        run();
        start.elapsed().as_secs_f64() * 1e3
    });
    times.fold(f64::INFINITY, f64::min)
}

fn values(n: usize, d: usize, phase: f64) -> Vec<f64> {
    (0..n * d)
        .map(|i| (0.37 * (i / d) as f64 + 1.3 * (i % d) as f64 + phase).sin() + 0.1 * (5.1 * i as f64).cos())
        .collect()
}

#[test]
#[ignore = "a measurement"]
fn timing_of_latent_models() {
    let (x, y) = (values(200, 2, 0.4), values(200, 14, 0.1));
    let parameters = [0.1, 0.2, -0.3, -4.0];
    let one = shortest(|| drop(LatentModel::energy(&x, &y, &parameters).expect("an energy")));
    println!("energy and gradient, N = 200, 14 outputs, q = 2: {one:.3} ms");
    let columns: Vec<String> = (0..14).map(|c| format!("c{c}")).collect();
    let spaces = [SpaceData { name: "robot", columns: columns.clone(), values: &y }];
    let settings = Settings { latents: Some(2), iterations: 100, prior: false, back: None };
    let start = processor();
    let (model, trained) = LatentModel::train(&spaces, &settings).expect("a model");
    println!("training: {:.3} s, {trained:?}", (processor() - start));
    let pose = values(1, 14, 0.55);
    println!("latent of a new pose, optimised: {:.3} ms", shortest(|| drop(model.infer(0, &pose))));
    for form in [BackForm::Kernel, BackForm::Mlp] {
        let settings = Settings { back: Some(("robot".to_string(), form)), ..settings.clone() };
        let model = LatentModel::train(&spaces, &settings).expect("a model").0;
        let (mut standard, mut x) = ([0.0; 14], [0.0; 2]);
        let time = shortest(|| (0..100).for_each(|_| assert!(model.map_back(&pose, &mut standard, &mut x))));
        println!("latent of a new pose, back constraint {form:?}: {:.2} us", time * 10.0);
    }
}

#[test]
#[ignore = "a measurement"]
fn timing_of_gaussian_processes() {
    let (x, y) = (values(201, 6, 0.4), values(201, 1, 0.1));
    let start = processor();
    let mut gp =
        GaussianProcess::new(Kernel::matern52(6, 1.0), 0.1, &x[..1200], 6, &y[..200], 1).expect("a process");
    let found = gp.optimise(&Options::default()).expect("a fit");
    println!("fit of 200 x 6, Matern 5/2 ARD: {:.2} ms, {found:?}", (processor() - start) * 1e3);
    gp.push(&x[1200..], &y[200..]).expect("a point");
    gp.remove(200);
    let time = shortest(|| {
        gp.push(&x[1200..], &y[200..]).expect("a point");
        gp.remove(200);
    });
    println!("a point added and removed: {:.1} us", time * 1e3);
    let (mut mean, mut scratch) = ([0.0], gp.scratch());
    let time = shortest(|| assert!(gp.predict(&x[..6], &mut mean, &mut scratch) > 0.0));
    println!("prediction: {:.2} us", 1e3 * time);
}
