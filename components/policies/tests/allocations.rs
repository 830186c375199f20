//! Only construction allocates.

use std::time::Duration;

use motorium::telemetry::{CountingAllocator, allocations, counts_allocations};
use motorium_policies::dmp::{DiscreteDmp, DmpModel, OrientationDmp, Scaling, Settings, Variant};
use motorium_policies::reach::{Leg, PathShape, PoseReach, Repeat};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn allocated(work: impl FnOnce()) -> u64 {
    assert!(counts_allocations());
    let before = allocations().own;
    work();
    allocations().own - before
}

#[test]
fn a_primitive_starts_runs_and_changes_course_without_allocating() {
    for variant in [Variant::Classic, Variant::GoalSafe, Variant::QuinticGoal] {
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
fn an_orientation_turns_and_changes_course_without_allocating() {
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
fn a_reach_runs_through_its_legs_without_allocating() {
    let leg = |x, shape| Leg {
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
