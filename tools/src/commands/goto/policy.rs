//! The policy of a running graph that accepts goals.

use anyhow::{Context as _, bail};
use motorium::declare::RobotReference;
use motorium::nearest::suggest;
use motorium::plan::{ComponentPlan, Plan, PortPlan, TopicPlan};
use motorium::state::{JointState, MotionGoal, StateBuffer};

/// A component with a goal input, and the topics that connect to it.
#[derive(Debug)]
pub(super) struct Policy<'a> {
    pub(super) component: &'a ComponentPlan,
    pub(super) robot: &'a RobotReference,
    pub(super) goals: &'a TopicPlan,
    pub(super) status: &'a TopicPlan,
    pub(super) joints: &'a TopicPlan,
}

impl<'a> Policy<'a> {
    /// Finds the component of this name, or the only one that accepts goals.
    ///
    /// # Errors
    /// If there is no such component, there are several, or its ports are not wired.
    pub(super) fn find(plan: &'a Plan, name: Option<&str>) -> anyhow::Result<Self> {
        let all: Vec<&ComponentPlan> =
            plan.components.iter().filter(|component| goal_input(component).is_some()).collect();
        let names = || all.iter().map(|component| component.name.as_str());
        let graph = &plan.name;
        let component = match (name, all.as_slice()) {
            (_, []) => bail!(
                "graph `{graph}` has no component that accepts goals, such as `policy.trajectory`\nhelp: \
                 graphs/panda-goto.toml has one"
            ),
            (Some(name), all) => {
                all.iter().copied().find(|component| component.name == name).with_context(|| {
                    let advice = suggest(name, names(), "there are");
                    format!("graph `{graph}` has no component `{name}` that accepts goals; {advice}")
                })?
            }
            (None, [only]) => *only,
            (None, _) => bail!(
                "several components accept goals: {}\nhelp: name one with --component",
                names().collect::<Vec<_>>().join(", ")
            ),
        };
        let topic = |ports: &'a [PortPlan], port: &str, table: &str| {
            let index = ports.iter().find(|known| known.port == port).and_then(|known| known.topic);
            index.map(|index| &plan.topics[index]).with_context(|| {
                let name = &component.name;
                format!(
                    "port `{port}` of component `{name}` is not wired\nhelp: add `{port} = \"TOPIC\"` to its \
                     `{table}`, see graphs/panda-goto.toml"
                )
            })
        };
        let robot = component.robot.as_ref();
        Ok(Self {
            component,
            robot: robot.with_context(|| format!("component `{}` has no robot", component.name))?,
            goals: topic(&component.inputs, "goal", "subscribe")?,
            status: topic(&component.outputs, "goal_status", "publish")?,
            joints: topic(&component.inputs, "joint_state", "subscribe")?,
        })
    }

    /// Returns the frame to which goal poses refer, if its configuration names one.
    pub(super) fn frame(&self) -> Option<&'a str> {
        self.component.config.get("frame").and_then(serde_json::Value::as_str)
    }
}

/// Returns the goal input of a component that also reads joint states.
fn goal_input(component: &ComponentPlan) -> Option<&PortPlan> {
    let has = |port: &&PortPlan, name: &str, type_name: &str| {
        port.port == name && port.layout.type_name == type_name
    };
    let goal = component.inputs.iter().find(|port| has(port, "goal", MotionGoal::NAME))?;
    component.inputs.iter().any(|port| has(&port, "joint_state", JointState::NAME)).then_some(goal)
}
