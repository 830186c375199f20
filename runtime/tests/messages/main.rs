//! The messages of the runtime as known to files and programs in other languages.

use motorium::state::{Decoder, encode, numbered};

/// A changed hash breaks every file and program that uses the type; give a changed type a new number instead.
#[test]
fn layouts_of_numbered_messages_do_not_change() {
    let known = include_str!("layouts.txt");
    let line = |(number, layout): &(u16, motorium::state::TypeLayout)| {
        format!("{number} {} {}\n", layout.type_name, layout.hash())
    };
    let found: String = numbered().iter().map(line).collect();
    assert_eq!(found, known);
}

#[test]
fn every_message_survives_its_text_form() {
    for (_, layout) in numbered() {
        let decoder = Decoder::new(&layout).unwrap();
        let field = layout.fields.iter().find(|field| field.count.is_some());
        let text = field.map_or(String::new(), |field| format!("{}=[1, 2, 3]", field.name));
        let bytes = encode(&layout, &text).unwrap_or_else(|error| panic!("{}: {error}", layout.type_name));
        let value = serde_json::to_value(decoder.decode(&bytes).unwrap()).unwrap();
        if let Some(field) = field {
            assert_eq!(value["count"], 3, "{}", layout.type_name);
            let expected =
                if field.name == "text" { 3 } else { value[&field.name].as_array().unwrap().len() };
            assert_eq!(expected, 3, "{}.{}", layout.type_name, field.name);
        }
    }
}
