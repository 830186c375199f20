//! Bus traffic: rates, ages, errors.

use std::collections::BTreeMap;

use motorium_can::{Bits, Decoded, Rates, Record, Report};
use serde::Serialize;

/// Counters of the traffic on some buses.
#[derive(Debug, Default)]
pub(super) struct Traffic {
    buses: BTreeMap<String, Bus>,
}

#[derive(Debug, Default)]
struct Bus {
    rates: Option<Rates>,
    frames: u64,
    busy_ns: u64,
    last: Option<Report>,
    error: Option<String>,
    errors: u64,
    ids: BTreeMap<(u32, String), Line>,
}

/// The frames of one identifier.
#[derive(Debug, Default)]
struct Line {
    frames: u64,
    new: u64,
    seen_us: u64,
    data: String,
    message: Option<String>,
    signals: Vec<SignalRow>,
    text: String,
}

/// One bus in a table.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct BusRow {
    pub(super) interface: String,
    pub(super) frames: u64,
    /// Frames a second since the last table.
    pub(super) rate_hz: f64,
    /// Fraction of the time in which the bus carried bits; `None` if the bitrate of the bus is unknown.
    pub(super) load: Option<f64>,
    pub(super) errors: u64,
    /// Latest report of the bus's controller.
    pub(super) error: Option<String>,
    /// Errors counted as sender and as receiver.
    pub(super) counters: Option<[u8; 2]>,
    pub(super) ids: Vec<IdRow>,
}

/// One identifier in a table.
#[derive(Debug, Default, PartialEq, Serialize)]
pub(super) struct IdRow {
    pub(super) id: String,
    pub(super) frames: u64,
    pub(super) rate_hz: f64,
    /// Age of the latest frame, ms.
    pub(super) age_ms: f64,
    /// Data of the latest frame in hexadecimal.
    pub(super) data: String,
    /// Name of the message in the database, if it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) message: Option<String>,
    /// The signals of the message.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) signals: Vec<SignalRow>,
    /// Message and signals as text.
    #[serde(skip)]
    pub(super) text: String,
}

/// One signal of a message.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct SignalRow {
    pub(super) name: String,
    /// Value of the signal; `null` in JSON if the value is not finite.
    pub(super) value: f64,
    pub(super) unit: String,
    /// The name of the value, if the database has one.
    pub(super) label: Option<String>,
}

impl SignalRow {
    fn from_decoded(decoded: &Decoded<'_>) -> Vec<Self> {
        let row = |signal: &motorium_can::SignalValue<'_>| Self {
            name: signal.name.to_string(),
            value: signal.value,
            unit: signal.unit.to_string(),
            label: signal.label.map(str::to_string),
        };
        decoded.signals.iter().map(row).collect()
    }
}

impl Traffic {
    /// Counts frames of a bus; the load is available if its bitrates are known.
    pub(super) fn follow(&mut self, interface: &str, rates: Option<Rates>) {
        self.buses.entry(interface.to_string()).or_default().rates = rates;
    }

    /// Counts a record, with its decoded message if available.
    pub(super) fn take(&mut self, record: &Record, words: Option<&Decoded<'_>>) {
        let bus = self.buses.entry(record.interface().to_string()).or_default();
        if let Some(report) = record.report() {
            bus.errors += 1;
            bus.error = record.error();
            bus.last = Some(Report {
                counters: report.counters.or(bus.last.and_then(|last| last.counters)),
                ..report
            });
            return;
        }
        bus.frames += 1;
        let Some(frame) = record.frame() else { return };
        if let Some(rates) = &bus.rates {
            bus.busy_ns += Bits::from_frame(&frame).ns(rates);
        }
        let line = bus.ids.entry((frame.id.arbitration(), frame.id.to_string())).or_default();
        line.frames += 1;
        line.new += 1;
        line.seen_us = record.time_us();
        line.data = frame.data().iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ");
        line.message = words.map(|words| words.name.to_string());
        line.signals = words.map_or_else(Vec::new, SignalRow::from_decoded);
        line.text = words.map_or_else(String::new, Decoded::to_string);
    }

    /// Returns the table at `now_us`, `seconds` after the last one; resets its counts.
    pub(super) fn table(&mut self, now_us: u64, seconds: f64) -> Vec<BusRow> {
        let row = |(name, bus): (&String, &mut Bus)| {
            let new: u64 = bus.ids.values().map(|line| line.new).sum();
            let busy_ns = core::mem::take(&mut bus.busy_ns);
            let ids = bus.ids.iter_mut().map(|((_, id), line)| IdRow {
                id: id.clone(),
                frames: line.frames,
                rate_hz: core::mem::take(&mut line.new) as f64 / seconds,
                age_ms: now_us.saturating_sub(line.seen_us) as f64 * 1e-3,
                data: line.data.clone(),
                message: line.message.clone(),
                signals: line.signals.clone(),
                text: line.text.clone(),
            });
            BusRow {
                interface: name.clone(),
                frames: bus.frames,
                rate_hz: new as f64 / seconds,
                load: bus.rates.map(|_| busy_ns as f64 * 1e-9 / seconds),
                errors: bus.errors,
                error: bus.error.clone(),
                counters: bus.last.and_then(|last| last.counters),
                ids: ids.collect(),
            }
        };
        self.buses.iter_mut().map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn take(traffic: &mut Traffic, line: &str) {
        traffic.take(&line.parse().unwrap(), None);
    }

    #[test]
    fn top_shows_figures_since_the_last_table() {
        let mut traffic = Traffic::default();
        traffic.follow("can0", Some(Rates { nominal: 1_000_000, fast: 1_000_000 }));
        for k in 0..100 {
            take(&mut traffic, &format!("(10.{:06}) can0 123#0102030405060708", 10_000 * k));
        }
        take(&mut traffic, "(10.500000) can0 00000777#00");
        take(&mut traffic, "(10.600000) can0 20000204#0020000000008803");
        let rows = traffic.table(11_000_000, 1.0);
        let [bus] = &rows[..] else { panic!("{rows:?}") };
        assert_eq!((bus.frames, bus.rate_hz, bus.errors, bus.counters), (101, 101.0, 1, Some([0x88, 3])));
        assert!(bus.error.as_deref().unwrap().contains("controller problem"), "{bus:?}");
        // 100 frames of 111 to 135 bits
        assert!(bus.load.is_some_and(|load| load > 0.0111 && load < 0.0137), "{bus:?}");
        let ids: Vec<_> = bus.ids.iter().map(|row| (row.id.as_str(), row.frames, row.age_ms)).collect();
        assert_eq!(ids, [("0x00000777", 1, 500.0), ("0x123", 100, 10.0)]);
        let rows = traffic.table(12_000_000, 1.0);
        assert_eq!((rows[0].frames, rows[0].rate_hz, rows[0].load), (101, 0.0, Some(0.0)));
    }
}
