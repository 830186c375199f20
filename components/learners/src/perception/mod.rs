//! Perceptual coupling: maps the picture of a letter to the movement that writes it.
//!
//! A picture of 28 x 28 pixels passes through a small convolutional network, whose outputs are the weights of
//! a motion library and the start, goal and velocity of the movement:
//!
//! | layer | out |
//! |---|---|
//! | convolution 5 x 5, ReLU, maximum of 2 x 2 | 8 x 12 x 12 |
//! | convolution 5 x 5, ReLU, maximum of 2 x 2 | 16 x 4 x 4 |
//! | dense, ReLU | 256 |
//! | dense | weights + 3 for each degree of freedom |
//!
//! **Loss.** The path is linear in the outputs, `y = A o`. With `A^T A = L L^T` the squared error of position
//! is `|L^T (o' - o)|^2`. The network learns `z = L^T o`, in which all outputs have equal weight, and `o =
//! L^-T z`.
//!
//! **Time.** The picture of a letter does not show its speed. The letters are therefore learned at constant
//! speed along the stroke ([`even_speed`]), and paths are compared as curves ([`chamfer`]).
//! [`Coupling::written`] writes at a given pen speed, or at the mean speed of the training letters.
//!
//! **Files.** [`Coupling::write`] and [`Coupling::read`] store a complete coupling: its network and its
//! library. [`Picture::read`] reads pictures (PGM).
//!
//! The network is small enough for plain matrix products on one core, so the crate uses no deep-learning
//! framework. Training is seeded: the same seed gives the same weights on the same machine.
//!
//! Source: Delhaisse, PhD thesis, 2019, section 3.4 (picture to weights); the loss and the layers are
//! original to this crate. Adam: Kingma, Ba, ICLR 2015.

mod coupling;
mod file;
mod image;
mod letter;
mod picture;

pub use coupling::{Coupling, Training, length};
pub use file::CouplingFileError;
pub use image::ImageError;
pub use letter::{augmented, begun_at_zero, chamfer, even_speed, unit_extent};
pub use picture::{PIXELS, Picture};

/// Largest size of a coupling or picture file, bytes.
const LONGEST: u64 = 1 << 28;
