//! The model of the joint sensors.

use std::f64::consts::TAU;
use std::time::Duration;

use motorium::units::TimeSpan;
use motorium_robots::PerJoint;
use motorium_sensors::encoder::{
    Differentiation, EncoderModel, EncoderSettings, JointErrors, SampleError, SettingsError,
};

const PERIOD_NS: u64 = 1_000_000;

fn encoder(joints: usize, settings: &EncoderSettings) -> EncoderModel {
    EncoderModel::new(joints, settings, 0, Duration::from_nanos(PERIOD_NS)).unwrap()
}

/// Position, velocity and effort readings of one resting joint.
fn readings(settings: &EncoderSettings, samples: u64) -> [Vec<f64>; 3] {
    let mut encoder = encoder(1, settings);
    let mut columns = [const { Vec::new() }; 3];
    for k in 0..samples {
        encoder.sample(k * PERIOD_NS, &[0.4], &[-0.2], &[3.0]).unwrap();
        let reading = encoder.reading(k * PERIOD_NS).unwrap();
        let values = [reading.position, reading.velocity, reading.effort];
        columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value[0]));
    }
    columns
}

fn noise(deviation: f64) -> JointErrors {
    JointErrors { noise: PerJoint::All(deviation), ..JointErrors::default() }
}

/// Errors with a position resolution.
fn stepped(resolution: PerJoint) -> JointErrors {
    JointErrors { resolution, ..JointErrors::default() }
}

fn noisy(seed: u64) -> EncoderSettings {
    EncoderSettings {
        position: noise(2e-3),
        velocity: noise(0.05),
        effort: noise(0.4),
        seed: Some(seed),
        ..EncoderSettings::default()
    }
}

#[test]
fn ideal_encoder_reads_the_truth_immediately() {
    let mut encoder = encoder(2, &EncoderSettings::default());
    encoder.sample(7, &[0.1, -3.0], &[1.0, 2.0], &[5.0, -6.0]).unwrap();
    let reading = encoder.reading(7).unwrap();
    assert_eq!(reading.sampled_at, 7);
    assert_eq!(
        (reading.position, reading.velocity, reading.effort),
        (&[0.1, -3.0][..], &[1.0, 2.0][..], &[5.0, -6.0][..])
    );
}

/// Tolerances are five standard errors of the estimates.
#[test]
fn noise_is_normal_with_the_configured_deviation() {
    let samples = 100_000_u64;
    let n = samples as f64;
    for (column, (mean, deviation)) in
        readings(&noisy(3), samples).iter().zip([(0.4, 2e-3), (-0.2, 0.05), (3.0, 0.4)])
    {
        let standard: Vec<f64> = column.iter().map(|value| (value - mean) / deviation).collect();
        let moment = |power: i32| standard.iter().map(|z| z.powi(power)).sum::<f64>() / n;
        assert!(moment(1).abs() < 5.0 / n.sqrt(), "mean {}", moment(1));
        assert!((moment(2) - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "variance {}", moment(2));
        assert!(moment(3).abs() < 5.0 * (15.0 / n).sqrt(), "skewness {}", moment(3));
        assert!((moment(4) - 3.0).abs() < 5.0 * (96.0 / n).sqrt(), "kurtosis {}", moment(4));
        let within = |bound: f64| standard.iter().filter(|z| z.abs() < bound).count() as f64 / n;
        assert!((within(1.0) - 0.682_689).abs() < 5.0 * (0.2166 / n).sqrt());
        assert!((within(2.0) - 0.954_500).abs() < 5.0 * (0.0434 / n).sqrt());
        // white noise: consecutive samples are uncorrelated
        let lag = standard.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / n;
        assert!(lag.abs() < 5.0 / n.sqrt(), "autocorrelation {lag}");
    }
}

#[test]
fn position_velocity_and_effort_noise_is_independent() {
    let samples = 50_000_u64;
    let [position, velocity, effort] = readings(&noisy(3), samples);
    let correlation = |a: &[f64], b: &[f64]| {
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
        let (ma, mb) = (mean(a), mean(b));
        let product = |x: &[f64], mx: f64, y: &[f64], my: f64| {
            x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum::<f64>()
        };
        product(a, ma, b, mb) / (product(a, ma, a, ma) * product(b, mb, b, mb)).sqrt()
    };
    let bound = 5.0 / (samples as f64).sqrt();
    assert!(correlation(&position, &velocity).abs() < bound);
    assert!(correlation(&position, &effort).abs() < bound);
    assert!(correlation(&velocity, &effort).abs() < bound);
}

#[test]
fn readings_are_reproducible_from_their_seed() {
    assert_eq!(readings(&noisy(11), 500), readings(&noisy(11), 500));
    let ([one, ..], [other, ..]) = (readings(&noisy(11), 500), readings(&noisy(12), 500));
    assert!(one.iter().zip(&other).all(|(a, b)| a != b));
}

#[test]
fn noise_channels_are_independent() {
    let quiet = EncoderSettings { velocity: JointErrors::default(), ..noisy(5) };
    let ([position, _, effort], [same_position, velocity, same_effort]) =
        (readings(&noisy(5), 200), readings(&quiet, 200));
    assert_eq!((position, effort), (same_position, same_effort));
    assert!(velocity.iter().all(|v| *v == -0.2));
}

#[test]
fn positions_are_rounded_to_the_nearest_step() {
    let step = TAU / 8192.0;
    let settings = EncoderSettings { position: stepped(PerJoint::All(step)), ..EncoderSettings::default() };
    let mut encoder = encoder(1, &settings);
    for k in 0..20_000_u64 {
        let truth = -4.0 + 4e-4 * k as f64;
        encoder.sample(k * PERIOD_NS, &[truth], &[0.0], &[0.0]).unwrap();
        let read = encoder.reading(k * PERIOD_NS).unwrap().position[0];
        assert!((read - truth).abs() <= 0.5 * step * (1.0 + 1e-9), "{truth} read as {read}");
        let counts = (truth / step).round();
        assert_eq!(read, counts * step);
    }
}

#[test]
fn noisy_positions_are_quantised() {
    let settings = EncoderSettings {
        position: JointErrors { noise: PerJoint::All(2e-3), ..stepped(PerJoint::All(1e-3)) },
        ..noisy(1)
    };
    let [position, ..] = readings(&settings, 5000);
    assert!(position.iter().all(|q| (q / 1e-3 - (q / 1e-3).round()).abs() < 1e-9));
    let distinct: std::collections::BTreeSet<i64> =
        position.iter().map(|q| (q / 1e-3).round() as i64).collect();
    assert!(distinct.len() > 8, "the noise spans several steps, found {distinct:?}");
}

#[test]
fn resolution_and_noise_are_configured_per_joint() {
    let settings = EncoderSettings {
        position: JointErrors {
            noise: PerJoint::Each(vec![0.0, 1e-3]),
            ..stepped(PerJoint::Each(vec![0.1, 0.0]))
        },
        ..EncoderSettings::default()
    };
    let mut encoder = encoder(2, &settings);
    encoder.sample(0, &[0.26, 0.26], &[0.0; 2], &[0.0; 2]).unwrap();
    let reading = encoder.reading(0).unwrap();
    assert!((reading.position[0] - 0.3).abs() < 1e-15);
    assert!(reading.position[1] != 0.26 && (reading.position[1] - 0.26).abs() < 0.01);
}

#[test]
fn whole_period_latency_delays_by_exact_ticks() {
    for ticks in [0, 1, 3, 10] {
        let settings =
            EncoderSettings { latency: TimeSpan { ns: ticks * PERIOD_NS }, ..EncoderSettings::default() };
        let mut encoder = encoder(1, &settings);
        for k in 0..100_u64 {
            encoder.sample(k * PERIOD_NS, &[k as f64], &[0.0], &[0.0]).unwrap();
            let read =
                encoder.reading(k * PERIOD_NS).map(|reading| (reading.sampled_at, reading.position[0]));
            let expected = k.checked_sub(ticks).map(|sampled| (sampled * PERIOD_NS, sampled as f64));
            assert_eq!(read, expected, "{ticks} ticks, at tick {k}");
        }
        assert_eq!(encoder.lost(), 0);
    }
}

#[test]
fn half_period_latency_delays_to_the_next_tick() {
    let settings = EncoderSettings { latency: TimeSpan { ns: PERIOD_NS / 2 }, ..EncoderSettings::default() };
    let mut encoder = encoder(1, &settings);
    encoder.sample(0, &[1.0], &[0.0], &[0.0]).unwrap();
    assert!(encoder.reading(PERIOD_NS / 2 - 1).is_none());
    assert_eq!(encoder.reading(PERIOD_NS / 2).unwrap().position, [1.0]);
    encoder.sample(PERIOD_NS, &[2.0], &[0.0], &[0.0]).unwrap();
    assert_eq!(encoder.reading(PERIOD_NS).unwrap().position, [1.0]);
}

fn differentiated(cutoff_hz: f64) -> EncoderSettings {
    EncoderSettings { differentiate: Some(Differentiation { cutoff_hz }), ..EncoderSettings::default() }
}

#[test]
fn differentiated_velocity_is_a_first_order_low_pass() {
    let (cutoff, speed) = (20.0, 0.7);
    let mut encoder = encoder(1, &differentiated(cutoff));
    for k in 0..400_u64 {
        let t = k as f64 * 1e-3;
        encoder.sample(k * PERIOD_NS, &[speed * t], &[f64::NAN], &[0.0]).unwrap();
        let read = encoder.reading(k * PERIOD_NS).unwrap().velocity[0];
        let expected = speed * (1.0 - (-TAU * cutoff * t).exp());
        assert!((read - expected).abs() < 1e-9, "{read} instead of {expected} at {t} s");
    }
}

#[test]
fn differentiated_velocity_shows_position_quantisation() {
    let step = 1e-3;
    let settings = EncoderSettings { position: stepped(PerJoint::All(step)), ..differentiated(1e6) };
    let mut encoder = encoder(1, &settings);
    for k in 0..1000_u64 {
        encoder.sample(k * PERIOD_NS, &[0.3e-3 * k as f64], &[0.3], &[0.0]).unwrap();
        // zero or one step per millisecond
        let read = encoder.reading(k * PERIOD_NS).unwrap().velocity[0];
        assert!(read.abs() < 1e-6 || (read - 1.0).abs() < 1e-6, "{read} rad/s at {k}");
    }
}

#[test]
fn repeated_and_restarted_times_keep_velocity_finite() {
    let mut encoder = encoder(1, &differentiated(50.0));
    let mut velocity = |time, q: f64| {
        encoder.sample(time, &[q], &[0.0], &[0.0]).unwrap();
        encoder.reading(time).unwrap().velocity[0]
    };
    assert_eq!(velocity(5_000_000, 0.0), 0.0);
    let moving = velocity(6_000_000, 0.1);
    assert!(moving > 1.0);
    assert_eq!(velocity(6_000_000, 0.1), moving);
    assert_eq!(velocity(0, 9.0), 0.0);
}

#[test]
fn joint_state_of_another_size_is_rejected() {
    let error =
        encoder(2, &EncoderSettings::default()).sample(0, &[0.0; 3], &[0.0; 2], &[0.0; 2]).unwrap_err();
    assert_eq!(error, SampleError { position: 3, velocity: 2, effort: 2, joints: 2 });
    assert!(error.to_string().starts_with("the joint state has 3 positions, 2 velocities and 2 efforts"));
}

#[test]
fn invalid_settings_are_rejected() {
    let refuse =
        |settings: EncoderSettings| EncoderModel::new(2, &settings, 0, Duration::from_millis(1)).unwrap_err();
    let settings =
        EncoderSettings { position: stepped(PerJoint::Each(vec![0.1])), ..EncoderSettings::default() };
    assert_eq!(
        refuse(settings),
        SettingsError::Count { name: "position.resolution".to_string(), found: 1, expected: 2 }
    );
    let settings = EncoderSettings { position: noise(-1.0), ..EncoderSettings::default() };
    assert_eq!(refuse(settings).to_string(), "position.noise = -1: expected a number from 0 to 1e6");
    let settings = EncoderSettings { velocity: noise(0.1), ..differentiated(50.0) };
    assert_eq!(refuse(settings), SettingsError::NeedlessVelocityErrors);
    assert!(refuse(differentiated(0.0)).to_string().starts_with("differentiate.cutoff_hz = 0"));
    let settings = EncoderSettings { latency: TimeSpan { ns: u64::MAX }, ..EncoderSettings::default() };
    assert!(matches!(refuse(settings), SettingsError::Latency { .. }));
}

#[test]
fn settings_accept_one_number_or_a_list() {
    let text = r#"{"position": {"resolution": [0.001, 0.0], "noise": 0.002}, "latency": "500 us",
                   "differentiate": {"cutoff_hz": 80.0}}"#;
    let settings: EncoderSettings = serde_json::from_str(text).unwrap();
    assert_eq!(settings.position.resolution, PerJoint::Each(vec![0.001, 0.0]));
    assert_eq!(settings.position.noise, PerJoint::All(0.002));
    assert_eq!(settings.latency.ns, 500_000);
    assert_eq!(settings.differentiate, Some(Differentiation { cutoff_hz: 80.0 }));
    let error = serde_json::from_str::<EncoderSettings>(r#"{"position": {"resolutoin": 1.0}}"#);
    assert!(error.unwrap_err().to_string().contains("resolutoin"));
}

#[test]
fn readings_saturate_at_the_joint_range() {
    let ended = |range: PerJoint| JointErrors { range: Some(range), ..JointErrors::default() };
    let settings = EncoderSettings {
        position: ended(PerJoint::Each(vec![0.5, 9.0])),
        velocity: ended(PerJoint::All(2.0)),
        effort: ended(PerJoint::Each(vec![1e6, 3.0])),
        ..EncoderSettings::default()
    };
    let mut encoder = encoder(2, &settings);
    encoder.sample(0, &[-0.7, -0.7], &[5.0, -1.0], &[40.0, 40.0]).unwrap();
    let reading = encoder.reading(0).unwrap();
    assert_eq!(
        (reading.position, reading.velocity, reading.effort),
        (&[-0.5, -0.7][..], &[2.0, -1.0][..], &[40.0, 3.0][..])
    );
}

/// Five standard errors of the standard deviation of 2000 numbers.
const OF_2000: f64 = 5.0 / 63.2;

#[test]
fn bias_and_scale_errors_are_constant_per_joint() {
    let joints = 2000;
    let position =
        JointErrors { bias: PerJoint::All(0.01), scale_error: PerJoint::All(0.02), ..JointErrors::default() };
    let settings = EncoderSettings { position, ..EncoderSettings::default() };
    let mut encoder = encoder(joints, &settings);
    let mut read = |time: u64, q: f64| {
        encoder.sample(time, &vec![q; joints], &vec![0.0; joints], &vec![0.0; joints]).unwrap();
        encoder.reading(time).unwrap().position.to_vec()
    };
    let (zero, again, ten) = (read(0, 0.0), read(PERIOD_NS, 0.0), read(2 * PERIOD_NS, 10.0));
    assert_eq!(zero, again, "the same in each reading");
    let deviation = |values: &[f64]| (values.iter().map(|v| v * v).sum::<f64>() / joints as f64).sqrt();
    assert!((deviation(&zero) / 0.01 - 1.0).abs() < OF_2000, "{}", deviation(&zero));
    let scales: Vec<f64> = zero.iter().zip(&ten).map(|(zero, ten)| (ten - zero) / 10.0 - 1.0).collect();
    assert!((deviation(&scales) / 0.02 - 1.0).abs() < OF_2000, "{}", deviation(&scales));
}

#[test]
fn bias_walk_grows_with_the_root_of_state_time() {
    let joints = 2000;
    let effort = JointErrors { bias_walk: PerJoint::All(0.3), ..JointErrors::default() };
    let settings = EncoderSettings { effort, ..EncoderSettings::default() };
    let mut encoder = encoder(joints, &settings);
    let zeros = vec![0.0; joints];
    for k in 0..=400_u64 {
        encoder.sample(k * PERIOD_NS, &zeros, &zeros, &zeros).unwrap();
    }
    let walked = encoder.reading(400 * PERIOD_NS).unwrap().effort;
    let deviation = (walked.iter().map(|v| v * v).sum::<f64>() / joints as f64).sqrt();
    assert!((deviation / (0.3 * 0.4_f64.sqrt()) - 1.0).abs() < OF_2000, "{deviation}");
}

#[test]
fn drop_outs_leave_other_readings_unchanged() {
    let settings = EncoderSettings { drop_out: 0.2, ..noisy(6) };
    let (mut all, mut some) = (encoder(1, &noisy(6)), encoder(1, &settings));
    let mut kept = 0_u32;
    for k in 0..10_000_u64 {
        for encoder in [&mut all, &mut some] {
            encoder.sample(k * PERIOD_NS, &[0.4], &[-0.2], &[3.0]).unwrap();
        }
        let whole = all.reading(k * PERIOD_NS).unwrap();
        if let Some(reading) =
            some.reading(k * PERIOD_NS).filter(|reading| reading.sampled_at == k * PERIOD_NS)
        {
            assert_eq!(reading, whole);
            kept += 1;
        }
    }
    assert_eq!(u64::from(kept) + some.dropped(), 10_000);
    let share = 1.0 - f64::from(kept) / 10_000.0;
    assert!((share - 0.2).abs() < 5.0 * (0.2_f64 * 0.8 / 1e4).sqrt(), "{share}");
    assert_eq!(all.dropped(), 0);
    let wrong = EncoderSettings { drop_out: 1.5, ..EncoderSettings::default() };
    let error = EncoderModel::new(1, &wrong, 0, Duration::from_millis(1)).unwrap_err();
    assert_eq!(error.to_string(), "drop_out = 1.5: expected a fraction from 0 to 1");
}
