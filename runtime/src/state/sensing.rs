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
            /// Number of contact points that have no entry because the arrays are full. These points are
            /// merged: two entries of the same link carry their total force and moment. If more than 32 links
            /// are touched, some links may be omitted; [`ContactImpulses`] includes all contacts.
            cut: u64;
        }
        counted {
            /// Index of the touched link in the robot's model.
            link, link_mut: u32;
            /// Body that touches the link: the index of an object of the world, or 65536 plus the index of a
            /// link of the same robot; 65535 for a link of a different robot, 4294967295 for the ground,
            /// 4294967294 for a push defined in the graph.
            other, other_mut: u32;
            /// Position of the contact point, x, m.
            position_x, position_x_mut: f64;
            /// Position of the contact point, y, m.
            position_y, position_y_mut: f64;
            /// Position of the contact point, z, m.
            position_z, position_z_mut: f64;
            /// Force on the touched link, x, N.
            force_x, force_x_mut: f64;
            /// Force on the touched link, y, N.
            force_y, force_y_mut: f64;
            /// Force on the touched link, z, N.
            force_z, force_z_mut: f64;
            /// Penetration depth of the two surfaces, m.
            depth, depth_mut: f64;
        }
    }
}

/// Maximum number of links in [`ContactImpulses`].
pub const MAX_IMPULSES: usize = 128;

counted_buffer! {
    /// Accumulated impulses of all contacts and pushes on each link of a robot since the start of the
    /// episode, in world axes. The difference between two published values is the impulse between their
    /// publication times.
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
            /// Index of the link in the robot's model. Links that have not been touched are not listed.
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
            /// Index of the object in the list `objects` of the graph's `[world]`.
            object, object_mut: u32;
            /// Position of the object's centre, x, m.
            position_x, position_x_mut: f64;
            /// Position of the object's centre, y, m.
            position_y, position_y_mut: f64;
            /// Position of the object's centre, z, m.
            position_z, position_z_mut: f64;
            /// Orientation of the object, x of the unit quaternion.
            orientation_x, orientation_x_mut: f64;
            /// Orientation of the object, y of the unit quaternion.
            orientation_y, orientation_y_mut: f64;
            /// Orientation of the object, z of the unit quaternion.
            orientation_z, orientation_z_mut: f64;
            /// Orientation of the object, w of the unit quaternion.
            orientation_w, orientation_w_mut: f64;
        }
    }
}

crate::state_buffer! {
    /// Size and pixel format of a camera's images. The pixels are published on a separate topic, as slices of
    /// `u8`: rows from the top, pixels from the left, `stride` bytes per row.
    ///
    /// ```
    /// use motorium::state::ImageInfo;
    ///
    /// let grey = ImageInfo { width: 640, height: 480, stride: 640, encoding: ImageInfo::GREY_8, ..ImageInfo::default() };
    /// assert_eq!(grey.stride * grey.height, 307_200);
    /// ```
    pub struct ImageInfo as "motorium.ImageInfo" {
        /// Number of pixels per row.
        pub width: u32,
        /// Number of rows.
        pub height: u32,
        /// Number of bytes per row.
        pub stride: u32,
        /// Pixel format: one of the constants of this type.
        pub encoding: u32,
        /// Focal lengths along the rows and along the columns, pixels; 0 if unknown.
        pub focal_length: [f64; 2],
        /// Intersection of the optical axis with the image, pixels from the top left corner.
        pub principal_point: [f64; 2],
    }
}

impl ImageInfo {
    /// Pixel format: greyscale, one byte per pixel.
    pub const GREY_8: u32 = 1;
    /// Pixel format: red, green and blue, one byte each.
    pub const RGB_8: u32 = 2;
    /// Pixel format: blue, green and red, one byte each.
    pub const BGR_8: u32 = 3;
    /// Pixel format: depth along the optical axis as `f32`, m.
    pub const DEPTH_32: u32 = 4;
    /// Format: a JPEG file; `stride` is 0.
    pub const JPEG: u32 = 5;
}

crate::state_buffer! {
    /// One point of a point cloud, in the axes of the sensor. A cloud is a slice of points.
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
