//! Recordings as datasets of LeRobot, in the format of version 3.0: episodes of frames at a fixed rate, in
//! Parquet.
//!
//! | file | holds |
//! |---|---|
//! | `data/chunk-000/file-000.parquet` | the frames: `observation.state`, `action`, `timestamp`, `frame_index`, `episode_index`, `index`, `task_index`; `observation.images.CAMERA` as PNG files within the table; an episode is a row group, with pictures one for every 200 frames |
//! | `meta/info.json` | version, rate, counts, features with the names of their numbers |
//! | `meta/stats.json` | least, greatest, mean, standard deviation, quantiles and count of each feature |
//! | `meta/tasks.parquet` | the description of the task |
//! | `meta/episodes/chunk-000/file-000.parquet` | first frame, end, length and statistics of each episode |
//!
//! <https://huggingface.co/docs/lerobot/lerobot-dataset-v3>

mod choice;
mod dataset;
mod error;
mod frames;
mod pictures;
mod stats;

use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};
use std::path::Path;

use serde_json::{Value, json};

use super::Recording;
use crate::parquet::{Column, Values, write};
pub use choice::usual_signals;
pub use dataset::{Camera, Dataset};
pub use error::DatasetError;
use frames::Frames;
pub use pictures::usual_cameras;
use stats::{Numbers, Stats};

/// Version of the format.
const VERSION: &str = "v3.0";
const DATA: &str = "data/chunk-000/file-000.parquet";
const EPISODES: &str = "meta/episodes/chunk-000/file-000.parquet";
const TASKS: &str = "meta/tasks.parquet";

/// Frames per row group with images: the data of a row group must stay below two gigabytes.
const GROUP: usize = 200;

/// Size of a written dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DatasetCounts {
    /// Number of episodes.
    pub episodes: usize,
    /// Number of frames of all episodes.
    pub frames: usize,
}

/// Writes a recording as a dataset into a folder. Each frame contains the latest samples at its time. The
/// first frame of an episode is at the time when every signal has a sample.
///
/// # Errors
/// Returns an error if the recording cannot be read or lacks the signals, or the files cannot be written.
pub fn write_lerobot(
    recording: &Recording,
    dataset: &Dataset,
    folder: &Path,
) -> Result<DatasetCounts, DatasetError> {
    let frames = Frames::read(recording, dataset)?;
    let total = frames.timestamp.len();
    if total == 0 {
        return Err(DatasetError::Empty);
    }
    let lengths = &frames.lengths;
    let columns = frames.columns();
    let most = if frames.pictures.is_empty() { usize::MAX } else { GROUP };
    let groups =
        lengths.iter().flat_map(|length| (0..*length).step_by(most).map(move |at| (length - at).min(most)));
    table(folder, DATA, &columns, &groups.collect::<Vec<_>>(), &[])?;
    let of_pictures = frames.pictures.iter().flat_map(|pictures| pictures.stats_of_episodes(lengths));
    let of_numbers = stats_of_episodes(&columns, lengths);
    let of_episodes = [episodes(lengths, &dataset.task), of_numbers, of_pictures.collect()].concat();
    table(folder, EPISODES, &of_episodes, &[lengths.len()], &[])?;
    let tasks = [
        Column { name: "task_index".to_string(), values: Values::Int64(vec![0]) },
        Column { name: "task".to_string(), values: Values::Text(vec![dataset.task.clone()]) },
    ];
    table(folder, TASKS, &tasks, &[1], &[("pandas", index_of_tasks().to_string())])?;
    let stats = numbers(&columns).map(|column| {
        (column.name.clone(), Stats::from_rows(&Numbers::from_values(&column.values), 0..total).json())
    });
    let of_pictures = frames.pictures.iter().map(|pictures| (pictures.feature(), pictures.stats()));
    let stats: serde_json::Map<String, Value> = stats.chain(of_pictures).collect();
    text(folder, "meta/stats.json", &Value::Object(stats))?;
    text(folder, "meta/info.json", &info(dataset, &frames))?;
    Ok(DatasetCounts { episodes: lengths.len(), frames: total })
}

fn info(dataset: &Dataset, frames: &Frames) -> Value {
    let scalar = |dtype: &str| json!({ "dtype": dtype, "shape": [1], "names": null });
    let vector = |width: usize, names: &[String]| {
        let names = if names.len() == width { json!(names) } else { Value::Null };
        json!({ "dtype": "float32", "shape": [width], "names": names })
    };
    let [state, action] = frames.names(dataset);
    let (episodes, total) = (frames.lengths.len(), frames.timestamp.len());
    let mut features = json!({
        "observation.state": vector(frames.widths[0], &state),
        "action": vector(frames.widths[1], &action),
        "timestamp": scalar("float32"),
        "frame_index": scalar("int64"),
        "episode_index": scalar("int64"),
        "index": scalar("int64"),
        "task_index": scalar("int64"),
    });
    for pictures in &frames.pictures {
        features[pictures.feature()] = pictures.info();
    }
    json!({
        "codebase_version": VERSION,
        "robot_type": dataset.robot,
        "total_episodes": episodes,
        "total_frames": total,
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": dataset.fps,
        "splits": { "train": format!("0:{episodes}") },
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": null,
        "features": features,
    })
}

/// Columns with the position of each episode in the data.
fn episodes(lengths: &[usize], task: &str) -> Vec<Column> {
    let ends = lengths.iter().scan(0, |end, length| {
        *end += length;
        Some(*end as i64)
    });
    let ends: Vec<i64> = ends.collect();
    let lengths: Vec<i64> = lengths.iter().map(|length| *length as i64).collect();
    let starts = ends.iter().zip(&lengths).map(|(end, length)| end - length).collect();
    let column = |name: &str, values| Column { name: name.to_string(), values };
    let zeros = || Values::Int64(vec![0; lengths.len()]);
    let tasks = Values::List {
        lengths: vec![1; lengths.len()],
        entries: Box::new(Values::Text(vec![task.to_string(); lengths.len()])),
    };
    vec![
        column("episode_index", Values::Int64((0..lengths.len() as i64).collect())),
        column("tasks", tasks),
        column("length", Values::Int64(lengths.clone())),
        column("dataset_from_index", Values::Int64(starts)),
        column("dataset_to_index", Values::Int64(ends)),
        column("data/chunk_index", zeros()),
        column("data/file_index", zeros()),
        column("meta/episodes/chunk_index", zeros()),
        column("meta/episodes/file_index", zeros()),
    ]
}

/// Returns the columns other than images.
fn numbers(columns: &[Column]) -> impl Iterator<Item = &Column> {
    columns.iter().filter(|column| !matches!(column.values, Values::Group(_)))
}

/// Statistics of each episode, in one column per statistic and feature.
fn stats_of_episodes(columns: &[Column], lengths: &[usize]) -> Vec<Column> {
    let mut made = Vec::new();
    for column in numbers(columns) {
        let (read, mut begin) = (Numbers::from_values(&column.values), 0);
        let of_episode = |length: &usize| {
            begin += length;
            Stats::from_rows(&read, begin - length..begin)
        };
        let stats: Vec<Stats> = lengths.iter().map(of_episode).collect();
        let mut add = |name: &str, entries: Values| {
            let lengths = vec![entries.len() / stats.len().max(1); stats.len()];
            let values = Values::List { lengths, entries: Box::new(entries) };
            made.push(Column { name: format!("stats/{}/{name}", column.name), values });
        };
        let named: Vec<_> = stats.iter().map(Stats::named).collect();
        let names = named.first().into_iter().flatten().map(|(name, _)| *name);
        for (place, name) in names.enumerate() {
            add(name, Values::Double(named.iter().flat_map(|of| of[place].1.clone()).collect()));
        }
        add("count", Values::Int64(stats.iter().map(|stats| stats.count() as i64).collect()));
    }
    made
}

/// Metadata that makes pandas use the task texts as the index, where LeRobot looks them up.
fn index_of_tasks() -> Value {
    let column = |name: &str, kind: &str, numpy: &str| json!({ "name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": null });
    json!({
        "index_columns": ["task"],
        "column_indexes": [{
            "name": null, "field_name": null, "pandas_type": "unicode", "numpy_type": "object",
            "metadata": { "encoding": "UTF-8" },
        }],
        "columns": [column("task_index", "int64", "int64"), column("task", "unicode", "object")],
        "pandas_version": "2.2.0",
    })
}

fn table(
    folder: &Path,
    name: &str,
    columns: &[Column],
    groups: &[usize],
    facts: &[(&str, String)],
) -> Result<(), DatasetError> {
    let path = folder.join(name);
    let written = make(&path).and_then(|mut file| {
        write(&mut file, columns, groups, facts)?;
        file.flush()
    });
    written.map_err(|source| DatasetError::Write { path, source })
}

fn text(folder: &Path, name: &str, value: &Value) -> Result<(), DatasetError> {
    let path = folder.join(name);
    let written = make(&path).and_then(|mut file| {
        serde_json::to_writer_pretty(&mut file, value)?;
        file.flush()
    });
    written.map_err(|source| DatasetError::Write { path, source })
}

fn make(path: &Path) -> io::Result<BufWriter<File>> {
    path.parent().map_or(Ok(()), fs::create_dir_all)?;
    Ok(BufWriter::new(File::create(path)?))
}
