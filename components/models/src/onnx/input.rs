//! Inputs of a network.

/// Length of an axis of an input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Length {
    /// Fixed in the file.
    Fixed(usize),
    /// Chosen when the network is compiled, such as the number of rows; the name may be empty.
    Free(String),
}

/// An input of a model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Input {
    /// Name of the tensor.
    pub name: String,
    /// Length along each axis.
    pub shape: Vec<Length>,
}
