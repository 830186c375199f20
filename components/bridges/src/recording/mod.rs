//! Recordings: MCAP files with every sample of a run, written by `log.record` and read by the command-line
//! tools.
//!
//! In addition to the channels of [`foxglove`](crate::foxglove) for each topic, a file contains:
//!
//! | name | holds |
//! |---|---|
//! | channel `/log` | the events of the run, `foxglove.Log` |
//! | channel `motorium/events` | the events with their kinds, severities and values, `motorium.v1.Event` |
//! | channel `/robot_description` | the robot's URDF, once |
//! | attachments `plan.json`, the graph file, `machine.json`, `ROBOT.urdf` | description of the run and the machine |
//! | metadata `motorium` | version, graph, clock, seed, time of the start |
//! | metadata `recording`, at the end | samples and losses of each topic |
//!
//! Message times are publication times. In a real-time run they are measured since 1970. In lockstep they are
//! measured since the start of the run, and each episode starts where the previous one ended.

mod analysis;
mod batch;
mod component;
mod csv;
mod demonstration;
mod ease;
mod entries;
mod file;
mod film;
mod head;
mod lerobot;
mod machine;
mod order;
mod other;
mod outcome;
mod reader;
mod recorded;
mod recorder;
mod recover;
mod replaced;
mod replay;
mod scan;
mod score;
mod settings;
mod signals;
mod sink;
mod spans;
mod table;
mod taps;
mod threads;
mod verify;

pub use analysis::{Analysis, EventLine, TopicAnalysis, TrackedJoint, Tracking, analyse, quantile};
pub use component::{Record, RecordConfig};
pub use csv::{TableError, write_csv};
pub use demonstration::{Demonstration, DemonstrationError};
pub use entries::{Entries, Entry, Images, RecordedPicture, RecordedSample, Samples};
pub use film::film;
pub use lerobot::{
    Camera, Dataset, DatasetCounts, DatasetError, usual_cameras, usual_signals, write_lerobot,
};
pub use order::InOrder;
pub use other::{Opened, OtherLog, open};
pub use reader::{ReadError, Recording};
pub use recorded::{RecordedPictures, RecordedTopic};
pub use recover::{Recovered, recover};
pub use replaced::{ease_in, loggers, replaced, replayed};
pub use replay::{Eased, Replay, ReplayConfig, replay_kind};
pub use score::{
    GoalScore, JointScore, JointsScore, PoseScore, Score, Tolerance, score, spectral_arc_length,
};
pub use signals::{Curve, Envelope, Signal, SignalError, SignalsError, curves};
pub use table::write_parquet;
pub use verify::{Difference, Verification, VerifyError, What, verify};

use motorium_recordings::messages::metadata::{LAYOUT, TOPIC};

/// Profile of the files, in their header.
const PROFILE: &str = "motorium";
/// Name of the metadata record with the facts of the run.
const RUN: &str = "motorium";
/// Name of the metadata record with the counts of the recording.
const COUNTS: &str = "recording";
/// Key of that record in a recording that only keeps the end of a run: the length of the kept period, ns. The
/// counts cover the whole run.
const KEPT: &str = "kept ns";
/// Name of the metadata record with the losses of a recovered recording.
const RECOVERED: &str = "recovered";
/// Name of the attachment with the plan.
const PLAN: &str = "plan.json";
/// Metadata key of an exact channel: the hash of its layout.
const HASH: &str = "layout_hash";
/// Name of the channel with the events of a run.
const EVENTS: &str = "motorium/events";
