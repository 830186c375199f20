//! Default signals of a dataset.

use motorium::plan::Plan;
use motorium::state::{JointCommand, JointState, StateBuffer as _, from_bytes};

use super::super::{Recording, Signal};

/// Returns the default state and action signals of a recording with one commanded robot. The state is the
/// measured positions read by the writer of the joint commands. The action is the commanded positions, or the
/// efforts if no position is controlled. Returns `None` without joint states or joint commands, or with
/// several writers of commands.
pub fn usual_signals(recording: &Recording, plan: &Plan) -> Option<(Signal, Signal)> {
    let of_type = |name: &'static str| {
        plan.topics.iter().enumerate().filter(move |(_, topic)| topic.layout.type_name == name)
    };
    let mut commands =
        of_type(JointCommand::NAME).filter(|(_, topic)| recording.topic(&topic.name).is_some());
    let (Some((_, command)), None) = (commands.next(), commands.next()) else { return None };
    let state = of_type(JointState::NAME).find(|(index, topic)| {
        let reads = plan.components[command.writer].inputs.iter().any(|input| input.topic == Some(*index));
        reads && recording.topic(&topic.name).is_some()
    });
    let (_, state) = state?;
    let index = recording.topic(&command.name);
    let first = recording.samples().filter_map(Result::ok).find(|sample| Some(sample.topic) == index)?;
    let first = from_bytes::<JointCommand>(&first.bytes)?;
    let positions = first.kp().iter().any(|kp| *kp > 0.0);
    let signal = |topic: &str, field: &str| Signal {
        topic: topic.to_string(),
        field: Some(field.to_string()),
        entries: None,
    };
    let field = if positions { "position" } else { "effort" };
    Some((signal(&state.name, "position"), signal(&command.name, field)))
}
