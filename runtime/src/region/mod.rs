//! The control block of a run in shared memory: its lifecycle, its lockstep ticks, and its measurements.
//!
//! The control block is a file in the run's folder, mapped by the launcher, every worker, the guard and the
//! tools. It consists of atomics for which zero bytes are valid. Each part has one writer, named in its
//! documentation, except for the event log, which has several.

mod blocks;
mod checkpoint;
mod counter;
mod end;
mod events;
mod gate;
mod header;
mod mapping;
mod trace;
mod trace_ends;
mod turn;

pub use blocks::{ComponentBlock, EdgeBlock, LatencyBlock, MissCause, Misses, Stalls, TopicBlock};
pub use checkpoint::CHECKPOINT_BYTES;
pub(crate) use checkpoint::CheckpointBlock;
#[cfg(test)]
pub(crate) use checkpoint::Checkpoints;
pub(crate) use counter::add;
pub(crate) use end::panic_end;
pub use end::{Activity, End, Failure, Hang, PanicOrigin};
pub use events::{EVENT_TEXT_BYTES, EventKind, EventLog, EventReader, EventRecord, EventSeverity};
#[cfg(test)]
pub(crate) use events::{Ring, RingFound};
pub use gate::{GateBlock, GateReport, GateState, Latch, LimitKind, Limited, Refusal, Refused};
pub use header::{Command, EpisodeStart, Header, Phase};
pub use mapping::{Region, RegionError, layout_digest};
pub use trace::TraceEvent;
pub use trace_ends::TraceReader;
pub(crate) use trace_ends::TraceWriter;
pub use turn::TurnBlock;
