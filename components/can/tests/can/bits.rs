//! Bits of frames, compared with published lengths and an independent count.

use motorium_can::{Bits, Form, Frame, Id, Rates};

const FD: Rates = Rates { nominal: 1_000_000, fast: 5_000_000 };

/// Pseudo-random number generator.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }
}

#[test]
fn extreme_classic_frames_have_published_lengths() {
    for (extended, bytes, plain, worst) in
        [(false, 8, 111, 135), (false, 6, 95, 115), (true, 8, 131, 160), (false, 0, 47, 55)]
    {
        assert_eq!(Bits::nominal(extended, Form::Classic, bytes).nominal, plain);
        assert_eq!(Bits::worst(extended, Form::Classic, bytes).nominal, worst);
    }
}

#[test]
fn can_fd_frames_have_published_durations() {
    let us = |bits: Bits| (bits.ns(&FD) as f64 / 1e3).round();
    for (extended, bytes, shortest, longest) in [
        (false, 8, 49.0, 57.0),
        (false, 16, 62.0, 73.0),
        (false, 24, 76.0, 90.0),
        (false, 64, 140.0, 170.0),
        (true, 16, 81.0, 96.0),
        (true, 24, 95.0, 113.0),
        (true, 64, 159.0, 193.0),
    ] {
        assert_eq!(us(Bits::nominal(extended, Form::FdFast, bytes)), shortest, "{bytes} bytes");
        assert_eq!(us(Bits::worst(extended, Form::FdFast, bytes)), longest, "{bytes} bytes");
    }
}

#[test]
fn random_frames_have_the_published_mean_length() {
    let mut numbers = Numbers(7);
    for (extended, bytes, mean) in [(false, 8, 114.3), (false, 6, 97.8), (true, 8, 135.1)] {
        let mut sum = 0;
        for _ in 0..20_000 {
            let (id, data) = (numbers.next(), numbers.next().to_le_bytes());
            let id = if extended { Id::Extended(id as u32 >> 3) } else { Id::Standard((id & 0x7ff) as u16) };
            let bits = Bits::from_frame(&Frame::classic(id, &data[..bytes])).nominal;
            assert!(bits <= Bits::worst(extended, Form::Classic, bytes).nominal);
            assert!(bits >= Bits::nominal(extended, Form::Classic, bytes).nominal);
            sum += bits;
        }
        let found = f64::from(sum) / 20_000.0;
        assert!((found - mean).abs() < 0.15, "{found} bits, published are {mean}");
    }
}

/// Counts the bits of a frame as text, where stuffing replaces runs from the left: slow, but independent of
/// the library's algorithm.
#[test]
fn stuffing_matches_an_independent_count() {
    fn checksum(bits: &str) -> String {
        let mut register = vec![0_u8; 15];
        for bit in bits.bytes().map(|bit| bit - b'0') {
            let feedback = bit ^ register[0];
            register.remove(0);
            register.push(0);
            for (cell, tap) in register.iter_mut().zip([1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1]) {
                *cell ^= tap & feedback;
            }
        }
        register.iter().map(|bit| char::from(b'0' + bit)).collect()
    }
    fn stuffed(bits: &str) -> usize {
        let mut out: Vec<char> = Vec::new();
        for bit in bits.chars() {
            out.push(bit);
            if out.len() >= 5 && out[out.len() - 5..].iter().all(|other| *other == bit) {
                // a run that was not ended by a stuff bit
                let run = out.iter().rev().take_while(|other| **other == bit).count();
                if run == 5 {
                    out.push(if bit == '0' { '1' } else { '0' });
                }
            }
        }
        out.len()
    }
    let mut numbers = Numbers(99);
    for round in 0..2_000 {
        let bytes = round % 9;
        // mostly zero bits, which form long runs
        let data = (numbers.next() & numbers.next() & numbers.next()).to_le_bytes();
        let id = (numbers.next() & 0x7ff) as u16;
        let body: String = data[..bytes].iter().map(|byte| format!("{byte:08b}")).collect();
        let bits = format!("0{id:011b}000{bytes:04b}{body}");
        let whole = format!("{bits}{}", checksum(&bits));
        let found = Bits::from_frame(&Frame::classic(Id::Standard(id), &data[..bytes])).nominal as usize;
        assert_eq!(found, stuffed(&whole) + 13, "{whole}");
    }
}
