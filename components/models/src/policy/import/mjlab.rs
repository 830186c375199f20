//! Import of ONNX files with the metadata of mjlab.

use std::collections::BTreeMap;

use super::{ImportError, ImportOptions, NETWORK, TERMS};
use crate::inference::Port;
use crate::onnx::Model;
use crate::policy::{Action, ActionKind, Numbers, Observation, Policy, PolicyNetwork, Term};

/// Creates a policy from an ONNX file with the metadata of mjlab. The network stays unchanged, under the name
/// `policy.onnx`.
///
/// # Errors
///
/// [`ImportError`] with the invalid entry or the unsupported node.
pub fn import_mjlab(bytes: &[u8], options: ImportOptions) -> Result<Policy, ImportError> {
    let model = Model::read(bytes)?;
    let program = model.program(1)?;
    let numbers = |shape: Option<&Port>| shape.map_or(0, |port| port.shape.iter().product::<usize>());
    let (inputs, outputs) = (numbers(program.inputs().first()), numbers(program.outputs().first()));
    let metadata: BTreeMap<&str, &str> = model.metadata().collect();
    let entry = |key: &'static str| metadata.get(key).copied().ok_or(ImportError::Missing(key));
    let list = |key: &'static str| {
        let names: Vec<String> = entry(key)?.split(',').map(|name| name.trim().to_owned()).collect();
        Ok::<_, ImportError>(names)
    };
    let count = |key: &'static str, found: usize| {
        if found == outputs { Ok(()) } else { Err(ImportError::Count { key, found, expected: outputs }) }
    };
    let values = |key: &'static str| {
        let parse =
            |text: &String| text.parse::<f64>().map_err(|_| ImportError::Number { key, found: text.clone() });
        list(key)?.iter().map(parse).collect::<Result<Vec<f64>, ImportError>>()
    };
    let each = |key: &'static str| {
        let values = values(key)?;
        count(key, values.len())?;
        Ok::<_, ImportError>(values)
    };
    let joints = list("joint_names")?;
    count("joint_names", joints.len())?;
    let scale = match values("action_scale")?.as_slice() {
        [scale] => Numbers::All(*scale),
        scales => {
            count("action_scale", scales.len())?;
            Numbers::Each(scales.to_vec())
        }
    };
    let action = Action {
        joints,
        kind: ActionKind::Position,
        scale,
        offset: Numbers::All(0.0),
        default_pose: each("default_joint_pos")?,
        clip: None,
        kp: Some(Numbers::Each(each("joint_stiffness")?)),
        kd: Some(Numbers::Each(each("joint_damping")?)),
    };
    let term = |name: &String| match TERMS.iter().find(|(known, _)| known == name) {
        Some((_, term)) => Ok(Observation { history: options.history, ..Observation::new(*term) }),
        None => Err(ImportError::Term { name: name.clone() }),
    };
    let observations = list("observation_names")?.iter().map(term).collect::<Result<_, _>>()?;
    let ImportOptions { rate, history, robot } = options;
    let mut policy = Policy {
        network: NETWORK.to_owned(),
        rate,
        robot,
        initial_states: Vec::new(),
        observations,
        action,
        pattern: None,
    };
    // the rest of the input is the height scan
    let width = |policy: &Policy| -> usize {
        policy.observations.iter().map(|term| policy.width(term) * term.history).sum()
    };
    let others = width(&policy);
    let mut scans = policy.observations.iter_mut().filter(|observation| observation.term == Term::HeightScan);
    if let (Some(scan), None) = (scans.next(), scans.next()) {
        scan.rays = inputs.checked_sub(others).map(|left| left / history.max(1));
    }
    let expected = width(&policy);
    if expected != inputs {
        return Err(ImportError::Width { found: inputs, expected });
    }
    policy.check()?;
    PolicyNetwork::new(&policy, program)?;
    Ok(policy)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inference::Unary;
    use crate::onnx::write_mlp;

    const METADATA: [(&str, &str); 7] = [
        ("run_path", "team/run"),
        ("joint_names", "knee,hip"),
        ("default_joint_pos", "0.100,-0.200"),
        ("joint_stiffness", "20.000,30.000"),
        ("joint_damping", "0.500,0.600"),
        ("action_scale", "0.250"),
        (
            "observation_names",
            "base_ang_vel,projected_gravity,command,joint_pos,joint_vel,actions,height_scan",
        ),
    ];

    fn options() -> ImportOptions {
        ImportOptions { rate: 50.0, history: 1, robot: Some("go1".to_owned()) }
    }

    fn network(inputs: usize, metadata: &[(&str, &str)]) -> Vec<u8> {
        write_mlp(inputs, &[(vec![0.1; 2 * inputs], vec![0.0; 2])], Unary::Elu(1.0), metadata)
    }

    #[test]
    fn metadata_of_mjlab_makes_a_policy() {
        let policy = import_mjlab(&network(15 + 7, &METADATA), options()).expect("a policy");
        assert_eq!(policy.action.joints, ["knee", "hip"]);
        assert_eq!(policy.action.scale, Numbers::All(0.25));
        assert_eq!(policy.action.kp, Some(Numbers::Each(vec![20.0, 30.0])));
        assert_eq!(policy.observations[6].rays, Some(7));
        let text = policy.to_toml().expect("text");
        assert_eq!(Policy::parse(&text).as_ref(), Ok(&policy), "{text}");
        let terms = METADATA.map(|(key, value)| (key, value.trim_end_matches(",height_scan")));
        let history = ImportOptions { history: 3, ..options() };
        assert_eq!(import_mjlab(&network(45, &terms), history).expect("a policy").inputs(), Ok(45));
    }

    #[test]
    fn metadata_that_does_not_fit_is_named() {
        let error = |inputs: usize, key: &str, value: Option<&str>| {
            let entries: Vec<(&str, &str)> = METADATA
                .into_iter()
                .filter_map(|(name, old)| if name == key { Some((name, value?)) } else { Some((name, old)) })
                .collect();
            import_mjlab(&network(inputs, &entries), options()).expect_err(key)
        };
        assert_eq!(error(22, "joint_names", None), ImportError::Missing("joint_names"));
        let found = error(22, "joint_names", Some("knee,hip,foot"));
        assert_eq!(found, ImportError::Count { key: "joint_names", found: 3, expected: 2 });
        let found = error(22, "joint_damping", Some("0.5,x"));
        assert_eq!(found, ImportError::Number { key: "joint_damping", found: "x".to_owned() });
        let found = error(22, "observation_names", Some("joint_pos,motion_anchor"));
        assert_eq!(found, ImportError::Term { name: "motion_anchor".to_owned() });
        let found = error(22, "observation_names", Some("joint_pos,joint_vel"));
        assert_eq!(found, ImportError::Width { found: 22, expected: 4 });
        assert!(matches!(error(22, "joint_names", Some("hip,hip")), ImportError::Policy(_)));
    }
}
