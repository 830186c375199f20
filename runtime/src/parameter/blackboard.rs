//! The iceoryx2 blackboard that holds a component's parameters, as accessed by the component.

use std::cell::Cell;

use iceoryx2::node::Node;
use iceoryx2::port::reader::{BlackboardValue, EntryHandle, Reader};
use iceoryx2::service::port_factory::blackboard;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable as _;

use super::Numbers;
use crate::declare::{MAX_PARAMETER_NUMBERS, ParameterDeclaration, ParameterValue};
use crate::domain::{ServiceError, Shared, refused, service_name};
use crate::plan::{ComponentPlan, ParameterPlan};
use crate::state::Field;

crate::state_buffer! {
    /// Values of all parameters of a component, in the order of their declaration: the bits of a number, the
    /// index of a choice, the bits of every number of an array.
    pub(super) struct RawTable as "motorium.ParameterTable" {
        pub(super) bits: [u64; MAX_PARAMETER_NUMBERS],
    }
}

/// The key of the one entry.
pub(super) const ENTRY: u64 = 0;

/// Returns the position of each parameter in a table.
pub(super) fn places(parameters: &[ParameterPlan]) -> impl Iterator<Item = (usize, &ParameterPlan)> {
    parameters.iter().scan(0, |next, plan| {
        let place = *next;
        *next += plan.declaration.numbers();
        Some((place, plan))
    })
}

/// Writes an admitted value to its position.
pub(super) fn encode(declaration: &ParameterDeclaration, value: &ParameterValue, bits: &mut [u64]) {
    match value {
        ParameterValue::Float(x) => bits[0] = x.to_bits(),
        ParameterValue::Integer(i) => bits[0] = *i as u64,
        ParameterValue::Boolean(b) => bits[0] = u64::from(*b),
        ParameterValue::Choice(name) => {
            let index = declaration.choices.iter().position(|choice| choice == name);
            bits[0] = index.unwrap_or_default() as u64;
        }
        ParameterValue::Array(values) => {
            bits.iter_mut().zip(values).for_each(|(bits, value)| *bits = value.to_bits());
        }
    }
}

/// Returns the value at a position whose bits have been checked.
pub(super) fn decode(declaration: &ParameterDeclaration, bits: &[u64]) -> ParameterValue {
    match &declaration.default {
        ParameterValue::Float(_) => ParameterValue::Float(f64::from_bits(bits[0])),
        ParameterValue::Integer(_) => ParameterValue::Integer(bits[0] as i64),
        ParameterValue::Boolean(_) => ParameterValue::Boolean(bits[0] != 0),
        ParameterValue::Choice(_) => {
            let name = usize::try_from(bits[0]).ok().and_then(|index| declaration.choices.get(index));
            ParameterValue::Choice(name.cloned().unwrap_or_default())
        }
        ParameterValue::Array(_) => {
            ParameterValue::Array(bits.iter().map(|bits| f64::from_bits(*bits)).collect())
        }
    }
}

/// Returns `true` if `bits` are a valid value of the parameter. Does not allocate.
fn admits(declaration: &ParameterDeclaration, bits: &[u64]) -> bool {
    match &declaration.default {
        ParameterValue::Float(_) | ParameterValue::Array(_) => {
            bits.iter().all(|bits| declaration.allows(f64::from_bits(*bits)))
        }
        ParameterValue::Integer(_) => declaration.allows(bits[0] as i64 as f64),
        ParameterValue::Boolean(_) => bits[0] <= 1,
        ParameterValue::Choice(_) => bits[0] < declaration.choices.len() as u64,
    }
}

/// Returns the table of the initial values.
pub(super) fn initial(component: &ComponentPlan) -> RawTable {
    let mut table = RawTable::ZERO;
    for (place, plan) in places(&component.parameters) {
        encode(&plan.declaration, &plan.initial, &mut table.bits[place..place + plan.declaration.numbers()]);
    }
    table
}

/// Returns the error of an operation on the parameters of a component.
pub(super) fn failed(
    component: &str,
    action: &'static str,
) -> impl Fn(&dyn core::fmt::Display) -> ServiceError {
    refused(format!("component `{component}`"), action)
}

/// Blackboard of one component's parameters, owned by the launcher.
#[derive(Debug)]
pub(crate) struct ParameterService {
    service: blackboard::PortFactory<Shared, u64>,
}

impl ParameterService {
    /// Creates the blackboard of a component, if it has parameters.
    pub(crate) fn create(
        node: &Node<Shared>,
        component: &ComponentPlan,
    ) -> Result<Option<Self>, ServiceError> {
        if component.parameters.is_empty() {
            return Ok(None);
        }
        let name = &component.name;
        let service = node
            .service_builder(&service_name("parameters", name)?)
            .blackboard_creator::<u64>()
            .max_readers(8)
            .max_nodes(12)
            .add(ENTRY, initial(component))
            .create()
            .map_err(|error| failed(name, "creating its parameters")(&error))?;
        Ok(Some(Self { service }))
    }

    /// Abandons the blackboard without accessing iceoryx2's data in shared memory, which may be damaged.
    pub(crate) fn abandon(self) {
        self.service.abandon();
    }
}

/// Declaration of a parameter, the numbers of all parameters, and the index of the parameter's first number.
pub(crate) type FoundParameter<'a> = (&'a ParameterDeclaration, &'a Numbers, usize);

/// The component's side, which checks for changes between two steps.
pub(crate) struct ParameterReader {
    parameters: Vec<ParameterPlan>,
    numbers: Numbers,
    port: Option<Port>,
}

struct Port {
    handle: EntryHandle<Shared, u64, RawTable>,
    /// Table found by the last check.
    seen: Option<BlackboardValue<RawTable>>,
    _reader: Reader<Shared, u64>,
}

impl ParameterReader {
    pub(crate) fn open(node: &Node<Shared>, component: &ComponentPlan) -> Result<Self, ServiceError> {
        let parameters = component.parameters.clone();
        let table = initial(component);
        let count: usize = parameters.iter().map(|plan| plan.declaration.numbers()).sum();
        let numbers: Numbers = table.bits[..count].iter().copied().map(Cell::new).collect();
        let port = if parameters.is_empty() { None } else { Some(Port::open(node, &component.name)?) };
        let mut this = Self { parameters, numbers, port };
        this.refresh();
        Ok(this)
    }

    /// Applies all changes since the last call together, except values of the wrong type or out of range.
    #[inline]
    pub(crate) fn refresh(&mut self) {
        let Some(port) = &mut self.port else { return };
        if port.seen.as_ref().is_none_or(|seen| !port.handle.is_up_to_date(seen)) {
            self.apply();
        }
    }

    #[cold]
    fn apply(&mut self) {
        if let Some(port) = &mut self.port {
            port.seen = Some(port.handle.get());
        }
        let Some(table) = self.port.as_ref().and_then(|port| port.seen.as_ref()) else { return };
        for (place, plan) in places(&self.parameters) {
            let places = place..place + plan.declaration.numbers();
            let bits = &table.bits[places.clone()];
            if admits(&plan.declaration, bits) {
                self.numbers[places].iter().zip(bits).for_each(|(number, bits)| number.set(*bits));
            }
        }
    }

    /// Returns the parameter with this name.
    pub(crate) fn parameter(&self, name: &str) -> Option<FoundParameter<'_>> {
        let mut parameters = places(&self.parameters);
        let (place, plan) = parameters.find(|(_, plan)| plan.declaration.name == name)?;
        Some((&plan.declaration, &self.numbers, place))
    }

    /// Returns all parameters with their values.
    pub(super) fn values(&self) -> impl Iterator<Item = (&ParameterPlan, ParameterValue)> {
        places(&self.parameters).map(|(place, plan)| {
            let numbers = &self.numbers[place..place + plan.declaration.numbers()];
            let bits: Vec<u64> = numbers.iter().map(Cell::get).collect();
            (plan, decode(&plan.declaration, &bits))
        })
    }
}

impl Port {
    fn open(node: &Node<Shared>, name: &str) -> Result<Self, ServiceError> {
        let reader = node
            .service_builder(&service_name("parameters", name)?)
            .blackboard_opener::<u64>()
            .open()
            .map_err(|error| failed(name, "opening its parameters")(&error))?
            .reader_builder()
            .create()
            .map_err(|error| failed(name, "reading its parameters")(&error))?;
        let handle = reader
            .entry::<RawTable>(&ENTRY)
            .map_err(|error| failed(name, "reading its parameters")(&error))?;
        Ok(Self { handle, seen: None, _reader: reader })
    }
}
