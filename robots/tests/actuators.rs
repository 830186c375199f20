//! Actuator models compared with their equations.

use motorium_robots::{Actuator, ActuatorSettings, Delay, Envelope, Thermal};

fn actuator(settings: ActuatorSettings, limit: f64) -> Actuator {
    Actuator::new(&settings, limit).unwrap()
}

#[test]
fn ideal_actuator_delivers_the_command_within_its_limit() {
    let mut ideal = actuator(ActuatorSettings::default(), 5.0);
    assert_eq!([3.0, 7.0, -9.0].map(|wanted| ideal.step(wanted, 2.0, 1e-3)), [3.0, 5.0, -5.0]);
}

#[test]
fn effort_follows_a_step_as_a_first_order_lag() {
    let lag = 0.03;
    let mut lagging = actuator(ActuatorSettings { lag, ..ActuatorSettings::default() }, f64::INFINITY);
    let h = 1e-6;
    for step in 1..=90_000 {
        let effort = lagging.step(4.0, 0.0, h);
        let expected = 4.0 * (1.0 - (-f64::from(step) * h / lag).exp());
        assert!((effort - expected).abs() < 1e-4, "after {step} us: {effort}, {expected}");
    }
}

#[test]
fn long_step_neither_overshoots_nor_oscillates() {
    let mut lagging = actuator(ActuatorSettings { lag: 1e-4, ..ActuatorSettings::default() }, 10.0);
    let mut before = 0.0;
    for _ in 0..20 {
        let effort = lagging.step(8.0, 0.0, 0.05);
        assert!((before..=8.0).contains(&effort), "{before}, {effort}");
        before = effort;
    }
    assert!((before - 8.0).abs() < 1e-9);
}

#[test]
fn saturated_motor_approaches_its_limit_with_its_lag() {
    let lag = 0.01;
    let settings = ActuatorSettings { lag, ..ActuatorSettings::default() };
    let (mut asked_much, mut asked_the_limit) = (actuator(settings.clone(), 10.0), actuator(settings, 10.0));
    for _ in 0..50 {
        assert_eq!(asked_much.step(1e4, 0.0, 1e-3), asked_the_limit.step(10.0, 0.0, 1e-3));
    }
}

#[test]
fn effort_rate_is_limited_in_both_directions() {
    let settings = ActuatorSettings { rate_limit: Some(200.0), ..ActuatorSettings::default() };
    let mut slow = actuator(settings, 50.0);
    let efforts: Vec<f64> =
        (0..200).map(|step| slow.step(if step < 100 { 10.0 } else { -10.0 }, 0.0, 1e-3)).collect();
    for (step, effort) in efforts.iter().enumerate() {
        let time = 1e-3 * (step + 1) as f64;
        // rises for 50 ms, constant until 100 ms, falls for 100 ms
        let expected = if step < 100 { (200.0 * time).min(10.0) } else { 10.0 - 200.0 * (time - 0.1) };
        assert!((effort - expected.max(-10.0)).abs() < 1e-9, "step {step}: {effort}, {expected}");
    }
}

#[test]
fn envelope_falls_with_speed_but_not_for_braking() {
    let envelope = Envelope { stall_effort: 12.0, no_load_velocity: 6.0 };
    let motor = actuator(ActuatorSettings { envelope: Some(envelope), ..ActuatorSettings::default() }, 10.0);
    for (velocity, low, high) in [
        (0.0, -10.0, 10.0),
        // 12 (1 - v / 6), with the joint's limit of 10 above it
        (0.5, -10.0, 10.0),
        (3.0, -10.0, 6.0),
        (6.0, -10.0, 0.0),
        (9.0, -10.0, 0.0),
        (-3.0, -6.0, 10.0),
        (-9.0, 0.0, 10.0),
    ] {
        assert_eq!(motor.available(velocity), (low, high), "at {velocity}");
    }
}

#[test]
fn delayed_command_acts_exactly_at_its_time() {
    for (delay, steps) in [(0.0, 0), (1e-3, 1), (2.5e-3, 3), (20e-3, 20)] {
        let mut line = Delay::new(delay, -1);
        for step in 0..100 {
            let expected = if step < steps { -1 } else { step - steps };
            assert_eq!(line.acting(step), expected, "{delay} s, step {step}");
            line.advance(step, 1e-3);
        }
        line.reset();
        assert_eq!(line.acting(7), if steps == 0 { 7 } else { -1 });
    }
}

#[test]
fn winding_heats_exponentially_to_the_continuous_effort() {
    let thermal = Thermal { continuous_effort: 5.0, time_constant: 2.0 };
    let mut motor =
        actuator(ActuatorSettings { thermal: Some(thermal), ..ActuatorSettings::default() }, 10.0);
    let h = 1e-3;
    // four times the continuous losses: the limit starts to decrease at a heat of 0.8
    let full_until = -2.0 * (1.0_f64 - 0.8 / 4.0).ln();
    for step in 1..=20_000 {
        let (time, effort) = (h * f64::from(step), motor.step(10.0, 0.0, h));
        if time < full_until - h {
            assert_eq!(effort, 10.0, "{time} s");
            let expected = 4.0 * (1.0 - (-time / 2.0).exp());
            assert!((motor.heat() - expected).abs() < 1e-9, "{time} s: {}", motor.heat());
        } else if time > full_until + 2.0 * h {
            assert!((5.0..10.0).contains(&effort), "{time} s: {effort}");
        }
    }
    assert!((motor.effort() - 5.0).abs() < 0.01 && (motor.heat() - 1.0).abs() < 0.01, "{motor:?}");
    // and cools
    for _ in 0..2000 {
        motor.step(0.0, 0.0, h);
    }
    assert!((motor.heat() - (-1.0_f64).exp()).abs() < 0.01, "{}", motor.heat());
}

#[test]
fn combined_stages_respect_every_bound() {
    let settings = ActuatorSettings {
        envelope: Some(Envelope { stall_effort: 30.0, no_load_velocity: 8.0 }),
        thermal: Some(Thermal { continuous_effort: 6.0, time_constant: 0.3 }),
        lag: 4e-3,
        rate_limit: Some(900.0),
        ..ActuatorSettings::default()
    };
    let mut motor = actuator(settings, 20.0);
    let mut before = 0.0;
    for step in 0..5000 {
        let phase = 0.003 * f64::from(step);
        let (wanted, velocity) = (40.0 * (7.0 * phase).sin(), 10.0 * phase.cos());
        let law = motor.law(velocity, 1e-3);
        assert!(law.low <= law.high, "{law:?}");
        let effort = motor.step(wanted, velocity, 1e-3);
        assert!((law.low..=law.high).contains(&effort));
        assert!((effort - before).abs() <= 0.9 + 1e-12 && effort.abs() <= 20.0, "{before}, {effort}");
        before = effort;
    }
}

#[test]
fn invalid_actuator_settings_are_rejected_by_name() {
    let bad = |change: fn(&mut ActuatorSettings)| {
        let mut settings = ActuatorSettings::default();
        change(&mut settings);
        Actuator::new(&settings, 1.0).unwrap_err().to_string()
    };
    assert_eq!(bad(|settings| settings.delay = -1.0), "delay = -1: expected a time from 0 to 10 s");
    assert!(bad(|settings| settings.lag = f64::NAN).starts_with("lag = NaN"));
    assert!(bad(|settings| settings.rate_limit = Some(0.0)).starts_with("rate_limit = 0"));
    let flat = Envelope { stall_effort: 1.0, no_load_velocity: 0.0 };
    assert_eq!(
        Actuator::new(&ActuatorSettings { envelope: Some(flat), ..ActuatorSettings::default() }, 1.0)
            .unwrap_err()
            .setting,
        "envelope.no_load_velocity"
    );
}
