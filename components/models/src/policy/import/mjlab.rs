//! Import of ONNX files with the metadata of mjlab.

use std::collections::BTreeMap;

use super::served::{self, Served};
use super::{HeightGrid, ImportError, ImportOptions, NETWORK, TERMS};
use crate::inference::Port;
use crate::onnx::Model;
use crate::policy::{Action, ActionKind, Numbers, Observation, Policy, Term};

/// Factors of the terms.
const SCALE: &str = "observation_terms_scale";
/// Bounds of the terms before the factors.
const CLIP: &str = "observation_terms_clip";
/// Steps of the terms; 0 and 1 select only the newest.
const HISTORY: &str = "observation_terms_history_length";
/// 1 for terms with flattened steps.
const FLAT: &str = "observation_terms_flatten_history_dim";

/// Points of the height scan of mjlab's velocity tasks: 1.6 m x 1 m, every 0.1 m.
const HEIGHT_POINTS: [usize; 2] = [17, 11];

/// Splits a list at its commas; brackets keep entries together.
fn entries(text: &str) -> Vec<&str> {
    let mut depth = 0_usize;
    let comma = |c: char| {
        match c {
            '[' | '(' => depth += 1,
            ']' | ')' => depth = depth.saturating_sub(1),
            _ => {}
        }
        c == ',' && depth == 0
    };
    text.split(comma).map(str::trim).collect()
}

/// Parses the numbers of an entry: one number, or several in brackets or separated by semicolons.
fn numbers(entry: &str) -> Option<Vec<f64>> {
    let inner = entry.trim_matches(['[', ']', '(', ')', ' ']);
    inner.split([',', ';']).map(|number| number.trim().parse().ok()).collect()
}

/// Settings of the observation terms in the metadata.
struct Settings<'a> {
    names: Vec<&'a str>,
    metadata: &'a BTreeMap<&'a str, &'a str>,
}

impl Settings<'_> {
    /// Returns the numbers of each term in a list; `None` if the list is missing.
    fn list(&self, key: &'static str) -> Result<Option<Vec<Vec<f64>>>, ImportError> {
        let Some(text) = self.metadata.get(key) else { return Ok(None) };
        let parse = |entry: &&str| {
            let found = || (*entry).to_owned();
            numbers(entry).ok_or_else(|| ImportError::Number { key, found: found() })
        };
        let list = entries(text).iter().map(parse).collect::<Result<Vec<_>, _>>()?;
        match list.len() {
            found if found == self.names.len() => Ok(Some(list)),
            found => Err(ImportError::Terms { key, found, expected: self.names.len() }),
        }
    }

    fn wrong(&self, term: usize, key: &'static str, message: impl Into<String>) -> ImportError {
        ImportError::Setting { name: self.names[term].to_owned(), key, message: message.into() }
    }

    /// Returns the steps of each term.
    fn histories(&self, option: Option<usize>) -> Result<Vec<usize>, ImportError> {
        let flat = self.list(FLAT)?;
        let Some(list) = self.list(HISTORY)? else { return Ok(vec![option.unwrap_or(1); self.names.len()]) };
        let steps = list.iter().enumerate().map(|(term, numbers)| {
            let steps = match numbers[..] {
                [steps] if (0.0..=1e6).contains(&steps) && steps.fract() == 0.0 => (steps as usize).max(1),
                _ => {
                    return Err(self.wrong(
                        term,
                        HISTORY,
                        format!("found {numbers:?}, expected a number of steps"),
                    ));
                }
            };
            if let Some(option) = option.filter(|option| *option != steps) {
                let message = format!("found {steps} steps, expected {option} as in `--history`");
                return Err(self.wrong(term, HISTORY, message));
            }
            if steps > 1 && flat.as_ref().is_some_and(|flat| flat[term] == [0.0]) {
                return Err(self.wrong(
                    term,
                    FLAT,
                    "found 0, expected a history that is concatenated to one row",
                ));
            }
            Ok(steps)
        });
        steps.collect()
    }

    /// Returns the bounds of each term.
    fn clips(&self) -> Result<Vec<Option<[f64; 2]>>, ImportError> {
        let Some(list) = self.list(CLIP)? else { return Ok(vec![None; self.names.len()]) };
        let clips = list.iter().enumerate().map(|(term, numbers)| match numbers[..] {
            [f64::NEG_INFINITY, f64::INFINITY] => Ok(None),
            [low, high] => Ok(Some([low, high])),
            _ => {
                Err(self.wrong(term, CLIP, format!("found {numbers:?}, expected a lower and a higher bound")))
            }
        });
        clips.collect()
    }
}

/// Creates a policy and its network from an ONNX file with the metadata of mjlab. The network is not changed,
/// except for the order and the offset of a height scan.
///
/// # Errors
///
/// [`ImportError`] with the invalid entry or the unsupported node.
pub fn import_mjlab(bytes: &[u8], options: ImportOptions) -> Result<(Policy, Vec<u8>), ImportError> {
    let model = Model::read(bytes)?;
    let program = model.program(1)?;
    let count_of = |shape: Option<&Port>| shape.map_or(0, |port| port.shape.iter().product::<usize>());
    let (inputs, outputs) = (count_of(program.inputs().first()), count_of(program.outputs().first()));
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
        twist: None,
    };
    let ImportOptions { rate, robot, .. } = options;
    let mut policy = Policy {
        network: NETWORK.to_owned(),
        rate,
        robot,
        initial_states: Vec::new(),
        observations: Vec::new(),
        action,
        pattern: None,
        robot_digest: None,
    };
    let settings = Settings { names: entries(entry("observation_names")?), metadata: &metadata };
    let terms = settings.names.iter().map(|name| match TERMS.iter().find(|(known, _)| known == name) {
        Some((_, term)) => Ok(*term),
        None => Err(ImportError::Term { name: (*name).to_owned() }),
    });
    let terms = terms.collect::<Result<Vec<Term>, _>>()?;
    let (histories, clips, scales) =
        (settings.histories(options.history)?, settings.clips()?, settings.list(SCALE)?);
    let widths = terms.iter().map(|term| policy.width(&Observation::new(*term)));
    let others: usize = widths.zip(&histories).map(|(width, history)| width * history).sum();
    let mut served = Vec::new();
    for (index, term) in terms.iter().copied().enumerate() {
        let (history, clip) = (histories[index], clips[index]);
        let scale = scales.as_ref().map(|scales| &scales[index][..]);
        if term == Term::HeightScan {
            let rays = inputs.saturating_sub(others) / history.max(1);
            let scale = match scale {
                None => options.height_scale.ok_or(ImportError::HeightScale)?,
                Some([scale]) => match options.height_scale.filter(|option| option != scale) {
                    None => *scale,
                    Some(option) => {
                        let message = format!("found {scale}, expected {option} as in `--height-scale`");
                        return Err(settings.wrong(index, SCALE, message));
                    }
                },
                Some(found) => {
                    let message = format!("found {} numbers, expected 1", found.len());
                    return Err(settings.wrong(index, SCALE, message));
                }
            };
            let offset = options.height_offset.unwrap_or(0.0);
            let usual = (rays == HEIGHT_POINTS[0] * HEIGHT_POINTS[1]).then_some(HEIGHT_POINTS);
            let points = options.height_points.or(usual);
            let grid = points.map(|points| HeightGrid::from_points(points, offset));
            let grid = grid.filter(|grid| grid.count() == rays);
            let grid = grid.ok_or(ImportError::HeightPoints { rays, points })?;
            served.push(grid.served(scale, clip, history));
            continue;
        }
        let width = policy.width(&Observation::new(term));
        let scale = match scale {
            None => Numbers::All(1.0),
            Some([scale]) => Numbers::All(*scale),
            Some(scales) if scales.len() == width => Numbers::Each(scales.to_vec()),
            Some(found) => {
                let message = format!("found {} numbers, expected 1 or {width}", found.len());
                return Err(settings.wrong(index, SCALE, message));
            }
        };
        let observation = Observation { scale, clip, history, ..Observation::new(term) };
        served.push(Served { observation, order: (0..width).collect(), add: 0.0 });
    }
    policy.observations = served.iter().map(|served| served.observation.clone()).collect();
    let expected: usize = policy.observations.iter().map(|term| policy.width(term) * term.history).sum();
    if expected != inputs {
        return Err(ImportError::Width { found: inputs, expected });
    }
    let is_given =
        options.height_points.is_some() || options.height_scale.is_some() || options.height_offset.is_some();
    if is_given && !terms.contains(&Term::HeightScan) {
        return Err(ImportError::NoHeightScan);
    }
    served::finish(policy, &model, bytes, &served)
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
        ImportOptions {
            rate: 50.0,
            history: None,
            robot: Some("go1".to_owned()),
            height_points: Some([7, 1]),
            height_scale: Some(0.2),
            height_offset: None,
        }
    }

    fn network(inputs: usize, metadata: &[(&str, &str)]) -> Vec<u8> {
        let weights = (0..2 * inputs).map(|k| (0.7 * k as f32).sin()).collect();
        write_mlp(inputs, &[(weights, vec![0.0; 2])], Unary::Elu(1.0), metadata)
    }

    #[test]
    fn mjlab_metadata_becomes_a_policy() {
        let (policy, _) = import_mjlab(&network(15 + 7, &METADATA), options()).expect("a policy");
        assert_eq!(policy.action.joints, ["knee", "hip"]);
        assert_eq!(policy.action.scale, Numbers::All(0.25));
        assert_eq!(policy.action.kp, Some(Numbers::Each(vec![20.0, 30.0])));
        assert_eq!(policy.observations[6].rays, Some(7));
        let text = policy.to_toml().expect("text");
        assert_eq!(Policy::parse(&text).as_ref(), Ok(&policy), "{text}");
        let terms = METADATA.map(|(key, value)| (key, value.trim_end_matches(",height_scan")));
        let bytes = network(45, &terms);
        let history = ImportOptions { history: Some(3), ..options() };
        assert_eq!(import_mjlab(&bytes, history.clone()), Err(ImportError::NoHeightScan));
        let history = ImportOptions { height_points: None, height_scale: None, ..history };
        let (policy, written) = import_mjlab(&bytes, history).expect("a policy");
        assert_eq!((policy.inputs(), written == bytes), (Ok(45), true), "the network is unchanged");
    }

    /// Returns the metadata of later versions, with an observation of six numbers and a height scan of 3 x 2
    /// points.
    fn with_settings<'a>(settings: &[(&'a str, &'a str)]) -> Vec<(&'a str, &'a str)> {
        let mut metadata: Vec<(&str, &str)> = METADATA[..6].to_vec();
        metadata.push(("observation_names", "command,height_scan,projected_gravity"));
        metadata.extend(settings);
        metadata
    }

    const SETTINGS: [(&str, &str); 4] = [
        (SCALE, "2.000,0.200,[1.0, 2.0, 3.0]"),
        (CLIP, "-inf;inf,-1.000;0.500,[-inf, inf]"),
        (HISTORY, "2.000,0.000,0.000"),
        (FLAT, "1.000,1.000,1.000"),
    ];

    #[test]
    fn settings_of_terms_are_read() {
        let options = || ImportOptions { height_points: Some([3, 2]), ..options() };
        let import = |settings: &[(&str, &str)]| {
            import_mjlab(&network(6 + 6 + 3, &with_settings(settings)), options())
        };
        let (policy, _) = import(&SETTINGS).expect("a policy");
        let [command, scan, gravity] = &policy.observations[..] else { panic!("three terms") };
        assert_eq!((&command.scale, command.clip, command.history), (&Numbers::All(2.0), None, 2));
        assert_eq!((&scan.scale, scan.clip, scan.rays), (&Numbers::All(-0.2), Some([-0.5, 1.0]), Some(6)));
        assert_eq!(gravity.scale, Numbers::Each(vec![1.0, 2.0, 3.0]));
        let error = |index: usize, text: &'static str| {
            let mut settings = SETTINGS;
            settings[index].1 = text;
            import(&settings).expect_err(text)
        };
        let found = error(0, "1.000,0.200");
        assert_eq!(found, ImportError::Terms { key: SCALE, found: 2, expected: 3 });
        let setting = |error: ImportError| match error {
            ImportError::Setting { name, key, .. } => (name, key),
            other => panic!("{other:?}"),
        };
        assert_eq!(setting(error(0, "[1.0, 2.0],0.200,1.000")), ("command".to_owned(), SCALE));
        assert_eq!(setting(error(0, "1.000,[0.2, 0.3],1.000")), ("height_scan".to_owned(), SCALE));
        assert_eq!(setting(error(1, "-inf;inf,1.000,-inf;inf")), ("height_scan".to_owned(), CLIP));
        assert_eq!(setting(error(2, "2.500,0.000,0.000")), ("command".to_owned(), HISTORY));
        assert_eq!(setting(error(3, "0.000,1.000,1.000")), ("command".to_owned(), FLAT));
        let other = ImportOptions { height_scale: Some(0.5), ..options() };
        let found = import_mjlab(&network(15, &with_settings(&SETTINGS)), other).expect_err("another scale");
        assert_eq!(setting(found), ("height_scan".to_owned(), SCALE));
        let other = ImportOptions { history: Some(3), ..options() };
        let found =
            import_mjlab(&network(15, &with_settings(&SETTINGS)), other).expect_err("another history");
        assert_eq!(setting(found), ("command".to_owned(), HISTORY));
    }

    #[test]
    fn height_scans_change_their_sign_and_order() {
        // 3 points along x, 2 along y; mjlab: x fastest, y from the right; height of the sensor above them
        let settings = [(SCALE, "1.000,0.200,1.000"), (CLIP, "-inf;inf,-1.000;1.000,-inf;inf")];
        let bytes = network(12, &with_settings(&settings));
        let options = ImportOptions { height_points: Some([3, 2]), height_offset: Some(0.25), ..options() };
        let (policy, adapted) = import_mjlab(&bytes, options).expect("a policy");
        // motorium: rows from the back, each from right to left; height of the surface above the sensor
        let heights = [
            [-0.50, -0.55], // back: right, left
            [-0.60, -2.00], // middle
            [-0.70, 0.30],  // front
        ];
        let mjlab = [
            0.2 * (0.50 - 0.25), // right: back, middle, front
            0.2 * (0.60 - 0.25),
            0.2 * (0.70 - 0.25),
            0.2 * (0.55 - 0.25), // left
            0.2,                 // 2 m - 0.25 m is beyond the bound of 1
            0.2 * (-0.30 - 0.25),
        ];
        let mut assembly = crate::policy::Assembly::new(&policy);
        assembly.push(0, &[0.1, 0.2, 0.3]);
        assembly.push(1, heights.as_flattened());
        assembly.push(2, &[0.0, 0.6, -0.8]);
        let mut input = [0.0; 12];
        assembly.write(&mut input);
        let run = |bytes: &[u8], input: &[f32]| {
            let mut program = Model::read(bytes).and_then(|model| model.program(1)).expect("a network");
            program.input_mut(0).copy_from_slice(input);
            program.run();
            program.output(0).to_vec()
        };
        let rest = [&[0.1, 0.2, 0.3][..], &mjlab.map(|value| value as f32), &[0.0, 0.6, -0.8]].concat();
        for (found, expected) in run(&adapted, &input).iter().zip(run(&bytes, &rest)) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
    }

    #[test]
    fn unknown_height_scans_are_errors() {
        let import =
            |rays: usize, options: ImportOptions| import_mjlab(&network(15 + rays, &METADATA), options);
        let without = ImportOptions { height_points: None, ..options() };
        let found = import(7, without.clone()).expect_err("no grid");
        assert_eq!(found, ImportError::HeightPoints { rays: 7, points: None });
        assert!(import(187, without).is_ok(), "the grid of the velocity tasks");
        let found = import(8, options()).expect_err("another grid");
        assert_eq!(found, ImportError::HeightPoints { rays: 8, points: Some([7, 1]) });
        let found = import(7, ImportOptions { height_scale: None, ..options() }).expect_err("no scale");
        assert_eq!(found, ImportError::HeightScale);
    }

    #[test]
    fn mismatched_metadata_is_reported() {
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
