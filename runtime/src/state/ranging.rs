//! Measurements of range, position and magnetic field sensors.

#![allow(unsafe_code)] // `Field` implementations that look only at the used part of their arrays

use super::counted::counted_buffer;

/// Maximum number of rays in [`Ranges`].
pub const MAX_RANGES: usize = 2048;
/// Maximum number of points in a [`HeightScan`].
pub const MAX_HEIGHTS: usize = 1024;

counted_buffer! {
    /// Distances along the rays of a sensor, in the order of its rays.
    ///
    /// ```
    /// use motorium::state::Ranges;
    ///
    /// let mut ranges = Ranges::default();
    /// (ranges.least, ranges.most) = (0.1, 10.0);
    /// ranges.set_count(2);
    /// ranges.range_mut().copy_from_slice(&[0.5, 11.0]);
    /// let met = ranges.range().iter().filter(|range| f64::from(**range) <= ranges.most);
    /// assert_eq!(met.count(), 1);
    /// ```
    pub struct Ranges as "motorium.Ranges", at most MAX_RANGES {
        plain {
            /// Minimum range of the sensor, m.
            least: f64;
            /// Maximum range of the sensor, m. A ray that hits nothing in range has a larger value.
            most: f64;
        }
        counted {
            /// Distance to the hit along the ray, m.
            range, range_mut: f32;
        }
    }
}

counted_buffer! {
    /// Heights of the surface on a grid around a sensor: row by row from the back, each row from right to
    /// left.
    ///
    /// The grid is level and centred on the sensor. Its rows are along the sensor's y and its columns along
    /// x, rotated by yaw only.
    ///
    /// ```
    /// use motorium::state::HeightScan;
    ///
    /// let mut scan = HeightScan::default();
    /// (scan.rows, scan.columns, scan.spacing) = (2, 3, 0.1);
    /// scan.set_count(6);
    /// scan.height_mut()[5] = -0.3; // ahead on the left
    /// assert_eq!(scan.height().iter().filter(|height| **height < -0.2).count(), 1);
    /// ```
    pub struct HeightScan as "motorium.HeightScan", at most MAX_HEIGHTS {
        plain {
            /// Number of rows: grid points along x.
            rows: u32;
            /// Number of columns: grid points along y.
            columns: u32;
            /// Distance between adjacent points, m.
            spacing: f64;
            /// Minimum reported height, m. Points without a surface have this height.
            least: f64;
            /// Maximum reported height, m.
            most: f64;
        }
        counted {
            /// Height of the surface above the sensor's origin, m; negative below.
            height, height_mut: f32;
        }
    }
}

crate::state_buffer! {
    /// A position and velocity measured by a satellite navigation receiver.
    ///
    /// ```
    /// use motorium::state::GeoFix;
    ///
    /// let fix = GeoFix { latitude: 46.52, longitude: 6.57, altitude: 400.0, ..GeoFix::default() };
    /// assert_eq!(fix.velocity, [0.0; 3]);
    /// ```
    pub struct GeoFix as "motorium.GeoFix" {
        /// Geodetic latitude on the WGS 84 ellipsoid, degrees, north positive.
        pub latitude: f64,
        /// Longitude, degrees, east positive.
        pub longitude: f64,
        /// Height above the ellipsoid, m.
        pub altitude: f64,
        /// Velocity towards east, north and up, m/s.
        pub velocity: [f64; 3],
        /// Standard deviations of the position towards east, north and up, m.
        pub position_deviation: [f64; 3],
        /// Standard deviations of the velocity towards east, north and up, m/s.
        pub velocity_deviation: [f64; 3],
    }
}

crate::state_buffer! {
    /// Height from a barometer or a radar altimeter.
    ///
    /// ```
    /// use motorium::state::Altitude;
    ///
    /// let climbing = Altitude { height: 12.0, rate: 0.5 };
    /// assert!(climbing.rate > 0.0);
    /// ```
    pub struct Altitude as "motorium.Altitude" {
        /// Height above the sensor's reference level, m.
        pub height: f64,
        /// Rate of change of the height, m/s.
        pub rate: f64,
    }
}

crate::state_buffer! {
    /// A magnetic flux density measured in the axes of the sensor.
    ///
    /// ```
    /// use motorium::state::MagneticField;
    ///
    /// let earth = MagneticField { field: [2e-5, 0.0, -4e-5] };
    /// assert!((earth.field[0].hypot(earth.field[2]) - 4.47e-5).abs() < 1e-7);
    /// ```
    pub struct MagneticField as "motorium.MagneticField" {
        /// Flux density, T.
        pub field: [f64; 3],
    }
}
