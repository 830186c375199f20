//! Perceptual coupling: the picture of a letter becomes the movement that writes it.
//!
//! A picture of 28 x 28 pixels goes through a small convolutional network, whose outputs are the weights of a
//! motion library and the start, goal and velocity of the movement:
//!
//! | layer | out |
//! |---|---|
//! | convolution 5 x 5, ReLU, maximum of 2 x 2 | 8 x 12 x 12 |
//! | convolution 5 x 5, ReLU, maximum of 2 x 2 | 16 x 4 x 4 |
//! | dense, ReLU | 256 |
//! | dense | weights + 3 for each degree of freedom |
//!
//! **Loss.** The path is linear in the outputs, `y = A o`. With `A^T A = L L^T` the squared error of position
//! is `|L^T (o' - o)|^2`; the network learns `z = L^T o`, in which all outputs count alike, and `o = L^-T z`.
//!
//! **Time.** The picture of a letter does not show its speed. So the letters are learned as they are drawn at
//! even speed along the stroke ([`even_speed`]), and paths are compared as curves ([`chamfer`]).
//! [`Coupling::written`] writes at a pen speed that is asked for, or at the mean one of the letters learned.
//!
//! **Files.** [`Coupling::write`] and [`Coupling::read`] keep a coupling whole: its network and its library.
//! [`Picture::read`] reads pictures (PGM).
//!
//! The network is small enough for plain matrix products on one core; a framework for it would cost more to
//! build than it saves. Training is seeded: the same seed gives the same weights on the same machine.
//!
//! Source: Delhaisse, PhD thesis, 2019, section 3.4 (picture to weights); the loss and the layers are our
//! own. Adam: Kingma, Ba, ICLR 2015.

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

/// Longest file of a coupling or a picture, bytes.
const LONGEST: u64 = 1 << 28;
