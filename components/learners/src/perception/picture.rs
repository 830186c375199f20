//! Pictures of strokes.

use motorium_models::networks::IMAGE_SIDE;
use nalgebra::DMatrix;

/// Number of pixels per side of a picture.
pub const PIXELS: usize = IMAGE_SIDE;

/// A square grey picture: pixels from 0 to 1, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture(pub Vec<f32>);

/// Size of a letter of extent 1 in the picture, pixels.
pub(super) const EXTENT: f64 = 20.0;
/// Half width of a line, as the standard deviation of its profile, pixels.
pub(super) const LINE: f64 = 0.7;

impl Picture {
    /// Draws a path (samples x 2, extent 1, centred at 0) as a soft line.
    pub fn from_path(path: &DMatrix<f64>) -> Self {
        let mut pixels = vec![0.0_f32; PIXELS * PIXELS];
        let place = |k: usize| {
            let middle = 0.5 * (PIXELS - 1) as f64;
            [middle + EXTENT * path[(k, 0)], middle - EXTENT * path[(k, 1)]]
        };
        for k in 1..path.nrows() {
            let (a, b) = (place(k - 1), place(k));
            let range = |a: f64, b: f64| {
                let low = (a.min(b) - 3.0 * LINE).floor().max(0.0) as usize;
                low..((a.max(b) + 3.0 * LINE).ceil().max(0.0) as usize + 1).min(PIXELS)
            };
            for row in range(a[1], b[1]) {
                for column in range(a[0], b[0]) {
                    let squared = from_segment([column as f64, row as f64], a, b);
                    let grey = (-0.5 * squared / (LINE * LINE)).exp() as f32;
                    let pixel = &mut pixels[row * PIXELS + column];
                    *pixel = pixel.max(grey);
                }
            }
        }
        Self(pixels)
    }
}

/// Returns the squared distance of a point from a segment.
fn from_segment(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (along, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let squared = along[0] * along[0] + along[1] * along[1];
    let part =
        if squared > 0.0 { ((to[0] * along[0] + to[1] * along[1]) / squared).clamp(0.0, 1.0) } else { 0.0 };
    (to[0] - part * along[0]).powi(2) + (to[1] - part * along[1]).powi(2)
}
