//! Acceleration limits of setpoints, and joints that they keep behind their commands.

use super::*;

/// Offers a command after a step in which the drives restrained the shoulder or not.
fn offer_after(arm: &mut Arm, restrained: bool, command: &JointCommand) -> Verdict {
    arm.gate.note_restrained(&[restrained, false], &arm.position, DT, &arm.book);
    let mut gravity = |effort: &mut [f64]| effort.copy_from_slice(&GRAVITY);
    let measured = Measured { position: &arm.position, velocity: &arm.velocity, gravity: &mut gravity };
    arm.gate.offer(Offer { command, is_new: true, ahead: DT }, measured, DT, &arm.book)
}

fn arrivals(arm: &Arm) -> Vec<Option<f64>> {
    arm.gate.setpoints().iter().map(|setpoint| setpoint.arrival_velocity).collect()
}

#[test]
fn setpoints_of_commands_carry_the_acceleration_limits() {
    let mut arm = Arm::following();
    let limits = |arm: &Arm| arm.gate.setpoints().iter().map(|s| s.max_acceleration).collect::<Vec<_>>();
    let still = command([0.5, -0.5], [0.0; 2]);
    assert_eq!(arm.offer(&still), Verdict::Applied);
    assert_eq!(limits(&arm), [7.5, 12.5]);
    let mut efforts = still;
    efforts.kp_mut()[0] = 0.0;
    efforts.kd_mut()[0] = 0.0;
    assert_eq!(arm.offer(&efforts), Verdict::Applied);
    assert_eq!(limits(&arm), [f64::INFINITY, 12.5], "pure efforts");
    arm.silence();
    assert_eq!(limits(&arm), [f64::INFINITY; 2], "the safe state");
}

#[test]
fn restrained_joints_are_counted_and_arrive_with_their_command() {
    let mut arm = Arm::following();
    let moves = command([0.501, -0.5], [0.005, 0.0]);
    assert_eq!(offer_after(&mut arm, true, &moves), Verdict::Applied);
    assert_eq!(*arm.book.limited.borrow(), [(0, LimitKind::Acceleration)]);
    assert_eq!(arrivals(&arm), [Some(0.005), None]);
    // without a stated velocity, the rate of the positions
    let moves = command([0.5015, -0.5], [0.0; 2]);
    offer_after(&mut arm, false, &moves);
    let rate = arrivals(&arm)[0].unwrap();
    assert!((rate - 0.5).abs() < 1e-9, "{rate} rad/s");
    // a clamped position moves for an unknown time
    offer_after(&mut arm, false, &command([1.0, -0.5], [0.0; 2]));
    assert_eq!(arrivals(&arm), [Some(0.0), None]);
    assert_eq!(arm.book.limited.borrow().len(), 2, "{:?}", arm.book.limited.borrow());
}

#[test]
fn a_joint_that_meets_its_setpoint_is_no_longer_behind() {
    let mut arm = Arm::following();
    let still = command([0.5, -0.5], [0.0; 2]);
    offer_after(&mut arm, true, &still);
    (0..10).for_each(|_| {
        offer_after(&mut arm, false, &still);
    });
    assert_eq!(arrivals(&arm), [Some(0.0), None], "it was restrained 10 ms ago");
    (0..20).for_each(|_| {
        offer_after(&mut arm, false, &still);
    });
    assert_eq!(arrivals(&arm), [None; 2]);
    // far away it stays behind
    arm.position[0] = 0.3;
    (0..100).for_each(|step| {
        offer_after(&mut arm, step == 0, &still);
    });
    assert_eq!(arrivals(&arm), [Some(0.0), None]);
    arm.gate.reset();
    arm.silence();
    offer_after(&mut arm, false, &still);
    assert_eq!(arrivals(&arm), [None; 2], "after a reset");
}
