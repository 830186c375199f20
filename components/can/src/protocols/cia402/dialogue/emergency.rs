//! Emergency messages of CiA 402 drives.

use crate::drive::Fault;
use crate::protocols::cia402::codec::Emergency;
use crate::protocols::dialogue::Response;

/// Returns the content of an emergency message: an error, or the end of an error with a code of 0x00xx.
pub(super) fn response(emergency: Emergency) -> Response {
    match emergency.code >> 8 {
        0 => Response::Other,
        _ => Response::Emergency { fault: fault(emergency.code), is_present: emergency.register != 0 },
    }
}

/// Returns the fault for a CiA 402 error code.
pub(super) fn fault(code: u16) -> Fault {
    match code {
        0x8130 => Fault::CommunicationLost,
        0x2300..=0x23ff => Fault::OverCurrent,
        0x3210..=0x321f => Fault::OverVoltage,
        0x3220..=0x322f => Fault::UnderVoltage,
        0x4310..=0x431f => Fault::HotTransistors,
        0x4300..=0x43ff => Fault::HotMotor,
        0x7300..=0x73ff => Fault::Encoder,
        code => Fault::Other(code.into()),
    }
}
