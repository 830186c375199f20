//! Observations of sensors and simulations: contacts, objects, images, point clouds.

#![allow(unsafe_code)] // `Field` implementations that look only at the used part of their arrays

use super::counted::counted_buffer;

/// Maximum number of contacts in [`Contacts`].
pub const MAX_CONTACTS: usize = 64;
/// Maximum number of objects in [`ObjectPoses`].
pub const MAX_OBJECTS: usize = 64;

counted_buffer! {
    /// Contact points between a robot and its environment, in the world frame.
    ///
    /// ```
    /// use motorium::state::Contacts;
    ///
    /// let mut contacts = Contacts::default();
    /// contacts.set_count(1);
    /// contacts.force_z_mut()[0] = 12.5;
    /// assert_eq!(contacts.force_z(), [12.5]);
    /// ```
    pub struct Contacts as "motorium.Contacts", at most MAX_CONTACTS {
        plain {
            /// Number of contact points without an entry, because the arrays are full. They are merged: two
            /// entries of their link have their force and moment. With more than 32 touched links some may be
            /// omitted; [`ContactImpulses`] has the sum of all.
            cut: u64;
        }
        counted {
            /// Index of the touched link in the robot's model.
            link, link_mut: u32;
            /// The other body: the index of an object of the world, or of a link plus 65536; 65535 for a link
            /// of another robot, 4294967295 for the ground, 4294967294 for a push of the graph.
            other, other_mut: u32;
            /// Position of the point, x, m.
            position_x, position_x_mut: f64;
            /// Position of the point, y, m.
            position_y, position_y_mut: f64;
            /// Position of the point, z, m.
            position_z, position_z_mut: f64;
            /// Force on the link, x, N.
            force_x, force_x_mut: f64;
            /// Force on the link, y, N.
            force_y, force_y_mut: f64;
            /// Force on the link, z, N.
            force_z, force_z_mut: f64;
            /// Depth of the overlap of the surfaces, m.
            depth, depth_mut: f64;
        }
    }
}

/// Maximum number of links in [`ContactImpulses`].
pub const MAX_IMPULSES: usize = 128;

counted_buffer! {
    /// Impulses of all contacts and pushes on links of a robot, added up since the start of the episode. The
    /// difference of two values is the impulse between them, over any number of steps. Vectors are in the
    /// axes of the world.
    ///
    /// ```
    /// use motorium::state::ContactImpulses;
    ///
    /// let mut impulses = ContactImpulses::default();
    /// impulses.set_count(1);
    /// impulses.impulse_z_mut()[0] = 0.3;
    /// assert_eq!(impulses.impulse_z(), [0.3]);
    /// ```
    pub struct ContactImpulses as "motorium.ContactImpulses", at most MAX_IMPULSES {
        plain {
            /// Number of impulses omitted since the start of the episode because the arrays are full.
            cut: u64;
        }
        counted {
            /// Index of the link in the robot's model. A link that has not been touched is not
            /// listed.
            link, link_mut: u32;
            /// Impulse on the link, x, N s.
            impulse_x, impulse_x_mut: f64;
            /// Impulse on the link, y, N s.
            impulse_y, impulse_y_mut: f64;
            /// Impulse on the link, z, N s.
            impulse_z, impulse_z_mut: f64;
            /// Moment of the impulses about the origin of the world, x, N m s.
            moment_x, moment_x_mut: f64;
            /// Moment of the impulses about the origin of the world, y, N m s.
            moment_y, moment_y_mut: f64;
            /// Moment of the impulses about the origin of the world, z, N m s.
            moment_z, moment_z_mut: f64;
        }
    }
}

counted_buffer! {
    /// Poses of the objects of the world, in the world frame.
    ///
    /// ```
    /// use motorium::state::ObjectPoses;
    ///
    /// let mut poses = ObjectPoses::default();
    /// poses.set_count(2);
    /// poses.orientation_w_mut().fill(1.0);
    /// assert_eq!(poses.orientation_w(), [1.0, 1.0]);
    /// ```
    pub struct ObjectPoses as "motorium.ObjectPoses", at most MAX_OBJECTS {
        counted {
            /// Index of the object in `objects` of the world.
            object, object_mut: u32;
            /// Position of its centre, x, m.
            position_x, position_x_mut: f64;
            /// Position of its centre, y, m.
            position_y, position_y_mut: f64;
            /// Position of its centre, z, m.
            position_z, position_z_mut: f64;
            /// Orientation, x of the unit quaternion.
            orientation_x, orientation_x_mut: f64;
            /// Orientation, y of the unit quaternion.
            orientation_y, orientation_y_mut: f64;
            /// Orientation, z of the unit quaternion.
            orientation_z, orientation_z_mut: f64;
            /// Orientation, w of the unit quaternion.
            orientation_w, orientation_w_mut: f64;
        }
    }
}

crate::state_buffer! {
    /// Size and format of the images of a camera, whose pixels are slices of `u8` on a separate topic: rows
    /// from the top, pixels from the left, `stride` bytes per row.
    ///
    /// ```
    /// use motorium::state::ImageInfo;
    ///
    /// let grey = ImageInfo { width: 640, height: 480, stride: 640, encoding: ImageInfo::GREY_8, ..ImageInfo::default() };
    /// assert_eq!(grey.stride * grey.height, 307_200);
    /// ```
    pub struct ImageInfo as "motorium.ImageInfo" {
        /// Pixels of a row.
        pub width: u32,
        /// Rows.
        pub height: u32,
        /// Bytes of a row.
        pub stride: u32,
        /// Format of a pixel: one of the constants of this type.
        pub encoding: u32,
        /// Focal lengths along the rows and columns, pixels; 0 if unknown.
        pub focal_length: [f64; 2],
        /// The point of the image on the optical axis, pixels from the top left corner.
        pub principal_point: [f64; 2],
    }
}

impl ImageInfo {
    /// Greyscale, one byte per pixel.
    pub const GREY_8: u32 = 1;
    /// Red, green and blue, a byte each.
    pub const RGB_8: u32 = 2;
    /// Blue, green and red, a byte each.
    pub const BGR_8: u32 = 3;
    /// Depth along the optical axis as `f32`, m.
    pub const DEPTH_32: u32 = 4;
    /// A file in the JPEG format; `stride` is 0.
    pub const JPEG: u32 = 5;
}

crate::state_buffer! {
    /// One point of a cloud (a slice of points), in the axes of the sensor.
    ///
    /// ```
    /// use motorium::state::CloudPoint;
    ///
    /// assert_eq!(size_of::<CloudPoint>(), 16);
    /// ```
    pub struct CloudPoint as "motorium.CloudPoint" {
        /// Position, x, m.
        pub x: f32,
        /// Position, y, m.
        pub y: f32,
        /// Position, z, m.
        pub z: f32,
        /// Intensity of the return, 0 to 1; 0 if unknown.
        pub intensity: f32,
    }
}
