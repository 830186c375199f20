//! Frames of a dataset: signals of a recording, resampled at a fixed rate.

use std::iter::Peekable;

use motorium::nearest::suggest;
use motorium::state::Decoder;

use super::super::signals::as_f64;
use super::super::{RecordedSample, Recording, Signal, SignalsError};
use super::dataset::Dataset;
use super::error::DatasetError;
use super::pictures::Pictures;
use crate::parquet::{Column, Values};

/// `state` and `action`.
const WHAT: [&str; 2] = ["state", "action"];

/// Frames of all episodes, stored by column.
#[derive(Debug, Default)]
pub(super) struct Frames {
    /// Lengths of the state and of the action in a frame.
    pub(super) widths: [usize; 2],
    /// Numbers of all frames.
    numbers: [Vec<f32>; 2],
    /// Time since the first frame of the episode, s.
    pub(super) timestamp: Vec<f32>,
    /// Frames of each episode.
    pub(super) lengths: Vec<usize>,
    /// Time of each frame in the recording, ns.
    times_ns: Vec<u64>,
    /// Images of each camera.
    pub(super) pictures: Vec<Pictures>,
}

/// Signal that is read from the recording.
struct Source {
    what: usize,
    topic: usize,
    signal: Signal,
    decoder: Decoder,
    /// Newest numbers in the episode.
    newest: Option<Vec<f32>>,
}

impl Source {
    fn new(recording: &Recording, what: usize, signal: &Signal) -> Result<Self, SignalsError> {
        let topics = recording.topics();
        let topic = recording.topic(&signal.topic).ok_or_else(|| SignalsError::NoTopic {
            topic: signal.topic.clone(),
            advice: suggest(&signal.topic, topics.iter().map(|topic| topic.name.as_str()), "its topics are"),
        })?;
        let layout = &topics[topic].layout;
        let names =
            || layout.fields.iter().map(|field| field.name.as_str()).filter(|name| *name != "reserved");
        if let Some(field) = &signal.field
            && !names().any(|name| name == field)
        {
            let advice = suggest(field, names(), "its fields are");
            return Err(SignalsError::NoField { topic: signal.topic.clone(), field: field.clone(), advice });
        }
        let decoder = Decoder::new(layout)?;
        Ok(Self { what, topic, signal: signal.clone(), decoder, newest: None })
    }

    fn take(&mut self, sample: &RecordedSample) -> Result<(), SignalsError> {
        let mut found = Vec::new();
        for (name, value) in &self.decoder.decode(&sample.bytes)?.0 {
            if self.signal.field.as_deref().is_some_and(|wanted| wanted != *name) {
                continue;
            }
            let all = value.numbers();
            let chosen = match &self.signal.entries {
                Some(entries) => all.get(entries.start..entries.end.min(all.len())).unwrap_or(&[]),
                None => all,
            };
            found.extend(chosen.iter().map(|number| as_f64(*number) as f32));
        }
        self.newest = Some(found);
        Ok(())
    }
}

impl Frames {
    pub(super) fn read(recording: &Recording, dataset: &Dataset) -> Result<Self, DatasetError> {
        let mut sources = Vec::new();
        for (what, signals) in [&dataset.state, &dataset.action].into_iter().enumerate() {
            for signal in signals {
                sources.push(Source::new(recording, what, signal)?);
            }
        }
        let begin_ns = recording.times().map_or(0, |(first, _)| first);
        let topics: Vec<usize> = sources.iter().map(|source| source.topic).collect();
        let is_wanted = |sample: &RecordedSample| topics.contains(&sample.topic);
        let samples = recording.in_order().filter(|sample| sample.as_ref().map_or(true, is_wanted));
        let mut samples = samples.map(|sample| sample.map_err(SignalsError::from)).peekable();
        let mut frames =
            Self { pictures: Pictures::from_recording(recording, &dataset.cameras)?, ..Self::default() };
        while samples.peek().is_some() {
            frames.episode(&mut samples, &mut sources, dataset.fps, begin_ns)?;
        }
        let Self { pictures, times_ns, lengths, .. } = &mut frames;
        for of_camera in pictures {
            of_camera.read(recording, times_ns, lengths)?;
        }
        Ok(frames)
    }

    /// Reads the frames of the episode to which the next samples belong.
    fn episode(
        &mut self,
        samples: &mut Peekable<impl Iterator<Item = Result<RecordedSample, SignalsError>>>,
        sources: &mut [Source],
        fps: u32,
        begin_ns: u64,
    ) -> Result<(), DatasetError> {
        sources.iter_mut().for_each(|source| source.newest = None);
        let before = self.timestamp.len();
        let mut first_ns = None;
        let Some(Ok(first)) = samples.peek() else {
            return samples.next().map_or(Ok(()), |failed| Ok(failed.map(drop)?));
        };
        let (number, begun_ns) = (first.stamp.episode, first.time_ns);
        // In real time, each component enters an episode at its next step. A slow one still publishes in the
        // previous episode after a fast one has entered the next.
        let in_episode = |sample: &Result<RecordedSample, SignalsError>| {
            sample.as_ref().map_or(true, |sample| sample.stamp.episode <= number)
        };
        let pictured = self.pictures.iter().map(|pictures| pictures.first_from(begun_ns).unwrap_or(u64::MAX));
        let pictured_ns = pictured.max().unwrap_or(0);
        // Computed from the first frame, so a rate whose period is not a whole number of nanoseconds does not
        // drift.
        let frame_ns = |first_ns: u64, index: usize| {
            first_ns + (index as u128 * 1_000_000_000 / u128::from(fps.max(1))) as u64
        };
        while let Some(sample) = samples.next_if(in_episode) {
            let sample = sample?;
            for source in sources.iter_mut().filter(|source| source.topic == sample.topic) {
                source.take(&sample)?;
            }
            // A sample at exactly the time of a frame belongs to that frame.
            let next = samples.peek().filter(|next| in_episode(next)).and_then(|next| next.as_ref().ok());
            let next_ns = next.map_or(sample.time_ns + 1, |next| next.time_ns);
            let is_whole = sources.iter().all(|source| source.newest.is_some()) && pictured_ns < next_ns;
            if next_ns == sample.time_ns || !is_whole {
                continue;
            }
            let first_ns = *first_ns.get_or_insert(sample.time_ns.max(pictured_ns));
            while frame_ns(first_ns, self.timestamp.len() - before) < next_ns {
                self.times_ns.push(frame_ns(first_ns, self.timestamp.len() - before));
                self.frame(sources, (self.timestamp.len() - before) as f64 / f64::from(fps.max(1))).map_err(
                    |(what, found)| DatasetError::Width {
                        what: WHAT[what],
                        found,
                        expected: self.widths[what],
                        least: found.min(self.widths[what]),
                        time_s: sample.time_ns.saturating_sub(begin_ns) as f64 * 1e-9,
                    },
                )?;
            }
        }
        let length = self.timestamp.len() - before;
        self.lengths.extend((length > 0).then_some(length));
        Ok(())
    }

    /// Adds a frame. On a change of width, returns the signal and its width.
    fn frame(&mut self, sources: &[Source], time_s: f64) -> Result<(), (usize, usize)> {
        for what in 0..2 {
            let newest = sources.iter().filter(|source| source.what == what);
            let numbers: Vec<f32> =
                newest.filter_map(|source| source.newest.as_deref()).flatten().copied().collect();
            if self.timestamp.is_empty() {
                self.widths[what] = numbers.len();
            } else if self.widths[what] != numbers.len() {
                return Err((what, numbers.len()));
            }
            self.numbers[what].extend(numbers);
        }
        self.timestamp.push(time_s as f32);
        Ok(())
    }

    /// Columns of the data. A feature of one number is not stored as a list.
    pub(super) fn columns(&self) -> Vec<Column> {
        let total = self.timestamp.len();
        let column = |name: &str, values| Column { name: name.to_string(), values };
        let vector = |what: usize| match self.widths[what] {
            1 => Values::Float(self.numbers[what].clone()),
            width => Values::List {
                lengths: vec![width; total],
                entries: Box::new(Values::Float(self.numbers[what].clone())),
            },
        };
        let episodes = || self.lengths.iter().copied().enumerate();
        let within = episodes().flat_map(|(_, length)| 0..length as i64).collect();
        let of =
            episodes().flat_map(|(episode, length)| core::iter::repeat_n(episode as i64, length)).collect();
        let numbers = vec![
            column("observation.state", vector(0)),
            column("action", vector(1)),
            column("timestamp", Values::Float(self.timestamp.clone())),
            column("frame_index", Values::Int64(within)),
            column("episode_index", Values::Int64(of)),
            column("index", Values::Int64((0..total as i64).collect())),
            column("task_index", Values::Int64(vec![0; total])),
        ];
        numbers.into_iter().chain(self.pictures.iter().map(Pictures::column)).collect()
    }

    /// Names of the entries of state and action; entries without a name are named after the signal and their
    /// index.
    pub(super) fn names(&self, dataset: &Dataset) -> [Vec<String>; 2] {
        let signals = [&dataset.state, &dataset.action];
        core::array::from_fn(|what| {
            let width = self.widths[what];
            if dataset.names[what].len() == width {
                return dataset.names[what].clone();
            }
            let of = match signals[what].as_slice() {
                [one] => one.field.clone().unwrap_or_else(|| one.topic.clone()),
                _ => WHAT[what].to_string(),
            };
            (0..width).map(|index| format!("{of}_{index}")).collect()
        })
    }
}
