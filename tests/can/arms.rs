//! Drive tables, and the graph of an arm that is simulated together with its drives on kernel interfaces.

/// A graph with this name: the arm of `urdf`, and its drives at `rate` on the buses of the drive table
/// `table`.
pub(crate) fn graph(name: &str, urdf: &str, rate: &str, table: &str) -> String {
    format!(
        r#"
name  = "{name}"
clock = "realtime"

[robot.arm]
urdf = "{urdf}"

[component.physics]
kind      = "physics.articulated"
robot     = "arm"
rate      = "1 kHz"
budget    = "150 us"
config    = {{ plant = true }}
subscribe = {{ joint_command = "drive_efforts" }}
publish   = {{ joint_state = "true_joint_state" }}

[component.drives]
kind      = "can.drive_sim"
robot     = "arm"
rate      = "{rate}"
budget    = "60 us"
subscribe = {{ joint_state = "true_joint_state" }}
publish   = {{ joint_command = "drive_efforts" }}
config    = {{ drives = "{table}" }}
"#
    )
}

/// A bus of 1 Mbit/s; if `fast`, a CAN FD bus with a data bit rate of 5 Mbit/s.
pub(crate) fn bus(name: &str, interface: &str, fast: bool) -> String {
    let data = if fast { "data_bitrate = 5_000_000\n" } else { "" };
    format!("[[bus]]\nname = \"{name}\"\ninterface = \"{interface}\"\nbitrate = 1_000_000\n{data}\n")
}

/// A drive with the protocol keys `protocol`, and with the ranges of its frames: position \[rad\], velocity
/// \[rad/s\] and torque \[N m\].
pub(crate) fn drive(
    joint: &str,
    bus: &str,
    protocol: &str,
    [position, velocity, torque]: [f64; 3],
) -> String {
    format!(
        "[[drive]]\njoint = \"{joint}\"\nbus = \"{bus}\"\n{protocol}\nwatchdog = \"20 ms\"\n\
         ranges = {{ position = {position:?}, velocity = {velocity:?}, torque = {torque:?} }}\n\n"
    )
}
