//! Steps in which nothing can touch.

use super::ContactScene;
use crate::contact::parties::Least;
use crate::robot::Robot;

impl ContactScene {
    /// Begins a step of `dt` \[s\] in one integration step in which robots without movable objects cannot
    /// touch anything. `false`, and nothing has begun, where they might.
    pub(crate) fn begin_calm(&mut self, robot: &Robot, dt: f64, [far, _]: [usize; 2]) -> bool {
        let calm = far == 1 && self.is_simple() && self.detector.is_calm(robot, dt);
        if calm {
            self.objects.feel(&robot.gravity);
            self.lengths.fill(dt);
        }
        calm
    }

    /// Looks how near the robots are to anything, after a [detection](Self::begin).
    pub(crate) fn look_ahead(&mut self, robot: &Robot) {
        if self.is_simple() {
            self.detector.look_ahead(robot, Least::OF_STEP);
        }
    }

    /// True where nothing moves but robots, each for itself.
    fn is_simple(&self) -> bool {
        self.objects.now.is_empty() && self.connections.most() == 0 && self.colliders.terrain.is_none()
    }
}
