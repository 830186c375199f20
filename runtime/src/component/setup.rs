//! What a component is configured with: its ports, its parameters, its place in the graph.

use std::rc::Rc;
use std::time::Duration;

use iceoryx2::node::Node;

use super::ConfigureError;
use crate::declare::RobotReference;
use crate::plan::{Activation, ClockKind, ComponentPlan, Plan, PortPlan};
use crate::region::CHECKPOINT_BYTES;
use crate::run_folder::RunFolder;
use crate::state::StateBuffer;
use crate::transport::{
    AnyParameter, Connect, Context, Input, InputPlace, Output, Parameter, ParameterReader, PortError, Probe,
    Shared, Trigger, open_trigger,
};

/// Hands a component what it declared.
///
/// Ports are opened here, once; a port that the graph leaves unwired can be opened too and stays silent.
pub struct Setup {
    plan: Plan,
    index: usize,
    node: Node<Shared>,
    context: Rc<Context>,
    parameters: ParameterReader,
    ports: Vec<Rc<dyn Connect>>,
    trigger: Option<Trigger>,
}

type Finished = (Vec<Rc<dyn Connect>>, ParameterReader, Option<Trigger>);

impl Setup {
    pub(crate) fn new(
        folder: &RunFolder,
        plan: &Plan,
        index: usize,
        context: Rc<Context>,
    ) -> Result<Self, String> {
        let domain = folder.domain().map_err(|error| error.to_string())?;
        let node = domain.node().map_err(|error| error.to_string())?;
        let component = &plan.components[index];
        let parameters = ParameterReader::open(&node, component).map_err(|error| error.to_string())?;
        let trigger = match (plan.clock, &component.activation) {
            (ClockKind::Realtime, Activation::Triggered { topic, .. }) => {
                Some(open_trigger(&node, &plan.topics[*topic], &context).map_err(|error| error.to_string())?)
            }
            _ => None,
        };
        Ok(Self { plan: plan.clone(), index, node, context, parameters, ports: Vec::new(), trigger })
    }

    pub(crate) fn finish(self) -> Finished {
        (self.ports, self.parameters, self.trigger)
    }

    pub(crate) fn plan(&self) -> &Plan {
        &self.plan
    }

    pub(crate) fn context(&self) -> &Rc<Context> {
        &self.context
    }

    fn component(&self) -> &ComponentPlan {
        &self.plan.components[self.index]
    }

    /// The component's name in the graph.
    pub fn name(&self) -> &str {
        &self.component().name
    }

    /// The robot the graph gives this component.
    ///
    /// # Errors
    /// The graph gives it none; say so in `declare` already, so that `check` finds it.
    pub fn robot(&self) -> Result<&RobotReference, ConfigureError> {
        self.component().robot.as_ref().ok_or_else(|| {
            ConfigureError::failed("it needs a robot: add `robot = \"NAME\"` to the component")
        })
    }

    /// Nominal time between two steps.
    pub fn period(&self) -> Duration {
        Duration::from_nanos(self.component().period_ns())
    }

    /// The component's own seed, derived from the run's seed and its name.
    pub fn seed(&self) -> u64 {
        self.component().seed
    }

    /// Opens a declared input.
    ///
    /// # Errors
    /// It is not declared, or was declared with another type, or its topic cannot be joined.
    pub fn input<T: StateBuffer>(&mut self, port: &str) -> Result<Input<T>, PortError> {
        let component = self.component();
        let (index, plan) = find(&component.inputs, port)?;
        same_type::<T>(plan)?;
        let Some(topic) = plan.topic else { return Ok(Input::unwired(self.context.clone())) };
        let is_cause = component.cause == Some(index);
        let edge = self.plan.edges().iter().position(|edge| *edge == (topic, self.index));
        let pin = self.plan.pin(self.index, index);
        let place = InputPlace { index: topic, topic: &self.plan.topics[topic], port, pin, is_cause, edge };
        let input = Input::<T>::open(&self.node, place, self.context.clone())?;
        self.ports.extend(input.connection());
        Ok(input)
    }

    /// Opens a declared output.
    ///
    /// # Errors
    /// It is not declared, or was declared with another type, or its topic cannot be joined.
    pub fn output<T: StateBuffer>(&mut self, port: &'static str) -> Result<Output<T>, PortError> {
        let component = self.component();
        let (index, plan) = find(&component.outputs, port)?;
        same_type::<T>(plan)?;
        let Some(topic) = plan.topic else { return Ok(Output::unwired(port, self.context.clone())) };
        let probes = self
            .plan
            .latencies
            .iter()
            .enumerate()
            .filter(|(_, latency)| latency.component == self.index && latency.output == index)
            .map(|(i, latency)| Probe { index: i, max_ns: latency.max_ns, on_miss: latency.on_miss })
            .collect();
        let topic = (topic, &self.plan.topics[topic]);
        let output = Output::<T>::open(&self.node, topic, port, probes, self.context.clone())?
            .ending_steps(self.plan.stays_on_core(topic.0));
        self.ports.extend(output.connection());
        Ok(output)
    }

    /// A declared parameter.
    ///
    /// # Errors
    /// It is not declared, or was declared with another type.
    pub fn parameter<T: AnyParameter>(&self, name: &str) -> Result<Parameter<T>, ConfigureError> {
        let value = self
            .parameters
            .parameter(name)
            .ok_or_else(|| ConfigureError::failed(format!("parameter `{name}` is not declared")))?;
        if value.get().kind() != T::KIND {
            let found = value.get().kind();
            return Err(ConfigureError::failed(format!(
                "parameter `{name}` was declared as {found:?} and opened as {:?}",
                T::KIND
            )));
        }
        Ok(Parameter::new(value.clone()))
    }

    /// A place for `N` numbers that outlives a crash of this component.
    ///
    /// # Errors
    /// More than it holds.
    pub fn checkpoint(&self, numbers: usize) -> Result<Checkpoint, ConfigureError> {
        if numbers * 8 > CHECKPOINT_BYTES {
            return Err(ConfigureError::failed(format!(
                "a checkpoint of {numbers} numbers, but it holds {}",
                CHECKPOINT_BYTES / 8
            )));
        }
        Ok(Checkpoint { context: self.context.clone(), words: vec![0; numbers] })
    }
}

fn find<'a>(ports: &'a [PortPlan], name: &str) -> Result<(usize, &'a PortPlan), PortError> {
    ports
        .iter()
        .enumerate()
        .find(|(_, port)| port.port == name)
        .ok_or_else(|| PortError::NotDeclared { port: name.to_string() })
}

fn same_type<T: StateBuffer>(plan: &PortPlan) -> Result<(), PortError> {
    let layout = T::layout();
    if layout == plan.layout {
        return Ok(());
    }
    Err(PortError::TypeChanged {
        port: plan.port.clone(),
        difference: plan.layout.difference("declared", &layout, "opened"),
    })
}

/// Numbers that outlive a crash of their component: saved at a step, found again after a restart.
#[derive(Debug)]
pub struct Checkpoint {
    context: Rc<Context>,
    words: Vec<u64>,
}

impl Checkpoint {
    /// Saves the numbers: as many as the checkpoint was made for. A writer killed half-way leaves the older ones.
    pub fn save(&mut self, numbers: impl IntoIterator<Item = f64>) {
        for (word, number) in self.words.iter_mut().zip(numbers) {
            *word = number.to_bits();
        }
        self.context.block().checkpoint.save(self.words.iter().copied());
    }

    /// The numbers saved before the component was restarted, if it was and they are all finite.
    pub fn resume(&mut self) -> Option<Vec<f64>> {
        if self.context.incarnation() == 0 || !self.context.block().checkpoint.load(&mut self.words) {
            return None;
        }
        let numbers: Vec<f64> = self.words.iter().map(|word| f64::from_bits(*word)).collect();
        numbers.iter().all(|number| number.is_finite()).then_some(numbers)
    }
}
