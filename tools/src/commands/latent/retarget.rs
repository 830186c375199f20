//! `motorium latent retarget`: converts a recorded human movement to poses of a robot.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use motorium_recordings::retarget::{RetargetOptions, RobotLimb, retarget};
use motorium_recordings::{Limb, Recording, Selection, Skeleton, Trunk, read};
use motorium_robots::{BasePose, RobotSource};
use nalgebra::Vector3;
use serde_json::json;

use crate::out::outln;
use crate::output::{Overwrite, check_format, write_file};

/// Compute poses of a robot whose limbs point in the same directions as a human's in a recorded movement.
///
/// TAKE is a file of joint angles (.bvh; .amc, or a table of its values, with --skeleton), or a table of limb
/// directions.
///
/// Example: motorium latent retarget take.amc --skeleton subject.asf --robot panda --limb
/// right_upperarm=panda_link2:panda_link4 --limb right_forearm=panda_link4:panda_link6 --output panda.csv
#[derive(Debug, clap::Args)]
pub(super) struct Retarget {
    /// The recorded movement
    take: PathBuf,
    /// Skeleton of the human, .asf
    #[arg(long, value_name = "FILE")]
    skeleton: Option<PathBuf>,
    /// Samples per second of files without times
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Limb of the human by its joints, NAME=FROM:TO; may be repeated [default: CMU's arms]
    #[arg(long, value_name = "LIMB", value_parser = limb)]
    body: Vec<Limb>,
    /// Joint in whose frame directions are expressed, and its forward and up axes in the rest pose
    #[arg(long, value_name = "JOINT,AXIS,AXIS", default_value = "thorax,z,y", value_parser = trunk)]
    trunk: Trunk,
    /// The robot
    #[arg(long, add = crate::complete::robots())]
    robot: String,
    /// Roll, pitch and yaw of the robot's base, rad
    #[arg(long, value_name = "R,P,Y", value_parser = angles, allow_hyphen_values = true)]
    base_rpy: Option<[f64; 3]>,
    /// Limb of the robot by its frames, NAME=FROM:TO; may be repeated
    #[arg(long, value_name = "LIMB", value_parser = limb, required = true)]
    limb: Vec<Limb>,
    /// Write every Nth sample
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    every: u64,
    /// File of the robot's poses
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// File of the directions of the human's limbs
    #[arg(long, value_name = "FILE")]
    human: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

fn trunk(text: &str) -> Result<Trunk, String> {
    let axis = |name: &str| match name {
        "x" => Some(Vector3::x()),
        "y" => Some(Vector3::y()),
        "z" => Some(Vector3::z()),
        _ => None,
    };
    let parts: Vec<&str> = text.split(',').collect();
    let parsed = match parts[..] {
        [joint, forward, up] if !joint.is_empty() && forward != up => {
            axis(forward).zip(axis(up)).map(|axes| (joint, axes))
        }
        _ => None,
    };
    let (joint, (forward, up)) =
        parsed.ok_or_else(|| "expected a joint and two different axes, such as thorax,z,y".to_string())?;
    Ok(Trunk { joint: joint.to_string(), forward, up })
}

fn limb(text: &str) -> Result<Limb, String> {
    let parts = text.split_once('=').and_then(|(name, ends)| Some((name, ends.split_once(':')?)));
    match parts {
        Some((name, (from, to))) if ![name, from, to].contains(&"") => {
            Ok(Limb { name: name.to_string(), from: from.to_string(), to: to.to_string() })
        }
        _ => Err("expected NAME=FROM:TO".to_string()),
    }
}

fn angles(text: &str) -> Result<[f64; 3], String> {
    let parsed: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let angles = parsed.ok().filter(|angles: &Vec<f64>| angles.iter().all(|angle| angle.is_finite()));
    angles
        .and_then(|angles| angles.try_into().ok())
        .ok_or_else(|| "expected three numbers, R,P,Y".to_string())
}

/// Arms and hands of a skeleton of the CMU motion-capture database.
fn arms() -> Vec<Limb> {
    let bones =
        [("upperarm", "clavicle", "humerus"), ("forearm", "humerus", "radius"), ("hand", "wrist", "hand")];
    let sides = [("left", "l"), ("right", "r")];
    let limbs = sides.iter().flat_map(|(side, letter)| {
        bones.iter().map(move |(name, from, to)| Limb {
            name: format!("{side}_{name}"),
            from: format!("{letter}{from}"),
            to: format!("{letter}{to}"),
        })
    });
    limbs.collect()
}

impl Retarget {
    /// Directions of the human's limbs.
    fn directions(&self) -> anyhow::Result<Recording> {
        let text = |path: &Path| std::fs::read_to_string(path).with_context(|| path.display().to_string());
        let shown = self.take.display().to_string();
        let ending = self.take.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        let skeleton = self.skeleton.as_ref().map(|path| {
            Ok::<_, anyhow::Error>(Skeleton::from_asf(&path.display().to_string(), &text(path)?)?)
        });
        let (skeleton, take) = match (ending, skeleton.transpose()?) {
            ("bvh", _) => {
                let (skeleton, take) = Skeleton::from_bvh(&shown, &text(&self.take)?)?;
                (Some(skeleton), take)
            }
            ("amc", Some(skeleton)) => {
                let rate = self.rate.context("an .amc file has no times\nhelp: add `--rate 120`")?;
                let take = skeleton.read_amc(&shown, &text(&self.take)?, rate)?;
                (Some(skeleton), take)
            }
            ("amc", None) => {
                anyhow::bail!("{shown}: a file .amc needs its skeleton\nhelp: add `--skeleton FILE.asf`")
            }
            (_, skeleton) => {
                (skeleton, read(&self.take, &Selection { rate: self.rate, ..Selection::default() })?)
            }
        };
        let Some(skeleton) = skeleton else { return Ok(take) };
        let body = if self.body.is_empty() { arms() } else { self.body.clone() };
        Ok(skeleton.directions(&take, &self.trunk, &body)?)
    }

    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let outputs = || [&self.output].into_iter().chain(&self.human);
        self.overwrite.check([&self.take].into_iter().chain(&self.skeleton), outputs())?;
        outputs().try_for_each(|output| check_format(output, &["csv"]))?;
        let directions = self.directions()?;
        let rpy = self.base_rpy.unwrap_or_default();
        let source = RobotSource {
            name: &self.robot,
            text: &self.robot,
            pose: Some(BasePose { position: [0.0; 3], rpy }),
            ..RobotSource::default()
        };
        let loaded = source.load()?;
        let model = &loaded.model;
        let limbs: Vec<RobotLimb> = self
            .limb
            .iter()
            .map(|limb| {
                let (from, to) = (model.frame(&limb.from)?, model.frame(&limb.to)?);
                Ok::<_, anyhow::Error>(RobotLimb { name: limb.name.clone(), from, to })
            })
            .collect::<Result<_, _>>()?;
        let mut home = model.neutral();
        if let Some(profile) = &loaded.profile {
            let joints = profile.home(model)?;
            let base = home.len() - joints.len();
            home[base..].copy_from_slice(joints.as_slice());
        }
        let found = retarget(&directions, model, &limbs, &home, &RetargetOptions::default())?;
        write(&self.output, &found.positions, self.every)?;
        if let Some(human) = &self.human {
            write(human, &directions, self.every)?;
        }
        let degrees: Vec<f64> = found.medians.iter().map(|angle| angle.to_degrees()).collect();
        if self.json {
            let medians: serde_json::Map<_, _> =
                limbs.iter().zip(&degrees).map(|(limb, angle)| (limb.name.clone(), json!(angle))).collect();
            let branches: Vec<_> = found
                .branches
                .iter()
                .map(|change| json!({ "sample": change.sample, "joint": change.joint, "step": change.step }))
                .collect();
            outln!(
                "{}",
                json!({
                    "robot": self.robot,
                    "samples": found.positions.samples(),
                    "joints": found.positions.names(),
                    "median_error_deg": medians,
                    "branch_changes": branches,
                    "file": self.output.display().to_string(),
                })
            );
            return Ok(ExitCode::SUCCESS);
        }
        outln!("{} samples of {} joints", found.positions.samples(), found.positions.names().len());
        for (limb, angle) in limbs.iter().zip(&degrees) {
            outln!("{:<16} median error {angle:.2} deg", limb.name);
        }
        for change in &found.branches {
            outln!("sample {}: {} changes its branch by {:.2}", change.sample, change.joint, change.step);
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Writes a table of poses.
fn write(path: &Path, recording: &Recording, every: u64) -> anyhow::Result<()> {
    let mut text = recording.names().join(",") + "\n";
    let every = usize::try_from(every).unwrap_or(usize::MAX);
    for row in recording.values().row_iter().step_by(every) {
        for (column, value) in row.iter().enumerate() {
            let comma = if column == 0 { "" } else { "," };
            let _ = write!(text, "{comma}{value:.5}");
        }
        text.push('\n');
    }
    write_file(path, text)
}
