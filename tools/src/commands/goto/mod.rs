//! `motorium goto`: moves the robot of a running graph to a goal.

mod goal;
mod policy;

use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use motorium::os::monotonic_ns;
use motorium::session::TopicReader;
use motorium::state::{GoalState, GoalStatus, JointState, MotionGoal, encode};
use motorium::units::TimeSpan;
use motorium_bridges::Feed;
use motorium_policies::trajectory::{GoalPlanner, Planned};
use serde_json::json;

use super::topic::publish::fed_from_outside;
use super::topic::watch::{End, Look, Watch};
use crate::out::{errln, outln};
use crate::robots;
use crate::runs::{LivingRun, RunArg};
use goal::GoalArgs;
use policy::Policy;

/// Time limit for the policy's answer.
const ANSWER: Duration = Duration::from_secs(3);
/// Interval between two polls of the status.
const POLL: Duration = Duration::from_millis(5);
/// Interval between two progress lines.
const LINES: Duration = Duration::from_secs(1);

/// Move the robot of a running graph to a goal, and wait for its arrival.
///
/// A component of the graph must accept goals, as policy.trajectory does, from a topic that bridge.iceoryx2
/// publishes. Limits and reach are checked before the goal is sent, but collisions are not. The exit code is
/// 1 if the goal is refused or missed.
///
/// Example: motorium goto panda-goto --position 0.4,0.1,0.5 --gripper open
#[derive(Debug, clap::Args)]
pub(crate) struct Goto {
    /// The run: its id, a prefix of the id, or the name of its graph [default: the only one]
    #[arg(value_name = "RUN", add = crate::complete::runs())]
    run: Option<String>,
    #[command(flatten)]
    goal: GoalArgs,
    /// The component that accepts the goal [default: the only one]
    #[arg(long, value_name = "COMPONENT", add = crate::complete::components())]
    component: Option<String>,
    /// Maximum time to wait for the arrival
    #[arg(long, value_name = "TIME", default_value = "60s")]
    within: TimeSpan,
    /// Print the end of the motion as JSON
    #[arg(long)]
    json: bool,
}

impl Goto {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let run = RunArg::named(self.run.as_deref()).open()?;
        let policy = Policy::find(&run.plan, self.component.as_deref())?;
        fed_from_outside(&run.plan, policy.goals)?;
        let robot = robots::load_in_world(policy.robot)?;
        let goal = self.goal.goal(&robot, policy.frame(), monotonic_ns())?;
        let watch = Watch::open(&run, policy.status)?;
        check(&run, &policy, &goal)?;
        let mut status = watch.reader()?;
        // the bridge drops values of a sender that has exited
        let _feed = send(&run, &policy, &goal)?;
        let begin = Instant::now();
        let reached = follow(&watch, &mut status, &goal, Duration::from_nanos(self.within.ns))?;
        let (seconds, error) = (begin.elapsed().as_secs_f64(), reached.error);
        if self.json {
            let (run, component) = (run.folder.id(), &policy.component.name);
            outln!("{}", json!({ "run": run, "component": component, "seconds": seconds, "error": error }));
        } else {
            outln!("reached in {seconds:.1} s, {error:.4} rad or m off at most");
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Checks limits and reach from the measured joint positions.
fn check(run: &LivingRun, policy: &Policy<'_>, goal: &MotionGoal) -> anyhow::Result<()> {
    let mut reader = TopicReader::open(&run.folder.domain()?, policy.joints)?;
    reader.poll();
    let state = reader.value::<JointState>()?;
    let state = state.with_context(|| format!("`{}` has no joint state yet", policy.joints.name))?;
    let mut planner = GoalPlanner::new(policy.robot, policy.frame())?;
    let (found, expected) = (state.count(), planner.model().joint_count());
    anyhow::ensure!(found == expected, "`{}` has {found} joints, expected {expected}", policy.joints.name);
    let planned = planner.begin(goal, state.position()).map(|()| planner.advance(usize::MAX));
    match planned {
        Err(refusal) | Ok(Planned::Refused(refusal)) => {
            bail!("the goal was not sent: {}", planner.explain(&refusal))
        }
        Ok(Planned::Ready | Planned::Searching) => Ok(()),
    }
}

fn send(run: &LivingRun, policy: &Policy<'_>, goal: &MotionGoal) -> anyhow::Result<Feed> {
    let MotionGoal { number, has_position, position, orientation, joints, duration, .. } = goal;
    let text = format!(
        "number={number} has_position={has_position} position={position:?} orientation={orientation:?} \
         joints={joints} duration={duration:?} joint={:?}",
        goal.joint()
    );
    let bytes = encode(&policy.goals.layout, &text)?;
    let feed = Feed::open(&run.folder.domain()?, policy.goals).with_context(|| {
        format!("the goal cannot be published on `{}` of run {}", policy.goals.name, run.folder.id())
    })?;
    feed.send(&bytes)?;
    Ok(feed)
}

/// Prints the progress until the goal is reached, and returns its last status.
fn follow(
    watch: &Watch<'_>,
    reader: &mut TopicReader,
    goal: &MotionGoal,
    within: Duration,
) -> anyhow::Result<GoalStatus> {
    let (begin, mut printed) = (Instant::now(), None::<Instant>);
    let mut last = None::<GoalStatus>;
    let end = watch.follow(POLL, Some(within), || {
        reader.poll();
        let Some(status) = reader.value::<GoalStatus>()?.filter(|status| status.goal == goal.number) else {
            anyhow::ensure!(last.is_none(), "a newer goal has replaced this goal");
            let is_late = begin.elapsed() >= ANSWER;
            anyhow::ensure!(
                !is_late,
                "the policy did not answer within {} s: does it step?",
                ANSWER.as_secs()
            );
            return Ok(Look::Seen);
        };
        last = Some(*status);
        let seconds = status.remaining;
        match status.goal_state() {
            Some(GoalState::Reached) => return Ok(Look::Enough),
            Some(GoalState::Refused) => bail!("the goal was refused: {}", status.as_str()),
            Some(GoalState::Missed) => bail!("the goal was missed: {}", status.as_str()),
            Some(GoalState::Moving) if printed.is_none_or(|printed| printed.elapsed() >= LINES) => {
                printed = Some(Instant::now());
                errln!("{:3.0} %, {seconds:.1} s left", 100.0 * status.progress);
            }
            Some(GoalState::Idle | GoalState::Planning | GoalState::Moving) | None => {}
        }
        Ok(Look::Seen)
    })?;
    match (end, last) {
        (End::Enough, Some(status)) => Ok(status),
        (End::Interrupted, _) => bail!("interrupted; the robot continues to its goal"),
        (End::RunOver, _) => bail!("the run ended before the goal was reached"),
        (End::Time | End::Enough, _) => {
            bail!("not reached within {} s; the robot continues to its goal", within.as_secs_f64())
        }
    }
}
