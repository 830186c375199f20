//! The displayed position in a recording, and its playback.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use foxglove::websocket::{PlaybackCommand, PlaybackControlRequest, PlaybackState, PlaybackStatus};

/// Slowest and fastest speed, relative to the recording.
const SPEEDS: [f64; 2] = [0.01, 100.0];

/// A position in a recording that advances with time, and on request of viewers.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Player {
    start_ns: u64,
    end_ns: u64,
    /// Position since the start of the recording, ns.
    place: f64,
    speed: f64,
    plays: bool,
    /// `true` until a viewer subscribes or sends a request; the player is at the start.
    waits: bool,
    /// `true` if the position was set since the last step.
    sought: bool,
}

/// The move of one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Moved {
    /// Current position, as recording time, ns.
    pub(crate) to_ns: u64,
    /// `true` after a seek: viewers must discard earlier data.
    pub(crate) sought: bool,
    /// `true` if this step reached the end.
    pub(crate) ended: bool,
}

impl Player {
    /// Creates a player at the start, which plays as soon as a viewer subscribes.
    pub(crate) fn new((start_ns, end_ns): (u64, u64)) -> Self {
        Self { start_ns, end_ns, place: 0.0, speed: 1.0, plays: true, waits: true, sought: true }
    }

    /// Advances by a time of the viewer.
    pub(crate) fn step(&mut self, passed: Duration) -> Moved {
        let length = self.length();
        let was = self.place;
        if self.plays && !self.waits && !self.sought {
            self.place = (was + passed.as_nanos() as f64 * self.speed).min(length);
        }
        let ended = self.plays && self.place >= length;
        self.plays &= !ended;
        Moved { to_ns: self.time_ns(), sought: std::mem::take(&mut self.sought), ended }
    }

    /// Plays or pauses at a speed, optionally from another position. Playing at the end restarts from the
    /// beginning.
    pub(crate) fn set(&mut self, plays: bool, speed: f64, seek_ns: Option<u64>) {
        if speed.is_finite() && speed > 0.0 {
            self.speed = speed.clamp(SPEEDS[0], SPEEDS[1]);
        }
        let again = plays && !self.plays && seek_ns.is_none() && self.place >= self.length();
        if let Some(place) = seek_ns.or(again.then_some(self.start_ns)) {
            self.place = place.clamp(self.start_ns, self.end_ns).saturating_sub(self.start_ns) as f64;
            self.sought = true;
        }
        self.plays = plays;
        self.waits = false;
    }

    /// Records that a client has subscribed.
    pub(crate) fn begin(&mut self) {
        self.waits = false;
    }

    /// Handles Foxglove's playback control and returns the new state.
    pub(crate) fn obey(&mut self, request: PlaybackControlRequest) -> PlaybackState {
        let plays = request.playback_command == PlaybackCommand::Play;
        self.set(plays, f64::from(request.playback_speed), request.seek_time);
        PlaybackState { request_id: Some(request.request_id), ..self.state() }
    }

    /// Returns the state for Foxglove viewers.
    pub(crate) fn state(&self) -> PlaybackState {
        let status = match (self.plays, self.place >= self.length()) {
            (true, _) => PlaybackStatus::Playing,
            (false, true) => PlaybackStatus::Ended,
            (false, false) => PlaybackStatus::Paused,
        };
        PlaybackState {
            status,
            current_time: self.time_ns(),
            playback_speed: self.speed as f32,
            did_seek: self.sought,
            request_id: None,
        }
    }

    /// Returns the recording and position for the viewer's own page.
    pub(crate) fn position_json(&self) -> serde_json::Value {
        serde_json::json!({
            "length_s": self.length() * 1e-9,
            "place_s": self.place * 1e-9,
            "speed": self.speed,
            "plays": self.plays,
        })
    }

    /// Returns the recording time at a position in seconds from the start, ns.
    pub(crate) fn time_at(&self, place_s: f64) -> u64 {
        self.start_ns.saturating_add((place_s * 1e9) as u64)
    }

    /// Returns the speed relative to the recording.
    pub(crate) fn speed(&self) -> f64 {
        self.speed
    }

    fn length(&self) -> f64 {
        self.end_ns.saturating_sub(self.start_ns) as f64
    }

    fn time_ns(&self) -> u64 {
        self.start_ns + self.place as u64
    }
}

/// A player that the listeners of the server share with the thread that plays.
pub(crate) type Shared = Arc<Mutex<Player>>;

#[cfg(test)]
mod tests {
    use super::*;

    const START: u64 = 1_700_000_000_000_000_000;
    const SECOND: u64 = 1_000_000_000;

    fn player() -> Player {
        let mut player = Player::new((START, START + 10 * SECOND));
        assert!(player.step(Duration::from_secs(1)).sought, "it begins at the start");
        assert_eq!(player.step(Duration::from_secs(5)).to_ns, START, "nobody looks");
        player.begin();
        player
    }

    fn ask(command: PlaybackCommand, seek_time: Option<u64>) -> PlaybackControlRequest {
        PlaybackControlRequest {
            playback_command: command,
            playback_speed: 2.0,
            seek_time,
            request_id: "one".into(),
        }
    }

    #[test]
    fn player_moves_at_its_speed_and_stops_at_the_end() {
        let mut player = player();
        assert_eq!(player.step(Duration::from_secs(3)).to_ns, START + 3 * SECOND);
        player.set(true, 2.0, None);
        assert_eq!(
            player.step(Duration::from_secs(3)),
            Moved { to_ns: START + 9 * SECOND, sought: false, ended: false }
        );
        assert_eq!(
            player.step(Duration::from_secs(3)),
            Moved { to_ns: START + 10 * SECOND, sought: false, ended: true }
        );
        assert_eq!(player.state().status, PlaybackStatus::Ended);
        assert_eq!(
            player.step(Duration::from_secs(3)),
            Moved { to_ns: START + 10 * SECOND, sought: false, ended: false }
        );
    }

    #[test]
    fn pause_holds_the_position_and_seek_is_reported_once() {
        let mut player = player();
        let state = player.obey(ask(PlaybackCommand::Pause, Some(START + 4 * SECOND)));
        assert_eq!((state.status, state.current_time), (PlaybackStatus::Paused, START + 4 * SECOND));
        assert!(state.did_seek && state.request_id.as_deref() == Some("one") && state.playback_speed == 2.0);
        assert_eq!(
            player.step(Duration::from_secs(1)),
            Moved { to_ns: START + 4 * SECOND, sought: true, ended: false }
        );
        assert_eq!(
            player.step(Duration::from_secs(1)),
            Moved { to_ns: START + 4 * SECOND, sought: false, ended: false }
        );
    }

    #[test]
    fn play_at_the_end_restarts_and_positions_are_clamped() {
        let mut player = player();
        player.set(false, 1.0, Some(START + 99 * SECOND));
        assert_eq!(player.step(Duration::ZERO).to_ns, START + 10 * SECOND);
        player.set(true, f64::NAN, None);
        assert_eq!(player.step(Duration::from_secs(1)), Moved { to_ns: START, sought: true, ended: false });
        player.set(true, -1.0, Some(0));
        assert_eq!((player.step(Duration::ZERO).to_ns, player.speed()), (START, 1.0));
    }
}
