//! MCAP files written by any program: records, channels and decoded messages.
//!
//! [`MessageLog`] lists the channels of a file and decodes their messages into [`Value`]s, using the schemas
//! in the file:
//!
//! | message encoding | schema encoding |
//! |---|---|
//! | `cdr` (plain, little or big endian) | `ros2msg`, `ros2idl`, `omgidl` |
//! | `json` | any, or none |
//! | `protobuf` | `protobuf` |
//!
//! A channel with an unsupported encoding or schema format has the [reason](Unsupported) in place of a
//! decoder. Chunks may be uncompressed or compressed with lz4 or zstd. Damaged files are read as far as
//! possible ([`Records`]).

mod cdr;
mod chunks;
mod decoder;
mod definition;
mod framing;
mod idl;
mod lengths;
mod log;
pub mod metadata;
mod msg;
mod protobuf;
mod records;
mod value;
pub mod wire;

pub use decoder::{Damaged, Decoder, Schema, Unsupported};
pub use framing::Summary;
pub use log::{Channel, LogError, Message, MessageLog};
pub use records::{Damage, Records};
pub use value::{Leaf, Number, Value};
