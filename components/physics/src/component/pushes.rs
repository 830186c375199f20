//! External pushes at specified times.

use motorium::declare::ConfigError;
use motorium::units::TimeSpan;
use motorium_robots::FrameId;
use nalgebra::{Point3, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::{Articulation, Engine, Simulation, Simulator};

/// A force and a torque on a link of the robot during an interval of a run or an episode.
///
/// ```toml
/// at = "2 s"
/// duration = "100 ms"
/// link = "torso"
/// force = [60.0, 0.0, 0.0]
/// ```
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PushConfig {
    /// Start time of the push.
    pub at: TimeSpan,
    /// Duration of the push.
    pub duration: TimeSpan,
    /// Name of the pushed link; with several robots, `ROBOT/LINK`. Default: the base link of the first robot.
    #[serde(default)]
    pub link: Option<String>,
    /// Point of application, in link axes, m. Default: the origin of the link.
    #[serde(default)]
    pub point: [f64; 3],
    /// Force in world axes, N. Default: zero.
    #[serde(default)]
    pub force: [f64; 3],
    /// Additional torque in world axes, N m. Default: zero.
    #[serde(default)]
    pub torque: [f64; 3],
}

/// The pushes of a component with resolved links.
pub(super) struct Pushes(Vec<Push>);

struct Push {
    from_ns: u64,
    to_ns: u64,
    /// Index of the articulation, and of the link among its frames.
    link: (usize, FrameId),
    point: Point3<f64>,
    force: Vector3<f64>,
    torque: Vector3<f64>,
}

impl Pushes {
    /// Checks the pushes for these robots.
    pub(super) fn new(configs: &[PushConfig], robots: &[Articulation]) -> Result<Self, ConfigError> {
        let push = |(index, config): (usize, &PushConfig)| {
            let key = |name: &str| format!("pushes[{index}].{name}");
            let first = robots[0].model();
            let name = config.link.as_ref().unwrap_or(&first.frames()[0].name);
            let found = |(of, own): (usize, &Articulation)| Some((of, own.model().frame(name).ok()?));
            let unknown =
                |error: motorium_robots::UnknownFrame| ConfigError::key(key("link"), error.to_string());
            let link = match robots.iter().enumerate().find_map(found) {
                Some(link) => link,
                None => (0, first.frame(name).map_err(unknown)?),
            };
            for (name, numbers) in
                [("point", config.point), ("force", config.force), ("torque", config.torque)]
            {
                if let Some(number) = numbers.iter().find(|number| number.is_nan() || number.abs() >= 1e6) {
                    let message = format!("{number}, expected a number between -1e6 and 1e6");
                    return Err(ConfigError::key(key(name), message));
                }
            }
            if config.force == [0.0; 3] && config.torque == [0.0; 3] {
                return Err(ConfigError::key(
                    format!("pushes[{index}]"),
                    "the push has neither a force nor a torque",
                )
                .advise("write `force = [60.0, 0.0, 0.0]`"));
            }
            if config.duration.ns == 0 {
                return Err(ConfigError::key(key("duration"), "0, expected a time such as \"100 ms\""));
            }
            Ok(Push {
                from_ns: config.at.ns,
                to_ns: config.at.ns.saturating_add(config.duration.ns),
                link,
                point: config.point.into(),
                force: config.force.into(),
                torque: config.torque.into(),
            })
        };
        configs.iter().enumerate().map(push).collect::<Result<_, _>>().map(Self)
    }

    /// Returns the pushes at time `now_ns` as forces at points: the link as the index of its articulation and
    /// its index among the frames, the point in link axes \[m\], and the force in world axes \[N\]. A torque
    /// is a pair of forces, each half a metre from the point.
    pub(super) fn forces(
        &self,
        now_ns: u64,
    ) -> impl Iterator<Item = ((usize, FrameId), Point3<f64>, Vector3<f64>, Vector3<f64>)> + Clone {
        let active = self.0.iter().filter(move |push| (push.from_ns..push.to_ns).contains(&now_ns));
        active.flat_map(|push| {
            let force = (push.force != Vector3::zeros()).then(|| (push.force, Vector3::zeros()));
            let pair = couple(&push.torque);
            let all = force.into_iter().chain(pair.into_iter().flatten());
            all.map(|(force, arm)| (push.link, push.point, arm, force))
        })
    }

    /// Applies the pushes at time `now_ns` to the next step of the simulation.
    pub(super) fn apply<E: Engine>(&self, simulation: &mut Simulation<E>, now_ns: u64) {
        for push in self.0.iter().filter(|push| (push.from_ns..push.to_ns).contains(&now_ns)) {
            simulation.apply_wrench_to(push.link, push.point, push.force, push.torque);
        }
    }
}

/// Returns two forces that form a torque, each with its arm from a point \[m, world axes\].
fn couple(torque: &Vector3<f64>) -> Option<[(Vector3<f64>, Vector3<f64>); 2]> {
    if *torque == Vector3::zeros() {
        return None;
    }
    // Arm perpendicular to the torque, derived from the axis with the smallest component.
    let mut arm = Vector3::zeros();
    arm[torque.iamin()] = 1.0;
    arm = (arm - torque * (torque.dot(&arm) / torque.norm_squared())).normalize();
    let force = torque.cross(&arm);
    Some([(force, arm * 0.5), (-force, arm * -0.5)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pair_of_forces_equals_the_torque_without_net_force() {
        for torque in [Vector3::x() * 3.0, Vector3::new(0.1, -7.0, 2.0), Vector3::z() * -1e-3] {
            let pair = couple(&torque).unwrap();
            let sum: Vector3<f64> = pair.iter().map(|(force, _)| force).sum();
            let moment: Vector3<f64> = pair.iter().map(|(force, arm)| arm.cross(force)).sum();
            assert!(sum.norm() < 1e-12 && (moment - torque).norm() < 1e-12, "{torque}: {sum}, {moment}");
        }
        assert!(couple(&Vector3::zeros()).is_none());
    }
}
