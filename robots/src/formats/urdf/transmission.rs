//! Transmissions between motors and joints.
//!
//! URDF does not define an element for rotor inertia. Drake's elements in `<actuator>`
//! (`<drake:gear_ratio value>`, `<drake:rotor_inertia value>`) are supported, as is ROS's
//! `<mechanicalReduction>` in the actuator, the joint or the transmission.

use std::collections::HashMap;

use roxmltree::Node;
use urdf_rs::Robot;

use super::error::UrdfProblem;
use super::warning::ModelWarning;
use crate::Drive;

/// Records one `<transmission>` of a joint. Fails with the faulty element.
pub(crate) fn read<'a, 'i>(
    transmission: Node<'a, 'i>,
    drives: &mut HashMap<String, (String, Drive)>,
    warnings: &mut Vec<ModelWarning>,
) -> Result<(), (Node<'a, 'i>, UrdfProblem)> {
    let named = |name: &str| -> Vec<&'a str> {
        let children = transmission.children().filter(|child| child.tag_name().name() == name);
        children.filter_map(|child| child.attribute("name")).collect()
    };
    let (joints, actuators) = (named("joint"), named("actuator"));
    let name = transmission.attribute("name").unwrap_or("").to_owned();
    let [joint] = joints[..] else {
        if joints.len() > 1 {
            let (joints, actuators) = (joints.len(), actuators.len());
            warnings.push(ModelWarning::CoupledTransmission { transmission: name, joints, actuators });
        }
        return Ok(());
    };
    if actuators.len() > 1 {
        let (joints, actuators) = (1, actuators.len());
        warnings.push(ModelWarning::CoupledTransmission { transmission: name, joints, actuators });
        return Ok(());
    }
    let mut drive = Drive::DIRECT;
    for element in transmission.descendants().filter(Node::is_element) {
        let (target, attribute, value) = match element.tag_name().name() {
            "mechanicalReduction" => (&mut drive.reduction, "text", element.text().unwrap_or("")),
            "gear_ratio" => (&mut drive.reduction, "value", element.attribute("value").unwrap_or("")),
            "rotor_inertia" => (&mut drive.rotor_inertia, "value", element.attribute("value").unwrap_or("")),
            _ => continue,
        };
        match value.trim().parse::<f64>() {
            Ok(number) if number.is_finite() => *target = number,
            _ => {
                let element_name = format!("{}> of <transmission name=\"{name}\"", element.tag_name().name());
                let value = value.to_owned();
                return Err((
                    element,
                    UrdfProblem::Number { element: element_name, attribute, value, expected: 1 },
                ));
            }
        }
        if drive.rotor_inertia < 0.0 {
            let (joint, value) = (joint.to_owned(), drive.rotor_inertia);
            return Err((element, UrdfProblem::NegativeJointValue { joint, what: "rotor inertia", value }));
        }
    }
    drives.insert(joint.to_owned(), (name, drive));
    Ok(())
}

/// Warns about transmissions of unknown joints.
pub(crate) fn warn_of_unknown_joints(
    robot: &Robot,
    drives: &HashMap<String, (String, Drive)>,
    warnings: &mut Vec<ModelWarning>,
) {
    let known = |joint: &str| robot.joints.iter().any(|known| known.name == joint);
    let drives = drives.iter().filter(|(joint, _)| !known(joint));
    let mut unknown: Vec<_> = drives.map(|(joint, (transmission, _))| (transmission, joint)).collect();
    unknown.sort();
    warnings.extend(unknown.into_iter().map(|(transmission, joint)| ModelWarning::TransmissionJoint {
        transmission: transmission.clone(),
        joint: joint.clone(),
    }));
}
