//! `motorium export`: a recording as tables.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use motorium::declare::Taps;
use motorium_bridges::recording::{Recording, write_csv};

use crate::out::outln;

/// Write a recording as tables of comma-separated values, one for each topic.
///
/// Example: motorium export out/a.mcap --topic panda/joint_state --output out/a
#[derive(Debug, clap::Args)]
pub(crate) struct Export {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// A topic, in whose name `*` stands for any characters; may be repeated. All if not given
    #[arg(long, value_name = "TOPIC")]
    topic: Vec<String>,
    /// The folder of the tables; FILE without `.mcap` if not given
    #[arg(long, short, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

impl Export {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let recording = Recording::open(&self.file)?;
        let folder = self.output.unwrap_or_else(|| self.file.with_extension(""));
        let chosen = match self.topic.as_slice() {
            [] => Taps::new(["*"], core::time::Duration::ZERO),
            names => Taps::new(names.iter().map(String::as_str), core::time::Duration::ZERO),
        };
        let names: Vec<String> = recording.topics().iter().map(|topic| topic.name.clone()).collect();
        if let Some(unknown) = chosen.unmatched(&names) {
            anyhow::bail!("the recording has no topic `{unknown}`; its topics are {}", names.join(", "));
        }
        std::fs::create_dir_all(&folder).with_context(|| format!("making {}", folder.display()))?;
        for (index, name) in names.iter().enumerate().filter(|(_, name)| chosen.includes(name)) {
            let path = folder.join(format!("{}.csv", name.replace('/', "-")));
            let mut file =
                BufWriter::new(File::create(&path).with_context(|| format!("making {}", path.display()))?);
            let rows = write_csv(&recording, index, &mut file)?;
            file.flush().with_context(|| format!("writing {}", path.display()))?;
            outln!("{}: {rows} rows", path.display());
        }
        Ok(ExitCode::SUCCESS)
    }
}
