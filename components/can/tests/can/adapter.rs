//! Adapter with simulated drives on a simulated bus, without a runtime.

use motorium_can::adapter::{Adapter, OnTrip, Phase, WrongSetting};
use motorium_can::bus::simulated::Event;
use motorium_can::drive::{Command, Ranges};
use motorium_can::{Frame, Id, Range, Received, SimulatedBus, SimulatedDrive, Table};
use motorium_drive::JointSetpoint;

const CYCLE_NS: u64 = 1_000_000;
const DELAY_NS: u64 = 50_000;

/// Fault of a drive's answers: returns the answers that are sent instead, with their delays.
type Befalls = fn(u64, Frame) -> Vec<(Frame, u64)>;

/// Two drives on a bus, and the adapter.
struct Rig {
    adapter: Adapter,
    bus: SimulatedBus,
    drives: Vec<SimulatedDrive>,
    cycle: u64,
    befalls: Befalls,
}

fn table() -> Table {
    let drive = |joint: &str, node: u8| {
        format!(
            "[[drive]]\njoint = \"{joint}\"\nbus = \"can0\"\nprotocol = \"damiao\"\nnode = {node}\nwatchdog = \"5 ms\"\n\
             ranges = {{ position = 12.5, velocity = 30.0, torque = 10.0 }}\nratio = 2.0\n"
        )
    };
    let bus = "[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\n";
    Table::parse(&format!("{bus}{}{}", drive("a", 1), drive("b", 2))).unwrap()
}

fn well(_: u64, answer: Frame) -> Vec<(Frame, u64)> {
    vec![(answer, 0)]
}

impl Rig {
    fn new(befalls: Befalls) -> Self {
        let table = table();
        let drive = |index| SimulatedDrive::new(table.drive(index).unwrap(), Some(5_000_000));
        Self {
            adapter: Adapter::new(&table, &[0, 1], &[0.3, 0.3], OnTrip::Damp),
            bus: SimulatedBus::new(table.rates(0), 3, 64),
            drives: vec![drive(0), drive(1)],
            cycle: 0,
            befalls,
        }
    }

    /// Runs cycles: the adapter sends, the bus advances by a cycle, drives answer and step, the adapter
    /// collects.
    fn run(&mut self, cycles: u64) {
        for _ in 0..cycles {
            let begin_ns = self.cycle * CYCLE_NS;
            let mut frames = Vec::new();
            self.adapter.write(0, &mut frames);
            frames.iter().for_each(|frame| assert!(self.bus.enqueue(0, *frame, begin_ns)));
            self.adapter.sent(0, frames.len(), begin_ns);
            while let Some(event) = self.bus.next(begin_ns + CYCLE_NS) {
                let Event::Delivered { sender, frame, time_ns } = event else { continue };
                if sender > 0 {
                    self.adapter.take(0, &Received { frame, time_ns });
                    continue;
                }
                for (index, drive) in self.drives.iter_mut().enumerate() {
                    let Some(answer) = drive.receive(&frame, time_ns) else { continue };
                    // the fault affects the first drive
                    let answers =
                        if index == 0 { (self.befalls)(self.cycle, answer) } else { well(0, answer) };
                    for (answer, late_ns) in answers {
                        self.bus.enqueue(index + 1, answer, time_ns + DELAY_NS + late_ns);
                    }
                }
            }
            self.drives.iter_mut().for_each(|drive| {
                drive.step(1.0, 0.0, begin_ns + CYCLE_NS);
            });
            self.adapter.end_cycle(true);
            self.cycle += 1;
        }
    }

    fn phases(&self) -> Vec<Phase> {
        self.adapter.links().iter().map(|link| link.phase()).collect()
    }

    fn counts(&self) -> motorium_can::adapter::Counts {
        *self.adapter.links()[0].counts()
    }
}

#[test]
fn drives_are_checked_queried_and_enabled_together() {
    let mut rig = Rig::new(well);
    rig.run(3);
    assert_eq!(rig.phases(), [Phase::Checking(3); 2], "one setting per cycle");
    rig.run(2);
    assert_eq!(rig.phases(), [Phase::Disabled; 2]);
    rig.run(2);
    assert_eq!(rig.phases(), [Phase::Enabled; 2]);
    rig.run(1000);
    assert_eq!(rig.counts().missing, 0);
    let (position, ..) = rig.adapter.links()[0].state();
    assert!((position - 0.5).abs() < 25.0 / 65535.0 / 2.0, "{position} rad with a gear ratio of 2");
}

#[test]
fn a_drive_switched_on_later_is_awaited() {
    let mut rig = Rig::new(|cycle, answer| if cycle < 30 { vec![] } else { well(0, answer) });
    rig.run(30);
    assert!(!rig.adapter.links()[0].is_found() && rig.adapter.links()[1].is_found());
    assert_eq!(rig.phases()[1], Phase::Disabled, "no drive is enabled without the other one");
    assert_eq!((rig.counts().awaited, rig.counts().missing), (30, 0));
    rig.run(100);
    assert_eq!(rig.phases(), [Phase::Enabled; 2]);
    assert_eq!((rig.counts().awaited, rig.counts().missing, rig.counts().lost), (30, 0, 0));
    assert!(!rig.adapter.has_tripped());
}

#[test]
fn a_command_reaches_the_drive_through_the_gear() {
    let mut rig = Rig::new(well);
    rig.run(10);
    rig.adapter.set(0, JointSetpoint { effort: 6.0, ..JointSetpoint::default() });
    rig.run(2);
    let torque = rig.drives[0].step(1.0, 0.0, rig.cycle * CYCLE_NS);
    assert!((torque - 3.0).abs() <= Range::symmetric(10.0).resolution(12), "{torque} N m");
}

#[test]
fn a_silent_drive_is_lost_in_the_third_cycle() {
    for from in [20, 57, 200] {
        let mut rig = Rig::new(match from {
            20 => |cycle, answer| if cycle < 20 { well(0, answer) } else { vec![] },
            57 => |cycle, answer| if cycle < 57 { well(0, answer) } else { vec![] },
            _ => |cycle, answer| if cycle < 200 { well(0, answer) } else { vec![] },
        });
        rig.run(from + 2);
        assert!(!rig.adapter.has_tripped() && rig.adapter.is_complete());
        rig.run(1);
        assert!(rig.adapter.has_tripped() && !rig.adapter.is_complete());
        assert_eq!((rig.counts().lost_in, rig.counts().missing), (Some(from + 3), 3));
    }
}

#[test]
fn a_late_answer_counts_as_late_and_missing() {
    let mut rig = Rig::new(|cycle, answer| match cycle {
        50 => vec![(answer, 800_000)],
        _ => vec![(answer, 0)],
    });
    rig.run(100);
    let counts = rig.counts();
    assert_eq!((counts.late, counts.missing, counts.duplicate, counts.lost), (1, 1, 0, 0));
}

#[test]
fn duplicate_answers_are_counted_and_ignored() {
    let mut rig = Rig::new(|cycle, answer| if cycle == 50 { vec![(answer, 0); 2] } else { well(0, answer) });
    rig.run(100);
    assert_eq!((rig.counts().duplicate, rig.counts().missing), (1, 0));
}

#[test]
fn malformed_answers_are_counted_and_ignored() {
    let mut rig = Rig::new(|cycle, answer| match cycle {
        50 => vec![(Frame::classic(answer.id, &answer.data()[..7]), 0)],
        // the invalid state 5, and a distant position
        51 => vec![(Frame::classic(answer.id, &[0x51, 0xff, 0xff, 0, 0, 0, 0, 0]), 0)],
        _ => well(0, answer),
    });
    rig.run(52);
    assert_eq!((rig.counts().refused, rig.counts().missing), (2, 2));
    assert!((rig.adapter.links()[0].state().0 - 0.5).abs() < 1e-3);
}

#[test]
fn frames_of_unknown_devices_are_counted_separately() {
    let mut rig = Rig::new(well);
    let stranger = Received { frame: Frame::classic(Id::Standard(0x321), &[0; 8]), time_ns: 0 };
    rig.adapter.take(0, &stranger);
    assert_eq!((rig.adapter.stray(), rig.counts().refused), (1, 0));
}

#[test]
fn a_wrong_range_or_watchdog_keeps_all_drives_disabled() {
    for wrong_watchdog in [false, true] {
        let mut rig = Rig::new(well);
        let mut codec = *rig.drives[0].codec();
        if !wrong_watchdog {
            codec = codec.with_ranges(Ranges { torque: Range::symmetric(5.0), ..*codec.ranges() });
        }
        rig.drives[0] = SimulatedDrive::new(codec, if wrong_watchdog { None } else { Some(5_000_000) });
        rig.run(100);
        assert!(!rig.drives.iter().any(SimulatedDrive::is_enabled));
        let (joint, wrong) = rig.adapter.wrong_setting().unwrap();
        assert_eq!((joint, matches!(wrong, WrongSetting::Watchdog { .. })), (0, wrong_watchdog));
    }
}

#[test]
fn drives_release_when_their_watchdog_expires() {
    let mut rig = Rig::new(well);
    rig.run(20);
    assert!(rig.drives.iter().all(SimulatedDrive::is_enabled));
    let killed_ns = rig.cycle * CYCLE_NS;
    for time_ns in (killed_ns..killed_ns + 5_000_000).step_by(250_000) {
        rig.drives.iter_mut().for_each(|drive| {
            drive.step(1.0, 0.0, time_ns);
        });
    }
    assert!(!rig.drives.iter().any(SimulatedDrive::is_enabled));
    assert!(rig.drives.iter().all(|drive| drive.watchdog_trips() == 1));
}

#[test]
fn a_released_drive_trips_the_adapter_until_resumed() {
    let mut rig = Rig::new(well);
    rig.run(20);
    rig.drives[0].cut_power();
    rig.run(2);
    assert!(rig.adapter.has_tripped());
    rig.run(100);
    assert!(rig.adapter.has_tripped() && !rig.drives[0].is_enabled(), "it does not resume automatically");
    rig.adapter.resume();
    rig.run(10);
    assert_eq!(rig.phases(), [Phase::Enabled; 2]);
}

#[test]
fn the_others_are_damped_while_the_adapter_has_tripped() {
    let mut rig = Rig::new(|cycle, answer| if cycle < 20 { well(0, answer) } else { vec![] });
    rig.adapter.set(1, JointSetpoint { effort: 6.0, ..JointSetpoint::default() });
    rig.run(30);
    let (still, moving) =
        (rig.drives[1].step(1.0, 0.0, 30 * CYCLE_NS), rig.drives[1].step(1.0, 4.0, 30 * CYCLE_NS));
    assert!(still.abs() < 0.01, "no effort at rest: {still} N m");
    // 0.3 N m s/rad at the joint are 0.075 at the drive of a gear with ratio 2
    assert!((moving + 0.3).abs() < 0.02, "{moving} N m");
}

#[test]
fn drives_release_after_the_adapter_dies_100_of_100() {
    let mut in_time = 0;
    for trial in 0..100 {
        let mut rig = Rig::new(well);
        rig.run(20 + trial % 7);
        // the last frame arrives at any time within a period of the 4 kHz inner loop
        let last_ns = rig.cycle * CYCLE_NS + 7_919 * trial;
        for drive in &mut rig.drives {
            let frame = drive.codec().command(&Command { torque: 1.0, ..Default::default() });
            assert!(drive.receive(&frame, last_ns).is_some());
        }
        let step_ns = 250_000;
        let loops = (1..).map(|k| (last_ns / step_ns + k) * step_ns);
        for now_ns in loops.take_while(|now_ns| *now_ns < last_ns + 5_000_000) {
            assert!(rig.drives.iter_mut().all(|drive| drive.step(1.0, 0.0, now_ns) > 0.9), "not early");
        }
        let over_ns = (last_ns + 5_000_000).div_ceil(step_ns) * step_ns;
        let has_let_go =
            |drive: &mut SimulatedDrive| drive.step(1.0, 0.0, over_ns) == 0.0 && !drive.is_enabled();
        in_time += u64::from(rig.drives.iter_mut().all(has_let_go));
    }
    assert_eq!(in_time, 100);
}

#[test]
fn constant_latency_is_distinguished_from_a_lost_answer() {
    // late by a whole cycle, like answers to the next cycle's frames
    let mut rig = Rig::new(|cycle, answer| vec![(answer, if cycle < 50 { 0 } else { CYCLE_NS + 20_000 })]);
    rig.run(52);
    assert!(!rig.adapter.has_tripped(), "the answer to the previous cycle is accepted");
    rig.run(2);
    assert!(rig.adapter.has_tripped());
    assert_eq!((rig.counts().lost_in, rig.counts().late), (Some(53), 2));
    rig.run(50);
    assert_eq!(rig.counts().lost, 1);
    assert!(rig.counts().missing >= 50, "{:?}", rig.counts());

    let mut rig = Rig::new(|cycle, answer| if cycle == 50 { vec![] } else { well(0, answer) });
    rig.run(100);
    let counts = rig.counts();
    assert_eq!((counts.missing, counts.late, counts.lost), (1, 0, 0));
    assert!(!rig.adapter.has_tripped());
}
