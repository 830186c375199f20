//! PNG files of 8-bit colours.
//!
//! Charts are flat areas and thin lines: each row is written as its difference to the one above, and runs of equal bytes are
//! copied. <https://www.w3.org/TR/png-3/>, RFC 1950 and RFC 1951.

/// A picture of rows of red, green and blue, as a file.
pub(super) fn encode(width: usize, height: usize, pixels: &[u8]) -> Vec<u8> {
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    let size = |value: usize| (value as u32).to_be_bytes();
    // 8 bits a channel, red green blue, and the only methods there are.
    let head = [&size(width)[..], &size(height), &[8, 2, 0, 0, 0]].concat();
    chunk(b"IHDR", &head, &mut file);
    chunk(b"IDAT", &compressed(&filtered(3 * width, pixels)), &mut file);
    chunk(b"IEND", &[], &mut file);
    file
}

fn chunk(kind: &[u8; 4], data: &[u8], file: &mut Vec<u8>) {
    file.extend((data.len() as u32).to_be_bytes());
    let from = file.len();
    file.extend(kind);
    file.extend(data);
    let sum = crc(&file[from..]);
    file.extend(sum.to_be_bytes());
}

/// Rows as differences to the row above: filter 2.
fn filtered(bytes_per_row: usize, pixels: &[u8]) -> Vec<u8> {
    let mut above = vec![0; bytes_per_row];
    let mut rows = Vec::with_capacity(pixels.len() + pixels.len() / bytes_per_row.max(1));
    for row in pixels.chunks_exact(bytes_per_row.max(1)) {
        rows.push(2);
        rows.extend(row.iter().zip(&above).map(|(byte, above)| byte.wrapping_sub(*above)));
        above.copy_from_slice(row);
    }
    rows
}

/// The polynomial of PNG, a bit at a time.
fn crc(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { 0xedb8_8320 ^ crc >> 1 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step))
}

fn adler(bytes: &[u8]) -> u32 {
    let (a, b) = bytes.iter().fold((1u32, 0u32), |(a, b), byte| {
        let a = (a + u32::from(*byte)) % 65_521;
        (a, (b + a) % 65_521)
    });
    b << 16 | a
}

/// A stream of bits, the lowest of a byte first.
#[derive(Default)]
struct Bits {
    bytes: Vec<u8>,
    pending: u32,
    count: u32,
}

impl Bits {
    /// Adds a number, its lowest bit first.
    fn number(&mut self, value: u32, bits: u32) {
        self.pending |= value << self.count;
        self.count += bits;
        while self.count >= 8 {
            self.bytes.push(self.pending as u8);
            self.pending >>= 8;
            self.count -= 8;
        }
    }

    /// Adds a code, its highest bit first.
    fn code(&mut self, value: u32, bits: u32) {
        self.number(value.reverse_bits() >> (32 - bits), bits);
    }

    /// Adds a symbol of the fixed code: a byte, the end of the block (256) or a length.
    fn symbol(&mut self, symbol: u32) {
        match symbol {
            0..144 => self.code(0x30 + symbol, 8),
            144..256 => self.code(0x190 + symbol - 144, 9),
            256..280 => self.code(symbol - 256, 7),
            _ => self.code(0xc0 + symbol - 280, 8),
        }
    }

    /// Adds a copy of the last byte, 3 to 258 times.
    fn run(&mut self, length: u32) {
        let (symbol, base, extra) = match length {
            258 => (285, 258, 0),
            3..=10 => (254 + length, length, 0),
            _ => {
                // Eight lengths share a number of extra bits four symbols at a time.
                let extra = (length - 3).ilog2() - 2;
                let group = (length - 3) >> extra;
                (257 + 4 * extra + group, (group << extra) + 3, extra)
            }
        };
        self.symbol(symbol);
        self.number(length - base, extra);
        // The distance of one byte.
        self.code(0, 5);
    }
}

/// One block of the fixed code in the frame of zlib.
fn compressed(bytes: &[u8]) -> Vec<u8> {
    let mut bits = Bits { bytes: vec![0x78, 0x01], ..Bits::default() };
    bits.number(0b011, 3);
    for run in bytes.chunk_by(|a, b| a == b) {
        bits.symbol(u32::from(run[0]));
        let mut left = run.len() as u32 - 1;
        while left >= 3 {
            let length = left.min(258);
            bits.run(length);
            left -= length;
        }
        (0..left).for_each(|_| bits.symbol(u32::from(run[0])));
    }
    bits.symbol(256);
    bits.number(0, 7);
    bits.bytes.extend(adler(bytes).to_be_bytes());
    bits.bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_the_standards() {
        // The check values of the registries of CRC-32 and Adler-32.
        assert_eq!(crc(b"123456789"), 0xcbf4_3926);
        assert_eq!(adler(b"Wikipedia"), 0x11e6_0398);
    }

    #[test]
    fn lengths_have_the_symbols_of_the_table_in_the_standard() {
        // Section 3.2.5 of RFC 1951: length, symbol, extra bits, their value.
        for (length, symbol, extra, value) in [
            (3, 257, 0, 0),
            (10, 264, 0, 0),
            (11, 265, 1, 0),
            (12, 265, 1, 1),
            (18, 268, 1, 1),
            (19, 269, 2, 0),
            (34, 272, 2, 3),
            (35, 273, 3, 0),
            (66, 276, 3, 7),
            (67, 277, 4, 0),
            (130, 280, 4, 15),
            (131, 281, 5, 0),
            (257, 284, 5, 30),
            (258, 285, 0, 0),
        ] {
            let (mut found, mut expected) = (Bits::default(), Bits::default());
            found.run(length);
            expected.symbol(symbol);
            expected.number(value, extra);
            expected.code(0, 5);
            assert_eq!((found.bytes, found.pending), (expected.bytes, expected.pending), "{length}");
        }
    }
}
