//! Field buses: frames and health.

crate::state_buffer! {
    /// A frame of a CAN or CAN FD bus.
    ///
    /// ```
    /// use motorium::state::CanFrame;
    ///
    /// let mut frame = CanFrame { id: 0x141, length: 2, ..CanFrame::default() };
    /// frame.data[..2].copy_from_slice(&[0x9c, 0]);
    /// assert_eq!(frame.flags & CanFrame::EXTENDED, 0);
    /// ```
    pub struct CanFrame as "motorium.CanFrame" {
        /// Time at which the kernel or the adapter received it, ns of the monotonic clock; 0 for a frame to
        /// be sent.
        pub receive_time: u64,
        /// Identifier, 11 or 29 bits.
        pub id: u32,
        /// Flags: the constants of this type.
        pub flags: u32,
        /// Index of the bus within its component.
        pub bus: u32,
        /// Bytes of `data` in use, 0 to 64.
        pub length: u32,
        /// The bytes.
        pub data: [u8; 64],
    }
}

impl CanFrame {
    /// The identifier has 29 bits.
    pub const EXTENDED: u32 = 1;
    /// A CAN FD frame.
    pub const FD: u32 = 2;
    /// Its data was sent at the higher rate.
    pub const BIT_RATE_SWITCH: u32 = 4;
    /// A request for a frame, without data.
    pub const REMOTE: u32 = 8;
    /// An error frame in the format of Linux.
    pub const ERROR: u32 = 16;
    /// A packet of a serial line; the identifier is the number of the sending or addressed device.
    pub const PACKET: u32 = 32;
}

crate::state_buffer! {
    /// Health of a field bus since the start of the run.
    ///
    /// ```
    /// use motorium::state::BusHealth;
    ///
    /// assert_eq!(BusHealth::default().state, BusHealth::STOPPED);
    /// ```
    pub struct BusHealth as "motorium.BusHealth" {
        /// State of the controller: one of the constants of this type.
        pub state: u32,
        /// Index of the bus within its component.
        pub bus: u32,
        /// Frames received.
        pub received: u64,
        /// Frames sent.
        pub sent: u64,
        /// Number of frames not sent in time.
        pub unsent: u64,
        /// Number of received frames lost before they reached the graph.
        pub dropped: u64,
        /// Number of device answers that did not arrive in time.
        pub unanswered: u64,
        /// Errors of the bus.
        pub errors: u64,
        /// Number of times that the controller went bus-off.
        pub bus_off: u64,
        /// Fraction of time in which the bus carried bits, 0 to 1.
        pub load: f64,
    }
}

impl BusHealth {
    /// Not started.
    pub const STOPPED: u32 = 0;
    /// Error active: the controller sends and receives.
    pub const ACTIVE: u32 = 1;
    /// Error passive: the controller has counted many errors and no longer signals them actively.
    pub const PASSIVE: u32 = 2;
    /// Bus-off: the controller has left the bus.
    pub const BUS_OFF: u32 = 3;
    /// Error warning: the controller has counted many errors, but still sends and receives.
    pub const WARNING: u32 = 4;
    /// The interface is down or missing.
    pub const DOWN: u32 = 5;
}
