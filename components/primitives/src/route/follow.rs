//! A route in progress.

use super::{Place, RouteSettings, RouteStep, Stop, turn_between};
use crate::profile::Profile;

/// Execution of a route by a wheeled base. Only [`new`](Self::new) allocates.
#[derive(Clone, Debug)]
pub struct Route {
    stops: Vec<Stop>,
    settings: RouteSettings,
    current: usize,
    stage: Stage,
    /// Time since the stage began \[s\].
    elapsed: f64,
    /// Start and end of the stage.
    from: Place,
    to: Place,
    profile: Profile,
    turning: Profile,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// Before the first step, or before the start to the next stop.
    Setting,
    /// Turning on the spot to face the stop.
    Facing,
    /// Driving to the stop.
    Driving,
    /// Turning on the spot to the stop's angle.
    Aligning,
    /// At the stop.
    Dwelling,
    Finished,
}

impl Route {
    /// Creates a route through `stops`. The route begins with the first call of [`step`](Self::step). Without
    /// stops, the route is finished immediately.
    pub fn new(stops: Vec<Stop>, settings: RouteSettings) -> Self {
        let stage = if stops.is_empty() { Stage::Finished } else { Stage::Setting };
        Self {
            stops,
            settings,
            current: 0,
            stage,
            elapsed: 0.0,
            from: Place::default(),
            to: Place::default(),
            profile: Profile::rest(),
            turning: Profile::rest(),
        }
    }

    /// Returns the index of the current stop.
    pub fn stop(&self) -> usize {
        self.current
    }

    /// Returns `true` if the route is finished: the base has reached the last stop, and the dwell time is
    /// over.
    pub fn is_finished(&self) -> bool {
        self.stage == Stage::Finished
    }

    /// Advances by a time step `dt` \[s\] and returns the command. `at` is the measured pose of the base in
    /// the world.
    pub fn step(&mut self, at: Place, dt: f64) -> RouteStep {
        self.elapsed += dt;
        let mut stopped = None;
        // A finished stage starts the next; one step advances at most through all stages of one stop.
        for _ in 0..5 {
            if !self.is_over(at) {
                break;
            }
            if self.stage == Stage::Dwelling {
                stopped = Some(self.to);
            }
            self.next(at);
        }
        let (command, beside) = self.command(at);
        RouteStep { command, stopped, beside }
    }

    /// Returns `true` if the stage is over for a base at `at`.
    fn is_over(&self, at: Place) -> bool {
        let length = self.profile.duration().max(self.turning.duration());
        let late = self.elapsed >= length + self.settings.grace;
        let [near, aligned] = self.settings.arrival;
        let (ahead, _) = self.off(at, self.to);
        let turned = turn_between(at.yaw, self.to.yaw).abs() <= aligned;
        let here = match self.stage {
            Stage::Setting => return true,
            Stage::Finished => return false,
            Stage::Dwelling => return self.elapsed >= self.stops[self.current].dwell,
            Stage::Facing | Stage::Aligning => turned,
            Stage::Driving if self.settings.sideways => {
                (self.to.x - at.x).hypot(self.to.y - at.y) <= near && turned
            }
            // driving cannot correct the lateral error at the goal
            Stage::Driving => ahead.abs() <= near,
        };
        self.elapsed >= length && (here || late)
    }

    /// Returns the position of a place in base axes: ahead and to the left.
    fn off(&self, at: Place, place: Place) -> (f64, f64) {
        let (dx, dy) = (place.x - at.x, place.y - at.y);
        let (sin, cos) = at.yaw.sin_cos();
        (cos * dx + sin * dy, cos * dy - sin * dx)
    }

    fn next(&mut self, at: Place) {
        let after = match self.stage {
            Stage::Setting if self.settings.sideways => Stage::Driving,
            Stage::Setting => Stage::Facing,
            Stage::Facing => Stage::Driving,
            Stage::Driving if self.settings.sideways => Stage::Dwelling,
            Stage::Driving => Stage::Aligning,
            Stage::Aligning => Stage::Dwelling,
            Stage::Dwelling if self.current + 1 < self.stops.len() => {
                self.current += 1;
                Stage::Setting
            }
            Stage::Dwelling if self.settings.forever => {
                self.current = 0;
                Stage::Setting
            }
            Stage::Dwelling | Stage::Finished => Stage::Finished,
        };
        self.stage = after;
        self.elapsed = 0.0;
        self.plan(at);
    }

    fn plan(&mut self, at: Place) {
        let Stop { position: [x, y], yaw, .. } = self.stops[self.current];
        let (dx, dy) = (x - at.x, y - at.y);
        let way = dx.hypot(dy);
        let is_here = way <= self.settings.arrival[0];
        let heading = if !is_here { at.yaw + turn_between(at.yaw, dy.atan2(dx)) } else { at.yaw };
        let rest = Profile::rest();
        let settings = &self.settings;
        let turn_to = |yaw: f64| Profile::time_optimal(yaw - at.yaw, &settings.turn);
        let aligned = |from: f64| yaw.map_or(from, |yaw| from + turn_between(from, yaw));
        (self.from, self.profile, self.turning) = match self.stage {
            Stage::Setting | Stage::Dwelling | Stage::Finished => return,
            Stage::Facing => {
                self.to = Place { x, y, yaw: heading };
                (at, rest, turn_to(heading))
            }
            Stage::Driving if settings.sideways => {
                self.to = Place { x, y, yaw: aligned(at.yaw) };
                let (drive, turn) = (Profile::time_optimal(way, &settings.drive), turn_to(self.to.yaw));
                let together = drive.duration().max(turn.duration());
                (at, drive.taking(together), turn.taking(together))
            }
            Stage::Driving => {
                // a goal that is no longer ahead counts as reached
                let is_ahead = !is_here && turn_between(at.yaw, heading).abs() < 1.0;
                let ahead = if is_ahead { way } else { 0.0 };
                self.to = Place { x, y, yaw: if ahead > 0.0 { heading } else { at.yaw } };
                (at, Profile::time_optimal(ahead, &settings.drive), rest)
            }
            Stage::Aligning => {
                self.to.yaw = aligned(self.to.yaw);
                (at, rest, turn_to(self.to.yaw))
            }
        };
    }

    /// Returns the velocity in base axes and the distance of the base from its line.
    fn command(&self, at: Place) -> (Place, Option<f64>) {
        let (settings, time) = (&self.settings, self.elapsed);
        match self.stage {
            Stage::Setting | Stage::Finished | Stage::Dwelling => (Place::default(), None),
            Stage::Facing | Stage::Aligning => {
                let turn = self.turning.sample(time);
                let error = turn_between(at.yaw, self.from.yaw + turn.value);
                (Place { yaw: turn.rate + settings.turn_gain * error, ..Place::default() }, None)
            }
            Stage::Driving => {
                let (way, turn) = (self.profile.sample(time), self.turning.sample(time));
                let (dx, dy) = (self.to.x - self.from.x, self.to.y - self.from.y);
                let length = dx.hypot(dy).max(f64::MIN_POSITIVE);
                let (ux, uy) = (dx / length, dy / length);
                let wanted =
                    Place { x: self.from.x + way.value * ux, y: self.from.y + way.value * uy, yaw: 0.0 };
                let (ex, ey) = self.off(at, wanted);
                let beside = (uy * (at.x - self.from.x) - ux * (at.y - self.from.y)).abs();
                if settings.sideways {
                    let error = turn_between(at.yaw, self.from.yaw + turn.value);
                    let (sin, cos) = at.yaw.sin_cos();
                    let command = Place {
                        x: way.rate * (cos * ux + sin * uy) + settings.gain * ex,
                        y: way.rate * (cos * uy - sin * ux) + settings.gain * ey,
                        yaw: turn.rate + settings.turn_gain * error,
                    };
                    return (command, Some(beside));
                }
                let error = turn_between(at.yaw, self.to.yaw);
                let turn_gain = settings.turn_gain.max(2.0 * way.rate.abs() / settings.length);
                let back = way.rate * ey / (settings.length * settings.length);
                let command = Place {
                    x: way.rate * error.cos() + settings.gain * ex,
                    y: 0.0,
                    yaw: back + turn_gain * error.sin(),
                };
                (command, Some(beside))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;
    use crate::route::RouteSettings;

    const DT: f64 = 1e-3;

    fn stop(x: f64, y: f64, yaw: Option<f64>) -> Stop {
        Stop { position: [x, y], yaw, dwell: 0.1 }
    }

    /// Moves a base that follows its commands except for a velocity disturbance; returns every stop with the
    /// pose there.
    fn drive(
        route: &mut Route,
        mut at: Place,
        disturbed: impl Fn(f64) -> Place,
    ) -> (Vec<(Place, Place)>, f64) {
        let (mut stops, mut time) = (Vec::new(), 0.0);
        while !route.is_finished() && time < 200.0 {
            let step = route.step(at, DT);
            stops.extend(step.stopped.map(|wanted| (wanted, at)));
            let (command, push) = (step.command, disturbed(time));
            let (sin, cos) = at.yaw.sin_cos();
            let (x, y) = (command.x + push.x, command.y + push.y);
            at.x += DT * (cos * x - sin * y);
            at.y += DT * (sin * x + cos * y);
            at.yaw += DT * (command.yaw + push.yaw);
            time += DT;
        }
        (stops, time)
    }

    fn off((wanted, at): &(Place, Place)) -> (f64, f64) {
        ((wanted.x - at.x).hypot(wanted.y - at.y), turn_between(wanted.yaw, at.yaw).abs())
    }

    const SQUARE: [(f64, f64, f64); 4] =
        [(2.0, 0.0, FRAC_PI_2), (2.0, 2.0, PI), (0.0, 2.0, -FRAC_PI_2), (0.0, 0.0, 0.0)];

    #[test]
    fn every_corner_of_a_square_is_reached() {
        for sideways in [false, true] {
            let stops = SQUARE.map(|(x, y, yaw)| stop(x, y, Some(yaw))).to_vec();
            let mut route = Route::new(stops, RouteSettings { sideways, ..RouteSettings::default() });
            let start = Place { x: 0.03, y: -0.02, yaw: 0.2 };
            let (corners, time) = drive(&mut route, start, |_| Place::default());
            assert_eq!(corners.len(), 4);
            for (corner, (x, y, yaw)) in corners.iter().zip(SQUARE) {
                assert_eq!((corner.0.x, corner.0.y), (x, y));
                assert!(turn_between(corner.0.yaw, yaw).abs() < 1e-9);
                let (distance, angle) = off(corner);
                assert!(distance < 3e-3 && angle < 3e-3, "{sideways}: {distance} m, {angle} rad");
            }
            assert!((40.0..60.0).contains(&time), "{time} s");
        }
    }

    #[test]
    fn lateral_push_is_corrected_while_driving() {
        let mut route = Route::new(vec![stop(2.0, 0.0, None)], RouteSettings::default());
        let push =
            |time: f64| Place { y: if (3.0..4.0).contains(&time) { 0.05 } else { 0.0 }, ..Place::default() };
        let (stops, _) = drive(&mut route, Place::default(), push);
        let (distance, angle) = off(&stops[0]);
        assert!(distance < 3e-3 && angle < 5e-3, "{distance} m, {angle} rad");
    }

    #[test]
    fn stuck_base_is_abandoned_and_its_error_reported() {
        let mut route = Route::new(vec![stop(1.0, 0.0, None)], RouteSettings::default());
        let (mut missed, mut time) = (None, 0.0);
        while !route.is_finished() {
            missed = missed.or(route.step(Place::default(), DT).stopped);
            time += DT;
        }
        assert_eq!(missed, Some(Place { x: 1.0, y: 0.0, yaw: 0.0 }));
        assert!(time < 10.0, "{time} s");
    }

    #[test]
    fn turns_in_the_shorter_direction() {
        for (from, to, turn) in
            [(3.0, -3.0, 0.283_185_307), (-3.0, 3.0, -0.283_185_307), (0.0, 7.0, 0.716_814_693)]
        {
            assert!((turn_between(from, to) - turn).abs() < 1e-8, "{from} to {to}");
        }
        let mut route = Route::new(vec![stop(0.0, 0.0, Some(-3.0))], RouteSettings::default());
        let start = Place { yaw: 3.0, ..Place::default() };
        let (stops, time) = drive(&mut route, start, |_| Place::default());
        assert!(
            (stops[0].1.yaw - (std::f64::consts::TAU - 3.0)).abs() < 3e-3 && time < 2.0,
            "{stops:?} {time}"
        );
    }
}
