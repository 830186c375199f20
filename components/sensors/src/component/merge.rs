//! `joint.merge`: the joint state of a robot from several publishers.

use std::collections::BTreeMap;

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium_robots::RobotSource;
use schemars::JsonSchema;
use serde::Deserialize;

/// Configuration of `joint.merge`.
///
/// ```toml
/// [parts.arm]
/// joints = ["panda_joint1", "panda_joint2", "panda_joint3", "panda_joint4", "panda_joint5", "panda_joint6", "panda_joint7"]
///
/// [parts.gripper]
/// joints      = ["panda_finger_joint1"]
/// stale_after = "50 ms"
/// ```
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointMergeConfig {
    /// Publishers by the name of the input. Together, the publishers must provide every joint of the robot
    /// exactly once.
    pub parts: BTreeMap<String, PartConfig>,
}

/// A group of joints measured by one publisher.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PartConfig {
    /// Names of the joints, in the order of the publisher's joint states.
    pub joints: Vec<String>,
    /// Maximum age of a joint state. While the state of any part is older, no merged state is published.
    /// Default 20 ms.
    #[serde(default = "stale_after")]
    pub stale_after: TimeSpan,
}

fn stale_after() -> TimeSpan {
    TimeSpan { ns: 20_000_000 }
}

/// A component that merges joint states from several publishers (buses, or a gripper and an arm) in the order
/// of the robot's joints.
///
/// The component publishes once per step while the states of all parts are fresh. When the states of one part
/// become stale, the component stops publishing, and consumers of the merged state enter their safe state as
/// if the sensor were missing. The result counts these steps per part.
///
/// Publishers may have different rates. Each step uses the newest state of every part, so a state of a slow
/// publisher appears in several merged states. The source time of a merged state is the oldest source time
/// among its parts.
pub struct JointMerge {
    parts: Vec<Part>,
    merged: Output<JointState>,
    clock: RunClock,
    joints: usize,
    published: u64,
    withheld: u64,
}

/// One publisher.
struct Part {
    name: String,
    input: Input<JointState>,
    /// Robot index of each of its joints.
    joints: Vec<usize>,
    stale_after_ns: u64,
    /// Number of steps in which the part was stale or missing.
    stale: u64,
    /// Maximum age of its state at the publication of a merged state, ns.
    oldest_ns: u64,
}

impl Component for JointMerge {
    const KIND: &'static str = "joint.merge";
    const SUMMARY: &'static str = "merges joint states from several publishers";
    const RESETS: bool = true;
    type Config = JointMergeConfig;

    fn declare(config: &JointMergeConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let robot = super::robot::named(declare, "the joints of a robot")?;
        places(config, &names(robot)?)?;
        for name in config.parts.keys() {
            declare.input::<JointState>(name, "joint state of a part of the joints");
        }
        declare.output::<JointState>("joint_state", "joint state of the whole robot");
        Ok(())
    }

    fn configure(config: JointMergeConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let names = names(setup.robot()?)?;
        let mut parts = Vec::new();
        for (joints, (name, part)) in places(&config, &names)?.into_iter().zip(&config.parts) {
            let (input, stale_after_ns) = (setup.input(name)?, part.stale_after.ns);
            parts.push(Part { name: name.clone(), input, joints, stale_after_ns, stale: 0, oldest_ns: 0 });
        }
        let merged = setup.output("joint_state")?;
        let clock = setup.clock();
        Ok(Self { parts, merged, clock, joints: names.len(), published: 0, withheld: 0 })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        let (mut fresh, mut source_ns) = (true, u64::MAX);
        let now_ns = self.clock.stamp_ns(self.clock.now_ns());
        for part in &mut self.parts {
            let measured_ns = part.input.latest().map(|state| state.stamp().source_time);
            let age_ns = measured_ns.map(|measured_ns| now_ns.saturating_sub(measured_ns));
            source_ns = source_ns.min(measured_ns.unwrap_or(0));
            let is_stale = age_ns.is_none_or(|age_ns| age_ns > part.stale_after_ns);
            part.stale += u64::from(is_stale);
            fresh &= !is_stale;
        }
        if !fresh {
            self.withheld += 1;
            return Ok(());
        }
        let mut merged = self.merged.loan()?;
        merged.set_count(self.joints);
        for part in &mut self.parts {
            // the state that was fresh in the check above
            let Some(state) = part.input.current() else { continue };
            part.oldest_ns = part.oldest_ns.max(now_ns.saturating_sub(state.stamp().source_time));
            if state.count() != part.joints.len() {
                return Err(StepError::failed(
                    "the joint state of a part has a different number of joints than its list `joints`",
                ));
            }
            for (from, to) in part.joints.iter().enumerate() {
                merged.position_mut()[*to] = state.position()[from];
                merged.velocity_mut()[*to] = state.velocity()[from];
                merged.effort_mut()[*to] = state.effort()[from];
            }
        }
        merged.publish_from(source_ns)?;
        self.published += 1;
        Ok(())
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        (self.published, self.withheld) = (0, 0);
        self.parts.iter_mut().for_each(|part| (part.stale, part.oldest_ns) = (0, 0));
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let stale: BTreeMap<&str, u64> =
            self.parts.iter().map(|part| (part.name.as_str(), part.stale)).collect();
        let oldest_ms: BTreeMap<&str, f64> =
            self.parts.iter().map(|part| (part.name.as_str(), part.oldest_ns as f64 * 1e-6)).collect();
        Some(serde_json::json!({
            "published": self.published,
            "withheld": self.withheld,
            "stale": stale,
            "oldest_ms": oldest_ms,
        }))
    }
}

/// Returns the names of the robot's joints, in order.
fn names(robot: &RobotReference) -> Result<Vec<String>, ConfigError> {
    let source = RobotSource {
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        settings: robot.settings.as_ref(),
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        pose: None,
    };
    let loaded = source.load().map_err(|error| ConfigError::new(error.to_string()))?;
    let names = loaded.model.joint_names().to_vec();
    if names.is_empty() || names.len() > MAX_JOINTS {
        let message =
            format!("robot `{}` has {} joints, expected 1 to {MAX_JOINTS}", robot.name, names.len());
        return Err(ConfigError::key("robot", message));
    }
    Ok(names)
}

/// Maps each joint of each part to its index in the robot. Every joint must be in exactly one part.
fn places(config: &JointMergeConfig, names: &[String]) -> Result<Vec<Vec<usize>>, ConfigError> {
    let mut owners: Vec<Option<&str>> = vec![None; names.len()];
    let mut places = Vec::new();
    for (part, PartConfig { joints, .. }) in &config.parts {
        let mut own = Vec::new();
        for (index, joint) in joints.iter().enumerate() {
            let key = || format!("parts.{part}.joints[{index}]");
            let Some(place) = names.iter().position(|name| name == joint) else {
                let known = names.iter().map(String::as_str);
                let advice = motorium::nearest::suggest(joint, known, "its joints are");
                return Err(
                    ConfigError::key(key(), format!("the robot has no joint `{joint}`")).advise(advice)
                );
            };
            if let Some(other) = owners[place].replace(part) {
                let message = format!("joint `{joint}` is already measured by `{other}`");
                return Err(ConfigError::key(key(), message));
            }
            own.push(place);
        }
        places.push(own);
    }
    if let Some(missing) = owners.iter().position(Option::is_none) {
        let message = format!("no part measures joint `{}`", names[missing]);
        return Err(ConfigError::key("parts", message).advise("each joint of the robot must be in one part"));
    }
    Ok(places)
}

#[cfg(test)]
mod tests {
    use motorium::testing::{Graph, Instance, Probe, Source};

    use super::*;

    const ARM: [&str; 2] = ["joint3", "joint1"];

    fn state(positions: &[f64]) -> JointState {
        let mut state = JointState::default();
        state.set_count(positions.len());
        state.position_mut().copy_from_slice(positions);
        state
    }

    fn merge(arm: &[&str], gripper: &[&str]) -> Instance {
        let joints = |names: &[&str]| toml::Value::from(names.to_vec());
        let part = |names: &[&str]| {
            let entries = [("joints", joints(names)), ("stale_after", "10 ms".into())];
            toml::Value::Table(entries.map(|(key, value)| (key.to_string(), value)).into_iter().collect())
        };
        let parts = [("arm", part(arm)), ("gripper", part(gripper))];
        let parts: toml::Table = parts.map(|(key, value)| (key.to_string(), value)).into_iter().collect();
        Instance::of::<JointMerge>("merge")
            .robot("planar")
            .rate("500 Hz")
            .subscribe("arm", "arm/state")
            .subscribe("gripper", "gripper/state")
            .publish("joint_state", "state")
            .config("parts", parts)
    }

    #[test]
    fn parts_are_merged_in_order_until_one_is_stale() {
        let arm = Source::new("left-bus", "arm/state", |_| Some(state(&[3.0, 1.0])));
        let gripper =
            Source::new("right-bus", "gripper/state", |tick| (tick.index < 200).then(|| state(&[2.0])));
        let probe = Probe::<JointState>::for_topic("state").triggered();
        let graph = Graph::new("merged").robot("planar", "planar-3r");
        let graph = graph.with(arm).with(gripper).with(merge(&ARM, &["joint2"])).with(&probe);
        let report = graph.run("1 s").unwrap();
        let samples = probe.samples();
        assert!(
            (95..=115).contains(&samples.len()),
            "{} values until the gripper fell silent",
            samples.len()
        );
        assert!(samples.iter().all(|sample| sample.value.position() == [1.0, 2.0, 3.0]));
        let result = &report.results["merge"];
        assert!(result["stale"]["gripper"].as_u64().unwrap() > 380, "{result}");
        assert!(result["stale"]["arm"].as_u64().unwrap() < 5, "{result}");
    }

    #[test]
    fn every_joint_is_in_exactly_one_part() {
        for (arm, gripper, expected) in [
            (&["joint1", "joint2"][..], &["joint2", "joint3"][..], "`joint2` is already measured by `arm`"),
            (&["joint1"], &["joint2"], "no part measures joint `joint3`"),
            (&["joint1", "jiont2"], &["joint3"], "no joint `jiont2`"),
        ] {
            let source = Source::new("bus", "arm/state", |_| Some(state(&[0.0])));
            let other = Source::new("other", "gripper/state", |_| Some(state(&[0.0])));
            let graph = Graph::new("refused").robot("planar", "planar-3r");
            let graph = graph.with(source).with(other).with(merge(arm, gripper));
            let text = graph.check().unwrap_err().render(false);
            assert!(text.contains(expected), "{text}");
        }
    }
}
