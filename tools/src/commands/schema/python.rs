//! The built-in states as a Python module for the iceoryx2 package.

use std::fmt::Write as _;

use motorium::state::{FieldLayout, Stamp, StateBuffer as _, TypeLayout, built_in};

/// Text of the module before its classes.
const HEAD: &str = include_str!("motorium_types.py");

/// Generates the module: a `ctypes` class for each built-in state and for `Stamp`, and a function that joins
/// a run.
pub(super) fn module() -> anyhow::Result<String> {
    let mut text = HEAD.to_string();
    for layout in built_in().iter().chain([&Stamp::layout()]) {
        class(layout, &mut text)?;
    }
    Ok(text)
}

fn class(layout: &TypeLayout, text: &mut String) -> anyhow::Result<()> {
    let name = layout.type_name.rsplit('.').next().unwrap_or_default();
    writeln!(text, "\n\nclass {name}(ctypes.Structure):\n    _fields_ = [")?;
    let mut end = 0;
    for field in &layout.fields {
        anyhow::ensure!(field.offset == end, "{}.{} has padding before it", layout.type_name, field.name);
        writeln!(text, "        (\"{}\", {}),", field.name.replace('.', "_"), kind(layout, field)?)?;
        end = field.offset + field.size;
    }
    anyhow::ensure!(end == layout.size, "{} has padding at its end", layout.type_name);
    writeln!(text, "    ]")?;
    writeln!(text, "\n    @staticmethod\n    def type_name():\n        return \"{}\"", layout.type_name)?;
    Ok(())
}

/// Returns the `ctypes` expression of a number or an array of numbers.
fn kind(layout: &TypeLayout, field: &FieldLayout) -> anyhow::Result<String> {
    let array = field.kind.strip_prefix('[').and_then(|kind| kind.strip_suffix(']'));
    let (number, entries) = array.and_then(|array| array.split_once("; ")).unwrap_or((&field.kind, ""));
    let number = match number {
        "f64" => "ctypes.c_double",
        "f32" => "ctypes.c_float",
        "u8" => "ctypes.c_uint8",
        "u16" => "ctypes.c_uint16",
        "u32" => "ctypes.c_uint32",
        "u64" => "ctypes.c_uint64",
        "i8" => "ctypes.c_int8",
        "i16" => "ctypes.c_int16",
        "i32" => "ctypes.c_int32",
        "i64" => "ctypes.c_int64",
        other => anyhow::bail!("{}.{} is {other}", layout.type_name, field.name),
    };
    Ok(if entries.is_empty() { number.to_string() } else { format!("{number} * {entries}") })
}
