//! Import cycles between the modules of every crate of the workspace.
//!
//! The lists only shrink. After removing a cycle, copy the printed table.

use std::collections::BTreeMap;

use crate::modules::{Arrows, Modules, PARENT, cycles, parents_in_cycles};
use crate::{crates, root};

/// Remaining cycles: the crate, the parent module, and its children that use each other.
const CYCLES: &[(&str, &str, &[&str])] = &[];

/// Number of remaining children that use their parent and are used by it, by crate.
const PARENTS: &[(&str, usize)] = &[];

/// A cycle of modules: the crate, the parent module, the children.
type Cycle = (String, String, Vec<String>);

/// Returns the arrows of every crate, by its folder and the parent module.
fn arrows() -> BTreeMap<String, BTreeMap<String, Arrows>> {
    let folders = crates::members(&root()).into_values();
    let with_sources = folders.filter(|folder| root().join(folder).join("src").is_dir());
    with_sources
        .map(|folder| (folder.clone(), Modules::read(&root().join(&folder).join("src")).arrows()))
        .collect()
}

/// Compares found cycles with the listed ones: every found cycle must be part of a listed one, and no listed
/// cycle may be larger than necessary.
fn compare(found: &[Cycle], listed: &[(&str, &str, &[&str])]) -> Vec<String> {
    let is_within = |(area, parent, members): &Cycle, (other, level, listed): &(&str, &str, &[&str])| {
        area == other && parent == level && members.iter().all(|member| listed.contains(&member.as_str()))
    };
    let name = |area: &str, parent: &str| match parent {
        "" => area.to_string(),
        _ => format!("{area}, module {parent}"),
    };
    let mut problems = Vec::new();
    for cycle in found.iter().filter(|cycle| !listed.iter().any(|entry| is_within(cycle, entry))) {
        let (area, parent, members) = cycle;
        problems.push(format!("{}: {} use each other", name(area, parent), members.join(", ")));
    }
    for entry @ (area, parent, members) in listed {
        let within: Vec<_> = found.iter().filter(|cycle| is_within(cycle, entry)).collect();
        if !within.iter().any(|(_, _, found)| found.len() == members.len()) {
            let left: Vec<String> =
                within.iter().map(|(_, _, found)| format!("[{}]", found.join(", "))).collect();
            let left = if left.is_empty() {
                "is gone".to_string()
            } else {
                format!("is now {}", left.join(" and "))
            };
            let members = members.join(", ");
            problems
                .push(format!("{}: the listed cycle [{members}] {left}: update CYCLES", name(area, parent)));
        }
    }
    problems
}

#[test]
fn modules_import_each_other_only_in_listed_cycles() {
    let (mut found, mut table, mut details) = (Vec::new(), String::new(), String::new());
    for (area, levels) in arrows() {
        for (parent, arrows) in levels {
            for members in cycles(&arrows) {
                table += &format!("    ({area:?}, {parent:?}, &{members:?}),\n");
                for ((from, to), place) in &arrows {
                    if members.contains(from) && members.contains(to) {
                        details += &format!("{area}, {parent}: {from} -> {to} ({place})\n");
                    }
                }
                found.push((area.clone(), parent.clone(), members));
            }
        }
    }
    // `cargo only layers modules -- --nocapture` prints the arrows, and the table to copy
    println!("{details}\n{table}");
    let problems = compare(&found, CYCLES);
    assert!(problems.is_empty(), "{}\nhelp: the arrows are printed above", problems.join("\n"));
}

#[test]
fn children_and_parents_use_each_other_no_more_than_listed() {
    let (mut problems, mut table) = (Vec::new(), String::new());
    let listed: BTreeMap<&str, usize> = PARENTS.iter().copied().collect();
    for (area, levels) in arrows() {
        let mut count = 0;
        for (parent, arrows) in &levels {
            for child in parents_in_cycles(arrows) {
                let place = |from: &str, to: &str| &arrows[&(from.to_string(), to.to_string())];
                println!(
                    "{area}, {parent}: {child} -> its parent ({}), and back ({})",
                    place(child, PARENT),
                    place(PARENT, child)
                );
                count += 1;
            }
        }
        if count > 0 {
            table += &format!("    ({area:?}, {count}),\n");
        }
        let allowed = listed.get(area.as_str()).copied().unwrap_or_default();
        if count != allowed {
            let change =
                if count > allowed { "move what both need into a child" } else { "lower the number" };
            problems.push(format!(
                "{area}: {count} children and parents use each other, {allowed} listed: {change}"
            ));
        }
    }
    println!("{table}");
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}

/// Returns the arrows of a small crate.
fn modules(files: &[(&str, &str)]) -> BTreeMap<String, Arrows> {
    let mut modules = Modules::empty();
    for (path, source) in files {
        let path: Vec<String> =
            path.split("::").filter(|name| !name.is_empty()).map(str::to_string).collect();
        modules.add(&path, source);
    }
    modules.arrows()
}

/// Returns the arrows between the children of one parent.
fn between(arrows: &BTreeMap<String, Arrows>, parent: &str) -> Vec<(String, String)> {
    arrows.get(parent).into_iter().flat_map(|arrows| arrows.keys().cloned()).collect()
}

fn pair(from: &str, to: &str) -> (String, String) {
    (from.to_string(), to.to_string())
}

#[test]
fn arrows_follow_reexports_to_the_definition() {
    let arrows = modules(&[
        ("", "mod a; mod b; pub mod c; pub use a::Thing as Renamed; pub use b::*;"),
        ("a", "pub struct Thing;"),
        ("b", "mod inner; pub use inner::Deep; pub fn run() {}"),
        ("b::inner", "pub struct Deep; fn f() -> crate::Renamed { crate::Renamed }"),
        ("c", "use crate::{Deep, Renamed}; fn f() { crate::run(); super::b::run(); other::g() }"),
    ]);
    assert_eq!(between(&arrows, ""), [pair("b", "a"), pair("c", "a"), pair("c", "b")]);
    assert!(arrows[""][&pair("c", "a")].ends_with("crate::Renamed"), "{arrows:?}");
    assert_eq!(between(&arrows, "b"), [], "the re-export of a child is no arrow");
}

#[test]
fn paths_through_imports_and_inline_modules_count() {
    let arrows = modules(&[
        ("", "mod a; mod b { pub mod deep { pub fn f() {} } } mod c;"),
        ("a", "use crate::b; use crate::c::{self, X as Y}; fn f() { b::deep::f(); Y::new(); c::g() }"),
        (
            "c",
            "pub struct X { z: super::a::Z } mod own { use super::X; fn f() { let x = super::super::b::f(); } }",
        ),
    ]);
    assert_eq!(between(&arrows, ""), [pair("a", "b"), pair("a", "c"), pair("c", "a"), pair("c", "b")]);
    assert_eq!(cycles(&arrows[""]), [["a", "c"]]);
    assert_eq!(between(&arrows, "c"), [pair("own", PARENT)]);
}

#[test]
fn tests_attributes_and_visibilities_draw_no_arrows() {
    let arrows = modules(&[
        ("", "mod a; mod b; #[cfg(test)] mod tests;"),
        (
            "a",
            "#[cfg(test)] use crate::b::X; #[serde(with = \"crate::b\", x = crate::b::X)] struct A(std::b::X);",
        ),
        (
            "b",
            "/// [`A`](crate::a::A)\npub(in crate::a) struct X; #[cfg(test)] mod tests { use crate::a::A; }",
        ),
        ("tests", "use crate::a::A;"),
    ]);
    assert!(arrows.is_empty(), "{arrows:?}");
}

#[test]
fn children_of_a_parent_in_a_cycle_are_counted() {
    let arrows = modules(&[
        ("", "mod a;"),
        ("a", "mod b; mod c; use b::B; pub struct A; pub use c::C;"),
        ("a::b", "use super::A; pub struct B;"),
        ("a::c", "use super::A; pub struct C;"),
    ]);
    assert_eq!(between(&arrows, "a"), [pair(PARENT, "b"), pair("b", PARENT), pair("c", PARENT)]);
    assert_eq!(parents_in_cycles(&arrows["a"]), ["b"]);
    assert!(cycles(&arrows["a"]).is_empty());
}

#[test]
fn list_of_cycles_may_only_shrink() {
    let cycle = |members: &[&str]| {
        ("robots".to_string(), "world".to_string(), members.iter().map(ToString::to_string).collect())
    };
    let listed: &[(&str, &str, &[&str])] = &[("robots", "world", &["a", "b", "c", "d"])];
    assert_eq!(compare(&[cycle(&["a", "b", "c", "d"])], listed), [""; 0]);
    assert_eq!(compare(&[cycle(&["a", "e"])], &[]), ["robots, module world: a, e use each other"]);
    assert_eq!(
        compare(&[cycle(&["a", "b"]), cycle(&["c", "d"])], listed),
        ["robots, module world: the listed cycle [a, b, c, d] is now [a, b] and [c, d]: update CYCLES"]
    );
    assert_eq!(
        compare(&[], listed),
        ["robots, module world: the listed cycle [a, b, c, d] is gone: update CYCLES"]
    );
    assert_eq!(compare(&[cycle(&["a", "b", "c", "d", "e"])], listed).len(), 2, "it grew");
}
