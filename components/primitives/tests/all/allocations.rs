//! Only construction allocates.

use std::time::Duration;

use motorium::telemetry::{CountingAllocator, allocations, counts_allocations};
use motorium_primitives::cpg::{
    Gait, HopfNetwork, HopfSettings, JointOscillation, Kuramoto, LegSettings, MatsuokaOscillator,
    MatsuokaSettings, Oscillator, OscillatorNetwork, OscillatorNetworkSettings, PhaseNetwork,
};
use motorium_primitives::dmp::{
    Coupling, DiscreteDmp, DmpModel, ObstacleAvoidance, OrientationDmp, PhaseStop, RhythmicDmp,
    RhythmicModel, RhythmicSettings, SampledDmp, SampledModel, Scaling, Settings, Variant,
};
use motorium_primitives::gmm::{Gmm, Gmr};
use motorium_primitives::kmp::{Kmp, KmpReference, KmpSettings};
use motorium_primitives::promp::{ProMp, ProMpBasis, ProMpRunner};
use motorium_primitives::reach::{PathShape, PoseReach, Repeat, Segment};
use motorium_primitives::regression::PolynomialPolicy;
use nalgebra::{DMatrix, DVector, Isometry3, UnitQuaternion, Vector3};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn allocated(work: impl FnOnce()) -> u64 {
    assert!(counts_allocations());
    let before = allocations().own;
    work();
    allocations().own - before
}

#[test]
fn discrete_primitive_never_allocates_after_new() {
    for variant in [Variant::Classic, Variant::GoalSafe, Variant::QuinticGoal, Variant::FinalVelocity] {
        for scaling in
            [Scaling::Fixed, Scaling::Displacement { limit: 2.0 }, Scaling::Similarity { limit: 2.0 }]
        {
            let settings = Settings { variant, scaling, kernels: 50, ..Settings::default() };
            let mut dmp = DiscreteDmp::new(DmpModel::new(14, settings).unwrap());
            let work = || {
                dmp.start(&[0.0; 14], &[1.0; 14], 1.0).unwrap();
                for k in 0..1500 {
                    dmp.step(1e-3);
                    if k == 500 {
                        dmp.set_goal(&[0.5; 14]).unwrap();
                        dmp.set_duration(2.0).unwrap();
                        dmp.weights_mut()[(3, 2)] = 40.0;
                        assert!(dmp.start(&[0.0; 3], &[1.0; 14], 1.0).is_err());
                    }
                }
            };
            assert_eq!(allocated(work), 0, "{variant:?}, {scaling:?}");
        }
    }
}

#[test]
fn orientation_primitive_never_allocates_after_new() {
    let mut dmp = OrientationDmp::new(DmpModel::new(3, Settings::default()).unwrap()).unwrap();
    let goal = |angle| UnitQuaternion::from_scaled_axis(Vector3::new(0.0, angle, 0.3));
    let work = || {
        dmp.start(goal(0.0), goal(2.0), 1.0).unwrap();
        (0..500).for_each(|_| dmp.step(1e-3));
        dmp.set_goal(goal(-1.0)).unwrap();
        (0..1000).for_each(|_| dmp.step(1e-3));
    };
    assert_eq!(allocated(work), 0);
}

#[test]
fn reach_never_allocates_after_new() {
    let leg = |x, shape| Segment {
        goal: Isometry3::translation(x, 0.0, 0.4),
        duration: Duration::from_millis(300),
        dwell: Duration::from_millis(20),
        shape,
    };
    let apex = Vector3::new(0.0, 0.0, 0.1);
    let legs = vec![leg(0.3, PathShape::Straight), leg(0.6, PathShape::Arc { apex })];
    let mut reach = PoseReach::new(legs, Repeat::Forever).unwrap();
    let work = || {
        reach.start(Isometry3::translation(0.4, 0.1, 0.5)).unwrap();
        for k in 0..3000 {
            reach.step(Duration::from_millis(1));
            std::hint::black_box((reach.pose(), reach.twist(), reach.acceleration()));
            if k == 1000 {
                reach.redirect(Isometry3::translation(0.5, 0.2, 0.3)).unwrap();
                reach.set_speed(0.5).unwrap();
            }
        }
    };
    assert_eq!(allocated(work), 0);
}

#[test]
fn rhythms_couplings_and_tables_never_allocate() {
    let period =
        DMatrix::from_fn(60, 3, |k, d| ((d + 1) as f64 * std::f64::consts::TAU * k as f64 / 60.0).sin());
    let model = RhythmicModel::fit(RhythmicSettings::default(), &[period], 1e-12).unwrap();
    let mut rhythm = RhythmicDmp::new(model);
    let mut stroke = DiscreteDmp::new(
        DmpModel::new(3, Settings { variant: Variant::FinalVelocity, ..Settings::default() }).unwrap(),
    );
    let other = DmpModel::new(3, stroke.model().settings().clone()).unwrap();
    let shown = DMatrix::from_fn(100, 3, |k, d| (k * (d + 1)) as f64 * 0.01);
    let mut table = SampledDmp::new(SampledModel::new(&Settings::default(), &shown).unwrap());
    let (avoidance, stop) = (ObstacleAvoidance::default(), PhaseStop::Quadratic { gain: 10.0 });
    let work = || {
        stroke.exchange(&other).unwrap();
        stroke.start_striking([&[0.0; 3]; 3], [&[1.0; 3], &[0.5; 3]], 1.0).unwrap();
        table.start(&[0.0; 3], &[2.0; 3], 1.0).unwrap();
        for k in 0..1000 {
            rhythm.step_entrained(1e-3, 0.1);
            let y = Vector3::from_column_slice(stroke.position());
            let v = Vector3::from_column_slice(stroke.velocity());
            let c = avoidance.acceleration(y, v, Vector3::new(0.5, 0.4, 0.5));
            let phase_rate = stop.rate(0.1);
            stroke.step_coupled(1e-3, &Coupling { acceleration: c.as_slice(), phase_rate }).unwrap();
            table.step();
            if k == 500 {
                rhythm.set_period(0.3).unwrap();
                rhythm.set_amplitude(2.0).unwrap();
                table.set_goal(&[1.0; 3]).unwrap();
            }
        }
    };
    assert_eq!(allocated(work), 0);
}

#[test]
fn pattern_generators_never_allocate_after_new() {
    let mut network = PhaseNetwork::of_gait(Gait::Tripod, &[LegSettings::default(); 6], 5.0).unwrap();
    let mut hopf =
        HopfNetwork::new(HopfSettings::default(), DMatrix::from_element(4, 4, 0.5), &[0.0; 4]).unwrap();
    let mut pair = MatsuokaOscillator::pair(MatsuokaSettings::default(), 2.2).unwrap();
    let mut kuramoto = Kuramoto::new(vec![6.0; 5], DMatrix::from_element(5, 5, 0.5), vec![0.0; 5]).unwrap();
    let work = || {
        for k in 0..2000 {
            network.step_entrained(1e-3, &[0.1; 6]);
            hopf.step_with_feedback(1e-3, &[0.1; 4]);
            pair.step_with_feedback(1e-3, &[0.1, 0.0]);
            kuramoto.step(1e-3);
            if k == 1000 {
                network.set_gait(Gait::Walk).unwrap();
                network.set_frequency(2.0).unwrap();
                network.set_amplitude_offset(2, 0.5, 0.1).unwrap();
                hopf.set_pattern(&[0.0, 1.0, 2.0, 3.0]).unwrap();
                hopf.set_settings(HopfSettings::default().with_stride(0.5, 0.6)).unwrap();
            }
        }
    };
    assert_eq!(allocated(work), 0);
}

#[test]
fn probabilistic_models_evaluate_without_allocating() {
    let basis = ProMpBasis::gaussian(8, 0.7).unwrap();
    let promp = ProMp::from_weights(basis, 2, DVector::zeros(16), DMatrix::identity(16, 16)).unwrap();
    let mut runner = ProMpRunner::new(promp.into());
    let means = vec![DVector::zeros(3), DVector::from_element(3, 1.0)];
    let gmm = Gmm::new(vec![0.5, 0.5], means, vec![DMatrix::identity(3, 3); 2]).unwrap();
    let mut gmr = Gmr::new(&gmm, 1).unwrap();
    let inputs: Vec<DVector<f64>> = (0..10).map(|k| DVector::from_element(1, f64::from(k) * 0.1)).collect();
    let reference = KmpReference::from_regression(&mut gmr, &inputs).unwrap();
    let mut kmp = Kmp::new(&reference, KmpSettings::default()).unwrap();
    let mut polynomial = PolynomialPolicy::new(4, 2, 3).unwrap();
    let work = || {
        runner.start(&[0.1, 0.2], &[0.0; 2], 1.0).unwrap();
        for k in 0..500 {
            runner.step(1e-3);
            let at = [f64::from(k) * 2e-3];
            gmr.predict(&at).unwrap();
            kmp.mean(&at).unwrap();
            polynomial.act(&[at[0]; 4], &mut [0.0; 2]).unwrap();
        }
    };
    assert_eq!(allocated(work), 0);
}

#[test]
fn oscillator_network_never_allocates_after_new() {
    let matsuoka = Oscillator::Matsuoka { settings: MatsuokaSettings::default(), inhibition: 2.2 };
    for model in [Oscillator::Kuramoto, Oscillator::Hopf(HopfSettings::default()), matsuoka] {
        let oscillations =
            [0, 0, 1, 2, 3].map(|leg| JointOscillation { leg, amplitude: 0.3, offset: 0.1, phase: 0.5 });
        let trot = Gait::Trot.phases(4).unwrap();
        let mut rhythm =
            OscillatorNetwork::new(model, &oscillations, trot, OscillatorNetworkSettings::default()).unwrap();
        let work = || {
            for k in 0..1000 {
                let pull = [0, 1, 2, 3, 4].map(|joint| rhythm.pull(joint, 0.2, 0.1, 2.0));
                rhythm.step_entrained(1e-3, &pull);
                if k == 500 {
                    rhythm.set_gait(Gait::Pace.phases(4).unwrap()).unwrap();
                    rhythm.set_frequency(2.0).unwrap();
                    rhythm.set_duty_factor(0.7).unwrap();
                    rhythm.set_amplitude_offset(3, 0.1, 0.0).unwrap();
                    assert!(rhythm.set_frequency(f64::NAN).is_err());
                }
            }
        };
        assert_eq!(allocated(work), 0, "{model:?}");
    }
}
