//! Electronic data sheets: the parser, compared with canopen (`databases/golden_eds.py`), and drive tables
//! with a data sheet.

use std::io;

use motorium_can::adapter::WrongSetting;
use motorium_can::cia402::Object;
use motorium_can::cia402::eds::Eds;
use motorium_can::{Table, TableError};

const SHEET: &str = include_str!("databases/motor.eds");

#[test]
fn data_sheet_objects_match_canopen() {
    let sheet = Eds::parse(SHEET).unwrap();
    let mut objects = 0;
    for line in include_str!("databases/golden_eds.txt").lines() {
        let fields: Vec<&str> = line.split('|').collect();
        let [head, low, high, name] = fields[..] else { panic!("{line}") };
        let head: Vec<&str> = head.split(' ').collect();
        let index = u16::from_str_radix(head[0], 16).unwrap();
        let entry = sheet.entry(Object { index, subindex: head[1].parse().unwrap() }).expect(line);
        assert_eq!((entry.name(), entry.is_writable()), (name, head[2] == "rw"), "{line}");
        // canopen does not report a limit that equals the limit of the type
        let number = |text: &str| text.parse::<i64>().ok();
        assert_eq!(entry.value(5), number(head[3]), "{line}");
        assert_eq!((entry.low(5), entry.high(5)), (number(low), number(high)), "{line}");
        objects += 1;
    }
    // canopen only counts the entries of a record or array; here its head is counted, too
    assert!(objects > 40 && sheet.len() >= objects, "{objects} of {}", sheet.len());
    assert_eq!((sheet.product(), sheet.is_empty()), ("Test drive", false));
}

#[test]
fn data_sheet_numbers_are_read_and_device_values_win() {
    let value = |text: &str| Eds::parse(&format!("[1001]\n{text}\n")).unwrap().value(0x1001, 0, 3);
    for (text, expected) in [
        ("DefaultValue=017", Some(15)),
        ("defaultvalue = 0xfF ", Some(255)),
        ("DefaultValue=-12", Some(-12)),
        ("DefaultValue=$NODEID+0x200", Some(0x203)),
        ("DefaultValue=0x600 + $nodeid", Some(0x603)),
        ("DefaultValue=$NODEID", Some(3)),
        ("DefaultValue=", None),
        ("DefaultValue=text", None),
        ("DefaultValue=+-1", None),
        ("ParameterValue=7\nDefaultValue=5", Some(7)),
        ("DefaultValue=5\nParameterValue=7", Some(7)),
    ] {
        assert_eq!(value(text), expected, "{text}");
    }
}

#[test]
fn hexadecimal_numbers_of_signed_types_are_negative() {
    let read = |kind: &str, number: &str| {
        let text =
            format!("[607d]\nLowLimit={number}\nHighLimit=0x7F\nDefaultValue={number}\nDataType={kind}\n");
        let sheet = Eds::parse(&text).unwrap();
        let entry = sheet.entry(Object { index: 0x607d, subindex: 0 }).unwrap();
        assert_eq!(entry.value(1), entry.low(1));
        assert_eq!(entry.high(1), Some(0x7f));
        entry.low(1)
    };
    for (kind, number, expected) in [
        ("0x0002", "0x80", -128),
        ("3", "0xFFFF", -1),
        ("0x04", "0x80000000", -2_147_483_648),
        ("0x0004", "-5", -5),
        ("0x0015", "0xFFFFFFFFFFFFFFFE", -2),
        ("0x0007", "0x80000000", 2_147_483_648),
    ] {
        assert_eq!(read(kind, number), Some(expected), "{kind} {number}");
    }
}

#[test]
fn an_invalid_data_sheet_is_refused_with_its_line() {
    let refused = |text: &str| Eds::parse(text).unwrap_err();
    assert_eq!(
        refused("[DeviceInfo]\nProductName=X\n").message,
        "no object, expected sections such as `[6040]`"
    );
    assert_eq!(refused("[6040]\nParameterName=X\n[6041\n").line, 3);
    assert_eq!(refused("[6040]\nnothing\n").to_string(), "line 2: \"nothing\", expected `Key=Value`");
}

fn table(entry: &str, sheet: &str) -> Result<Table, TableError> {
    let text = format!(
        "[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\n\n[[drive]]\njoint = \"a\"\nbus = \"can0\"\nprotocol = \"cia402\"\nnode = 5\n\
         watchdog = \"20 ms\"\neds = \"motor.eds\"\n{entry}\n"
    );
    Table::parse_with(&text, |name| match name {
        "motor.eds" => Ok(sheet.to_string()),
        _ => Err(io::ErrorKind::NotFound.into()),
    })
}

const RANGES: &str = "ranges = { position = 3.0, velocity = 30.0, torque = 10.0 }";

#[test]
fn a_table_takes_units_from_the_data_sheet() {
    let drive = &table(RANGES, SHEET).unwrap().drives[0];
    assert_eq!((drive.increments, drive.rated_torque), (Some(65536.0), Some(5.0)));
    // values in the table take precedence
    let drive = &table(&format!("{RANGES}\nincrements = 60000.0"), SHEET).unwrap().drives[0];
    assert_eq!(drive.increments, Some(6e4));
}

#[test]
fn a_current_limit_needs_rated_current_and_its_object() {
    let entry = format!("{RANGES}\ncurrent_limit = 2.0");
    let rated = "\n[6075]\nParameterName=Motor rated current\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\nDefaultValue=4000\n";
    let largest = |access: &str| {
        format!(
            "\n[6073]\nParameterName=Max current\nObjectType=0x7\nDataType=0x0006\nAccessType={access}\nDefaultValue=2000\n"
        )
    };
    let read = table(&entry, &format!("{SHEET}{rated}{}", largest("rw"))).unwrap();
    assert_eq!((read.drives[0].rated_current, read.ranges(0).torque.max), (Some(4.0), 2.5));
    let refused = |sheet: &str| table(&entry, sheet).unwrap_err().to_string();
    let found = refused(&format!("{SHEET}{rated}"));
    assert!(found.contains("the drive has no object 0x6073:00"), "{found}");
    let found = refused(&format!("{SHEET}{rated}{}", largest("ro")));
    assert!(found.contains("0x6073:00 \"Max current\" is read-only"), "{found}");
    let found = refused(&format!("{SHEET}{}", largest("rw")));
    assert!(found.contains("`current_limit` requires `rated_current`"), "{found}");
}

#[test]
fn drive_homing_needs_its_mode_objects_and_method() {
    let homing = |method: i8| {
        format!(
            "{RANGES}\ncurrent_limit = 2.0\nrated_current = 4.0\nhoming = {{ by = \"drive\", method = {method}, velocity = 0.5, creep_velocity = 0.1, acceleration = 1.0 }}"
        )
    };
    let object = |section: &str, access: &str, more: &str| {
        format!(
            "\n[{section}]\nParameterName=P\nObjectType=0x7\nDataType=0x0007\nAccessType={access}\n{more}\n"
        )
    };
    let with = |access: &str, methods: &str| {
        let rest = ["6099sub1", "6099sub2", "609A", "607C"].map(|section| object(section, access, ""));
        let method = object("6098", "rw", methods);
        let rest = [rest.concat(), object("6061", "ro", ""), object("6073", "rw", "")].concat();
        format!("{}{method}{rest}", SHEET.replace("0x380", "0x3A0"))
    };
    // the lowest method is -4, written as unsigned
    let all = |access: &str| with(access, "LowLimit=0xFC\nHighLimit=35");
    let drive = table(&homing(17), &all("rw")).unwrap().drives.remove(0);
    // 0.5 rad/s is 65536 / 4 pi increments per second
    let objects = [(0x6098, 0, 17), (0x6099, 1, 5215), (0x6099, 2, 1043), (0x609a, 0, 10430), (0x607c, 0, 0)];
    assert_eq!(drive.homing_registers(), objects);
    assert!(table(&homing(-4), &all("rw")).is_ok());
    // limits of the whole unsigned byte
    assert!(table(&homing(17), &with("rw", "LowLimit=0x00\nHighLimit=0xFF")).is_ok());
    let refused = |method: i8, sheet: &str| table(&homing(method), sheet).unwrap_err().to_string();
    let found = refused(17, SHEET);
    assert!(found.contains("the drive does not support homing: 0x6502 is 0x380"), "{found}");
    let largest = object("6073", "rw", "");
    let found = refused(17, &format!("{}{largest}", SHEET.replace("0x380", "0x3A0")));
    assert!(found.contains("the drive has no object 0x6098:00"), "{found}");
    let found = refused(17, &all("ro"));
    assert!(found.contains("0x6099:01 \"P\" is read-only"), "{found}");
    for method in [37, -5] {
        let found = refused(method, &all("rw"));
        assert!(
            found.contains(&format!("`homing.method` is {method}, beyond the methods of 0x6098")),
            "{found}"
        );
    }
}

#[test]
fn an_entry_that_contradicts_the_data_sheet_is_refused() {
    let refused = |entry: &str, sheet: &str| table(entry, sheet).unwrap_err().to_string();
    let found = refused(RANGES, &SHEET.replace("0x380", "0x300"));
    assert!(found.contains("does not support the mode 8 of `mode`: 0x6502 is 0x300"), "{found}");
    let found = refused("ranges = { position = 3.0, velocity = 30.0, torque = 13.0 }", SHEET);
    assert!(
        found.contains("`ranges.torque` is 13 N m, but the drive is limited to 12.5000 (0x6071, 0x6072)"),
        "{found}"
    );
    let found = refused("ranges = { position = 3.0, velocity = 50.0, torque = 10.0 }", SHEET);
    assert!(found.contains("`ranges.velocity` is 50 rad/s, but the drive is limited to 47.9369"), "{found}");
    let found = refused("ranges = { position = 3.2, velocity = 30.0, torque = 10.0 }", SHEET);
    assert!(found.contains("`ranges.position` is 3.2 rad, but the drive is limited to 3.1415"), "{found}");
    let found = refused(RANGES, &SHEET.replace("[60C2sub2]", "[5FFFsub2]"));
    assert!(found.contains("motor.eds: the drive has no object 0x60C2:02"), "{found}");
    let found = refused(RANGES, &SHEET.replace("[1A01sub2]", "[5FFFsub2]"));
    assert!(found.contains("the drive has no object 0x1A01:02, which the adapter writes"), "{found}");
    let found = refused(RANGES, "[6040\n");
    assert!(found.starts_with("line 5: drive of `a`: motor.eds, line 1: "), "{found}");
}

/// Data sheet with a read-only mapping of the first setpoints.
fn fixed() -> String {
    let (before, after) = SHEET.split_once("[1600sub0]").unwrap();
    let (mapping, rest) = after.split_once("[1800]").unwrap();
    format!("{before}[1600sub0]{}[1800]{rest}", mapping.replace("AccessType=rw", "AccessType=ro"))
}

#[test]
fn a_fixed_mapping_is_compared_and_not_written() {
    assert!(table(RANGES, &fixed()).is_ok());
    let found = table(&format!("{RANGES}\nmode = \"velocity\""), &fixed()).unwrap_err().to_string();
    assert!(
        found.contains("0x1600:02 maps 0x607A0020 and cannot be written, expected 0x60FF0020"),
        "{found}"
    );
    let wrong = WrongSetting::Mapping { index: 0x1600, found: 0x607a_0020, expected: 0x60ff_0020 };
    assert!(wrong.to_string().contains("maps 0x607A0020, expected 0x60FF0020"));
}

#[test]
fn a_fixed_mapping_must_match() {
    use super::drives::follow;
    let sheet = fixed();
    assert_eq!(follow(&table(RANGES, &sheet).unwrap(), None), (true, None));
    // the drive's mapping differs from the data sheet
    let read = table(RANGES, &sheet).unwrap();
    let is =
        table(&format!("{RANGES}\nmode = \"torque\""), &sheet.replace("0x607A0020", "0x60710010")).unwrap();
    let wrong = WrongSetting::Mapping { index: 0x1600, found: 0x6071_0010, expected: 0x607a_0020 };
    assert_eq!(follow(&read, Some(&is)), (false, Some(wrong)));
}

#[test]
fn compact_subobjects_and_comments_behind_values_are_read() {
    // CiA 306, 4.6.3.2: subobjects share the properties of their object, and `Value` sections list theirs
    let sheet = Eds::parse(
        "[1600]\nParameterName=Mapping\nObjectType=0x9\nDataType=0x0007\nAccessType=rw\nDefaultValue=0x1 ; none\n\
         CompactSubObj=3\n[1600Value]\nNrOfEntries=2\n1=0x60400010\n3=0x607A0020\n[1018sub1]\nDefaultValue=0x10 ; vendor\n",
    )
    .expect("a data sheet");
    let values: Vec<_> = (0..5).map(|subindex| sheet.value(0x1600, subindex, 1)).collect();
    assert_eq!(values, [Some(3), Some(0x6040_0010), Some(1), Some(0x607a_0020), None]);
    let writable =
        |subindex| sheet.entry(Object { index: 0x1600, subindex }).map(|entry| entry.is_writable());
    assert_eq!((writable(0), writable(2)), (Some(false), Some(true)));
    assert_eq!(sheet.value(0x1018, 1, 1), Some(16));
}
