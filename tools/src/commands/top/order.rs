//! The order of the components.

use core::cmp::Ordering;

use super::data::{ComponentSpan, ComponentTop, Span};

/// Sort key of components: names from A to Z, numbers in descending order.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Order {
    /// As in the graph file
    #[default]
    Graph,
    /// Their names
    Name,
    /// Steps a second
    Rate,
    /// Lateness, p99
    Lateness,
    /// Execution time, p99
    Execution,
    /// CPU time of a step, p99
    Cpu,
    /// Missed steps, all causes
    Missed,
    /// Share of their core
    Share,
    /// Resident memory
    Memory,
}

impl Order {
    /// All, with the key that chooses each.
    pub(super) const KEYS: [(char, Self, &'static str); 9] = [
        ('g', Self::Graph, "graph"),
        ('n', Self::Name, "name"),
        ('h', Self::Rate, "Hz"),
        ('l', Self::Lateness, "lateness"),
        ('e', Self::Execution, "execution"),
        ('c', Self::Cpu, "cpu"),
        ('m', Self::Missed, "missed"),
        ('u', Self::Share, "use"),
        ('b', Self::Memory, "memory"),
    ];

    /// Sorts components; equal ones stay in the order of the graph.
    pub(super) fn sort(self, components: &mut [&ComponentTop], span: Span, reversed: bool) {
        let by = |key: fn(&ComponentSpan) -> u64, a: &ComponentTop, b: &ComponentTop| {
            key(b.over(span)).cmp(&key(a.over(span)))
        };
        components.sort_by(|a, b| match self {
            Self::Graph => Ordering::Equal,
            Self::Name => a.name.cmp(&b.name),
            Self::Rate => b.over(span).rate_hz.total_cmp(&a.over(span).rate_hz),
            Self::Lateness => by(|span| span.lateness_ns.p99, a, b),
            Self::Execution => by(|span| span.execution_ns.p99, a, b),
            Self::Cpu => by(|span| span.cpu_ns.p99, a, b),
            Self::Missed => by(|span| span.misses.missed(), a, b),
            Self::Share => b.core_share.unwrap_or(0.0).total_cmp(&a.core_share.unwrap_or(0.0)),
            Self::Memory => b.resident_bytes.cmp(&a.resident_bytes),
        });
        if reversed {
            components.reverse();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::example::top;
    use super::*;

    fn sorted(order: Order, span: Span, reversed: bool) -> Vec<String> {
        let top = top();
        let mut components: Vec<&ComponentTop> = top.components.iter().collect();
        order.sort(&mut components, span, reversed);
        components.iter().map(|component| component.name.clone()).collect()
    }

    #[test]
    fn numbers_sort_descending_and_names_alphabetically() {
        assert_eq!(sorted(Order::Graph, Span::Run, false), ["physics", "encoder", "controller"]);
        assert_eq!(sorted(Order::Name, Span::Run, false), ["controller", "encoder", "physics"]);
        assert_eq!(sorted(Order::Execution, Span::Run, false), ["controller", "physics", "encoder"]);
        assert_eq!(sorted(Order::Execution, Span::Run, true), ["encoder", "physics", "controller"]);
        assert_eq!(sorted(Order::Missed, Span::Run, false)[0], "physics");
    }

    #[test]
    fn equal_rows_stay_in_the_order_of_the_graph() {
        assert_eq!(sorted(Order::Missed, Span::Interval, false), ["physics", "encoder", "controller"]);
    }

    #[test]
    fn each_key_selects_exactly_one_order() {
        for (i, (key, order, _)) in Order::KEYS.iter().enumerate() {
            assert!(Order::KEYS[..i].iter().all(|(other, before, _)| other != key && before != order));
        }
        assert_eq!(Order::KEYS.len(), <Order as clap::ValueEnum>::value_variants().len());
    }
}
