//! The modules of a crate and the arrows between them, followed through re-exports.
//!
//! An arrow runs from the module that names an item to the module that defines it, at the level at which
//! their paths diverge. An arrow between two siblings represents everything below them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::tokens::{self, Token};
use crate::{module_of, sources};

/// Longest chain of re-exports that is followed, and the part of it used up by a glob import.
const LONGEST_CHAIN: usize = 20;
const GLOB: usize = 5;
/// Name of a parent module in the arrows between it and its children.
pub(crate) const PARENT: &str = "(parent)";

/// Arrows between the modules of one parent: from, to, and one position that causes it.
pub(crate) type Arrows = BTreeMap<(String, String), String>;

/// All modules of a crate; the first is its root.
pub(crate) struct Modules(Vec<Module>);

#[derive(Default)]
struct Module {
    path: Vec<String>,
    parent: usize,
    children: BTreeMap<String, usize>,
    /// Imported names, with their paths.
    imports: BTreeMap<String, Vec<String>>,
    /// Paths of glob imports.
    globs: Vec<Vec<String>>,
    items: BTreeSet<String>,
    /// All paths with more than one name, and all imported paths.
    paths: Vec<Named>,
    is_test: bool,
}

/// A path in a source.
struct Named {
    names: Vec<String>,
    line: usize,
    is_reexport: bool,
}

impl Modules {
    /// Creates a crate with an empty root.
    pub(crate) fn empty() -> Self {
        Self(vec![Module::default()])
    }

    /// Reads the modules of the crate in a folder, except its tests and its programs in `bin`.
    pub(crate) fn read(src: &Path) -> Self {
        let mut files: Vec<_> = sources(src)
            .into_iter()
            .map(|file| file.strip_prefix(src).expect("below src").to_path_buf())
            .filter(|file| {
                !file.starts_with("bin") && (!file.ends_with("main.rs") || !src.join("lib.rs").exists())
            })
            .collect();
        // parents come first, because they declare which modules are tests
        files.sort_by_key(|file| (module_of(file).len(), file.clone()));
        let mut modules = Self::empty();
        for file in files {
            let text = std::fs::read_to_string(src.join(&file)).expect("a source file");
            let mut path = module_of(&file);
            if path.last().is_some_and(|last| last == "main") {
                path.pop();
            }
            modules.add(&path, &text);
        }
        modules
    }

    /// Adds the source of a module.
    pub(crate) fn add(&mut self, path: &[String], source: &str) {
        let module = path.iter().fold(0, |module, name| self.child(module, name));
        let tokens = without_attributes(&tokens::product(tokens::tokens(source)));
        self.parse(module, &tokens);
    }

    fn child(&mut self, parent: usize, name: &str) -> usize {
        if let Some(child) = self.0[parent].children.get(name) {
            return *child;
        }
        let child = self.0.len();
        let path = self.0[parent].path.iter().cloned().chain([name.to_string()]).collect();
        let is_test = self.0[parent].is_test;
        self.0.push(Module { path, parent, is_test, ..Module::default() });
        self.0[parent].children.insert(name.to_string(), child);
        child
    }

    fn parse(&mut self, module: usize, tokens: &[Token]) {
        let name = |at: usize| match tokens.get(at) {
            Some(Token::Name(name, line)) => Some((name.clone(), *line)),
            _ => None,
        };
        let is = |at: usize, text: &str| tokens.get(at).is_some_and(|token| token.is(text));
        let is_path = |at: usize| is(at, ":") && is(at + 1, ":");
        let (mut at, mut depth) = (0, 0_usize);
        while at < tokens.len() {
            let Some((word, line)) = name(at) else {
                match &tokens[at] {
                    Token::Mark('{') => depth += 1,
                    Token::Mark('}') => depth = depth.saturating_sub(1),
                    _ => {}
                }
                at += 1;
                continue;
            };
            match word.as_str() {
                "test_module" => {
                    if let Some((test, _)) = name(at + 1) {
                        let test = self.child(module, &test);
                        self.0[test].is_test = true;
                    }
                    at += 2;
                }
                "mod" if is(at + 2, ";") || is(at + 2, "{") => {
                    let Some((inner, _)) = name(at + 1) else { break };
                    let child = self.child(module, &inner);
                    at += 3;
                    if is(at - 1, "{") {
                        let end = tokens::closing(tokens, at - 1);
                        self.parse(child, &tokens[at..end - 1]);
                        at = end;
                    }
                }
                "use" if at == 0 || [";", "{", "}", ")", "pub"].iter().any(|before| is(at - 1, before)) => {
                    let is_reexport = at > 0 && (is(at - 1, "pub") || is(at - 1, ")"));
                    let mut found = Vec::new();
                    at = imports(tokens, at + 1, &[], &mut found);
                    for Import { names, alias, line } in found {
                        let module = &mut self.0[module];
                        match alias {
                            None => module.globs.push(names.clone()),
                            Some(alias) if depth == 0 => drop(module.imports.insert(alias, names.clone())),
                            Some(_) => {}
                        }
                        module.paths.push(Named { names, line, is_reexport });
                    }
                }
                "struct" | "enum" | "fn" | "trait" | "type" | "const" | "static" | "union" if depth == 0 => {
                    self.0[module].items.extend(name(at + 1).map(|(item, _)| item));
                    at += 1;
                }
                // a visibility names a module without using it
                "pub" if is(at + 1, "(") && is(at + 2, "in") => at = tokens::closing(tokens, at + 1),
                "macro_rules" => {
                    self.0[module].items.extend(name(at + 2).map(|(item, _)| item));
                    at += 3;
                }
                _ if is_path(at + 1) && !(at > 1 && is_path(at - 2)) => {
                    let mut names = vec![word];
                    at += 1;
                    while let (true, Some((next, _))) = (is_path(at), name(at + 2)) {
                        names.push(next);
                        at += 3;
                    }
                    self.0[module].paths.push(Named { names, line, is_reexport: false });
                }
                _ => at += 1,
            }
        }
    }

    /// Returns the module that defines the item of a path, as seen from a module; `None` outside the crate.
    /// Names that no source declares, such as names from macros, belong to the module of the path.
    fn resolve(&self, from: usize, names: &[String]) -> Option<usize> {
        self.follow(from, names, 0).map(|(module, _)| module)
    }

    /// Like [`resolve`](Self::resolve), with `true` if the name was found in a source.
    fn follow(&self, from: usize, names: &[String], chain: usize) -> Option<(usize, bool)> {
        let first = names.first()?;
        let module = &self.0[from];
        let (mut current, mut rest) = match first.as_str() {
            "crate" => (0, &names[1..]),
            "self" => (from, &names[1..]),
            "super" => {
                let up = names.iter().take_while(|name| *name == "super").count();
                ((0..up).fold(from, |module, _| self.0[module].parent), &names[up..])
            }
            name if module.children.contains_key(name) => (from, names),
            name => {
                let import = module.imports.get(name).filter(|_| chain < LONGEST_CHAIN)?;
                let is_itself = import.len() == 1 && import[0] == name;
                let full: Vec<String> = import.iter().chain(&names[1..]).cloned().collect();
                return if is_itself { None } else { self.follow(from, &full, chain + 1) };
            }
        };
        while let Some(name) = rest.first() {
            let module = &self.0[current];
            if let Some(child) = module.children.get(name) {
                (current, rest) = (*child, &rest[1..]);
                continue;
            }
            if chain < LONGEST_CHAIN
                && let Some(import) = module.imports.get(name)
            {
                let full: Vec<String> = import.iter().chain(&rest[1..]).cloned().collect();
                return self.follow(current, &full, chain + 1);
            }
            if module.items.contains(name) {
                return Some((current, true));
            }
            let globs = module.globs.iter().filter(|_| chain < LONGEST_CHAIN);
            let through = globs.into_iter().find_map(|glob| {
                let full: Vec<String> = glob.iter().chain([name]).cloned().collect();
                self.follow(current, &full, chain + GLOB).filter(|(_, is_found)| *is_found)
            });
            return Some(through.unwrap_or((current, false)));
        }
        Some((current, true))
    }

    /// Returns all arrows, by the path of the parent module.
    pub(crate) fn arrows(&self) -> BTreeMap<String, Arrows> {
        let mut arrows: BTreeMap<String, Arrows> = BTreeMap::new();
        for (from, module) in self.0.iter().enumerate().filter(|(_, module)| !module.is_test) {
            for Named { names, line, is_reexport } in &module.paths {
                let Some(to) = self.resolve(from, names) else { continue };
                let (source, target) = (&module.path, &self.0[to].path);
                let is_export_of_child = *is_reexport && target.starts_with(source);
                if to == from || is_export_of_child {
                    continue;
                }
                let shared = source.iter().zip(target).take_while(|(a, b)| a == b).count();
                let side = |path: &[String]| path.get(shared).map_or(PARENT, String::as_str).to_string();
                let place = format!("{}, line {line}: {}", source.join("::"), names.join("::"));
                let level = arrows.entry(source[..shared].join("::")).or_default();
                level.entry((side(source), side(target))).or_insert(place);
            }
        }
        arrows
    }
}

/// An import: its path and its local name; `None` for a glob import.
struct Import {
    names: Vec<String>,
    alias: Option<String>,
    line: usize,
}

/// Reads an import tree and returns its end.
fn imports(tokens: &[Token], mut at: usize, before: &[String], found: &mut Vec<Import>) -> usize {
    let mut names = before.to_vec();
    let mut line = 0;
    loop {
        match tokens.get(at) {
            Some(Token::Mark(':')) => at += 1,
            Some(Token::Mark('{')) => {
                let end = tokens::closing(tokens, at);
                at += 1;
                while at + 1 < end {
                    let next = imports(tokens, at, &names, found);
                    at = if tokens.get(next).is_some_and(|token| token.is(",")) { next + 1 } else { next };
                }
                return end;
            }
            Some(Token::Mark('*')) => {
                found.push(Import { names, alias: None, line });
                return at + 1;
            }
            Some(Token::Name(name, on)) if name == "as" => {
                if let Some(Token::Name(alias, _)) = tokens.get(at + 1) {
                    names.pop_if(|last| last == "self");
                    found.push(Import { names, alias: Some(alias.clone()), line: *on });
                }
                return at + 2;
            }
            Some(Token::Name(name, on)) => {
                names.push(name.clone());
                (line, at) = (*on, at + 1);
            }
            _ => {
                if names.len() > 1 {
                    names.pop_if(|last| last == "self");
                }
                if let Some(alias) = names.last().cloned().filter(|_| names.len() > before.len() || line > 0)
                {
                    found.push(Import { names, alias: Some(alias), line });
                }
                return at;
            }
        }
    }
}

/// Returns the tokens without attributes.
fn without_attributes(tokens: &[Token]) -> Vec<Token> {
    let (mut kept, mut at) = (Vec::new(), 0);
    while at < tokens.len() {
        match tokens::attribute(tokens, at) {
            Some(end) => at = end,
            None => {
                kept.push(tokens[at].clone());
                at += 1;
            }
        }
    }
    kept
}

/// Returns the groups of modules that use each other, directly or through others, sorted. Parents are
/// ignored.
pub(crate) fn cycles(arrows: &Arrows) -> Vec<Vec<String>> {
    let siblings: Vec<(&str, &str)> = arrows
        .keys()
        .map(|(from, to)| (from.as_str(), to.as_str()))
        .filter(|(from, to)| *from != PARENT && *to != PARENT)
        .collect();
    let names: BTreeSet<&str> = siblings.iter().flat_map(|(from, to)| [*from, *to]).collect();
    let reached = |from: &str| {
        let (mut reached, mut open) = (BTreeSet::new(), vec![from.to_string()]);
        while let Some(name) = open.pop() {
            let next = siblings.iter().filter(|(from, _)| *from == name).map(|(_, to)| (*to).to_string());
            open.extend(next.filter(|to| reached.insert(to.clone())));
        }
        reached
    };
    let reached: BTreeMap<&str, BTreeSet<String>> = names.iter().map(|name| (*name, reached(name))).collect();
    let mut groups: BTreeSet<Vec<String>> = BTreeSet::new();
    for name in &names {
        let group: Vec<String> = names
            .iter()
            .filter(|other| reached[name].contains(**other) && reached[*other].contains(*name))
            .map(ToString::to_string)
            .collect();
        if group.len() > 1 {
            groups.insert(group);
        }
    }
    groups.into_iter().collect()
}

/// Returns the children that use their parent and are used by it.
pub(crate) fn parents_in_cycles(arrows: &Arrows) -> Vec<&str> {
    let back = |child: &str| arrows.contains_key(&(child.to_string(), PARENT.to_string()));
    let children = arrows.keys().filter(|(from, to)| from == PARENT && back(to));
    children.map(|(_, child)| child.as_str()).collect()
}
