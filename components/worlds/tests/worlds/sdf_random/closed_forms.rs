//! Closed forms of frames, volumes and inertias that share no code with the reader.

use core::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};

/// A frame in another: `turn` has its axes as columns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub(crate) turn: Matrix3<f64>,
    pub(crate) origin: Vector3<f64>,
}

impl Frame {
    pub(crate) fn identity() -> Self {
        Self { turn: Matrix3::identity(), origin: Vector3::zeros() }
    }

    /// Creates a frame from a position and roll, pitch and yaw about fixed axes \[rad\].
    pub(crate) fn from_rpy([x, y, z, roll, pitch, yaw]: [f64; 6]) -> Self {
        let ((sr, cr), (sp, cp), (sy, cy)) = (roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
        let about_x = Matrix3::new(1.0, 0.0, 0.0, 0.0, cr, -sr, 0.0, sr, cr);
        let about_y = Matrix3::new(cp, 0.0, sp, 0.0, 1.0, 0.0, -sp, 0.0, cp);
        let about_z = Matrix3::new(cy, -sy, 0.0, sy, cy, 0.0, 0.0, 0.0, 1.0);
        Self { turn: about_z * about_y * about_x, origin: Vector3::new(x, y, z) }
    }

    /// Creates a frame from a position and a quaternion x, y, z, w of any length.
    pub(crate) fn from_quaternion([x, y, z]: [f64; 3], quaternion: [f64; 4]) -> Self {
        let length = quaternion.iter().map(|part| part * part).sum::<f64>().sqrt();
        let [i, j, k, w] = quaternion.map(|part| part / length);
        let turn = Matrix3::new(
            1.0 - 2.0 * (j * j + k * k),
            2.0 * (i * j - k * w),
            2.0 * (i * k + j * w),
            2.0 * (i * j + k * w),
            1.0 - 2.0 * (i * i + k * k),
            2.0 * (j * k - i * w),
            2.0 * (i * k - j * w),
            2.0 * (j * k + i * w),
            1.0 - 2.0 * (i * i + j * j),
        );
        Self { turn, origin: Vector3::new(x, y, z) }
    }

    /// Converts a frame relative to `self` to the frame in which `self` is expressed.
    pub(crate) fn then(&self, inner: &Self) -> Self {
        Self { turn: self.turn * inner.turn, origin: self.origin + self.turn * inner.origin }
    }
}

/// Corners of the tetrahedron of the tests.
pub(crate) const CORNERS: [[f64; 3]; 4] =
    [[0.0, 0.0, 0.0], [0.25, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.125]];

#[derive(Clone, Copy, Debug)]
pub(crate) enum Solid {
    Box([f64; 3]),
    Sphere(f64),
    Cylinder(f64, f64),
    Capsule(f64, f64),
    /// Scaled along its axes.
    Tetrahedron([f64; 3]),
    /// A plane that is not level: solid behind its frame's z axis.
    Slope,
}

/// A mass with its centre and its second moments about the centre, as \[kg m2\].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cloud {
    pub(crate) mass: f64,
    pub(crate) centre: Vector3<f64>,
    moments: Matrix3<f64>,
}

impl Cloud {
    /// Combines the clouds.
    pub(crate) fn sum(clouds: &[Self]) -> Self {
        let mass = clouds.iter().map(|cloud| cloud.mass).sum();
        let centre = clouds.iter().map(|cloud| cloud.centre * cloud.mass).sum::<Vector3<f64>>() / mass;
        let moments = clouds.iter().map(|cloud| {
            let way: Vector3<f64> = cloud.centre - centre;
            cloud.moments + way * way.transpose() * cloud.mass
        });
        Self { mass, centre, moments: moments.sum() }
    }

    /// Returns the cloud with another mass \[kg\].
    pub(crate) fn with_mass(&self, mass: f64) -> Self {
        Self { mass, moments: self.moments * (mass / self.mass), ..*self }
    }

    /// Returns the cloud in the parent of `frame`.
    pub(crate) fn moved(&self, frame: &Frame) -> Self {
        Self {
            mass: self.mass,
            centre: frame.origin + frame.turn * self.centre,
            moments: frame.turn * self.moments * frame.turn.transpose(),
        }
    }

    /// Returns the inertia about its centre.
    pub(crate) fn inertia(&self) -> Matrix3<f64> {
        Matrix3::from_diagonal_element(self.moments.trace()) - self.moments
    }
}

impl Solid {
    pub(crate) fn volume(&self) -> f64 {
        match *self {
            Self::Box([x, y, z]) => x * y * z,
            Self::Sphere(r) => 4.0 / 3.0 * PI * r * r * r,
            Self::Cylinder(r, l) => PI * r * r * l,
            Self::Capsule(r, l) => PI * r * r * l + 4.0 / 3.0 * PI * r * r * r,
            Self::Tetrahedron([x, y, z]) => (0.25 * 0.5 * 0.125 / 6.0) * (x * y * z).abs(),
            Self::Slope => f64::INFINITY,
        }
    }

    /// Returns a mass \[kg\] distributed evenly over the solid, in its frame.
    pub(crate) fn cloud(&self, mass: f64) -> Cloud {
        let round =
            |r: f64, along: f64| Matrix3::from_diagonal(&Vector3::new(0.25 * r * r, 0.25 * r * r, along));
        let (centre, moments) = match *self {
            Self::Box(size) => {
                (Vector3::zeros(), Matrix3::from_diagonal(&Vector3::from(size.map(|s| s * s / 12.0))))
            }
            Self::Sphere(r) => (Vector3::zeros(), Matrix3::from_diagonal_element(0.2 * r * r)),
            Self::Cylinder(r, l) => (Vector3::zeros(), round(r, l * l / 12.0)),
            Self::Capsule(r, l) => {
                let ball = 4.0 / 3.0 * PI * r * r * r / self.volume();
                let ends = 0.2 * r * r + 0.25 * l * l + 0.375 * l * r;
                let ends = Matrix3::from_diagonal(&Vector3::new(0.2 * r * r, 0.2 * r * r, ends));
                (Vector3::zeros(), round(r, l * l / 12.0) * (1.0 - ball) + ends * ball)
            }
            Self::Tetrahedron(scale) => {
                let corners =
                    CORNERS.map(|corner| Vector3::from(corner).component_mul(&Vector3::from(scale)));
                let sum: Vector3<f64> = corners.iter().sum();
                let squares: Matrix3<f64> = corners.iter().map(|corner| corner * corner.transpose()).sum();
                let centre = sum * 0.25;
                (centre, (squares + sum * sum.transpose()) / 20.0 - centre * centre.transpose())
            }
            Self::Slope => (Vector3::zeros(), Matrix3::zeros()),
        };
        Cloud { mass, centre, moments: moments * mass }
    }
}
