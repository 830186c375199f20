//! A reader of the OpenMetrics text format (version 1.0), written from its specification: it rejects whatever
//! a scraper would reject.

use std::collections::{BTreeMap, BTreeSet};

/// Labels of a series.
pub(crate) type Labels = BTreeMap<String, String>;

/// A family of metrics.
#[derive(Debug, Default)]
pub(crate) struct Family {
    pub(crate) kind: String,
    pub(crate) help: String,
    pub(crate) unit: Option<String>,
    /// Name, labels and value of each sample, in order.
    pub(crate) samples: Vec<(String, Labels, f64)>,
}

/// All families of a text, by name.
pub(crate) fn parse(text: &str) -> BTreeMap<String, Family> {
    let body = text.strip_suffix("# EOF\n").expect("the text ends with its mark");
    let mut families: BTreeMap<String, Family> = BTreeMap::new();
    let mut current = String::new();
    for line in body.lines() {
        if let Some(rest) = line.strip_prefix("# ") {
            let (kind, rest) = rest.split_once(' ').expect("a descriptor has a name");
            let (name, value) = rest.split_once(' ').expect("a descriptor says something");
            if name != current {
                assert!(!families.contains_key(name), "`{name}` is described twice");
                current = name.to_string();
            }
            let family = families.entry(current.clone()).or_default();
            assert!(family.samples.is_empty(), "`{line}` after the samples of the family");
            match kind {
                "HELP" => family.help = value.to_string(),
                "TYPE" => family.kind = value.to_string(),
                "UNIT" => family.unit = Some(value.to_string()),
                other => panic!("`{other}` is no descriptor: {line}"),
            }
            continue;
        }
        let (name, labels, value) = sample(line);
        let family = families.get_mut(&current).unwrap_or_else(|| panic!("`{line}` belongs to no family"));
        assert!(name.starts_with(&current), "`{line}` is not of the family `{current}`");
        family.samples.push((name, labels, value));
    }
    for (name, family) in &families {
        check(name, family);
    }
    families
}

/// `name{label="value",...} 1.5`
fn sample(line: &str) -> (String, Labels, f64) {
    let (name, rest) = line.split_at(line.find(['{', ' ']).expect("a value"));
    let legal = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == ':';
    assert!(name.chars().all(legal) && !name.starts_with(|c: char| c.is_ascii_digit()), "{line}");
    let mut labels = Labels::new();
    let mut rest = rest;
    if let Some(mut inner) = rest.strip_prefix('{') {
        while !inner.starts_with('}') {
            let (label, after) = inner.split_once("=\"").expect("a label has a value in quotes");
            assert!(label.chars().all(legal), "{line}");
            let (mut value, mut characters) = (String::new(), after.char_indices());
            let end = loop {
                match characters.next().expect("the quotes are closed") {
                    (at, '"') => break at + 1,
                    (_, '\\') => match characters.next().expect("something is escaped").1 {
                        'n' => value.push('\n'),
                        c @ ('"' | '\\') => value.push(c),
                        c => panic!("`\\{c}` in {line}"),
                    },
                    (_, c) => value.push(c),
                }
            };
            assert!(labels.insert(label.to_string(), value).is_none(), "`{label}` twice in {line}");
            inner = &after[end..];
            inner = inner.strip_prefix(',').unwrap_or(inner);
        }
        rest = &inner[1..];
    }
    let value = rest.strip_prefix(' ').expect("a blank before the value");
    (name.to_string(), labels, value.parse().unwrap_or_else(|_| panic!("`{value}` is no number: {line}")))
}

fn check(name: &str, family: &Family) {
    assert!(!family.help.is_empty(), "`{name}` is not explained");
    if let Some(unit) = &family.unit {
        assert!(name.ends_with(&format!("_{unit}")), "`{name}` does not end with its unit `{unit}`");
    }
    let mut seen = BTreeSet::new();
    for (sample, labels, value) in &family.samples {
        assert!(seen.insert((sample.clone(), labels.clone())), "{sample}{labels:?} comes twice");
        let suffix = &sample[name.len()..];
        match family.kind.as_str() {
            "counter" => assert!(suffix == "_total" && *value >= 0.0, "{sample} {value}"),
            "gauge" => assert_eq!(suffix, "", "{sample}"),
            "histogram" => assert!(["_sum", "_count", "_bucket"].contains(&suffix), "{sample}"),
            other => panic!("`{name}` is of the type `{other}`"),
        }
    }
    if family.kind == "histogram" {
        for labels in family.series() {
            family.histogram(&labels);
        }
    }
}

impl Family {
    /// Returns the sets of labels, without the bounds of buckets.
    pub(crate) fn series(&self) -> BTreeSet<Labels> {
        let without = |labels: &Labels| labels.clone().into_iter().filter(|(name, _)| name != "le").collect();
        self.samples.iter().map(|(_, labels, _)| without(labels)).collect()
    }

    /// Returns the value of the only series that contains these labels.
    pub(crate) fn value(&self, wanted: &[(&str, &str)]) -> f64 {
        let fits = |labels: &Labels| {
            wanted.iter().all(|(name, value)| labels.get(*name).map(String::as_str) == Some(value))
        };
        let found: Vec<f64> =
            self.samples.iter().filter(|(_, labels, _)| fits(labels)).map(|(.., value)| *value).collect();
        assert_eq!(found.len(), 1, "{wanted:?}: {found:?}");
        found[0]
    }

    /// Returns count and sum of a histogram, and checks its buckets.
    pub(crate) fn histogram(&self, series: &Labels) -> (f64, f64) {
        let (mut last, mut bound, mut count, mut sum) = (0.0, f64::NEG_INFINITY, None, None);
        for (name, labels, value) in &self.samples {
            let mut labels = labels.clone();
            let le = labels.remove("le");
            if &labels != series {
                continue;
            }
            match le {
                Some(le) => {
                    let le: f64 = if le == "+Inf" { f64::INFINITY } else { le.parse().expect("a bound") };
                    assert!(le > bound, "bounds ascend: {le} after {bound}");
                    assert!(*value >= last, "buckets hold all below them: {value} after {last}");
                    (last, bound) = (*value, le);
                }
                None if name.ends_with("_count") => count = Some(*value),
                None => sum = Some(*value),
            }
        }
        assert_eq!(bound, f64::INFINITY, "the last bucket holds everything");
        assert_eq!(count, Some(last), "and as much as is counted");
        (last, sum.expect("a sum"))
    }
}
