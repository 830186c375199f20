//! Errors of a measured quantity, compared with their statistics. Tolerances are five standard errors.

use motorium_sensors::channel::{Channel, ErrorModel};

fn moments(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n)
}

#[test]
fn noise_is_white_with_the_configured_deviation() {
    let errors = ErrorModel { noise: 0.3, ..ErrorModel::default() };
    let mut channel = Channel::new("x", &errors, 1, 4, 0).unwrap();
    let readings: Vec<f64> = (0..100_000)
        .map(|_| {
            let mut value = [2.0];
            channel.measure(1e-3, &mut value);
            value[0]
        })
        .collect();
    let (mean, variance) = moments(&readings);
    let n = readings.len() as f64;
    assert!((mean - 2.0).abs() < 5.0 * 0.3 / n.sqrt());
    assert!((variance / 0.09 - 1.0).abs() < 5.0 * (2.0 / n).sqrt());
    let lag: f64 = readings.windows(2).map(|pair| (pair[0] - 2.0) * (pair[1] - 2.0)).sum::<f64>() / n / 0.09;
    assert!(lag.abs() < 5.0 / n.sqrt(), "{lag}");
}

#[test]
fn bias_walk_grows_with_root_time_at_any_rate() {
    let errors = ErrorModel { bias_walk: 0.02, ..ErrorModel::default() };
    for (steps, dt) in [(100_u32, 1e-2), (1000, 1e-3)] {
        let ends: Vec<f64> = (0..2000)
            .map(|seed| {
                let mut channel = Channel::new("x", &errors, 1, seed, 0).unwrap();
                let mut value = [0.0];
                for _ in 0..steps {
                    value = [0.0];
                    channel.measure(dt, &mut value);
                }
                assert_eq!(value[0], channel.bias()[0]);
                value[0]
            })
            .collect();
        let (mean, variance) = moments(&ends);
        assert!(mean.abs() < 5.0 * 0.02 / 2000_f64.sqrt());
        assert!((variance / 4e-4 - 1.0).abs() < 5.0 * (2.0 / 2000.0_f64).sqrt(), "{variance}");
    }
}

#[test]
fn bias_and_scale_are_sampled_once_per_axis() {
    let errors = ErrorModel { bias: 0.5, scale_error: 0.01, ..ErrorModel::default() };
    let mut channel = Channel::new("x", &errors, 2000, 9, 0).unwrap();
    let measure = |channel: &mut Channel, truth: f64| {
        let mut values = vec![truth; 2000];
        channel.measure(1e-3, &mut values);
        values
    };
    let (at_zero, at_hundred) = (measure(&mut channel, 0.0), measure(&mut channel, 100.0));
    assert_eq!(at_zero, measure(&mut channel, 0.0), "the same in each reading");
    let bound = 5.0 * (2.0 / 2000.0_f64).sqrt();
    assert!((moments(&at_zero).1 / 0.25 - 1.0).abs() < bound);
    let scales: Vec<f64> =
        at_zero.iter().zip(&at_hundred).map(|(zero, hundred)| (hundred - zero) / 100.0).collect();
    let (mean, variance) = moments(&scales);
    assert!((mean - 1.0).abs() < 5.0 * 0.01 / 2000_f64.sqrt() && (variance / 1e-4 - 1.0).abs() < bound);
}

#[test]
fn readings_are_quantised_and_within_the_range() {
    let errors = ErrorModel { noise: 1.0, resolution: 0.25, range: Some(1.5), ..ErrorModel::default() };
    let mut channel = Channel::new("x", &errors, 1, 4, 0).unwrap();
    let mut ends = 0;
    for _ in 0..2000 {
        let mut value = [0.0];
        channel.measure(1e-3, &mut value);
        assert_eq!(value[0], (value[0] * 4.0).round() / 4.0);
        assert!(value[0].abs() <= 1.5);
        ends += u32::from(value[0].abs() == 1.5);
    }
    assert!(ends > 50, "some readings saturate");
}

#[test]
fn invalid_settings_are_rejected_with_their_key() {
    let refuse = |errors| Channel::new("gyroscope", &errors, 1, 0, 0).unwrap_err().setting;
    assert_eq!(refuse(ErrorModel { noise: -1.0, ..ErrorModel::default() }), "gyroscope.noise");
    assert_eq!(refuse(ErrorModel { range: Some(f64::NAN), ..ErrorModel::default() }), "gyroscope.range");
    assert_eq!(
        refuse(ErrorModel { bias_walk: f64::INFINITY, ..ErrorModel::default() }),
        "gyroscope.bias_walk"
    );
}
