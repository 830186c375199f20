//! Description of the machine on which a run was recorded.

use motorium::os::machine;

/// Describes this machine as JSON.
pub(super) fn facts() -> serde_json::Value {
    let kernel = machine::Kernel::detect();
    serde_json::json!({
        "kernel": format!("{} {}", kernel.release, kernel.version),
        "preemption": kernel.preemption(),
        "processor": machine::processor(),
        "cores": machine::online_cores().len(),
        "isolated_cores": machine::isolated_cores(),
        "governor": machine::governor(0),
        "clock_source": machine::clock_source(),
        "virtual": machine::is_virtual(),
        "architecture": std::env::consts::ARCH,
    })
}
