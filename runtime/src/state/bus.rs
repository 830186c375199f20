//! Messages of field buses: CAN frames and the health of a bus.

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
        /// Time at which the kernel or the adapter received the frame, ns on the monotonic clock; 0 for a
        /// frame to be sent.
        pub receive_time: u64,
        /// CAN identifier, 11 or 29 bits.
        pub id: u32,
        /// Flags: a combination of the constants of this type.
        pub flags: u32,
        /// Index of the bus within the component that owns it.
        pub bus: u32,
        /// Number of bytes of `data` in use, 0 to 64.
        pub length: u32,
        /// Payload; the first `length` bytes are in use.
        pub data: [u8; 64],
    }
}

impl CanFrame {
    /// Flag: the identifier has 29 bits.
    pub const EXTENDED: u32 = 1;
    /// Flag: a CAN FD frame.
    pub const FD: u32 = 2;
    /// Flag: the data was sent at the higher CAN FD bit rate.
    pub const BIT_RATE_SWITCH: u32 = 4;
    /// Flag: a remote frame, which requests data but contains no data.
    pub const REMOTE: u32 = 8;
    /// Flag: an error frame in the format of Linux SocketCAN.
    pub const ERROR: u32 = 16;
    /// Flag: a packet of a serial bus. The identifier is the number of the sending or addressed device.
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
        /// Index of the bus within the component that owns it.
        pub bus: u32,
        /// Number of frames received.
        pub received: u64,
        /// Number of frames sent.
        pub sent: u64,
        /// Number of frames that could not be sent in time.
        pub unsent: u64,
        /// Number of received frames lost before they reached the graph.
        pub dropped: u64,
        /// Number of device answers that did not arrive in time.
        pub unanswered: u64,
        /// Number of bus errors.
        pub errors: u64,
        /// Number of times that the controller went bus-off.
        pub bus_off: u64,
        /// Bus load: fraction of time in which the bus carried bits, 0 to 1.
        pub load: f64,
    }
}

impl BusHealth {
    /// State: not started.
    pub const STOPPED: u32 = 0;
    /// State: error active. The controller sends and receives.
    pub const ACTIVE: u32 = 1;
    /// State: error passive. The controller has counted many errors and has stopped signalling errors
    /// actively.
    pub const PASSIVE: u32 = 2;
    /// State: bus-off. The controller has left the bus.
    pub const BUS_OFF: u32 = 3;
    /// State: error warning. The controller has counted many errors. It sends and receives as in the error
    /// active state.
    pub const WARNING: u32 = 4;
    /// State: the interface is down or missing.
    pub const DOWN: u32 = 5;
}
