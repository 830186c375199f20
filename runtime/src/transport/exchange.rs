//! A plan's topics without its launcher: for measuring and testing the transport itself.

use std::path::Path;
use std::rc::Rc;

use iceoryx2::node::Node;

use super::{Domain, DomainError, Input, Output, PortError, Shared, TopicService, Trigger, open_trigger};
use crate::plan::{Activation, Plan, PortPlan};
use crate::region::Region;
use crate::run_folder::{RunFolder, RunFolderError};
use crate::state::StateBuffer;
use crate::worker::Context;

/// The services of a plan's topics, made and held open as the launcher does it. Nothing runs; whoever takes a
/// [`Seat`] steps by itself. Dropping it removes everything.
#[derive(Debug)]
pub struct Exchange {
    folder: RunFolder,
    _region: Region,
    _node: Node<Shared>,
    _topics: Vec<TopicService>,
}

/// The topics of a plan could not be made or joined.
#[derive(Debug, thiserror::Error)]
pub enum ExchangeError {
    /// The run's folder could not be made or read.
    #[error(transparent)]
    Folder(#[from] RunFolderError),
    /// The run's domain could not be joined.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// A topic could not be made or joined.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The plan has no such component.
    #[error("the plan has no component `{0}`")]
    NoComponent(String),
    /// The component is not triggered by a topic.
    #[error("component `{0}` has no trigger")]
    NoTrigger(String),
}

impl Exchange {
    /// Makes the folder, the region and all topics of a plan.
    ///
    /// # Errors
    /// `/dev/shm` is full or forbidden.
    pub fn create(plan: &Plan) -> Result<Self, ExchangeError> {
        super::quieten();
        let (folder, region) = RunFolder::create(plan)?;
        let made = || -> Result<_, ExchangeError> {
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

    /// Where it is: what [`Seat::take`] needs.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

impl Drop for Exchange {
    fn drop(&mut self) {
        self.folder.remove();
    }
}

/// The place of one component at an exchange, in this process or another.
#[derive(Debug)]
pub struct Seat {
    plan: Plan,
    index: usize,
    node: Node<Shared>,
    context: Rc<Context>,
}

impl Seat {
    /// Takes the place of a component.
    ///
    /// # Errors
    /// There is no such exchange or component.
    pub fn take(path: &Path, component: &str) -> Result<Self, ExchangeError> {
        super::quieten();
        let folder = RunFolder::open(path);
        let plan = folder.plan()?;
        let region = Rc::new(folder.region()?);
        let domain: Domain = folder.domain()?;
        let index = plan
            .components
            .iter()
            .position(|candidate| candidate.name == component)
            .ok_or_else(|| ExchangeError::NoComponent(component.to_string()))?;
        let context = Rc::new(Context::new(&plan, index, region));
        Ok(Self { node: domain.node()?, index, context, plan })
    }

    /// Opens an input of the component.
    ///
    /// # Errors
    /// It has no such input, or the topic cannot be joined.
    pub fn input<T: StateBuffer>(&self, port: &str) -> Result<Input<T>, ExchangeError> {
        let component = &self.plan.components[self.index];
        let Some(topic) = wired(&component.inputs, port)? else {
            return Ok(Input::unwired(self.context.clone()));
        };
        let topic = (topic, &self.plan.topics[topic]);
        Ok(Input::open(&self.node, topic, port, false, None, self.context.clone())?)
    }

    /// Opens an output of the component.
    ///
    /// # Errors
    /// It has no such output, or the topic cannot be joined.
    pub fn output<T: StateBuffer>(&self, port: &'static str) -> Result<Output<T>, ExchangeError> {
        let component = &self.plan.components[self.index];
        let Some(topic) = wired(&component.outputs, port)? else {
            return Ok(Output::unwired(port, self.context.clone()));
        };
        let topic = (topic, &self.plan.topics[topic]);
        Ok(Output::open(&self.node, topic, port, Vec::new(), self.context.clone())?)
    }

    /// Opens the trigger of the component.
    ///
    /// # Errors
    /// It has none, or its topic cannot be joined.
    pub fn trigger(&self) -> Result<Trigger, ExchangeError> {
        let component = &self.plan.components[self.index];
        match component.activation {
            Activation::Triggered { topic, .. } => {
                Ok(open_trigger(&self.node, &self.plan.topics[topic], &self.context)?)
            }
            Activation::Periodic { .. } => Err(ExchangeError::NoTrigger(component.name.clone())),
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
