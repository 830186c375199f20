//! Parameters: slow, typed, range-checked values on iceoryx2's blackboard, applied between two steps.
//!
//! All parameters of a component form one entry of the blackboard, so that a writer can set several
//! parameters atomically. While nothing changes, a step only compares one counter.

mod blackboard;
mod outside;

use std::cell::Cell;
use std::rc::Rc;

pub(crate) use blackboard::{FoundParameter, ParameterReader, ParameterService};
pub use outside::{ParameterError, ParameterTable};

use crate::declare::ParameterKind;

/// Numbers of all parameters of a component, as seen by the current step.
pub(crate) type Numbers = Rc<[Cell<u64>]>;

/// A parameter that a component reads. Changes are applied between two steps, never within one.
#[derive(Debug, Clone)]
pub struct Parameter<T> {
    numbers: Numbers,
    place: usize,
    marker: core::marker::PhantomData<T>,
}

/// A type of single-valued parameters.
pub trait AnyParameter: Copy {
    /// Declared kind of parameters of this type.
    const KIND: ParameterKind;
    /// Creates a value from `bits`, which must encode a value of the kind [`KIND`](Self::KIND).
    fn of_bits(bits: u64) -> Self;
}

impl AnyParameter for f64 {
    const KIND: ParameterKind = ParameterKind::Float;

    #[inline]
    fn of_bits(bits: u64) -> Self {
        Self::from_bits(bits)
    }
}

impl AnyParameter for i64 {
    const KIND: ParameterKind = ParameterKind::Integer;

    #[inline]
    fn of_bits(bits: u64) -> Self {
        bits as Self
    }
}

impl AnyParameter for bool {
    const KIND: ParameterKind = ParameterKind::Boolean;

    #[inline]
    fn of_bits(bits: u64) -> Self {
        bits != 0
    }
}

/// Value of a choice parameter: the index of the chosen name in the order of the declaration.
///
/// ```
/// use motorium::component::Choice;
/// use motorium::prelude::*;
///
/// const SHAPES: [&str; 2] = ["circle", "square"];
///
/// fn declare(declare: &mut Declare) {
///     declare.choice("shape", &SHAPES, "circle", "the shape to draw");
/// }
///
/// /// `shape` is `setup.parameter("shape")?`.
/// fn corners(shape: &Parameter<Choice>) -> u32 {
///     match SHAPES[shape.get().index()] {
///         "square" => 4,
///         _ => 0,
///     }
/// }
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Choice(usize);

impl Choice {
    /// Returns the index of the chosen name in the order of the declaration.
    pub fn index(self) -> usize {
        self.0
    }
}

impl AnyParameter for Choice {
    const KIND: ParameterKind = ParameterKind::Choice;

    #[inline]
    fn of_bits(bits: u64) -> Self {
        Self(bits as usize)
    }
}

impl<T: AnyParameter> Parameter<T> {
    pub(crate) fn new(numbers: Numbers, place: usize) -> Self {
        Self { numbers, place, marker: core::marker::PhantomData }
    }

    /// Returns the value that applies in this step.
    #[inline]
    pub fn get(&self) -> T {
        T::of_bits(self.numbers[self.place].get())
    }
}

/// An array parameter of fixed length. Changes are applied between two steps, to all entries together.
///
/// ```
/// use motorium::component::ParameterArray;
/// use motorium::prelude::*;
///
/// fn declare(declare: &mut Declare) {
///     declare.array("stiffness", &[600.0, 600.0, 200.0], 0.0..=1000.0, "N m/rad", "stiffness of each joint");
/// }
///
/// /// `stiffness` is `setup.parameter_array("stiffness")?`.
/// fn efforts(stiffness: &ParameterArray, error: &[f64], effort: &mut [f64]) {
///     for ((effort, error), stiffness) in effort.iter_mut().zip(error).zip(stiffness.iter()) {
///         *effort = stiffness * error;
///     }
/// }
/// ```
#[derive(Debug, Clone)]
pub struct ParameterArray {
    numbers: Numbers,
    place: usize,
    length: usize,
}

impl ParameterArray {
    pub(crate) fn new(numbers: Numbers, place: usize, length: usize) -> Self {
        Self { numbers, place, length }
    }

    /// Returns the number of entries, as declared.
    pub fn len(&self) -> usize {
        self.length
    }

    /// Returns `true` if the array has no entries. Declared arrays always have at least one entry.
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// Returns the value of one entry that applies in this step.
    ///
    /// # Panics
    /// If the index is not below [`len`](Self::len).
    #[inline]
    pub fn get(&self, index: usize) -> f64 {
        assert!(index < self.length, "number {index} of {}", self.length);
        f64::from_bits(self.numbers[self.place + index].get())
    }

    /// Returns an iterator over the entries that apply in this step, in order.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = f64> + '_ {
        self.numbers[self.place..self.place + self.length].iter().map(|bits| f64::from_bits(bits.get()))
    }
}
