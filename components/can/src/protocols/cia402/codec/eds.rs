//! Electronic data sheets of CANopen devices (CiA 306): EDS files, and DCF files, which contain the values of
//! a specific device.
//!
//! A data sheet is a text with sections such as `[6076]` or `[1A00sub1]`. Each section describes one object
//! of the dictionary: its name, type, access, limits and value.

use std::collections::BTreeMap;

use super::Object;

/// Electronic data sheet of a device.
///
/// ```
/// use motorium_can::cia402::Object;
/// use motorium_can::cia402::eds::Eds;
///
/// let text = "[DeviceInfo]\nProductName=Motor\n[6076]\nParameterName=Rated torque\nDataType=0x0007\nAccessType=ro\nDefaultValue=0x2710\n";
/// let sheet = Eds::parse(text)?;
/// let torque = sheet.entry(Object::RATED_TORQUE).ok_or("it has no 0x6076")?;
/// assert_eq!((sheet.product(), torque.value(1), torque.is_writable()), ("Motor", Some(10_000), false));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Eds {
    product: String,
    entries: BTreeMap<(u16, u8), Entry>,
}

/// Object of a data sheet.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Entry {
    name: String,
    line: usize,
    access: String,
    /// Number of bits, if the data type is a signed integer.
    signed_bits: Option<u32>,
    value: Option<Number>,
    low: Option<Number>,
    high: Option<Number>,
    /// Number of subobjects without sections, which share the properties of this object.
    compact: u8,
}

/// Number in a data sheet, optionally relative to the node ID.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Number {
    adds_node: bool,
    number: i64,
}

/// Data types of signed integers (CiA 301, table 44), with their number of bits.
const SIGNED: [(i64, u32); 8] =
    [(0x02, 8), (0x03, 16), (0x04, 32), (0x10, 24), (0x12, 40), (0x13, 48), (0x14, 56), (0x15, 64)];

/// Error returned when a data sheet cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {message}")]
pub struct EdsError {
    /// Line of the error, counted from 1.
    pub line: usize,
    /// Description of the found and expected text.
    pub message: String,
}

impl Number {
    /// Parses a number: decimal, hexadecimal `0x1F`, octal `017`, `$NODEID`, or `$NODEID+0x180`.
    fn parse(text: &str) -> Option<Self> {
        let upper = text.trim().to_ascii_uppercase();
        let Some(rest) = upper.strip_prefix("$NODEID") else {
            // some tools write the node ID last
            return match upper.split_once('+') {
                Some((number, node)) if node.trim() == "$NODEID" => {
                    Some(Self { adds_node: true, number: integer(number)? })
                }
                _ => Some(Self { adds_node: false, number: integer(&upper)? }),
            };
        };
        let number = match rest.trim().strip_prefix('+') {
            Some(number) => integer(number)?,
            None if rest.trim().is_empty() => 0,
            None => return None,
        };
        Some(Self { adds_node: true, number })
    }

    /// Interprets the number as a signed integer: tools write a 16-bit -1 as `0xFFFF`.
    fn as_signed(self, bits: u32) -> Self {
        let is_pattern = bits < 64 && !self.adds_node && (1 << (bits - 1)..1 << bits).contains(&self.number);
        Self { number: if is_pattern { self.number - (1 << bits) } else { self.number }, ..self }
    }

    fn for_node(self, node: u8) -> i64 {
        self.number + if self.adds_node { i64::from(node) } else { 0 }
    }
}

fn integer(text: &str) -> Option<i64> {
    let text = text.trim();
    let (negative, digits) = text.strip_prefix('-').map_or((false, text), |digits| (true, digits));
    if digits.is_empty() || !digits.starts_with(|digit: char| digit.is_ascii_digit()) {
        return None;
    }
    let number = match digits.strip_prefix("0X") {
        // 64 bits hold the pattern of a negative number
        Some(digits) => i64::from_str_radix(digits, 16)
            .or_else(|error| u64::from_str_radix(digits, 16).map(u64::cast_signed).map_err(|_| error)),
        None if digits.len() > 1 && digits.starts_with('0') => i64::from_str_radix(digits, 8),
        None => digits.parse(),
    };
    number.ok().map(|number| if negative { -number } else { number })
}

/// Parses the name of a section. Returns its object, if the section describes one.
fn object_of(section: &str) -> Option<(u16, u8)> {
    let lower = section.to_ascii_lowercase();
    let (index, subindex) = lower.split_once("sub").unwrap_or((&lower, "0"));
    let is_index = index.len() == 4 && index.bytes().all(|digit| digit.is_ascii_hexdigit());
    let subindex = if subindex.starts_with('+') { None } else { u8::from_str_radix(subindex, 16).ok() };
    is_index.then_some(())?;
    Some((u16::from_str_radix(index, 16).ok()?, subindex?))
}

/// Parses the name of a section with the values of subobjects, such as `1003Value`. Returns its index.
fn values_of(section: &str) -> Option<u16> {
    let lower = section.to_ascii_lowercase();
    let index = lower.strip_suffix("value").filter(|index| index.len() == 4)?;
    u16::from_str_radix(index, 16).ok()
}

impl Eds {
    /// Reads a data sheet.
    ///
    /// # Errors
    /// Returns an error if a line is neither a section nor a key with a value, or if there are no objects.
    pub fn parse(text: &str) -> Result<Self, EdsError> {
        let mut sheet = Self::default();
        let (mut object, mut section) = (None, String::new());
        let mut values = BTreeMap::new();
        for (line, text) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
            let text = text.trim();
            let refuse = |message: String| EdsError { line, message };
            if text.is_empty() || text.starts_with(';') || text.starts_with('#') {
                continue;
            }
            if let Some(rest) = text.strip_prefix('[') {
                let name = rest.strip_suffix(']');
                section =
                    name.ok_or_else(|| refuse(format!("{text:?}, expected `[SECTION]`")))?.trim().into();
                object = object_of(&section);
                if let Some(key) = object {
                    sheet.entries.entry(key).or_insert_with(|| Entry { line, ..Entry::default() });
                }
                continue;
            }
            let Some((key, value)) = text.split_once('=') else {
                // vendor sections may contain free text
                if object.is_none() {
                    continue;
                }
                return Err(refuse(format!("{text:?}, expected `Key=Value`")));
            };
            let (key, value) = (key.trim().to_ascii_lowercase(), value.trim());
            if let (Some(index), Ok(subindex)) = (values_of(&section), key.parse::<u8>()) {
                values.extend(Number::parse(value).map(|number| ((index, subindex), number)));
            }
            if section.eq_ignore_ascii_case("DeviceInfo") && key == "productname" {
                sheet.product = value.into();
            }
            let Some(entry) = object.and_then(|object| sheet.entries.get_mut(&object)) else { continue };
            entry.take(&key, value);
        }
        sheet.expand_compact(&values);
        sheet.entries.values_mut().for_each(Entry::apply_sign);
        if sheet.entries.is_empty() {
            let message = "no object, expected sections such as `[6040]`".to_string();
            return Err(EdsError { line: 1, message });
        }
        Ok(sheet)
    }

    /// Adds the subobjects of objects with `CompactSubObj`, with the `values` of their `Value` sections.
    fn expand_compact(&mut self, values: &BTreeMap<(u16, u8), Number>) {
        let compact: Vec<_> = self
            .entries
            .iter()
            .filter(|((_, subindex), entry)| *subindex == 0 && entry.compact > 0)
            .collect();
        let compact: Vec<_> =
            compact.into_iter().map(|((index, _), entry)| (*index, entry.clone())).collect();
        for (index, all) in compact {
            for subindex in 1..=all.compact {
                let value = values.get(&(index, subindex)).copied().or(all.value);
                let entry = Entry { value, compact: 0, ..all.clone() };
                self.entries.entry((index, subindex)).or_insert(entry);
            }
            // the object itself is its number of subobjects
            let count = Number { adds_node: false, number: all.compact.into() };
            let (access, name) = ("ro".to_string(), all.name.clone());
            let own = Entry { name, line: all.line, access, value: Some(count), ..Entry::default() };
            self.entries.insert((index, 0), own);
        }
    }

    /// Returns the name of the product; empty if it is missing.
    pub fn product(&self) -> &str {
        &self.product
    }

    /// Returns the entry of an object; `None` if the device does not have the object.
    pub fn entry(&self, object: Object) -> Option<&Entry> {
        self.entries.get(&(object.index, object.subindex))
    }

    /// Returns the value of an object for node ID `node`; `None` if the object or its value is missing.
    pub fn value(&self, index: u16, subindex: u8, node: u8) -> Option<i64> {
        self.entry(Object { index, subindex })?.value(node)
    }

    /// Returns the number of objects, counting each subindex.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Returns `true` if there are no objects; always `false` for a parsed data sheet.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }
}

impl Entry {
    fn take(&mut self, key: &str, value: &str) {
        // strings, domains and reals have values that are not integers
        let number = || Number::parse(value.split(';').next().unwrap_or(value));
        match key {
            "parametername" => self.name = value.into(),
            "datatype" => {
                self.signed_bits = number()
                    .and_then(|kind| SIGNED.iter().find(|signed| signed.0 == kind.number))
                    .map(|signed| signed.1);
            }
            "accesstype" => self.access = value.to_ascii_lowercase(),
            "defaultvalue" if self.value.is_none() => self.value = number(),
            // the value of the specific device takes precedence over the default
            "parametervalue" => self.value = number().or(self.value),
            "compactsubobj" => self.compact = value.parse().unwrap_or(0),
            "lowlimit" => self.low = number(),
            "highlimit" => self.high = number(),
            _ => {}
        }
    }

    /// Applies the sign of the data type, which may be listed after the numbers.
    fn apply_sign(&mut self) {
        let Some(bits) = self.signed_bits else { return };
        for number in [&mut self.value, &mut self.low, &mut self.high] {
            *number = number.map(|number| number.as_signed(bits));
        }
    }

    /// Returns the name of the object.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the line of the object's section in the data sheet, counted from 1.
    pub fn line(&self) -> usize {
        self.line
    }

    /// Returns `true` if the object is writable.
    pub fn is_writable(&self) -> bool {
        matches!(self.access.as_str(), "rw" | "rww" | "rwr" | "wo")
    }

    /// Returns the value for node ID `node`: the value of the specific device, or the default if the data
    /// sheet has no specific value. `None` if it has neither.
    pub fn value(&self, node: u8) -> Option<i64> {
        self.value.map(|value| value.for_node(node))
    }

    /// Returns the lowest allowed value for node ID `node`; `None` if it is not limited.
    pub fn low(&self, node: u8) -> Option<i64> {
        self.low.map(|low| low.for_node(node))
    }

    /// Returns the highest allowed value for node ID `node`; `None` if it is not limited.
    pub fn high(&self, node: u8) -> Option<i64> {
        self.high.map(|high| high.for_node(node))
    }
}
