//! The topics of a plan without a launcher, for measurements and tests of the transport.

use std::path::Path;
use std::rc::Rc;

use iceoryx2::node::Node;

use crate::context::Context;
use crate::plan::{Activation, Plan, PortPlan};
use crate::region::Region;
use crate::run_folder::{RunFolder, RunFolderError};
use crate::state::StateBuffer;
use crate::transport::{
    DomainError, Input, InputPlace, Output, OutputPlace, Participant, PortError, Shared, TopicService,
    Trigger, quieten,
};

/// The topics of a plan in shared memory, without a launcher and components. A thread or process joins the
/// topics as one of the components with an [`Endpoint`]. Dropping this value removes the topics.
#[derive(Debug)]
pub struct TopicSet {
    folder: RunFolder,
    _region: Region,
    _node: Node<Shared>,
    _topics: Vec<TopicService>,
}

/// Error of creating or joining the topics of a plan.
#[derive(Debug, thiserror::Error)]
pub enum TopicSetError {
    /// The run's folder could not be created or read.
    #[error(transparent)]
    Folder(#[from] RunFolderError),
    /// The run's domain could not be joined.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// A topic could not be created or joined.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The plan has no component with this name.
    #[error("the plan has no component `{0}`")]
    NoComponent(String),
    /// The component is not triggered by a topic.
    #[error("component `{0}` has no trigger")]
    NoTrigger(String),
}

impl TopicSet {
    /// Creates the folder, the control block and all topics of a plan.
    ///
    /// # Errors
    /// `/dev/shm` is full or inaccessible.
    pub fn create(plan: &Plan) -> Result<Self, TopicSetError> {
        quieten();
        let (folder, region) = RunFolder::create(plan)?;
        let made = || -> Result<_, TopicSetError> {
            let node = folder.domain()?.node()?;
            let topics = plan.topics.iter().map(|topic| TopicService::create(&node, topic));
            let topics = topics.collect::<Result<_, _>>()?;
            Ok((node, topics))
        };
        match made() {
            Ok((node, topics)) => Ok(Self { folder, _region: region, _node: node, _topics: topics }),
            Err(error) => {
                folder.remove();
                Err(error)
            }
        }
    }

    /// Returns the folder of the topics, for [`Endpoint::join`].
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

impl Drop for TopicSet {
    fn drop(&mut self) {
        self.folder.remove();
    }
}

/// The ports of one component of a plan. Each component may be in a separate process.
#[derive(Debug)]
pub struct Endpoint {
    plan: Plan,
    index: usize,
    participant: Participant,
}

impl Endpoint {
    /// Joins the topics in the folder `path` as one of the components.
    ///
    /// # Errors
    /// The topics do not exist, or the plan has no such component.
    pub fn join(path: &Path, component: &str) -> Result<Self, TopicSetError> {
        quieten();
        let folder = RunFolder::open(path);
        let plan = folder.plan()?;
        let region = Rc::new(folder.region()?);
        let index = plan
            .components
            .iter()
            .position(|candidate| candidate.name == component)
            .ok_or_else(|| TopicSetError::NoComponent(component.to_string()))?;
        let context = Rc::new(Context::new(&plan, index, region));
        Ok(Self { participant: Participant::new(Rc::new(folder.domain()?.node()?), context), index, plan })
    }

    /// Opens an input of the component.
    ///
    /// # Errors
    /// The component has no such input, or the topic cannot be joined.
    pub fn input<T: StateBuffer>(&self, port: &str) -> Result<Input<T>, TopicSetError> {
        let component = &self.plan.components[self.index];
        let Some(topic) = wired(&component.inputs, port)? else {
            return Ok(Input::unwired(self.participant.context().clone()));
        };
        let input = component.inputs.iter().position(|input| input.port == port).unwrap_or_default();
        let place = InputPlace {
            index: topic,
            topic: &self.plan.topics[topic],
            port,
            pin: self.plan.pin(self.index, input),
            is_cause: false,
            edge: None,
        };
        Ok(Input::open(&self.participant, &place)?)
    }

    /// Opens an output of the component.
    ///
    /// # Errors
    /// The component has no such output, or the topic cannot be joined.
    pub fn output<T: StateBuffer>(&self, port: &'static str) -> Result<Output<T>, TopicSetError> {
        let component = &self.plan.components[self.index];
        let Some(topic) = wired(&component.outputs, port)? else {
            return Ok(Output::unwired(port, self.participant.context().clone()));
        };
        let plan = &self.plan.topics[topic];
        let place = OutputPlace {
            index: topic,
            topic: plan,
            probes: Vec::new(),
            wakes_late: false,
            is_emergency_stop: false,
        };
        Ok(Output::open(&self.participant, place, port)?)
    }

    /// Opens the trigger of the component.
    ///
    /// # Errors
    /// The component has no trigger, or its topic cannot be joined.
    pub fn trigger(&self) -> Result<Trigger, TopicSetError> {
        let component = &self.plan.components[self.index];
        match component.activation {
            Activation::Triggered { topic, .. } => Ok(self.participant.trigger(&self.plan.topics[topic])?),
            Activation::Periodic { .. } | Activation::Descriptor { .. } => {
                Err(TopicSetError::NoTrigger(component.name.clone()))
            }
        }
    }
}

fn wired(ports: &[PortPlan], name: &str) -> Result<Option<usize>, PortError> {
    ports
        .iter()
        .find(|port| port.port == name)
        .map(|port| port.topic)
        .ok_or_else(|| PortError::NotDeclared { port: name.to_string() })
}
