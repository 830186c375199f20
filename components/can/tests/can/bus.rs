//! The simulated bus.

use motorium_can::bus::simulated::{ErrorState, Event};
use motorium_can::{Bits, Frame, Id, Rates, SimulatedBus};

const RATES: Rates = Rates { nominal: 1_000_000, fast: 1_000_000 };

fn frame(id: u16) -> Frame {
    Frame::classic(Id::Standard(id), &id.to_be_bytes())
}

/// Senders and frames in order of arrival until `until_ns`, with their times.
fn delivered(bus: &mut SimulatedBus, until_ns: u64) -> Vec<(usize, Frame, u64)> {
    let mut all = Vec::new();
    while let Some(event) = bus.next(until_ns) {
        if let Event::Delivered { sender, frame, time_ns } = event {
            all.push((sender, frame, time_ns));
        }
    }
    all
}

#[test]
fn the_lowest_waiting_identifier_is_sent_first() {
    let mut bus = SimulatedBus::new(RATES, 4, 8);
    for (node, id) in [(1, 0x300), (2, 0x100), (3, 0x200)] {
        assert!(bus.enqueue(node, frame(id), 0));
    }
    let order: Vec<Id> = delivered(&mut bus, 1_000_000).into_iter().map(|(_, frame, _)| frame.id).collect();
    assert_eq!(order, [0x100, 0x200, 0x300].map(Id::Standard));
}

#[test]
fn a_running_frame_is_not_interrupted() {
    let mut bus = SimulatedBus::new(RATES, 3, 8);
    bus.enqueue(1, frame(0x300), 0);
    bus.enqueue(2, frame(0x001), 10_000);
    let senders: Vec<usize> = delivered(&mut bus, 1_000_000).into_iter().map(|(sender, ..)| sender).collect();
    assert_eq!(senders, [1, 2]);
}

#[test]
fn frames_follow_each_other_without_gaps() {
    let mut bus = SimulatedBus::new(RATES, 2, 8);
    let frames = [frame(0x000), frame(0x2aa)];
    frames.iter().for_each(|frame| assert!(bus.enqueue(0, *frame, 0)));
    let times: Vec<u64> = delivered(&mut bus, 1_000_000).into_iter().map(|(_, _, time)| time).collect();
    let bits = frames.map(|frame| u64::from(Bits::from_frame(&frame).nominal) * 1000);
    // a frame arrives before the three bits of interframe space
    assert_eq!(times, [bits[0] - 3000, bits[0] + bits[1] - 3000]);
    assert_eq!(bus.busy_ns(), bits[0] + bits[1]);
}

#[test]
fn nothing_arrives_before_its_last_bit() {
    let mut bus = SimulatedBus::new(RATES, 2, 8);
    bus.enqueue(0, frame(0x123), 500_000);
    let lasts = u64::from(Bits::from_frame(&frame(0x123)).nominal) * 1000;
    assert!(delivered(&mut bus, 500_000 + lasts - 3001).is_empty());
    assert_eq!(delivered(&mut bus, 500_000 + lasts - 3000).len(), 1);
}

#[test]
fn a_disturbed_frame_is_sent_again_and_counted() {
    let mut bus = SimulatedBus::new(RATES, 2, 8);
    bus.enqueue(0, frame(0x123), 0);
    bus.disturb(1);
    let first = bus.next(1_000_000);
    assert!(
        matches!(first, Some(Event::Disturbed { sender: 0, state: ErrorState::Active, .. })),
        "{first:?}"
    );
    assert_eq!(delivered(&mut bus, 1_000_000).len(), 1);
}

#[test]
fn a_disturbed_sender_becomes_passive_and_then_bus_off() {
    let mut bus = SimulatedBus::new(RATES, 2, 8);
    bus.enqueue(0, frame(0x123), 0);
    bus.disturb(100);
    let mut states = Vec::new();
    while let Some(Event::Disturbed { state, .. }) = bus.next(1_000_000_000) {
        states.push(state);
    }
    // each error counts 8: the 16th reaches 128, the 32nd reaches 256
    let expected: Vec<ErrorState> = (1..=32)
        .map(|n| match n {
            32 => ErrorState::Off,
            16.. => ErrorState::Passive,
            _ => ErrorState::Active,
        })
        .collect();
    assert_eq!(states, expected);
    assert!(!bus.enqueue(0, frame(0x123), 0), "it is bus-off");
    bus.restart(0);
    assert!(bus.enqueue(0, frame(0x123), 0));
}

#[test]
fn a_lone_node_becomes_passive_and_stays() {
    let mut bus = SimulatedBus::new(RATES, 1, 8);
    bus.enqueue(0, frame(0x123), 0);
    let mut last = None;
    for _ in 0..1000 {
        last = bus.next(u64::MAX / 2);
    }
    assert!(matches!(last, Some(Event::Disturbed { state: ErrorState::Passive, .. })), "{last:?}");
}

#[test]
fn two_nodes_with_one_identifier_disturb_each_other() {
    let mut bus = SimulatedBus::new(RATES, 3, 8);
    bus.enqueue(1, Frame::classic(Id::Standard(7), &[1]), 0);
    bus.enqueue(2, Frame::classic(Id::Standard(7), &[2]), 0);
    assert!(matches!(bus.next(1_000_000), Some(Event::Disturbed { .. })));
    while let Some(event) = bus.next(1_000_000_000) {
        assert!(matches!(event, Event::Disturbed { .. }), "the third node receives nothing: {event:?}");
    }
    assert_eq!((bus.state(1), bus.state(2)), (ErrorState::Off, ErrorState::Off));
}

#[test]
fn a_full_queue_rejects_frames() {
    let mut bus = SimulatedBus::new(RATES, 2, 3);
    let taken = (0..5).filter(|_| bus.enqueue(0, frame(1), 0)).count();
    assert_eq!(taken, 3);
}
