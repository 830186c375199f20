//! Parameters of a running graph, read and set from outside its components.

use iceoryx2::node::Node;

use super::blackboard::{ENTRY, ParameterReader, RawTable, encode, failed, places};
use crate::declare::ParameterValue;
use crate::domain::{Domain, DomainError, ServiceError, Shared, service_name};
use crate::nearest::suggest;
use crate::plan::{ComponentPlan, ParameterPlan, Plan};

/// Error of reading or setting a parameter from outside the graph.
#[derive(Debug, thiserror::Error)]
pub enum ParameterError {
    /// The component or parameter does not exist.
    #[error("{0}")]
    Unknown(String),
    /// The value has the wrong type or is out of range.
    #[error("{0}")]
    Refused(String),
    /// The blackboard of the parameters cannot be opened, read or written.
    #[error(transparent)]
    Service(#[from] ServiceError),
    /// The iceoryx2 domain of the run cannot be joined.
    #[error(transparent)]
    Domain(#[from] DomainError),
}

/// Reads and sets the parameters of a running graph from outside.
#[derive(Debug)]
pub struct ParameterTable {
    node: Node<Shared>,
    plan: Plan,
}

/// Value for one parameter: index of the component, position in its table, parameter, admitted value.
type Admitted<'a> = (usize, usize, &'a ParameterPlan, ParameterValue);

impl ParameterTable {
    /// Joins a run to read and set its parameters.
    ///
    /// # Errors
    /// The iceoryx2 domain of the run cannot be joined.
    pub fn open(domain: &Domain, plan: Plan) -> Result<Self, ParameterError> {
        Ok(Self { node: domain.node()?, plan })
    }

    /// Returns all parameters of the graph: name of the component, declaration, and current value.
    ///
    /// # Errors
    /// The parameters cannot be read.
    pub fn list(&self) -> Result<Vec<(String, ParameterPlan, ParameterValue)>, ParameterError> {
        let mut all = Vec::new();
        for component in &self.plan.components {
            let reader = ParameterReader::open(&self.node, component)?;
            let values = reader.values();
            all.extend(values.map(|(plan, value)| (component.name.clone(), plan.clone(), value)));
        }
        Ok(all)
    }

    /// Sets the parameter named `component.parameter`, and returns the new value in its declared type. The
    /// value takes effect at the component's next step.
    ///
    /// # Errors
    /// The parameter does not exist, the value has the wrong type or is out of range, or a different process
    /// is setting parameters at the same time.
    pub fn set(&self, path: &str, value: ParameterValue) -> Result<ParameterValue, ParameterError> {
        let mut set = self.set_many([(path, value)])?;
        Ok(set.swap_remove(0))
    }

    /// Sets several parameters and returns their new values. All values for one component take effect
    /// together, at the component's next step.
    ///
    /// # Errors
    /// Same as [`set`](Self::set), for the first invalid value. If there is an error, no parameter is set.
    pub fn set_many<'a>(
        &self,
        values: impl IntoIterator<Item = (&'a str, ParameterValue)>,
    ) -> Result<Vec<ParameterValue>, ParameterError> {
        let mut admitted: Vec<Admitted<'_>> = Vec::new();
        for (path, value) in values {
            let one = self.admit(path, value)?;
            if admitted.iter().any(|(component, place, ..)| (*component, *place) == (one.0, one.1)) {
                return Err(ParameterError::Refused(format!("`{path}` is set twice in one request")));
            }
            admitted.push(one);
        }
        for (index, component) in self.plan.components.iter().enumerate() {
            let own = admitted.iter().filter(|(of, ..)| *of == index);
            self.write(component, own)?;
        }
        Ok(admitted.into_iter().map(|(.., value)| value).collect())
    }

    fn admit(&self, path: &str, value: ParameterValue) -> Result<Admitted<'_>, ParameterError> {
        let unknown = |message: String| ParameterError::Unknown(message);
        let (name, parameter) = path.split_once('.').ok_or_else(|| {
            unknown(format!("`{path}` is not a parameter; write it as `component.parameter`"))
        })?;
        let components = &self.plan.components;
        let index = components.iter().position(|component| component.name == name).ok_or_else(|| {
            let names = components.iter().map(|component| component.name.as_str());
            unknown(format!("the graph has no component `{name}`; {}", suggest(name, names, "it has")))
        })?;
        let parameters = &components[index].parameters;
        let found = places(parameters).find(|(_, plan)| plan.declaration.name == parameter);
        let (place, plan) = found.ok_or_else(|| {
            let names = parameters.iter().map(|plan| plan.declaration.name.as_str());
            unknown(format!(
                "`{name}` has no parameter `{parameter}`; {}",
                suggest(parameter, names, "it has")
            ))
        })?;
        let value = plan.declaration.admit(value).map_err(ParameterError::Refused)?;
        Ok((index, place, plan, value))
    }

    /// Writes values of one component to its table; readers see either the old values or all new ones.
    fn write<'a>(
        &self,
        component: &ComponentPlan,
        values: impl Iterator<Item = &'a Admitted<'a>>,
    ) -> Result<(), ParameterError> {
        let mut values = values.peekable();
        if values.peek().is_none() {
            return Ok(());
        }
        let name = &component.name;
        let service = self
            .node
            .service_builder(&service_name("parameters", name)?)
            .blackboard_opener::<u64>()
            .open()
            .map_err(|error| failed(name, "opening its parameters")(&error))?;
        // There is only one writer at a time, so the table cannot change between the read and the write
        // below.
        let writer = service
            .writer_builder()
            .create()
            .map_err(|error| failed(name, "writing its parameters")(&error))?;
        let entry = writer
            .entry::<RawTable>(&ENTRY)
            .map_err(|error| failed(name, "writing its parameters")(&error))?;
        let reader = service
            .reader_builder()
            .create()
            .map_err(|error| failed(name, "reading its parameters")(&error))?;
        let handle = reader
            .entry::<RawTable>(&ENTRY)
            .map_err(|error| failed(name, "reading its parameters")(&error))?;
        let mut table = *handle.get();
        for (_, place, plan, value) in values {
            let places = *place..place + plan.declaration.numbers();
            encode(&plan.declaration, value, &mut table.bits[places]);
        }
        entry.update_with_copy(table);
        Ok(())
    }
}
