//! Parameters: slow, typed, range-checked values on iceoryx2's blackboard, applied between two steps.

use std::cell::Cell;
use std::rc::Rc;

use iceoryx2::node::Node;
use iceoryx2::port::reader::{EntryHandle, Reader};
use iceoryx2::service::port_factory::blackboard;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable as _;

use super::topic::{refused, service_name};
use super::{Domain, PortError, Shared};
use crate::declare::{ParameterKind, ParameterValue};
use crate::plan::{ComponentPlan, ParameterPlan, Plan};
use crate::state::Field;

crate::state_buffer! {
    /// A parameter's value on the blackboard.
    struct RawValue as "motorium.ParameterValue" {
        /// Type: 0 float, 1 integer, 2 boolean.
        kind: u64,
        /// The value's bits.
        bits: u64,
    }
}

impl RawValue {
    fn of(value: ParameterValue) -> Self {
        match value {
            ParameterValue::Float(x) => Self { kind: 0, bits: x.to_bits() },
            ParameterValue::Integer(i) => Self { kind: 1, bits: i as u64 },
            ParameterValue::Boolean(b) => Self { kind: 2, bits: u64::from(b) },
        }
    }

    fn value(self) -> ParameterValue {
        match self.kind {
            0 => ParameterValue::Float(f64::from_bits(self.bits)),
            1 => ParameterValue::Integer(self.bits as i64),
            _ => ParameterValue::Boolean(self.bits != 0),
        }
    }
}

/// A parameter that a component reads; changes are applied between two steps, never within one.
#[derive(Debug, Clone)]
pub struct Parameter<T> {
    value: Rc<Cell<ParameterValue>>,
    marker: core::marker::PhantomData<T>,
}

/// The types a parameter may have.
pub trait AnyParameter: Copy {
    /// The declared kind that belongs to the type.
    const KIND: ParameterKind;
    /// Reads a value that is known to be of this kind.
    fn read(value: ParameterValue) -> Self;
}

macro_rules! parameter_type {
    ($type:ty, $kind:ident, $zero:expr) => {
        impl AnyParameter for $type {
            const KIND: ParameterKind = ParameterKind::$kind;

            fn read(value: ParameterValue) -> Self {
                if let ParameterValue::$kind(value) = value { value } else { $zero }
            }
        }
    };
}
parameter_type!(f64, Float, 0.0);
parameter_type!(i64, Integer, 0);
parameter_type!(bool, Boolean, false);

impl<T: AnyParameter> Parameter<T> {
    pub(crate) fn new(value: Rc<Cell<ParameterValue>>) -> Self {
        Self { value, marker: core::marker::PhantomData }
    }

    /// The value for this step.
    pub fn get(&self) -> T {
        T::read(self.value.get())
    }
}

/// A blackboard of one component's parameters, held by the launcher.
#[derive(Debug)]
pub(crate) struct ParameterService {
    service: blackboard::PortFactory<Shared, u64>,
}

impl ParameterService {
    /// Makes the blackboard of a component, if it has parameters.
    pub(crate) fn create(node: &Node<Shared>, component: &ComponentPlan) -> Result<Option<Self>, PortError> {
        if component.parameters.is_empty() {
            return Ok(None);
        }
        let name = &component.name;
        let mut builder = node
            .service_builder(&service_name("parameters", name)?)
            .blackboard_creator::<u64>()
            .max_readers(8)
            .max_nodes(12);
        for (key, parameter) in component.parameters.iter().enumerate() {
            builder = builder.add(key as u64, RawValue::of(parameter.initial));
        }
        let service = builder.create().map_err(|error| refused(name, "creating its parameters")(&error))?;
        Ok(Some(Self { service }))
    }
}

impl ParameterService {
    /// Lets go of the blackboard without a look at what iceoryx2 keeps in shared memory: its words may have been damaged.
    pub(crate) fn abandon(self) {
        self.service.abandon();
    }
}

/// The component's side: looks for changes at every tick boundary.
pub(crate) struct ParameterReader {
    entries: Vec<Entry>,
    _reader: Option<Reader<Shared, u64>>,
}

struct Entry {
    plan: ParameterPlan,
    handle: EntryHandle<Shared, u64, RawValue>,
    raw: RawValue,
    value: Rc<Cell<ParameterValue>>,
}

impl ParameterReader {
    pub(crate) fn open(node: &Node<Shared>, component: &ComponentPlan) -> Result<Self, PortError> {
        if component.parameters.is_empty() {
            return Ok(Self { entries: Vec::new(), _reader: None });
        }
        let name = &component.name;
        let reader = node
            .service_builder(&service_name("parameters", name)?)
            .blackboard_opener::<u64>()
            .open()
            .map_err(|error| refused(name, "opening its parameters")(&error))?
            .reader_builder()
            .create()
            .map_err(|error| refused(name, "reading its parameters")(&error))?;
        let mut entries = Vec::new();
        for (key, plan) in component.parameters.iter().enumerate() {
            let handle = reader
                .entry::<RawValue>(&(key as u64))
                .map_err(|error| refused(name, "reading a parameter")(&error))?;
            let value = Rc::new(Cell::new(plan.initial));
            entries.push(Entry { plan: plan.clone(), handle, raw: RawValue::ZERO, value });
        }
        let mut this = Self { entries, _reader: Some(reader) };
        this.refresh();
        Ok(this)
    }

    /// Applies what has changed. A value of the wrong type or out of range is not applied, whoever wrote it.
    pub(crate) fn refresh(&mut self) {
        for entry in &mut self.entries {
            let raw = *entry.handle.get();
            if raw == entry.raw {
                continue;
            }
            entry.raw = raw;
            let declaration = &entry.plan.declaration;
            let value = raw.value();
            let number = match value {
                ParameterValue::Float(x) => x,
                ParameterValue::Integer(i) => i as f64,
                ParameterValue::Boolean(_) => 0.0,
            };
            let admitted = value.kind() == declaration.default.kind()
                && number.is_finite()
                && declaration.min.is_none_or(|min| number >= min)
                && declaration.max.is_none_or(|max| number <= max);
            if admitted {
                entry.value.set(value);
            }
        }
    }

    pub(crate) fn parameter(&self, name: &str) -> Option<&Rc<Cell<ParameterValue>>> {
        self.entries.iter().find(|entry| entry.plan.declaration.name == name).map(|entry| &entry.value)
    }
}

/// A parameter could not be read or set from outside.
#[derive(Debug, thiserror::Error)]
pub enum ParameterError {
    /// There is no such component or parameter.
    #[error("{0}")]
    Unknown(String),
    /// The value has the wrong type or is out of range.
    #[error("{0}")]
    Refused(String),
    /// The run cannot be reached.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The run's domain cannot be joined.
    #[error(transparent)]
    Domain(#[from] super::DomainError),
}

/// The parameters of a running graph, seen from outside.
#[derive(Debug)]
pub struct ParameterTable {
    node: Node<Shared>,
    plan: Plan,
}

impl ParameterTable {
    /// Joins a run.
    ///
    /// # Errors
    /// The run's domain cannot be joined.
    pub fn open(domain: &Domain, plan: Plan) -> Result<Self, ParameterError> {
        Ok(Self { node: domain.node()?, plan })
    }

    /// All parameters of the graph: component, declaration, current value.
    ///
    /// # Errors
    /// The run cannot be reached.
    pub fn list(&self) -> Result<Vec<(String, ParameterPlan, ParameterValue)>, ParameterError> {
        let mut all = Vec::new();
        for component in &self.plan.components {
            let reader = ParameterReader::open(&self.node, component)?;
            for entry in &reader.entries {
                all.push((component.name.clone(), entry.plan.clone(), entry.value.get()));
            }
        }
        Ok(all)
    }

    /// Sets a parameter, named `component.parameter`. It takes effect at the component's next step.
    ///
    /// # Errors
    /// No such parameter; a value of another type or out of range; somebody else is writing at the moment.
    pub fn set(&self, path: &str, value: ParameterValue) -> Result<ParameterValue, ParameterError> {
        let unknown = |message: String| ParameterError::Unknown(message);
        let (name, parameter) = path
            .split_once('.')
            .ok_or_else(|| unknown(format!("`{path}` is no parameter; write it as `component.parameter`")))?;
        let component = self
            .plan
            .components
            .iter()
            .find(|component| component.name == name)
            .ok_or_else(|| unknown(format!("the graph has no component `{name}`")))?;
        let (key, plan) = component
            .parameters
            .iter()
            .enumerate()
            .find(|(_, plan)| plan.declaration.name == parameter)
            .ok_or_else(|| {
                let names: Vec<_> =
                    component.parameters.iter().map(|p| p.declaration.name.as_str()).collect();
                unknown(format!("`{name}` has no parameter `{parameter}`; it has: {}", names.join(", ")))
            })?;
        let value = plan.declaration.admit(value).map_err(ParameterError::Refused)?;
        let writer = self
            .node
            .service_builder(&service_name("parameters", name)?)
            .blackboard_opener::<u64>()
            .open()
            .map_err(|error| refused(name, "opening its parameters")(&error))?
            .writer_builder()
            .create()
            .map_err(|error| refused(name, "writing its parameters")(&error))?;
        let entry = writer
            .entry::<RawValue>(&(key as u64))
            .map_err(|error| refused(name, "writing a parameter")(&error))?;
        entry.update_with_copy(RawValue::of(value));
        Ok(value)
    }
}
