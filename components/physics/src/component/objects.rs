//! The objects of the world in the report of a run.

use serde_json::{Map, Value, json};

use crate::{Engine, ObjectId, Simulation, Simulator};

/// Returns pose, speed and contacts of every object by its name; `None` in a world without objects.
pub(super) fn report<E: Engine>(simulation: &Simulation<E>) -> Option<Value> {
    let objects = &simulation.world.objects;
    if objects.is_empty() {
        return None;
    }
    let mut report = Map::new();
    for (index, object) in objects.iter().enumerate() {
        let id = ObjectId(index);
        let pose = simulation.object_pose(id);
        let (roll, pitch, yaw) = pose.rotation.euler_angles();
        let (linear, angular) = simulation.object_velocity(id);
        let mut touching: Vec<String> = Vec::new();
        simulation.visit_contacts(&mut |contact| {
            if contact.force > 0.0 {
                match object.name.as_str() {
                    name if name == contact.first => touching.push(contact.second.to_owned()),
                    name if name == contact.second => touching.push(contact.first.to_owned()),
                    _ => {}
                }
            }
        });
        touching.sort_unstable();
        touching.dedup();
        let entry = json!({
            "position": pose.translation.vector.as_slice(),
            "rpy": [roll, pitch, yaw],
            "speed": linear.norm(),
            "rate_of_turn": angular.norm(),
            "touching": touching,
        });
        report.insert(object.name.clone(), entry);
    }
    Some(Value::Object(report))
}
