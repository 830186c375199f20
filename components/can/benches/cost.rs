//! Processor time of the codec (encoding one command and decoding one answer), and of an adapter cycle with
//! twelve joints, without the bus: `cargo bench -p motorium-can --bench cost`.

use std::hint::black_box;
use std::time::Instant;

use motorium_can::adapter::{Adapter, OnTrip, Phase};
use motorium_can::drive::{Command, Feedback, Ranges, State};
use motorium_can::mit::Drive;
use motorium_can::{AnySimulatedDrive, Frame, Overrides, Received, Table};
use motorium_drive::JointSetpoint;

const JOINTS: u8 = 12;
const CYCLES: usize = 100_000;

/// Time to encode one command and decode one answer, and time to copy a frame, ns: the minimum over many
/// alternating batches.
fn codec() -> [f64; 2] {
    const BATCH: u32 = 10_000;
    let mut least = [f64::INFINITY; 2];
    let mut time = |place: usize, work: &dyn Fn(u32)| {
        let start = Instant::now();
        work(BATCH);
        least[place] = least[place].min(start.elapsed().as_nanos() as f64 / f64::from(BATCH));
    };
    let drive = Drive::damiao(5, 0x15, Ranges::new(12.5, 30.0, 10.0));
    let feedback = Feedback {
        position: 1.0,
        velocity: -2.0,
        torque: 3.0,
        temperature: Some(30.0),
        voltage: None,
        state: State::Enabled,
    };
    let answer = drive.answer(&feedback);
    for _ in 0..200 {
        time(0, &|batch| {
            for step in 0..batch {
                let position = f64::from(black_box(step)) * 1e-4;
                let command = Command { position, velocity: 0.5, kp: 40.0, kd: 1.0, torque: 0.1 };
                black_box(drive.command(&command));
                let _ = black_box(drive.reply(black_box(&answer)));
            }
        });
        time(1, &|batch| {
            for _ in 0..batch {
                black_box(*black_box(&answer));
            }
        });
    }
    least
}

fn table() -> Table {
    let mut text = String::new();
    for bus in 0..6 {
        text += &format!("[[bus]]\nname = \"can{bus}\"\nbitrate = 1_000_000\n");
    }
    for joint in 0..JOINTS {
        text += &format!(
            "[[drive]]\njoint = \"joint{joint}\"\nbus = \"can{}\"\nprotocol = \"damiao\"\nnode = {}\nwatchdog = \"20 ms\"\n\
             ranges = {{ position = 12.5, velocity = 30.0, torque = 10.0 }}\n",
            joint / 2,
            joint % 2 + 1
        );
    }
    Table::parse(&text).expect("a drive table")
}

/// Duration of each cycle of an adapter with twelve joints, ns: encoding commands, and sorting and decoding
/// answers. The drives answer in between, which is not counted.
fn cycles() -> Vec<u64> {
    let table = table();
    let order: Vec<usize> = (0..JOINTS.into()).collect();
    let mut adapter = Adapter::new(&table, &order, &[0.3; JOINTS as usize], OnTrip::Damp);
    let mut drives: Vec<_> =
        order.iter().map(|index| AnySimulatedDrive::new(&table, *index, Overrides::default())).collect();
    let (mut frames, mut answers) = (Vec::<Frame>::with_capacity(64), Vec::with_capacity(64));
    let mut times = Vec::with_capacity(CYCLES);
    for cycle in 0..CYCLES as u64 {
        let now_ns = cycle * 1_000_000;
        let start = Instant::now();
        for joint in 0..usize::from(JOINTS) {
            let position = (cycle as f64 * 1e-3).sin() * 0.1;
            adapter.set(joint, JointSetpoint { position, kp: 20.0, kd: 1.0, ..JointSetpoint::default() });
        }
        let mut spent = start.elapsed();
        for bus in 0..6 {
            frames.clear();
            let start = Instant::now();
            adapter.write(bus, &mut frames);
            adapter.sent(bus, frames.len(), now_ns);
            spent += start.elapsed();
            answers.clear();
            for frame in &frames {
                for drive in &mut drives[2 * bus..2 * bus + 2] {
                    drive.receive(frame, now_ns, &mut |answer| answers.push(answer));
                }
            }
            let start = Instant::now();
            for frame in &answers {
                adapter.take(bus, &Received { frame: *frame, time_ns: now_ns + 400_000 });
            }
            spent += start.elapsed();
        }
        let start = Instant::now();
        adapter.end_cycle(true);
        times.push((spent + start.elapsed()).as_nanos() as u64);
    }
    assert!(adapter.links().iter().all(|link| link.phase() == Phase::Enabled), "all drives follow");
    times.sort_unstable();
    times
}

fn main() {
    let [codec, copy] = codec();
    println!("encode and decode a frame: {codec:.1} ns; copy of a frame: {copy:.1} ns");
    let times = cycles();
    let at = |share: f64| times[(share * (times.len() - 1) as f64) as usize] as f64 * 1e-3;
    println!(
        "cycle of {JOINTS} joints: p50 {:.2} us, p99 {:.2} us, p99.9 {:.2} us",
        at(0.5),
        at(0.99),
        at(0.999)
    );
}
