//! Steps in which nothing can touch.

use super::ContactScene;
use crate::contact::parties::Least;
use crate::robot::Robot;

impl ContactScene {
    /// Begins a step of `dt` \[s\] as a single integration step if the scene [is simple](Self::is_simple) and
    /// no robot can touch anything during the step. Otherwise returns `false` and begins nothing.
    pub(crate) fn begin_calm(&mut self, robot: &Robot, dt: f64, [far, _]: [usize; 2]) -> bool {
        let calm = far == 1 && self.is_simple() && self.detector.is_calm(robot, dt);
        if calm {
            self.objects.feel(&robot.gravity);
            self.lengths.fill(dt);
        }
        calm
    }

    /// Inspects the distances between the robots and everything else after a [detection](Self::begin).
    pub(crate) fn look_ahead(&mut self, robot: &Robot) {
        if self.is_simple() {
            self.detector.look_ahead(robot, Least::OF_STEP);
        }
    }

    /// Returns `true` if only robots move, independently of each other, and there is no terrain.
    fn is_simple(&self) -> bool {
        self.objects.now.is_empty() && self.connections.most() == 0 && self.colliders.terrain.is_none()
    }
}
