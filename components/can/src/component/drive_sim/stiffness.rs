//! Detection of drive loops that are too stiff for their step size.

use motorium_robots::Dynamics;
use nalgebra::DMatrix;

use crate::ControlMode;
use crate::component::Equipped;

/// Value of `kd dt / I` above which a discrete velocity loop amplifies every error, so its torque alternates
/// between both limits.
const UNSTABLE: f64 = 2.0;

/// Describes the first drive whose own loop is unstable for a step of `dt` \[s\]. The criterion is `kd dt /
/// I`, with the gain at the joint and the joint's effective inertia in the home pose.
pub(super) fn too_stiff(equipped: &Equipped, dt: f64) -> Option<String> {
    let Equipped { robot, table, order } = equipped;
    let (model, joints) = (&robot.model, robot.model.joint_count());
    let mut mass = DMatrix::zeros(model.nv(), model.nv());
    let home = robot.profile.as_ref().and_then(|profile| profile.configuration(model, &profile.home).ok());
    let q = home.map_or_else(|| model.neutral(), |home| home.as_slice().to_vec());
    Dynamics::new(model).crba(model, &q, &mut mass);
    // effective inertia when an effort only acts on this joint
    let inverse = mass.try_inverse()?;
    (0..joints).find_map(|i| {
        let entry = &table.drives[order[i]];
        if !entry.protocol.spec().has_loop() || entry.mode == Some(ControlMode::Torque) {
            return None;
        }
        let (ratio, column) = (entry.ratio, model.nv() - joints + i);
        let inertia = 1.0 / inverse[(column, column)];
        let kd = table.position_loop(order[i]).kd * ratio * ratio;
        let share = kd * dt / inertia;
        (share.is_finite() && share > UNSTABLE).then(|| {
            format!(
                "the loop of the drive of `{}` is unstable: kd dt / I = {kd:.3} N m s/rad x {:.3} ms / {inertia:.3} kg m2 = {share:.1}, expected at most {UNSTABLE}",
                entry.joint,
                dt * 1e3
            )
        })
    })
}
