//! `motorium reproduce chapter3`.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_library::{DAMPING, SampledSpring, data};

use super::sheet::Sheet;
use super::{body, letters, perception, search};
use crate::out::outln;

/// The motion library of Delhaisse's thesis (2019), chapter 3: what figures 3.9 to 3.12 and 3.14 to 3.19 show.
///
/// Writes each as CSV and SVG (bars: standard errors), and says of each claim whether it holds on these data.
///
/// Example: motorium reproduce chapter3 --data recordings/ --out out/
#[derive(Debug, clap::Args)]
pub(super) struct Chapter3 {
    /// The folder with uci-char-trajectories/train.jsonl and cmu-mocap/*.csv
    #[arg(long)]
    data: PathBuf,
    /// The folder to write to
    #[arg(long, default_value = "out")]
    out: PathBuf,
    /// Samples of each letter
    #[arg(long, default_value_t = 200)]
    samples: usize,
    /// Letters and seeds of each policy search
    #[arg(long, default_value_t = 10)]
    searches: usize,
    /// Epochs of the network that sees letters
    #[arg(long, default_value_t = 220)]
    epochs: usize,
    /// How many such networks are trained, each from a seed of its own
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..=100))]
    networks: u64,
    /// Random splits of the letters that errors of position are averaged over
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=100))]
    splits: u64,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Chapter3 {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let file = self.data.join("uci-char-trajectories/train.jsonl");
        let all = data::read(&file, &data::Options { rate: 200.0, columns: Vec::new() })?;
        let spring = SampledSpring::new(self.samples, DAMPING)?;
        let mut sheet =
            Sheet::new(self.out.clone(), 24 + self.epochs as u64 * self.networks + 5 * self.splits)?;
        let (seen, held) = all.hold_out(5);
        anyhow::ensure!(
            !held.trajectories.is_empty(),
            "{}: too few letters to hold some out",
            file.display()
        );
        let force = letters::figures(&mut sheet, &seen, &held, spring)?;
        letters::splits(&mut sheet, &all, spring, self.splits)?;
        search::figure(&mut sheet, &force, &held, self.searches)?;
        perception::figure(&mut sheet, &all, self.epochs, self.networks)?;
        body::figures(&mut sheet, &self.data.join("cmu-mocap"), self.searches)?;
        let claims = serde_json::to_string_pretty(&sheet.claims)?;
        sheet.write("claims.json", &claims)?;
        sheet.bar.finish_and_clear();
        if self.json {
            let report = serde_json::json!({ "claims": sheet.claims, "files": sheet.files });
            outln!("{}", serde_json::to_string_pretty(&report)?);
            return Ok(ExitCode::SUCCESS);
        }
        for claim in &sheet.claims {
            let word = if claim.holds { "holds" } else { "does not hold" };
            outln!("{}: {}\n    {word}: {}", claim.figure, claim.claim, claim.evidence);
        }
        outln!("{} files in {}", sheet.files.len(), self.out.display());
        Ok(ExitCode::SUCCESS)
    }
}
