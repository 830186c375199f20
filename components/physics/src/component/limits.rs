//! The limits of the drives, from the robot to the command gate.

use motorium::declare::ConfigError;
use motorium::safety::JointLimits;
use motorium_robots::{Loaded, ProfileError};

/// Returns limits and gains of every drive of a robot: the joints of its model, then its rotors, named
/// `names`.
///
/// Position, velocity and effort limits come from the model. Acceleration limits, limits of the effort's rate
/// of change, and the gains of the safe states come from the profile. The default gains of a robot without
/// gains reach full effort at a twentieth of a radian (or metre), with a damping of one tenth of the
/// stiffness.
///
/// A passive joint of the profile gets no gains. No drive can bring it to rest, so it may swing in every safe
/// state, and the others are at rest without it.
pub(super) fn of_drives(robot: &Loaded, names: &[String]) -> Result<Vec<JointLimits>, ConfigError> {
    let model = &robot.model;
    let profile = robot.profile.as_ref();
    let refused = |error: ProfileError| ConfigError::new(error.to_string());
    let acceleration =
        profile.map(|profile| profile.acceleration_limit(model)).transpose().map_err(refused)?;
    let effort_rate = profile.map(|profile| profile.effort_rate_limit(model)).transpose().map_err(refused)?;
    let gains = profile.and_then(|profile| profile.gains(model).ok());
    let joint = |(i, name): (usize, &String)| {
        if i >= model.joint_count() {
            // A rotor does not hold a position; its thrust has separate limits.
            return JointLimits::new(name);
        }
        let effort = model.effort_limit()[i].abs();
        let is_passive = profile.is_some_and(|profile| profile.passive.contains(name));
        let (kp, kd) = match &gains {
            _ if is_passive => (0.0, 0.0),
            Some(gains) => (gains.kp[i], gains.kd[i]),
            None => default_gains(effort),
        };
        let limits = JointLimits {
            lower: model.lower()[i],
            upper: model.upper()[i],
            velocity: model.velocity_limit()[i],
            acceleration: acceleration.as_ref().map_or(f64::INFINITY, |limits| limits[i]),
            effort_rate: effort_rate.as_ref().map_or(f64::INFINITY, |limits| limits[i]),
            kp,
            kd,
            ..JointLimits::new(name)
        };
        limits.with_effort(effort)
    };
    Ok(names.iter().enumerate().map(joint).collect())
}

fn default_gains(effort_limit: f64) -> (f64, f64) {
    let kp = if effort_limit.is_finite() { 20.0 * effort_limit } else { 1000.0 };
    (kp, 0.1 * kp)
}

#[cfg(test)]
mod tests {
    use motorium_robots::catalogue;

    use super::*;

    #[test]
    fn passive_joints_of_a_profile_without_gains_are_not_held() {
        let mut robot = motorium_robots::load("cart-pole", std::path::Path::new(".")).expect("it loads");
        let names = robot.model.joint_names().to_vec();
        let gains = |robot: &Loaded| -> Vec<(f64, f64)> {
            of_drives(robot, &names).expect("limits").iter().map(|limits| (limits.kp, limits.kd)).collect()
        };
        assert_eq!(gains(&robot), [(20.0, 9.4), (0.0, 0.0)]);
        let text = "title = \"c\"\nsources = []\njoints = [\"slider\", \"hinge\"]\nhome = \"down\"\npassive = [\"hinge\"]\n\
                    [poses]\ndown = [0.0, 0.0]\n";
        robot.profile = Some(motorium_robots::Profile::parse(text).expect("a profile"));
        let [slider, hinge] = gains(&robot)[..] else { panic!("two joints") };
        assert!(slider.0 > 0.0 && slider.1 > 0.0 && hinge == (0.0, 0.0), "{slider:?}, {hinge:?}");
    }

    #[test]
    fn catalogue_gains_pass_the_command_gate() {
        let mut robots = 0;
        for entry in catalogue() {
            let robot = motorium_robots::load(entry.name, std::path::Path::new(".")).expect("it loads");
            let Ok(gains) = entry.profile.gains(&robot.model) else { continue };
            robots += 1;
            for (i, effort) in robot.model.effort_limit().iter().enumerate() {
                let velocity = robot.model.velocity_limit()[i];
                let limits = JointLimits { velocity, ..JointLimits::new("joint") }.with_effort(effort.abs());
                // twice the gain, the maximum of `kp_scale`
                let passes = 2.0 * gains.kp[i] <= limits.max_kp && 2.0 * gains.kd[i] <= limits.max_kd;
                assert!(
                    passes,
                    "{} joint {i}: {limits:?}, gains {} and {}",
                    entry.name, gains.kp[i], gains.kd[i]
                );
                let (kp, kd) = default_gains(effort.abs());
                assert!(kp <= limits.max_kp && kd <= limits.max_kd, "{} joint {i}: {limits:?}", entry.name);
            }
        }
        assert!(robots > 15, "{robots} robots");
    }
}
