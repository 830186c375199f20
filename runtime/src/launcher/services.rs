//! The services of a run, which are the shared memory that outlives its components.

use std::rc::Rc;

use iceoryx2::node::Node;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable as _;

use super::LaunchError;
use crate::domain::Shared;
use crate::parameter::ParameterService;
use crate::plan::Plan;
use crate::run_folder::RunFolder;
use crate::transport::{TopicMemory, TopicService};

/// Shared memory that must outlive the components.
#[derive(Default)]
pub(super) struct Services {
    pub(super) node: Option<Node<Shared>>,
    topics: Vec<TopicService>,
    parameters: Vec<ParameterService>,
    /// Topics that components wait for.
    pub(super) waited_for: Vec<Rc<TopicMemory>>,
}

impl Services {
    /// Clears all publications for a new episode.
    pub(super) fn clear(&self) {
        self.topics.iter().for_each(|topic| topic.memory().clear());
    }

    /// Creates the services of a plan.
    pub(super) fn create(folder: &RunFolder, plan: &Plan) -> Result<Self, LaunchError> {
        let node = folder.domain()?.node()?;
        let mut services = Self::default();
        for topic in &plan.topics {
            let service = TopicService::create(&node, topic)?;
            services.waited_for.extend(service.waited_for());
            services.topics.push(service);
        }
        for component in &plan.components {
            services.parameters.extend(ParameterService::create(&node, component)?);
        }
        services.node = Some(node);
        Ok(services)
    }
}

impl Drop for Services {
    /// Abandons the services without accessing their data in shared memory, which a component may have
    /// damaged; files and objects are removed by name.
    fn drop(&mut self) {
        self.topics.drain(..).for_each(TopicService::abandon);
        self.parameters.drain(..).for_each(ParameterService::abandon);
        if let Some(node) = self.node.take() {
            node.abandon();
        }
    }
}
