//! Built-in synthetic letters: a motion library without any recording.
//!
//! Each letter is one stroke of straight lines and arcs through a few points in a box of 1 x 1 ([`shapes`]).
//! The stroke is rounded to a smooth curve and written with a speed that decreases where the curve bends,
//! like handwriting (the two-thirds power law: Lacquaniti, Terzuolo, Viviani, *The law relating the kinematic
//! and figural aspects of drawing movements*, Acta Psychologica 54, 1983). Seeded variation moves the points,
//! slants, stretches and rotates the whole letter, and changes its duration.

mod shapes;
mod writing;

pub use shapes::{ALPHABET, points};
pub use writing::{Variation, letters};
