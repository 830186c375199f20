//! Inputs of a network.

/// Length of an axis of an input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Length {
    /// Length fixed in the file.
    Fixed(usize),
    /// Length chosen when the network is compiled, such as the number of rows. Contains the name of the axis,
    /// which may be empty.
    Free(String),
}

/// An input of a model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Input {
    /// Name of the tensor.
    pub name: String,
    /// Length of each axis.
    pub shape: Vec<Length>,
}
