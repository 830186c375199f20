//! `motorium bench compare`: compares two files of `bench latency --json`.

use std::path::PathBuf;
use std::process::ExitCode;

use comfy_table::CellAlignment;
use motorium_benches::latency::{Change, Comparison, Direction, Written, compare};

use crate::failure::Failure;
use crate::out::{out, outln};
use crate::{exit, report, style};

/// Compare two files of `motorium bench latency --json`.
///
/// Compares the ratios of times to the floors of their file, never the times themselves. A change counts if
/// it exceeds 10 % and the variation between the turns of each file. With fewer than five turns, it counts if
/// it exceeds 50 %. The exit code is 6 if any measurement is slower.
///
/// Example: motorium bench compare before.json after.json
#[derive(Debug, clap::Args)]
pub(crate) struct Compare {
    /// The file measured before the change
    old: PathBuf,
    /// The file measured after the change
    new: PathBuf,
    /// More files from before the change: with three of each side, tails are compared too
    #[arg(long, value_name = "FILE", num_args = 1..)]
    more_old: Vec<PathBuf>,
    /// More files from after the change
    #[arg(long, value_name = "FILE", num_args = 1..)]
    more_new: Vec<PathBuf>,
    /// Print everything as JSON
    #[arg(long)]
    json: bool,
}

impl Compare {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let read = |first: PathBuf, more: Vec<PathBuf>| -> Result<Vec<Written>, _> {
            core::iter::once(first).chain(more).map(|file| Written::read(&file)).collect()
        };
        let sides = read(self.old, self.more_old).and_then(|old| Ok((old, read(self.new, self.more_new)?)));
        let (old, new) = match sides {
            Ok(sides) => sides,
            Err(error) => {
                return Ok(Failure::of_error(&error).report());
            }
        };
        let seen = compare(&old, &new);
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&seen)?);
        } else {
            out!("{}", table(&seen));
        }
        Ok(if seen.is_slower() { exit::slower() } else { ExitCode::SUCCESS })
    }
}

fn table(seen: &Comparison) -> String {
    let mut text = String::new();
    for difference in &seen.differences {
        text += &format!("{} {difference}\n", style::warning("not alike:"));
    }
    let mut table = report::table(["name", "", "per", "before", "after", "change", ""]);
    for change in &seen.changes {
        table.add_row([
            change.name.clone(),
            change.percentile.to_string(),
            change.floor.clone(),
            side(change.old, change.old_range),
            side(change.new, change.new_range),
            format!("{:+.0} %", 100.0 * (change.change - 1.0)),
            word(change),
        ]);
    }
    for column in table.column_iter_mut().skip(3).take(3) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    text += &format!("{}\n", table.trim_fmt());
    if !seen.left_out.is_empty() {
        text += &format!("{} {}\n", style::dim("not in all files:"), seen.left_out.join(", "));
    }
    let count = |direction| seen.changes.iter().filter(|change| change.direction == direction).count();
    let (slower, faster) = (count(Direction::Slower), count(Direction::Faster));
    text + &format!("{} compared: {slower} slower, {faster} faster\n", seen.changes.len())
}

fn word(change: &Change) -> String {
    match change.direction {
        Direction::Faster => style::good("faster").to_string(),
        Direction::Slower => style::error("slower").to_string(),
        Direction::Same => "same".to_string(),
        Direction::FloorMoved => style::warning("the floor itself moved").to_string(),
        Direction::TooFew => style::dim("too few runs").to_string(),
    }
}

/// Returns a ratio, with its range if there are several measurements.
fn side(ratio: f64, [low, high]: [f64; 2]) -> String {
    let number = |ratio: f64| match ratio {
        100.0.. => format!("{ratio:.0}"),
        0.1.. => format!("{ratio:.2}"),
        _ => format!("{ratio:.4}"),
    };
    if low == high {
        return number(ratio);
    }
    format!("{} ({}-{})", number(ratio), number(low), number(high))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(name: &str, change: f64, direction: Direction) -> Change {
        Change {
            name: name.to_string(),
            percentile: "p50",
            floor: "floor.futex.same".to_string(),
            old: 1.1,
            old_range: [1.05, 1.15],
            new: 1.1 * change,
            new_range: [1.1 * change; 2],
            change,
            direction,
        }
    }

    #[test]
    fn table_shows_both_ratios_their_ranges_and_the_verdict() {
        let seen = Comparison {
            differences: vec!["measured on a, and on b".to_string()],
            changes: vec![
                change("hop.x", 1.5, Direction::Slower),
                change("hop.y", 0.011, Direction::Faster),
                change("hop.z", 1.0, Direction::Same),
            ],
            left_out: vec!["chain.4".to_string()],
        };
        let text = anstream::adapter::strip_str(&table(&seen)).to_string();
        let line = |name: &str| text.lines().find(|line| line.contains(name)).unwrap().to_string();
        assert!(line("hop.x").ends_with("1.10 (1.05-1.15)    1.65   +50 %  slower"), "{text}");
        assert!(line("hop.y").contains("0.0121") && line("hop.y").ends_with("-99 %  faster"), "{text}");
        assert_eq!(line("not alike"), "not alike: measured on a, and on b");
        assert_eq!(line("not in all"), "not in all files: chain.4");
        assert!(text.ends_with("3 compared: 1 slower, 1 faster\n"), "{text}");
    }
}
