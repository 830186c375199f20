//! Only construction allocates.

use std::time::Duration;

use motorium::testing::allocations;
use motorium::units::TimeSpan;
use motorium_robots::PerJoint;
use motorium_sensors::encoder::{Differentiation, EncoderModel, EncoderSettings, JointErrors};

#[test]
fn sampling_and_reading_do_not_allocate() {
    for differentiate in [None, Some(Differentiation { cutoff_hz: 100.0 })] {
        let all = |number: f64| PerJoint::All(number);
        let settings = EncoderSettings {
            position: JointErrors { noise: all(1e-4), resolution: all(1e-4), ..JointErrors::default() },
            effort: JointErrors { noise: all(0.1), bias_walk: all(0.1), ..JointErrors::default() },
            drop_out: 0.1,
            latency: TimeSpan { ns: 3_500_000 },
            differentiate,
            ..EncoderSettings::default()
        };
        let mut encoder = EncoderModel::new(8, &settings, 0, Duration::from_millis(1)).unwrap();
        let count = allocations(|| {
            for k in 0..2000_u64 {
                // every tenth sample repeats, and the clock restarts once
                let time = (k - k % 10 / 9) % 1500 * 1_000_000;
                encoder.sample(time, &[0.5; 8], &[0.1; 8], &[2.0; 8]).unwrap();
                std::hint::black_box(encoder.reading(time));
                assert!(encoder.sample(time, &[0.0; 3], &[], &[]).is_err());
            }
        });
        assert_eq!(count, 0, "{differentiate:?}");
    }
}
