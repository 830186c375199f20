//! A distortion-free camera.

use nalgebra::{Unit, Vector3};

/// A distortion-free camera that looks along x. Columns increase to the right, along -y; rows increase
/// downwards, along -z.
///
/// Pixel coordinates start at the centre of the top left pixel.
///
/// ```
/// use motorium_sensors::pinhole::Pinhole;
/// use nalgebra::Vector3;
///
/// let camera = Pinhole::new(160, 120, std::f64::consts::FRAC_PI_2);
/// assert!((camera.focal_length[0] - 80.0).abs() < 1e-9);
/// let first = camera.directions().next().unwrap();
/// assert!(first.y > 0.0 && first.z > 0.0, "the top left corner");
/// assert_eq!(camera.directions().count(), 160 * 120);
/// let [column, row] = camera.project(&Vector3::new(2.0, -0.5, 0.0)).unwrap();
/// assert!((column - 99.5).abs() < 1e-9 && (row - 59.5).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// Pixels per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// Focal lengths along the rows and along the columns, pixels.
    pub focal_length: [f64; 2],
    /// Principal point: column and row of the optical axis, pixels.
    pub principal_point: [f64; 2],
}

impl Pinhole {
    /// Creates a camera with a horizontal `field_of_view` \[rad\].
    pub fn new(width: u32, height: u32, field_of_view: f64) -> Self {
        Self::square(width, height, half(width) / (0.5 * field_of_view).tan())
    }

    /// Creates a camera with a vertical `field_of_view` \[rad\].
    pub fn upright(width: u32, height: u32, field_of_view: f64) -> Self {
        Self::square(width, height, half(height) / (0.5 * field_of_view).tan())
    }

    /// Creates a camera with square pixels and the optical axis in the centre.
    fn square(width: u32, height: u32, focal_length: f64) -> Self {
        Self {
            width,
            height,
            focal_length: [focal_length; 2],
            principal_point: [half(width) - 0.5, half(height) - 0.5],
        }
    }

    /// Returns the vector in camera axes that points through an image point (column and row) and has a
    /// component of 1 along the optical axis.
    pub fn ray(&self, pixel: [f64; 2]) -> Vector3<f64> {
        let right = (pixel[0] - self.principal_point[0]) / self.focal_length[0];
        let down = (pixel[1] - self.principal_point[1]) / self.focal_length[1];
        Vector3::new(1.0, -right, -down)
    }

    /// Returns the unit vectors through the pixel centres in camera axes, row by row from the top left
    /// corner.
    pub fn directions(&self) -> impl Iterator<Item = Unit<Vector3<f64>>> {
        let camera = *self;
        (0..self.height).flat_map(move |row| {
            (0..camera.width)
                .map(move |column| Unit::new_normalize(camera.ray([f64::from(column), f64::from(row)])))
        })
    }

    /// Projects a point in camera axes \[m\] to its column and row in the image; `None` behind the camera.
    pub fn project(&self, point: &Vector3<f64>) -> Option<[f64; 2]> {
        if point.x <= 0.0 {
            return None;
        }
        let column = self.principal_point[0] - self.focal_length[0] * point.y / point.x;
        let row = self.principal_point[1] - self.focal_length[1] * point.z / point.x;
        Some([column, row])
    }
}

fn half(pixels: u32) -> f64 {
    0.5 * f64::from(pixels)
}
